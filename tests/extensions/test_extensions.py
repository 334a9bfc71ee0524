"""Extensions: what the table names is there, what is not there is not missed."""

import json
import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from running import SAMPLE, Run

import cubicfish_cli
from cubicfish_cli.app import extensions as extension
from cubicfish_cli.app.extensions import Extension, extensions


@pytest.fixture(scope="module")
def without_rigs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package, but for the rigs and their line of the table."""
    folder = tmp_path_factory.mktemp("without")
    package = shutil.copytree(
        Path(cubicfish_cli.__file__).parent,
        folder / "cubicfish_cli",
        ignore=shutil.ignore_patterns("__pycache__", "rigs"),
    )
    table = package / "app" / "extensions.py"
    text = table.read_text(encoding="utf-8")
    line = '    "rigs": "cubicfish_cli.extensions.rigs.extension:EXTENSION",\n'
    assert text.count(line) == 1
    table.write_text(text.replace(line, ""), encoding="utf-8")
    return folder


def run_without(folder: Path, *args: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "cubicfish_cli", *map(str, args)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder), "PYTHONSAFEPATH": ""},
        capture_output=True,
        text=True,
    )


def bare(text: str) -> str:
    """Without what depends on where lines end."""
    return re.sub(r"[\s-]", "", text)


@pytest.mark.slow
def test_a_single_camera_needs_no_rigs(without_rigs: Path, calibrated: Path, run: Run) -> None:
    said = run_without(without_rigs, "--help")
    assert said.returncode == 0
    assert "\n  rig " not in said.stdout
    assert "\n  rig " in run("--help").stdout
    assert "No such command 'rig'" in run_without(without_rigs, "rig", "info").stderr
    photo, flat = SAMPLE / "photos" / "corner_01.jpg", without_rigs / "flat.jpg"
    corners = SAMPLE / "true_corners.csv"
    lines: dict[str, list[object]] = {
        "calibrate": [corners, "-t", SAMPLE / "target.yaml", "-o", without_rigs / "c",
                      "--no-hold-out", "--refine-target", "off"],
        "evaluate": [corners, "-t", SAMPLE / "target.yaml", "-m", calibrated],
        "compare": [calibrated, SAMPLE / "true_camera.yaml"],
        "info": [calibrated],
        "report": [calibrated, "-o", without_rigs / "r.html"],
        "undistort": [photo, flat, "-m", calibrated],
        "map": [without_rigs / "m.npz", "-m", calibrated],
        "export": [calibrated, "--to", "opencv", "-o", without_rigs / "cv.yaml", "--max-error", 3],
    }  # fmt: skip
    for name, args in lines.items():
        helped = run_without(without_rigs, name, "--help").stdout
        assert bare(helped) == bare(run(name, "--help").stdout)
        done = run_without(without_rigs, name, *args, *(["--json"] if name != "calibrate" else []))
        assert done.returncode == 0, done.stderr
        assert name == "calibrate" or json.loads(done.stdout)
    assert flat.is_file()


def test_a_rig_is_no_camera_and_the_command_says_what_is(run: Run, tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("cubicfish_rig: 1\n")
    for path in (tmp_path, tmp_path / "rig.yaml"):
        said = run("info", path, code=1).stderr
        assert "camera" in said
        assert said.count("\n") == 1


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> list[EntryPoint]:
    """What is installed beside the package, as far as it says so."""
    found: list[EntryPoint] = []
    monkeypatch.setattr(extension, "entry_points", lambda group: found)
    extensions.cache_clear()
    yield found
    extensions.cache_clear()


HELLO = Extension(commands={"hello": "cubicfish_cli.commands.info:command"})


def test_another_distribution_adds_a_command(installed: list[EntryPoint], run: Run) -> None:
    installed.append(EntryPoint("hello", f"{__name__}:HELLO", extension.GROUP))
    assert "\n  hello " in run("--help").stdout
    assert "Say what the camera" in run("hello", "--help").stdout
    said = run("helo", code=2).stderr
    assert "did you mean 'hello'" in said


@pytest.mark.parametrize("place", ["no_such_module:HELLO", f"{__name__}:SAMPLE"])
def test_one_that_cannot_be_loaded_is_named_and_stops_no_other_command(
    installed: list[EntryPoint], run: Run, place: str
) -> None:
    installed.append(EntryPoint("broken", place, extension.GROUP))
    said = run("no-such", code=1).stderr
    assert f"the extension broken ({place})" in said
    assert said.count("\n") == 1
    assert run("info", "--help").exit_code == 0
