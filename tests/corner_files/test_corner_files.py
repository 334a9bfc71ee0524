"""Corners in files of other detectors: read by the names that truth has, or refused in one line."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import TRUE_LENS, corner_of_three, flat_board, poses_around, synthetic_corners

from cubicfish_cli.cli import corners as command
from cubicfish_cli.corner_files.observations_csv import load_corners, save_corners
from cubicfish_cli.corner_files.read import CORNER_FORMATS, read_corner_files
from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.observations import Observations
from cubicfish_cli.target import Target, load_target, target_text

SIZE = TRUE_LENS.image_size
THREE, FLAT = corner_of_three(), flat_board()
APRILGRID = """
units: mm
boards:
  - {name: grid, type: aprilgrid, tags: [5, 4], tag: 40, spacing: 0.3, first_marker: 7}
"""


def truth(target: Target, photos: int = 3) -> Observations:
    return synthetic_corners(target, poses_around(target, photos), noise=0.1)


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> Target:
    path = tmp_path_factory.mktemp("grid") / "target.yaml"
    path.write_text(APRILGRID)
    return load_target(path)


def same(read: Observations, true: Observations) -> None:
    """The same corners, in whatever order."""

    def keyed(corners: Observations) -> dict[tuple[str, str, int, int], tuple[float, float]]:
        rows = zip(
            corners.image, corners.board, corners.column, corners.row, corners.pixel, strict=True
        )
        return {
            (corners.images[i], corners.boards[b], int(c), int(r)): tuple(pixel.tolist())
            for i, b, c, r, pixel in rows
        }

    assert read.image_size == true.image_size
    assert keyed(read) == keyed(true)


# Writers of the layouts as their own programs write them -----------------------------------------


def write_csv(path: Path, corners: Observations, target: Target) -> None:
    """As scripts around Kalibr do, with a board's number: every corner row by row."""
    rows = [
        f"{corners.images[corners.image[i]]},{corners.board[i]},"
        f"{corners.row[i] * target.boards[corners.board[i]].columns + corners.column[i]},"
        f"{float(corners.pixel[i, 0])!r},{float(corners.pixel[i, 1])!r}"
        for i in range(len(corners.pixel))
    ]
    path.write_text("\n".join(["image,board,corner_id,x,y", *rows, ""]))


def vnl_rows(corners: Observations, target: Target, *, extra: str = " 0") -> list[str]:
    """As mrgingham: one row per corner of the board, row by row; dashes where nothing was found."""
    board = target.boards[0]
    rows = []
    for index, name in enumerate(corners.images):
        here = np.flatnonzero(corners.image == index)
        pixel = {(int(corners.row[i]), int(corners.column[i])): corners.pixel[i] for i in here}
        for row in range(board.rows):
            for column in range(board.columns):
                at = pixel.get((row, column))
                x, y = ("-", "-") if at is None else map(repr, at.tolist())
                rows.append(f"{name} {x} {y}{extra if at is not None else extra and ' -'}")
    return rows


# What the formats hold ---------------------------------------------------------------------------


def test_boards_go_by_their_places_or_by_their_names(tmp_path: Path) -> None:
    true, path = truth(THREE), tmp_path / "found.csv"
    write_csv(path, true, THREE)
    read = read_corner_files([path], THREE, image_size=SIZE)
    same(read.corners, true)
    assert read.left_out == 0
    assert read.empty == ()
    path.write_text(path.read_text().replace(".png,0,", ".png,4,"))
    with pytest.raises(CorrespondenceError, match="board '4', and which of the target's"):
        read_corner_files([path], THREE, image_size=SIZE)
    boards = {"4": "floor"}
    same(read_corner_files([path], THREE, boards=boards, image_size=SIZE).corners, true)


def test_numbers_find_boards_that_are_called_so(tmp_path: Path) -> None:
    path, head = tmp_path / "a.csv", "image,board,corner_id,x,y\n"
    path.write_text(head + "a,4,0,10,20\na,1,10,30,40\n")
    names = ("board1", "left", "board4")
    boards = (replace(board, name=name) for board, name in zip(THREE.boards, names, strict=True))
    target = Target(units="mm", boards=tuple(boards))
    read = read_corner_files([path], target, image_size=SIZE).corners
    assert [read.boards[i] for i in read.board] == ["board4", "board1"]
    assert read.column.tolist() == [0, 1]
    assert read.row.tolist() == [0, 1]
    # A board that bears a number is not also meant by its place: here 0 is nobody.
    path.write_text(head + "a,4,0,10,20\na,0,10,30,40\n")
    with pytest.raises(CorrespondenceError, match="board '0'"):
        read_corner_files([path], target, image_size=SIZE)


@pytest.mark.parametrize("extra", ["", " 0"])
def test_vnl_gives_the_true_corners(tmp_path: Path, extra: str) -> None:
    true = truth(FLAT)
    legend = "#!/usr/bin/x\n## a remark\n# filename x y" + (" level" if extra else "") + "\n"
    rows = vnl_rows(true, FLAT, extra=extra)
    nothing = "none.png - -" + (" -" if extra else "")
    path = tmp_path / "corners.vnl"
    path.write_text(legend + "\n".join([*rows[:88], nothing, *rows[88:]]) + "\n")
    read = read_corner_files([path], FLAT, image_size=SIZE)
    same(read.corners, true)
    assert read.empty == ("none.png",)
    assert read.left_out == len(rows) - len(true.pixel)


def test_vnl_levels_and_weights_are_weights_of_the_squared_error(tmp_path: Path) -> None:
    rows = [f"a.png {x} {y} 2" for y in range(8) for x in range(11)]
    path = tmp_path / "corners.vnl"
    path.write_text("\n".join(["# filename x y level", *rows]))
    assert read_corner_files([path], FLAT, image_size=SIZE).corners.weight[0] == 1 / 16
    path.write_text("\n".join(["# filename x y weight", *rows]))
    assert read_corner_files([path], FLAT, image_size=SIZE).corners.weight[0] == 4


def test_vnl_treats_corners_below_zero_as_not_found(tmp_path: Path) -> None:
    rows = [f"a.png {x - 1} {y}" for y in range(8) for x in range(11)]
    path = tmp_path / "corners.vnl"
    path.write_text("\n".join(["# filename x y", *rows]))
    read = read_corner_files([path], FLAT, image_size=SIZE)
    assert read.left_out == 8
    assert read.corners.column.min() == 1


def csv_of(corners: Observations, header: str, cell: Callable[[int, int, int], str]) -> str:
    rows = [
        f"{corners.image[i]},{cell(i, int(corners.column[i]), int(corners.row[i]))},"
        f"{float(corners.pixel[i, 0])!r},{float(corners.pixel[i, 1])!r}"
        for i in range(len(corners.pixel))
    ]
    return "\n".join([header, *rows, ""])


def as_photos(corners: Observations, names: list[str]) -> Observations:
    return replace(corners, images=tuple(names))


def test_kalibr_counts_an_aprilgrid_from_its_lowest_row(tmp_path: Path, grid: Target) -> None:
    # Kalibr's own picture of a 2x2 grid: 0..3 are the lowest row of corners, 4..7 the next.
    true = truth(grid)
    path = tmp_path / "found.csv"
    path.write_text(
        csv_of(true, "#timestamp [ns], corner_id, x, y", lambda i, c, r: str((7 - r) * 10 + c))
    )
    read = read_corner_files([path], grid, image_size=SIZE).corners
    same(read, as_photos(true, ["0", "1", "2"]))


def test_a_tag_and_its_corner_are_kalibrs(tmp_path: Path, grid: Target) -> None:
    def cell(_: int, column: int, row: int) -> str:
        tag_column, across = divmod(column, 2)
        tag_row, up = divmod(7 - row, 2)
        corner = {(0, 0): 0, (1, 0): 1, (1, 1): 2, (0, 1): 3}[across, up]
        return f"{7 + tag_row * 5 + tag_column},{corner}"

    true = truth(grid)
    path = tmp_path / "found.csv"
    path.write_text(csv_of(true, "ts,tag_id,corner_idx,kp_x,kp_y", cell))
    read = read_corner_files([path], grid, image_size=SIZE).corners
    same(read, as_photos(true, ["0", "1", "2"]))


def test_the_marker_of_a_tag_is_where_the_tag_id_says(tmp_path: Path, grid: Target) -> None:
    """The board's own list of its markers, against the corners that a tag's id names."""
    board = grid.boards[0]
    rows = ["image,tag_id,corner_index,x,y"]
    for marker, column, row in board.marker_cells().tolist():
        # bottom left, bottom right, top right, top left, on a picture of the board itself
        for corner, (c, r) in enumerate(((0, 1), (1, 1), (1, 0), (0, 0))):
            rows.append(f"a,{marker},{corner},{10 * (2 * column + c)},{10 * (2 * row + r)}")
    path = tmp_path / "found.csv"
    path.write_text("\n".join(rows))
    read = read_corner_files([path], grid, image_size=SIZE).corners
    assert np.array_equal(read.pixel, 10 * np.stack([read.column, read.row], axis=-1))


def test_one_camera_of_several_is_chosen(tmp_path: Path) -> None:
    path = tmp_path / "found.csv"
    path.write_text("image,cam,corner_id,x,y\na,0,0,10,20\na,0,1,20,20\na,1,0,10,20\n")
    with pytest.raises(CorrespondenceError, match="corners of 2 cameras: choose one"):
        read_corner_files([path], FLAT, image_size=SIZE)
    read = read_corner_files([path], FLAT, image_size=SIZE, only="cam0/*").corners
    assert read.images == ("cam0/a",)
    assert len(read.pixel) == 2


def test_grids_that_run_the_wrong_way_round_are_refused(tmp_path: Path, grid: Target) -> None:
    true = truth(grid)
    path = tmp_path / "found.csv"
    path.write_text(csv_of(true, "image,corner_id,x,y", lambda i, c, r: str(r * 10 + c)))
    with pytest.raises(CorrespondenceError, match=r"seen from behind .* from the lowest row up"):
        read_corner_files([path], grid, image_size=SIZE)
    flat = truth(FLAT)
    path.write_text(csv_of(flat, "image,corner_id,x,y", lambda i, c, r: str((7 - r) * 11 + c)))
    with pytest.raises(CorrespondenceError, match=r"seen from behind .* numbered row by row: "):
        read_corner_files([path], FLAT, image_size=SIZE)


def test_what_is_read_is_accepted_as_corners_csv(tmp_path: Path) -> None:
    true = truth(FLAT)
    path = tmp_path / "corners.vnl"
    path.write_text("\n".join(["# filename x y level", *vnl_rows(true, FLAT)]))
    read = read_corner_files([path], FLAT, image_size=SIZE).corners
    save_corners(tmp_path / "corners.csv", read, overwrite=False)
    same(load_corners(tmp_path / "corners.csv", FLAT), true)


def test_the_command_knows_the_same_words() -> None:
    assert command.FORMATS == CORNER_FORMATS


# What is refused ---------------------------------------------------------------------------------

VNL = "# filename x y level\n"
CSV = "image,corner_id,x,y\n"
REFUSED = {
    "legend.vnl": ("a.png 1 2 0\n", "must come before the corners"),
    "columns.vnl": ("# filename x y size\na.png 1 2 3\n", "unknown column 'size'"),
    "both.vnl": ("# filename x y level weight\na 1 2 0 1\n", "line 1: both level and weight"),
    "rows.vnl": (VNL + "a.png 1 2 0\na.png 2 2 0\n", "line 2: 'a.png' has 2 rows where"),
    "again.vnl": (VNL + "a - - -\nb - - -\na - - -\n", "line 4: rows of 'a' stand further up"),
    "text.vnl": (VNL + "a 1 2 0\n" * 87 + "a 1 two 0\n", "line 89: y must be a finite number"),
    "dash.vnl": (VNL + "a 1 2 0\n" * 87 + "a 1 -two 0\n", "line 89: y must be a finite number"),
    "level.vnl": (VNL + "a 1 2 99\n" + "a 1 2 0\n" * 87, "line 2: level must be a whole number"),
    "none.vnl": (VNL + "a - - -\n", "no corner in it is declared as found"),
    "header.csv": ("image,x,y\na,1,2\n", "'corner_id' is missing"),
    "more.csv": ("image,corner_id,x,y,colour\na,1,2,3,4\n", "unknown column 'colour'"),
    "short.csv": (CSV + "a,0,5\n", "line 2: 3 values where 4 belong"),
    "far.csv": (CSV + "a,0,5,721.5\n", "line 2: x 5, y 721.5 is outside the 960x720 image"),
    "big.csv": (CSV + "a,88,5,5\n", "line 2: corner 88 is outside board 'board' with 11x8"),
    "huge.csv": (CSV + f"a,{'9' * 30},5,5\n", "line 2: corner_id must be a whole number"),
    "minus.csv": (CSV + "a,-1,5,5\n", "line 2: corner -1 is outside"),
    "twice.csv": (CSV + "a,3,5,5\na,3,6,6\n", "line 3: the same corner as in line 2"),
    "nan.csv": (CSV + "a,0,inf,2\n", "line 2: x must be a finite number, not 'inf'"),
    "tags.csv": ("image,tag_id,corner_index,x,y\na,0,4,1,1\n", "corner_index 0, 1, 2 or 3"),
    "noun.csv": ("image,tag_id,corner_index,x,y\na,0,3,1,1\n", "is not an aprilgrid"),
    "weight.csv": ("image,corner_id,x,y,weight\na,0,1,2,0\n", "line 2: weight 0 must be above"),
    "board.csv": ("image,board,corner_id,x,y\na,7,0,1,2\n", "it has board '7'"),
    "what.txt": ("", "add --format mrcal or kalibr"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_bad_file_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    text, says = REFUSED[name]
    (tmp_path / name).write_text(text)
    with pytest.raises(CorrespondenceError) as refusal:
        read_corner_files([tmp_path / name], FLAT, image_size=(960, 720))
    assert says in str(refusal.value)
    assert name in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_files_of_several_kinds_of_trouble(tmp_path: Path) -> None:
    one = tmp_path / "one.csv"
    one.write_text("image,board,corner_id,x,y\na,0,0,1,1\n")
    with pytest.raises(CorrespondenceError, match="another file holds the corners of"):
        read_corner_files([one, one], FLAT, image_size=SIZE)
    with pytest.raises(CorrespondenceError, match="it has no board '3'; its boards: '0'"):
        read_corner_files([one], FLAT, boards={"3": "board"}, image_size=SIZE)
    with pytest.raises(CorrespondenceError, match="'bord' is not in the target: did you"):
        read_corner_files([one], FLAT, boards={"0": "bord"}, image_size=SIZE)
    with pytest.raises(CorrespondenceError, match="no photo in the files is called like 'b\\*'"):
        read_corner_files([one], FLAT, only="b*", image_size=SIZE)
    with pytest.raises(CorrespondenceError, match="does not exist"):
        read_corner_files([tmp_path / "no.csv"], FLAT, image_size=SIZE)
    (tmp_path / "a.vnl").write_text(VNL + "a - - -\n")
    with pytest.raises(CorrespondenceError, match="it is about one board, and which"):
        read_corner_files([tmp_path / "a.vnl"], THREE, image_size=SIZE)
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CorrespondenceError, match="is not UTF-8 text"):
        read_corner_files([tmp_path / "bytes.csv"], FLAT, image_size=SIZE)


@given(st.binary(max_size=300), st.sampled_from(CORNER_FORMATS), st.booleans())
def test_any_bytes_are_read_or_refused(tmp_path_factory, raw: bytes, kind, headed: bool) -> None:
    head = {"mrcal": VNL, "kalibr": CSV}[kind].encode() if headed else b""
    path = tmp_path_factory.getbasetemp() / "any"
    path.write_bytes(head + raw)
    said = ""
    try:
        read_corner_files([path], FLAT, kind=kind, image_size=SIZE)
    except CorrespondenceError as refusal:
        said = str(refusal)
    assert "\n" not in said


# From the command line to a camera ---------------------------------------------------------------


@pytest.mark.slow
def test_corners_of_others_calibrate_a_camera(tmp_path: Path, run) -> None:
    true = truth(THREE, photos=6)
    target, table, found = (tmp_path / name for name in ("target.yaml", "c.csv", "found.csv"))
    write_csv(found, true, THREE)
    target.write_text(target_text(THREE))
    line = ("corners", found, "--target", target, "--size", "{}x{}".format(*SIZE))
    said = run(*line, "-o", table).stdout
    assert f"wrote {table}: {len(true.pixel):,} corners in 6 photos" in said
    fit = run(
        *("calibrate", table, "--target", target, "-o", tmp_path / "c", "--json"),
        *("--no-hold-out", "--refine-target", "off"),
    )
    assert json.loads(fit.stdout)["rms_px"] < 0.15  # noise of 0.1 px along x and y
    run(*line, "-o", table, code=1)
    run("corners", found, "--target", target, code=2)
    run(*line, "--board", "=x", code=2)
    again = run(*line, "-o", table, "--overwrite", "--json")
    assert json.loads(again.stdout)["corners"] == len(true.pixel)
