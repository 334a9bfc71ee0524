"""The command line as a whole: quick help, and one line and an exit code for what goes wrong."""

import os
import resource
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from running import Run
from samples import SAMPLE

import cubicfish
from cubicfish import FitError
from cubicfish_cli import __version__
from cubicfish_cli.core_table import COMMANDS, commands_of
from cubicfish_cli.terminal.main import cli

CUBICFISH = [sys.executable, "-m", "cubicfish_cli"]
HEAVY = ("numpy", "cv2", "scipy", "yaml", "rich")


def heavy_modules_after(*args: str) -> str:
    code = (
        "import sys; from cubicfish_cli.terminal.main import cli\n"
        f"cli({list(args)!r}, standalone_mode=False)\n"
        f"print('loaded:', *({HEAVY!r} & sys.modules.keys()))"
    ).replace(repr(HEAVY), repr(set(HEAVY)))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1]


def processor_seconds(*command: str) -> float:
    """Of a program, the least of three runs."""
    spent = []
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(spent)


@pytest.mark.slow
def test_help_takes_little_more_than_any_program_does() -> None:
    least = processor_seconds(sys.executable, "-c", "import click")
    assert processor_seconds(*CUBICFISH, "--help") < 5 * least


@pytest.mark.slow
@pytest.mark.parametrize("args", [["--help"], ["calibrate", "-h"], ["project", "--help"]])
def test_help_loads_no_heavy_library(args: list[str]) -> None:
    assert heavy_modules_after(*args) == "loaded:"


@pytest.mark.slow
def test_a_table_is_calibrated_without_what_photos_films_and_rigs_need(tmp_path: Path) -> None:
    args = ["calibrate", SAMPLE / "true_corners.csv", "-t", SAMPLE / "target.yaml"]
    args += ["-o", tmp_path / "c", "--no-hold-out", "--refine-target", "off", "--no-report"]
    code = (
        "import sys; from cubicfish_cli.terminal.main import cli\n"
        f"cli({list(map(str, args))!r}, standalone_mode=False)\n"
        "print(*(name for name in sys.modules if name.startswith('cubicfish')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {*done.stdout.splitlines()[-1].split()}
    needless = {
        "cubicfish.find.detection.finder", "cubicfish.find.identification.scene",
        "cubicfish.rigs.calibrate", "cubicfish_cli.films.source",
        "cubicfish_cli.extensions.formats.lenses", "cubicfish_cli.render.overlay",
    }  # fmt: skip
    for name in needless:
        assert find_spec(name) is not None, name
    assert "cubicfish.fit.model_selection" in loaded
    assert not loaded & needless


# What a command does not do: pages, drawings, films, clusters, tables on a terminal, statistics.
NEEDLESS = {"matplotlib", "jinja2", "av", "rosbags", "asyncio", "distributed", "OpenEXR", "rich",
            "scipy.interpolate", "scipy.stats", "scipy.integrate",
            "scipy.ndimage", "scipy.signal", "scipy.cluster"}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "more"),
    [
        ("calibrate {photos} -t {target} -o {out} -j 1 --no-report --no-cache", {"scipy"}),
        ("detect {photos} -t {target} -o {out}/c.csv -j 1 --no-cache", set[str]()),
        ("evaluate {photos} -t {target} -m {camera} -j 1 --no-cache", set[str]()),
        ("undistort {photo} {out}/flat.png -m {camera} -j 1", {"scipy", "email"}),
        ("map {out}/flat.pgm -m {camera}", {"scipy", "email"}),
        ("info {camera}", {"scipy", "cv2"}),
    ],
)
def test_what_a_command_does_not_use_is_not_loaded(
    tmp_path: Path, line: str, more: set[str]
) -> None:
    photos = SAMPLE / "photos"
    files = {"photos": photos / "corner_0[1-3].jpg", "photo": photos / "corner_01.jpg"}
    known = {"target": SAMPLE / "target.yaml", "camera": SAMPLE / "true_camera.yaml"}
    args = line.format(**files, **known, out=tmp_path / "out").split()
    code = (
        "import sys; from cubicfish_cli.terminal.main import cli\n"
        f"cli({args!r}, standalone_mode=False)\n"
        f"print('loaded:', *({NEEDLESS | more!r} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded:"


@pytest.mark.slow
def test_a_hypothesis_that_is_not_tried_costs_no_start() -> None:
    code = "import sys, cubicfish.observe.detection; print('scipy.optimize' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


@pytest.mark.slow
def test_photos_are_undistorted_without_what_is_known_of_a_fit(tmp_path: Path) -> None:
    photo = next((SAMPLE / "photos").iterdir())
    args = ["undistort", photo, tmp_path / "flat.png", "-m", SAMPLE / "true_camera.yaml"]
    code = (
        "import sys; from cubicfish_cli.terminal.main import cli\n"
        f"cli({list(map(str, args))!r}, standalone_mode=False)\n"
        "print(*(name for name in sys.modules if name.startswith('cubicfish.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = done.stdout.splitlines()[-1].split()
    assert "cubicfish.io.camera_keys" in loaded
    assert find_spec("cubicfish.judge.fit_record")
    assert find_spec("cubicfish.target.target")
    for part in ("judge.fit_record", "judge.finding", "fit.", "target.target", "find."):
        assert not [name for name in loaded if name.startswith(f"cubicfish.{part}")]


@pytest.mark.slow
@pytest.mark.parametrize(
    "args",
    [
        ["calibrate"],
        ["calibrate", "--correspondences", "no.csv"],
        ["calibrate", "no.csv", "-t", "no.yaml"],
        ["calibrate", str(SAMPLE / "photos"), "-t", "no.yaml"],
        [
            "evaluate",
            "no.jpg",
            "-t",
            str(SAMPLE / "target.yaml"),
            "-m",
            str(SAMPLE / "true_camera.yaml"),
        ],
    ],
)
def test_missing_files_are_reported_before_anything_is_loaded(args: list[str]) -> None:
    code = (
        "import sys; from cubicfish_cli.terminal.main import cli\n"
        f"try: cli({args!r})\n"
        f"except SystemExit: print('loaded:', *({set(HEAVY)!r} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "name photos" in done.stderr or "does not exist" in done.stderr
    assert done.stdout == "loaded:\n"


@pytest.mark.slow
def test_the_check_for_heavy_libraries_sees_them(calibrated: Path, tmp_path: Path) -> None:
    points = tmp_path / "points.csv"
    points.write_text("0,0,1\n")
    said = heavy_modules_after("project", str(points), "-m", str(calibrated / "camera.yaml"))
    assert "numpy" in said


@pytest.mark.parametrize("name", commands_of(COMMANDS, ""))
def test_every_command_has_help_with_an_example(run: Run, name: str) -> None:
    said = run(name, "-h").output
    assert run(name, "--help").output == said
    assert "Examples:\n" in said
    assert f"cubicfish {name}" in said.split("Examples:")[1]
    assert "--debug" in said
    first = cli.get_command(None, name).get_short_help_str(200)  # type: ignore[union-attr,arg-type]
    assert first[:60].rstrip(".") in run("--help").output


def test_the_installed_program_runs() -> None:
    program = Path(sys.executable).with_name("cubicfish")
    if not program.exists():
        pytest.skip("cubicfish is not installed beside this Python")
    done = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"cubicfish, version {__version__}\n"


def test_a_bound_that_is_no_number_is_one_line() -> None:
    """OpenCV reads it when it is loaded, and would abort."""
    env = {**os.environ, "OPENCV_IO_MAX_IMAGE_PIXELS": "abc"}
    done = subprocess.run([*CUBICFISH, "--version"], capture_output=True, text=True, env=env)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("Error: OPENCV_IO_MAX_IMAGE_PIXELS is 'abc' in the environment")
    assert done.stderr.count("\n") == 1


def test_an_unknown_command_is_wrong_usage_and_the_nearest_is_named(run: Run) -> None:
    result = run("calibrat", code=2)
    assert "No such command 'calibrat': did you mean 'calibrate'?" in result.stderr
    assert result.stdout == ""


def test_a_known_error_is_one_line_on_stderr(run: Run, tmp_path: Path) -> None:
    result = run("project", "-m", tmp_path / "no.yaml", input="0,0,1\n", code=1)
    assert result.stdout == ""
    assert result.stderr.startswith("Error: ")
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("place", ["before", "after"])
def test_debug_shows_where_an_error_came_from(run: Run, tmp_path: Path, place: str) -> None:
    args = ["project", "-m", str(tmp_path / "no.yaml")]
    args = ["--debug", *args] if place == "before" else [*args, "--debug"]
    trace, _, error = run(*args, input="0,0,1\n", code=1).stderr.rpartition("Error: ")
    assert trace.startswith("Traceback")
    assert "CameraFileError" in trace
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("error", "said", "code"),
    [
        (FitError("the fit failed: do this"), "Error: the fit failed: do this\n", 1),
        (KeyboardInterrupt(), "Interrupted.\n", 130),
        (
            OSError(28, "No space left on device", "/x/y"),
            "Error: /x/y: No space left on device\n",
            1,
        ),
        (OSError("odd"), "Error: odd\n", 1),
        (MemoryError(), "Error: not enough memory: use smaller photos", 1),
    ],
)
def test_what_a_user_can_cause_has_an_exit_code(
    run: Run, monkeypatch: pytest.MonkeyPatch, error: BaseException, said: str, code: int
) -> None:
    def fail(path: Path, *, any_lift: bool) -> Any:
        raise error

    monkeypatch.setattr(cubicfish, "load_camera", fail)
    result = run("project", "-m", "any.yaml", input="0,0,1\n", code=code)
    assert result.stderr.startswith(said)
    assert result.stdout == ""


@pytest.mark.slow
@pytest.mark.parametrize("args", [[], ["target"]])
def test_without_a_command_the_help_is_shown(args: list[str]) -> None:
    done = subprocess.run([*CUBICFISH, *args], capture_output=True, text=True, check=False)
    lines = (done.stdout + done.stderr).splitlines()  # and exit code, by the release of click
    assert lines[0].startswith(" ".join(["Usage: cubicfish", *args]))
    assert "Commands:" in lines
    assert max(map(len, lines)) <= 80


def test_no_help_has_lost_its_lines(run: Run) -> None:
    for name in (*COMMANDS, "target print"):
        shown = run(*name.split(), "--help").stdout
        assert "\\b" not in shown, name  # click's mark for lines that stay as they are
        usage, _, _ = shown.partition("Examples:")
        assert max(map(len, usage.splitlines())) <= 80, name


def test_a_bug_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(path: Path, *, any_lift: bool) -> Any:
        raise ZeroDivisionError

    monkeypatch.setattr(cubicfish, "load_camera", fail)
    result = CliRunner().invoke(cli, ["project", "-m", "any.yaml"], input="0,0,1\n")
    assert isinstance(result.exception, ZeroDivisionError)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_an_interrupt_ends_with_130(tmp_path: Path) -> None:
    model = tmp_path / "camera.yaml"
    os.mkfifo(model)
    with (
        subprocess.Popen(
            [*CUBICFISH, "project", "-m", str(model)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process,
        model.open("w"),
    ):  # returns when the program reads its model
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=20)
    assert process.returncode == 130
    assert said == "Interrupted.\n"


WRAPPED = """
    try:
        signal.raise_signal(number)
    except KeyboardInterrupt as error:  # as Python 3.11 does while it makes a class
        raise RuntimeError("Error calling __set_name__") from error
"""
LOST = """
    class Passing:
        def __del__(self):
            signal.raise_signal(number)
    Passing()
    time.sleep(20)
"""
HALF_DONE = """
    class Writer:
        def __del__(self):
            raise ValueError("half done")
    writer = Writer()
    signal.raise_signal(number)
"""


INTERRUPTED, TERMINATED = ("SIGINT", "Interrupted.\n", 130), ("SIGTERM", "", 143)


@pytest.mark.parametrize(
    ("way", "ended"),
    [
        pytest.param(WRAPPED, INTERRUPTED, id="wrapped"),
        pytest.param(LOST, TERMINATED, id="lost"),
        pytest.param(HALF_DONE, INTERRUPTED, id="half done"),
        pytest.param(WRAPPED, TERMINATED, id="wrapped, terminated", marks=pytest.mark.slow),
        pytest.param(LOST, INTERRUPTED, id="lost, interrupted", marks=pytest.mark.slow),
        pytest.param(HALF_DONE, TERMINATED, id="half done, terminated", marks=pytest.mark.slow),
    ],
)
def test_a_signal_ends_it_whatever_comes_of_the_exception(
    tmp_path: Path, way: str, ended: tuple[str, str, int]
) -> None:
    name, said, code = ended
    program = tmp_path / "program.py"
    program.write_text(
        "import signal, time\n"
        "import click\n"
        "from cubicfish_cli.terminal.start import main\n"
        f"number = signal.{name}\n"
        f"def work(self, context):{way}\n"
        "click.Group.invoke = work\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, str(program), "project", "-m", "any.yaml"],
        input="0,0,1\n", capture_output=True, text=True, check=False, timeout=15,
    )  # fmt: skip
    assert (done.returncode, done.stderr, done.stdout) == (code, said, "")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
def test_a_signal_after_the_work_is_no_failure(tmp_path: Path, name: str, code: int) -> None:
    """What click makes of it, "Aborted!" and exit code 1, would be one."""
    program = tmp_path / "program.py"
    program.write_text(
        "import signal\n"
        "from cubicfish_cli.terminal import main, start\n"
        "whole = main.Program.invoke\n"
        "def invoke(self, context):\n"
        "    whole(self, context)\n"
        f"    signal.raise_signal(signal.{name})\n"
        "main.Program.invoke = invoke\n"
        "start.main()\n"
    )
    lens = SAMPLE / "true_camera.yaml"
    done = subprocess.run(
        [sys.executable, str(program), "compare", str(lens), str(lens)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == code
    assert "RMS difference" in done.stdout
    assert done.stderr.strip() == ("Interrupted." if name == "SIGINT" else "")


def test_a_reader_that_leaves_ends_it_quietly(calibrated: Path, tmp_path: Path) -> None:
    points = tmp_path / "points.csv"
    points.write_text("0.1,0.2,1\n" * 20_000)
    with subprocess.Popen(
        [*CUBICFISH, "project", str(points), "-m", str(calibrated / "camera.yaml")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"},
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.read(10)
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


@pytest.mark.slow
def test_a_terminal_without_the_letters_still_gets_its_text(
    calibrated: Path, tmp_path: Path
) -> None:
    args = ["map", tmp_path / "日.npz", "-m", calibrated / "camera.yaml", "--size", "8x6"]
    done = subprocess.run(
        [*CUBICFISH, *args],
        env={**os.environ, "PYTHONIOENCODING": "latin-1"},
        capture_output=True,
        check=True,
    )
    assert rb"\u65e5.npz" in done.stdout


def test_the_default_model_is_below_the_current_folder(
    run: Run, calibrated: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    said = run("project", input="0,0,1\n", code=1).stderr
    assert "there is no calibration/camera.yaml here: run 'cubicfish calibrate' first" in said
    monkeypatch.chdir(calibrated.parent)
    by_default = run("project", input="0,0,1\n").stdout
    assert by_default.count(",") == 1
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CUBICFISH_MODEL", str(calibrated / "camera.yaml"))
    assert run("project", input="0,0,1\n").stdout == by_default
    said = run("project", "-m", "other.yaml", input="0,0,1\n", code=1).stderr
    assert "other.yaml" in said


def test_signals_are_settled_before_anything_else_is_loaded() -> None:
    """Ctrl-C ends in a traceback until then, so nothing may come first that takes its time."""
    code = (
        "import __future__, os, re, signal, sys; before = set(sys.modules); "
        "import cubicfish_cli.terminal.start; "
        "print(*sorted(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [
        "cubicfish",
        "cubicfish.lazy",
        "cubicfish_cli",
        "cubicfish_cli.terminal",
        "cubicfish_cli.terminal.start",
    ]
