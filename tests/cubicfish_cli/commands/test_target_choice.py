"""The object without a file, by default, and from Kalibr's files."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from running import Run
from samples import SAMPLE

from cubicfish import TargetError, load_corners
from cubicfish_cli.inputs.target_source import colourings, target_in

CORNERS = SAMPLE / "true_corners.csv"


def write_photos(folder: Path, columns: int, rows: int, *, light: bool, count: int = 4) -> None:
    """Flat boards of (columns, rows) inner corners, in perspective, the outer squares as asked."""
    side = 60
    row, column = np.indices(((rows + 1) * side, (columns + 1) * side)) // side
    board = np.where((row + column) % 2 == (0 if light else 1), 235, 25).astype(np.uint8)
    board = np.pad(board, side, constant_values=235)
    height, width = board.shape
    folder.mkdir()
    ends = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    for index in range(count):
        lean = 12 * index
        to = ends + np.array([[lean, 5], [0, lean], [-lean, 0], [3, -lean]], np.float32)
        homography = cv2.getPerspectiveTransform(ends, (to * 0.9 + 60).astype(np.float32))
        picture = cv2.warpPerspective(board, homography, (760, 600), borderValue=140)
        cv2.imwrite(str(folder / f"p{index}.png"), cv2.GaussianBlur(picture, (0, 0), 0.8))


@pytest.mark.slow
@pytest.mark.parametrize("light", [False, True])
@pytest.mark.parametrize("cache", [(), ("--no-cache",)])
def test_a_board_is_named_by_its_counts_whatever_its_outer_squares(
    run: Run, tmp_path: Path, light: bool, cache: tuple[str, ...]
) -> None:
    write_photos(tmp_path / "photos", 7, 5, light=light)
    line = ("detect", tmp_path / "photos", "--board", "7x5", "--square", "3cm", *cache)
    run(*line, "-o", tmp_path / "c.csv")
    target = tmp_path / "t.yaml"
    target.write_text(
        "units: mm\nboards: [{name: board, type: checkerboard, corners: [7, 5], square: 30}]\n"
    )
    corners = load_corners(tmp_path / "c.csv", target_in(target))
    assert len(corners.pixel) == 4 * 35
    assert corners.boards == ("board",)


def flat_corners(folder: Path) -> Path:
    """A table of the corners of one of the sample's boards."""
    lines = CORNERS.read_text().splitlines()
    kept = [line.replace(",floor,", ",board,") for line in lines[2:] if ",floor," in line]
    (folder / "flat.csv").write_text("\n".join([*lines[:2], *kept]) + "\n")
    return folder / "flat.csv"


@pytest.mark.usefixtures("quick_fit")
def test_the_board_is_written_beside_the_camera_and_read_back(run: Run, tmp_path: Path) -> None:
    flat, out = flat_corners(tmp_path), tmp_path / "c"
    line = ("calibrate", flat, "--board", "9x6", "--square", "25mm", "--no-hold-out", "-o", out)
    run(*line, "--json")
    written = target_in(out / "target.yaml")
    assert (written.units, written.boards[0].square) == ("mm", 25.0)
    assert (written.boards[0].columns, written.boards[0].rows) == (9, 6)
    record = yaml.safe_load((out / "camera.yaml").read_text())["made_by"]["target"]
    assert record["file"] == str(out / "target.yaml")
    said = json.loads(run("evaluate", flat, "-m", out, "-t", record["file"], "--json").stdout)
    assert said["rms_px"] < 1
    run(*line[:-1], tmp_path / "p", "--lift", "point")
    assert (tmp_path / "p" / "target.yaml").read_bytes() == (out / "target.yaml").read_bytes()


@pytest.mark.usefixtures("quick_fit")
def test_photos_of_the_fit_are_no_worse_than_the_drawn_target_was(run: Run, tmp_path: Path) -> None:
    flat, out = flat_corners(tmp_path), tmp_path / "c"
    board = ("--board", "9x6", "--square", "25mm")
    run("calibrate", flat, *board, "--refine-target", "off", "--no-hold-out", "-o", out)
    camera = yaml.safe_load((out / "camera.yaml").read_text())
    fit = camera["fit"]
    off = fit["rms_px"]
    for level, before in (("off", f"against {off:.3f} px"), ("points", "on these photos\n")):
        # As if the refined target had left a fiftieth of that.
        fit |= {"refine_target": "points", "rms_px": off / 50, "held_out_rms_px": off / 50}
        fit["held_out_by_level"] = {level: off, "points": off / 50}
        (out / "camera.yaml").write_text(yaml.safe_dump(camera))
        for target in (board, ("--target", out / "target.yaml")):
            said = run("evaluate", flat, *target, "-m", out)
            assert before in said.stdout, said.stdout
            assert "calibrate again" not in said.stdout


def test_what_does_not_go_together_is_wrong_usage(run: Run, calibrated: Path) -> None:
    line = ("calibrate", CORNERS)
    assert "add --square" in run(*line, "--board", "9x6", code=2).stderr
    assert "--square is of --board" in run(*line, "--square", "3cm", code=2).stderr
    both = ("-t", SAMPLE / "target.yaml", "--board", "9x6", "--square", "1in")
    assert "leave --board out" in run(*line, *both, code=2).stderr
    assert "not a length" in run(*line, "--board", "9x6", "--square", "wide", code=1).stderr
    for counts in ("1x6", "9x1", "101x6", "9x101", "9"):
        wrong = run(*line, "--board", counts, "--square", "1in", code=2).stderr
        assert "not two numbers from 2 to 100" in wrong.replace("\n", " ")
    for name, more in (("calibrate", ()), ("detect", ()), ("evaluate", ("-m", calibrated))):
        said = run(name, SAMPLE / "photos", *more, code=2).stderr
        assert "cubicfish target print" in said
        assert "--board 9x6" in said


def test_target_yaml_of_the_current_folder_is_meant(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, calibrated: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "target.yaml").write_bytes((SAMPLE / "target.yaml").read_bytes())
    said = run("evaluate", CORNERS, "-m", calibrated)
    assert "Target: target.yaml.\n" in said.stderr
    said = run("evaluate", CORNERS, "-m", calibrated, "-t", "target.yaml", "-q")
    assert said.stderr == ""


KALIBR = {
    "aprilgrid": "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 5\ntagSize: 0.088\n"
    "tagSpacing: 0.3 #ratio\n",
    "checkerboard": "target_type: 'checkerboard' #gridtype\ntargetCols: 6\ntargetRows: 7\n"
    "rowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n",
}


def test_files_of_kalibr_are_read_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "april.yaml"
    path.write_text(KALIBR["aprilgrid"])
    (board,) = target_in(path).boards
    assert (board.columns, board.rows, board.square, board.spacing) == (12, 10, 0.088, 0.3)
    path.write_text(KALIBR["checkerboard"])
    loaded = target_in(path)
    (board,) = loaded.boards
    assert (board.columns, board.rows, board.square, loaded.units) == (6, 7, 0.06, "m")


@pytest.mark.parametrize(
    ("kind", "old", "new", "says"),
    [
        ("checkerboard", "colSpacingMeters: 0.06", "colSpacingMeters: 0.07", "differ: squares"),
        ("checkerboard", "targetCols: 6\n", "", "corners: must be two whole numbers"),
        ("checkerboard", "'checkerboard'", "circlegrid", "type: 'circlegrid' is not known"),
        ("aprilgrid", "tagSize: 0.088", "tagSize: -1", "tag: must be a positive"),
    ],
)
def test_what_kalibr_has_and_we_do_not_is_refused(
    tmp_path: Path, kind: str, old: str, new: str, says: str
) -> None:
    path = tmp_path / "t.yaml"
    path.write_text(KALIBR[kind].replace(old, new))
    with pytest.raises(TargetError, match=says):
        target_in(path)


@pytest.mark.parametrize(
    ("counts", "ways"), [((6, 4), 2), ((7, 5), 2), ((9, 6), 1), ((5, 5), 1), ((6, 6), 2)]
)
def test_colours_matter_only_where_a_turn_does_not_exchange_them(
    tmp_path: Path, counts: tuple[int, int], ways: int
) -> None:
    path = tmp_path / "t.yaml"
    text = "units: mm\nboards: [{{name: b, type: checkerboard, corners: [{}, {}], square: 1}}]\n"
    path.write_text(text.format(*counts))
    assert len(colourings(target_in(path))) == ways


@pytest.mark.slow
def test_a_checkerboard_of_kalibr_is_found_in_either_colours(run: Run, tmp_path: Path) -> None:
    write_photos(tmp_path / "photos", 7, 5, light=True)
    path = tmp_path / "kalibr.yaml"
    path.write_text(
        KALIBR["checkerboard"].replace("Cols: 6", "Cols: 7").replace("Rows: 7", "Rows: 5")
    )
    said = run("detect", tmp_path / "photos", "-t", path, "-o", tmp_path / "c.csv", "--json").stdout
    assert json.loads(said)["corners"] == 4 * 35


@pytest.mark.slow
def test_of_two_colourings_that_fit_alike_the_one_without_remarks_is_taken(
    run: Run, tmp_path: Path
) -> None:
    write_photos(tmp_path / "photos", 7, 5, light=True)
    given = ("--board", "7x5", "--square", "30mm", "--json")
    said = run("detect", tmp_path / "photos", *given, "-o", tmp_path / "c.csv").stdout
    assert json.loads(said)["corners"] == 4 * 35
    assert json.loads(said)["findings"] == []
