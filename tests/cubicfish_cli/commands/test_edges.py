"""What is odd about files and numbers, from the command line: a line, and nothing else."""

import json
import os
import shutil
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import yaml
from running import Run, invoke_cli
from samples import SAMPLE

from cubicfish.find.detection.grids import FoundGrids
from cubicfish.observe.photo_detection import GridCache
from cubicfish.photos import PictureFile
from cubicfish_cli.terminal.parameters import FOLDER

CORNERS, TARGET = SAMPLE / "true_corners.csv", SAMPLE / "target.yaml"
PHOTO = SAMPLE / "photos" / "corner_01.jpg"


def with_field(calibrated: Path, path: Path, degrees: float) -> Path:
    """The camera, trusted no farther from its axis."""
    record = yaml.safe_load((calibrated / "camera.yaml").read_text())
    record["max_angle_deg"] = degrees
    path.write_text(yaml.safe_dump(record))
    return path


def test_a_camera_that_sees_next_to_nothing_is_no_traceback(
    run: Run, calibrated: Path, tmp_path: Path
) -> None:
    tiny = with_field(calibrated, tmp_path / "tiny.yaml", 0.01)
    said = run("evaluate", CORNERS, "-t", TARGET, "-m", tiny, code=1).stderr
    assert "no corner lies within the 0° where this camera may be trusted" in said


@pytest.mark.parametrize(
    ("command", "name", "said"),
    [
        *[
            (command, "cam.yaml", "'cam.yaml' is the name of a file, and several files are written")
            for command in ("calibrate", "rig calibrate", "frames", "simulate", "target print")
        ],
        *[
            (command, "new/", "'new/' is a folder: give the name of a file")
            for command in ("detect", "corners", "report", "advise", "import")
        ],
    ],
)
def test_a_folder_is_not_named_as_a_file_nor_a_file_as_a_folder(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, name: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert said in " ".join(run(*command.split(), "-o", name, code=2).stderr.split())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("line", "whole"),
    [
        ("undistort my photos flat/", "my photos"),
        ("detect my photos/*.jpg", "my photos/*.jpg"),
        ("calibrate other.jpg my photos", "my photos"),
        ("rig calibrate my photos other.jpg", "my photos"),
    ],
)
def test_a_name_that_a_space_has_split_is_reported(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, whole: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my photos").mkdir()
    for name in ("my photos/1.jpg", "other.jpg"):
        shutil.copy(PHOTO, tmp_path / name)
    said = run(*line.split(), code=2).stderr
    assert f"my does not exist, '{whole}' does: put quotes round" in said
    (tmp_path / "my").mkdir()  # which may be meant
    assert "quotes" not in invoke_cli(*line.split()).stderr


def test_a_folder_that_is_there_may_be_called_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "old.yaml").mkdir()
    assert FOLDER.convert(str(tmp_path / "old.yaml"), None, None) == tmp_path / "old.yaml"


@pytest.mark.parametrize("degrees", [0.01, 5.0])
def test_a_narrow_camera_has_a_field_in_common_with_itself(
    run: Run, calibrated: Path, tmp_path: Path, degrees: float
) -> None:
    narrow = with_field(calibrated, tmp_path / "narrow.yaml", degrees)
    found = json.loads(run("compare", narrow, narrow, "--json").stdout)
    assert found["rms_px"] < 1e-6
    assert found["pixels"] > 100
    assert found["common_share"] == 1


@pytest.mark.parametrize(
    "option",
    [
        ("--scale", "1e-300"),
        ("--view", "plane:floor", "-t", TARGET, "--scale", "1e308"),
    ],
)
def test_numbers_beyond_sense_are_wrong_usage(
    run: Run, calibrated: Path, tmp_path: Path, option: tuple[object, ...]
) -> None:
    error = run("undistort", PHOTO, tmp_path / "a.png", "-m", calibrated, *option, code=2).stderr
    assert "is not in the range" in error


def test_corners_in_one_pixel_are_refused(run: Run, calibrated: Path, tmp_path: Path) -> None:
    head, *lines = CORNERS.read_text().splitlines()
    rows = [",".join([*line.split(",")[:4], "480", "360"]) for line in lines[1:]]
    table = tmp_path / "one.csv"
    table.write_text("\n".join([head, lines[0], *rows]) + "\n")
    for line in (("calibrate", table, "-o", tmp_path / "c"), ("evaluate", table, "-m", calibrated)):
        error = run(*line, "-t", TARGET, code=1).stderr
        assert "corners are at x 480, y 360: check the columns x and y" in error


def test_a_weight_that_is_too_large_is_said_to_be(run: Run, tmp_path: Path) -> None:
    head, names, *rows = CORNERS.read_text().splitlines()
    table = tmp_path / "heavy.csv"
    table.write_text("\n".join([head, names + ",weight", *(f"{row},1.1e9" for row in rows)]))
    error = run("calibrate", table, "-t", TARGET, "-o", tmp_path / "c", code=1).stderr
    assert "weight 1.1e+09 must be above 0 and at most 1e+09" in error


@pytest.mark.parametrize("name", ["line\nbreak.jpg", " blank.jpg", "\udcff.jpg"])
def test_a_photo_with_an_odd_name_is_left_out_and_said(
    run: Run, calibrated: Path, tmp_path: Path, name: str
) -> None:
    photos = tmp_path / "photos"
    photos.mkdir()
    shutil.copy(PHOTO, photos / "good.jpg")
    try:
        shutil.copy(PHOTO, photos / name)
    except (OSError, UnicodeError):
        pytest.skip("no file can have this name here")
    said = run("undistort", photos, tmp_path / "flat", "-m", calibrated, "--size", "64x48")
    assert [path.name for path in (tmp_path / "flat").glob("[!.]*")] == ["good.jpg"]
    assert "1 file left out (" in said.stderr


@pytest.mark.slow
def test_files_that_are_missed_among_photos_are_counted_and_named(run: Run, tmp_path: Path) -> None:
    photos = tmp_path / "photos"
    shutil.copytree(SAMPLE / "photos", photos)
    for name in ("a.HEIC", "b.heic", "film.mp4", "notes.txt", "raw.dng", ".hidden.heic"):
        (photos / name).write_bytes(b"x")
    (photos / "corner_02.jpg").write_bytes(PHOTO.read_bytes()[:2000])
    said = run("detect", photos, "-t", TARGET, "-o", tmp_path / "c.csv")
    missed = "film.mp4 and raw.dng"
    if not find_spec("pillow_heif"):  # without it photos of phones are missed too
        missed = f"a.HEIC, b.heic, {missed}"
    assert f"files left out ({missed}): " in said.stderr
    assert "notes.txt" not in said.stderr
    (row,) = (line for line in said.stdout.splitlines() if line.startswith("corner_02"))
    assert row.endswith("cannot be read")


def test_a_folder_of_folders_names_them(run: Run, tmp_path: Path) -> None:
    for name in ("cam0", "cam1"):
        (tmp_path / "rig" / name).mkdir(parents=True)
    error = run("detect", tmp_path / "rig", "-t", TARGET, "-o", tmp_path / "c.csv", code=1).stderr
    assert f"only folders ({tmp_path}/rig/cam0 and {tmp_path}/rig/cam1)" in error


def test_several_photos_do_not_become_a_folder_with_a_files_name(
    run: Run, calibrated: Path, tmp_path: Path
) -> None:
    error = run("undistort", SAMPLE / "photos", tmp_path / "out.png", "-m", calibrated, code=2)
    assert "10 photos become a folder: write" in error.stderr
    assert not (tmp_path / "out.png").exists()
    (tmp_path / "v1.png").mkdir()
    line = ("undistort", PHOTO, SAMPLE / "photos" / "corner_02.jpg", tmp_path / "v1.png")
    run(*line, "-m", calibrated, "--size", "64x48")


@pytest.mark.parametrize(
    ("place", "says"),
    [
        ("file/c", "is a file, not a folder"),
        ("/proc/nowhere", "cannot be written"),
        (".", "folder"),
    ],
)
def test_outputs_that_cannot_be_written_are_refused_before_the_work(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str, says: str
) -> None:
    if place.startswith("/proc") and not Path("/proc").is_dir():
        pytest.skip("there is no /proc here")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    monkeypatch.setattr("cubicfish.detect", None)
    if place != ".":
        error = run("calibrate", SAMPLE / "photos", "-t", TARGET, "-o", place, code=1).stderr
        assert says in error
    error = run("detect", SAMPLE / "photos", "-t", TARGET, "-o", place, code=1).stderr
    assert says in error
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
@pytest.mark.usefixtures("in_time")
def test_a_pipe_in_the_cache_is_not_waited_for(tmp_path: Path) -> None:
    cache = GridCache(folder=tmp_path)
    key = cache.key(b"photo", [])
    os.mkfifo(tmp_path / f"{key}.npz")
    assert cache.load(key) is None


def test_entries_of_the_cache_that_were_exchanged_are_not_used(tmp_path: Path) -> None:
    cache = GridCache(folder=tmp_path)
    one, other = cache.key(b"one", []), cache.key(b"other", [])
    found = FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=(64, 48))
    cache.save(one, found)
    assert cache.load(one) is not None
    (tmp_path / f"{one}.npz").rename(tmp_path / f"{other}.npz")
    assert cache.load(other) is None


@pytest.mark.usefixtures("quick_fit")
def test_a_huge_camera_gets_no_map_of_gigabytes(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PictureFile, "MAX_PIXELS", 960 * 720 - 1)
    line = ("calibrate", CORNERS, "-t", TARGET, "--no-hold-out", "-o", tmp_path / "c")
    said = run(*line)
    assert "No undistort_map.npz was written: a map of 960x720 pixels" in said.stderr
    assert {path.name for path in (tmp_path / "c").iterdir()} == {"camera.yaml", "corners.csv"}


@pytest.mark.parametrize("factor", [0.0, 1e-200])
def test_a_degenerate_camera_is_refused_in_one_line_or_scaled(
    run: Run, calibrated: Path, tmp_path: Path, factor: float
) -> None:
    record = yaml.safe_load((calibrated / "camera.yaml").read_text())
    rows = slice(2, 3) if factor == 0 else slice(0, 3)  # without a denominator, or tiny throughout
    for row in record["P"][rows]:
        row[:] = [factor * value for value in row]
    path = tmp_path / "odd.yaml"
    path.write_text(yaml.safe_dump(record))
    if factor:
        assert (
            run("project", "0,0,1", "-m", path).stdout[:6]
            == (run("project", "0,0,1", "-m", calibrated).stdout[:6])
        )
    else:
        assert "P has a pole or a fold" in run("project", "0,0,1", "-m", path, code=1).stderr
