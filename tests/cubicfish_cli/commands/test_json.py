"""Every command answers in JSON: one object on stdout, with the keys that docs/cli.md names."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
import pytest
from command_tree import commands
from lenses import smaller
from reference import keys_of
from running import Run
from samples import SAMPLE

from cubicfish import load_camera
from cubicfish_cli import save_camera
from cubicfish_cli.terminal.terminal import print_json

CORNERS, TARGET = SAMPLE / "true_corners.csv", SAMPLE / "target.yaml"
PHOTO = SAMPLE / "photos" / "corner_01.jpg"

# Commands whose result is a table of numbers on stdout, which other programs read as it is, and
# the one that is talked with.
TABLES = {"project", "unproject", "shoot"}

KEYS: dict[str, Mapping[str, str]] = {
    " ".join(words[1:]): keys_of(" ".join(words[1:]))
    for words, command in commands()
    if any("--json" in param.opts for param in command.params)
}


# Keys that only cameras and rigs have which are tested elsewhere.
RARE = {
    # Of points that somebody marked, and with a goal.
    "calibrate": {"goal_px", "marked"},
    "export": {"beyond", "formats"},
    "import": {"fold_deg"},
}


def records(run: Run, *lines: tuple[object, ...]) -> list[dict[str, Any]]:
    """What each command line prints with ``--json``; together they have every key of the help."""
    made = [record(run, *line) for line in lines]
    first = " ".join(word for word in map(str, lines[0]) if word.isalpha())
    name = max((name for name in KEYS if first.startswith(name)), key=len)
    for one in made:
        assert set(one) <= set(KEYS[name])
    assert set(KEYS[name]) - {key for one in made for key in one} <= RARE.get(name, set())
    return made


def record(run: Run, *line: object, code: int = 0) -> dict[str, Any]:
    """What a command line prints with ``--json``: one line, one object, and no NaN."""
    said = run(*line, "--json", code=code).stdout
    assert said.count("\n") == 1

    def refuse(constant: str) -> None:
        pytest.fail(f"{constant} in JSON")

    read = json.loads(said, parse_constant=refuse)
    assert isinstance(read, dict)
    return read


@pytest.fixture
def model(calibrated: Path) -> Path:
    return calibrated / "camera.yaml"


def test_every_command_has_it_or_prints_a_table() -> None:
    tree = {" ".join(words[1:]): command for words, command in commands()}
    plain = {name for name, command in tree.items() if not isinstance(command, click.Group)}
    assert set(KEYS) == plain - TABLES
    for name in KEYS:
        assert all(meaning and not meaning.endswith(".") for meaning in KEYS[name].values())


def test_what_is_not_finite_is_null_and_what_is_not_plain_is_made_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    values = np.array([[1.5, np.nan], [np.inf, -0.5]])
    print_json(
        {
            "table": values,
            "one": values[0, 1],
            "whole": np.int64(3),
            "true": np.bool_(True),
            "deep": ({"x": [float("-inf"), Path("größe.png")]},),
        }
    )
    said = capsys.readouterr().out
    assert json.loads(said) == {
        "table": [[1.5, None], [None, -0.5]],
        "one": None,
        "whole": 3,
        "true": True,
        "deep": [{"x": [None, "größe.png"]}],
    }
    assert said.count("\n") == 1


@pytest.mark.usefixtures("quick_fit")
def test_calibrate(run: Run, tmp_path: Path) -> None:
    line = ("calibrate", CORNERS, "-t", TARGET, "--no-hold-out", "-o")
    ray, point = records(run, (*line, tmp_path / "a"), (*line, tmp_path / "b", "--lift", "point"))
    for one, folder in ((ray, "a"), (point, "b")):
        written = {str(path) for path in (tmp_path / folder).iterdir()}
        assert set(one["files"].values()) == written
        assert one["files"]["camera"] == one["model"]
        assert one["held_out_rms_px"] is None
        assert one["photo_problems"] is None


@pytest.mark.slow
def test_evaluate_tells_which_photos_gave_nothing(run: Run, model: Path, tmp_path: Path) -> None:
    black = tmp_path / "black.png"
    cv2.imwrite(str(black), np.zeros((720, 960), np.uint8))
    line = ("evaluate", PHOTO, black, "-t", TARGET, "-m", model)
    (one,) = records(run, line)
    assert one["images"] == 1
    (problem,) = one["photo_problems"]
    assert problem.startswith("black.png")


@pytest.mark.slow
def test_detect(run: Run, tmp_path: Path) -> None:
    line = ("detect", PHOTO, "-t", TARGET, "-o", tmp_path / "c.csv")
    (one,) = records(run, (*line, "--draw", tmp_path / "seen"))
    assert one["drawings"] == [str(tmp_path / "seen" / "corner_01.png")]
    assert Path(one["drawings"][0]).exists()


def test_corners(run: Run, tmp_path: Path) -> None:
    table = tmp_path / "corners.vnl"
    lines = [f"a.png {30 * (i % 14) + 50} {30 * (i // 14) + 50}" for i in range(14 * 14)]
    table.write_text("\n".join(["# filename x y", *lines, "b.png - -"]))
    target = tmp_path / "target.yaml"
    target.write_text(
        "units: mm\nboards:\n- {name: a, type: checkerboard, corners: [14, 14], square: 20}\n"
    )
    line = ("corners", table, "-t", target, "--size", "640x640", "-o", tmp_path / "c.csv")
    (one,) = records(run, line)
    assert one["images"] == 1
    assert one["corners"] == 196
    assert one["empty_images"] == ["b.png"]


@pytest.mark.slow
def test_compare(run: Run, model: Path, tmp_path: Path) -> None:
    (one,) = records(run, ("compare", model, model, "--picture", tmp_path / "d.png"))
    assert one["picture"] == str(tmp_path / "d.png")


def test_target_check(run: Run, tmp_path: Path) -> None:
    (one,) = records(run, ("target", "check", TARGET, "--draw", tmp_path / "o.svg"))
    assert one["drawing"] == str(tmp_path / "o.svg")


@pytest.mark.slow
def test_target_print(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    (one,) = records(run, ("target", "print", "--object", "corner", "-o", tmp_path / "p"))
    files = {one[key] for key in ("boards", "target")}
    assert files == {str(path) for path in (tmp_path / "p").iterdir()}


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_report(run: Run, model: Path, tmp_path: Path) -> None:
    (one,) = records(run, ("report", model, "-o", tmp_path / "r.html"))
    assert Path(one["report"]).read_text(encoding="utf-8").startswith("<!")
    assert one["model"] == str(model)
    assert one["verdict"]["level"] in ("good", "care", "bad")
    assert any("photos" in line for line in one["absent"])


@pytest.mark.slow
def test_advise(run: Run, calibrated: Path, tmp_path: Path) -> None:
    line = ("advise", calibrated, "-o", tmp_path / "a.svg")
    (one,) = records(run, line)
    assert one["picture"] == str(tmp_path / "a.svg")


def test_undistort(run: Run, model: Path, tmp_path: Path) -> None:
    photos, flat = tmp_path / "in", tmp_path / "out"
    photos.mkdir()
    for name in ("a.jpg", "b.jpg"):
        (photos / name).write_bytes(PHOTO.read_bytes())
    line = ("undistort", photos, flat, "-m", model, "--size", "96x72", "--fit", "outer")
    made = ("--mask", tmp_path / "mask.png", "--camera", tmp_path / "v.yaml")
    first = record(run, *line, *made)
    assert first["model"] == str(model)
    assert first["images"] == 2
    assert first["files"] == [str(flat / "a.jpg"), str(flat / "b.jpg")]
    assert all(Path(path).exists() for path in (*first["files"], *first["extra_files"]))
    assert len(first["extra_files"]) == 2
    assert first["view"]["kind"] == "perspective"
    assert first["view"]["size"] == [96, 72]
    assert first["view"]["hfov_deg"] > 100
    assert first["view"]["cut"] is True
    (photos / "c.jpg").write_bytes(PHOTO.read_bytes())
    third = record(run, *line, "--skip-existing")
    assert (third["images"], third["skipped"]) == (1, ["a.jpg", "b.jpg"])
    nothing = record(run, *line, "--skip-existing")
    assert (nothing["images"], nothing["view"]) == (0, None)


def test_undistort_names_what_failed_and_why(run: Run, model: Path, tmp_path: Path) -> None:
    photos, flat = tmp_path / "in", tmp_path / "out"
    photos.mkdir()
    (photos / "a.jpg").write_bytes(PHOTO.read_bytes())
    (photos / "bad.jpg").write_bytes(b"no picture")
    line = ("undistort", photos, flat, "-m", model, "--size", "96x72")
    one = record(run, *line, code=1)
    assert one["files"] == [str(flat / "a.jpg")]
    (failed,) = one["failed"]
    assert failed["image"] == "bad.jpg"
    assert "bad.jpg" in failed["problem"]
    said = run(*line, "--overwrite", "--json", code=1).stderr
    assert said == ("Error: 1 of 2 photos could not be undistorted: see the JSON\n")
    alone = record(run, "undistort", photos / "bad.jpg", tmp_path / "x.png", "-m", model, code=1)
    assert alone["images"] == 0
    assert alone["failed"][0]["image"] == "bad.jpg"


def test_a_cube_has_six_parts(run: Run, model: Path, tmp_path: Path) -> None:
    line = ("map", tmp_path / "c.npz", "-m", model, "--view", "cube", "--size", "16x16")
    one = record(run, *line)
    assert one["view"]["parts"] == ["front", "right", "back", "left", "up", "down"]
    assert len(one["files"]) == 6


def test_map(run: Run, model: Path, tmp_path: Path) -> None:
    line = ("map", tmp_path / "m.pgm", "-m", model, "--size", "96x72")
    (one,) = records(run, line)
    written = {str(path) for path in tmp_path.iterdir()}
    assert {*one["files"], *one["extra_files"]} == written
    assert len(one["files"]) == 2
    assert one["image_size"] == [960, 720]
    assert one["view"]["size"] == [96, 72]
    (command,) = one["ffmpeg"]
    assert "remap" in command
    assert record(run, "map", tmp_path / "n.npz", "-m", model, "--size", "8x6")["ffmpeg"] == []


@pytest.mark.slow
def test_export_and_import(run: Run, model: Path, tmp_path: Path) -> None:
    lens = tmp_path / "lens.txt"
    near = ("-m", model, "--max-error", 9)
    one, other = records(
        run,
        ("export", "--to", "ocamcalib", "-o", lens, *near),
        ("export", "--to", "maps", "-o", tmp_path / "m.npz", "-m", model),
    )
    assert one["file"] == str(lens)
    assert other == {"file": str(tmp_path / "m.npz"), "format": "maps"}
    size = load_camera(model).camera.image_size
    (back,) = records(run, ("import", lens, "-o", tmp_path / "c.yaml"))
    assert back["model"] == str(tmp_path / "c.yaml")
    assert back["image_size"] == list(size)


def test_info(run: Run, calibrated: Path) -> None:
    (one,) = records(run, ("info", calibrated))
    assert one["image_size"] == [960, 720]


def test_transform(run: Run, calibrated: Path, tmp_path: Path) -> None:
    (one,) = records(run, ("transform", calibrated, "--scale", "0.5", "-o", tmp_path / "c.yaml"))
    assert one["image_size"] == [480, 360]


@pytest.mark.slow
def test_simulate(run: Run, calibrated: Path, tmp_path: Path) -> None:
    seen = load_camera(calibrated / "camera.yaml").fit.per_image[0].camera_from_world
    numbers = ",".join(map(repr, (*seen.rotation_vector, *seen.translation)))
    poses = tmp_path / "poses.csv"
    poses.write_text(f"image,rx,ry,rz,tx,ty,tz\na.jpg,{numbers}\n")
    model = tmp_path / "small.yaml"
    save_camera(model, smaller(load_camera(calibrated / "camera.yaml").camera, 2))
    line = ("simulate", "-t", TARGET, "-m", model, "--poses", poses, "-o", tmp_path / "simulated")
    (one,) = records(run, line)
    assert one["corners"] > 50
    files = [*one["photos"], one["true_corners"], one["true_poses"], one["true_camera"]]
    assert set(files) == {str(path) for path in (tmp_path / "simulated").iterdir()}


def of_missing_files(name: str, missing: Path) -> list[object]:
    """A file that is not there for every argument, and for the camera where one is asked for."""
    (command,) = (one for words, one in commands() if " ".join(words[1:]) == name)
    known = {word for param in command.params for word in param.opts}
    if "--view" in known:  # which needs no target unless it shows a plane
        known.discard("-t")
    given: list[object] = [missing for one in command.params if isinstance(one, click.Argument)]
    if "calibration" in {one.name for one in command.params}:  # which stands for the camera
        known.discard("-m")
    for option, value in (("-m", missing), ("-t", TARGET)):
        given += [option, value] if option in known else []
    return given


@pytest.mark.parametrize("name", sorted(KEYS))
def test_an_error_leaves_stdout_empty(run: Run, tmp_path: Path, name: str) -> None:
    """One line on stderr and an exit code, as without ``--json``."""
    missing, out = tmp_path / "missing", tmp_path / "out"
    special: dict[str, tuple[object, ...]] = {
        "rig calibrate": (missing, missing, "--names", "a,b", "-t", TARGET),
        "frames": (missing, "-o", out),
        "map": (out / "m.npz", "-m", missing),
        "rig map": (out / "m.npz", "-m", missing),
        "export": ("--to", "opencv", missing),
        "rig export": ("--to", "opencv", missing),
        "corners": (missing, "-t", TARGET, "--size", "960x720"),
    }
    said = run(*name.split(), *special.get(name, of_missing_files(name, missing)), "--json", code=1)
    assert said.stdout == ""
    assert said.stderr.splitlines()[-1].startswith("Error: ")
    assert said.stderr.count("Error: ") == 1
