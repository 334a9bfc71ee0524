"""mrcal's corners.vnl: read by the names that truth has, or refused in one line."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic import TRUE_LENS, corner_of_three, flat_board, poses_around, synthetic_corners

from cubicfish import (
    CorrespondenceError,
    CubicfishError,
    Observations,
    Target,
    TargetError,
    load_corners,
    save_corners,
)
from cubicfish_cli.extensions.formats.corner_files import read_corner_files

SIZE = TRUE_LENS.image_size
THREE, FLAT = corner_of_three(), flat_board()


def truth(target: Target, photos: int = 3) -> Observations:
    return synthetic_corners(target, poses_around(target, photos), noise=0.1)


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


def whole(names: str, board: str = "floor", order: int = 1) -> str:
    """All corners of THREE's board in photos of these names, a grid as seen from the front."""
    one = THREE.boards[THREE.board_names.index(board)]
    rows = [
        f"{name} {20 + 9 * column} {30 + 9 * row} 0"
        for name in names
        for row in range(one.rows)[::order]
        for column in range(one.columns)
    ]
    return "\n".join([VNL.rstrip(), *rows, ""])


def test_a_board_of_several_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.vnl"
    path.write_text(whole("a", "left"))
    read = read_corner_files([path], THREE, image_size=SIZE, board="left").corners
    assert {read.boards[i] for i in read.board.tolist()} == {"left"}
    np.testing.assert_array_equal(read.pixel[:, 0], 20 + 9 * read.column)
    np.testing.assert_array_equal(read.pixel[:, 1], 30 + 9 * read.row)
    np.testing.assert_array_equal(read.world, THREE.world_points(read.board, read.column, read.row))


def test_photos_of_one_camera_are_chosen(tmp_path: Path) -> None:
    paths = [tmp_path / "one.vnl", tmp_path / "two.vnl"]
    for path, names in zip(paths, ("ab", "cd"), strict=True):
        path.write_text(whole(names) + f"empty_{names} - - -\n")
    read = read_corner_files(paths, THREE, image_size=SIZE, board="floor", only="[bc]*")
    count = THREE.boards[0].columns * THREE.boards[0].rows
    assert read.corners.images == ("b", "c")
    assert read.corners.image.tolist() == [0] * count + [1] * count
    assert (read.empty, read.left_out) == ((), 0)
    every = read_corner_files(paths, THREE, image_size=SIZE, board="floor")
    assert every.corners.images == ("a", "b", "c", "d")
    assert every.empty == ("empty_ab", "empty_cd")


def test_what_is_read_is_accepted_as_corners_csv(tmp_path: Path) -> None:
    true = truth(FLAT)
    path = tmp_path / "corners.vnl"
    path.write_text("\n".join(["# filename x y level", *vnl_rows(true, FLAT)]))
    read = read_corner_files([path], FLAT, image_size=SIZE).corners
    save_corners(tmp_path / "corners.csv", read, overwrite=False)
    same(load_corners(tmp_path / "corners.csv", FLAT), true)


# What is refused ---------------------------------------------------------------------------------

VNL = "# filename x y level\n"
REFUSED = {
    "legend.vnl": ("a.png 1 2 0\n", "must come before the corners"),
    "columns.vnl": ("# filename x y size\na.png 1 2 3\n", "unknown column 'size'"),
    "both.vnl": ("# filename x y level weight\na 1 2 0 1\n", "line 1: both level and weight"),
    "rows.vnl": (VNL + "a.png 1 2 0\na.png 2 2 0\n", "line 2: 'a.png' has 2 rows where"),
    "again.vnl": (VNL + "a - - -\nb - - -\na - - -\n", "line 4: rows of 'a' stand further up"),
    "text.vnl": (VNL + "a 1 2 0\n" * 87 + "a 1 two 0\n", "line 89: y must be a finite number"),
    "dash.vnl": (VNL + "a 1 2 0\n" * 87 + "a 1 -two 0\n", "line 89: y must be a finite number"),
    "level.vnl": (VNL + "a 1 2 99\n" + "a 1 2 0\n" * 87, "line 2: level must be a whole number"),
    "half.vnl": (VNL + "a 1 2 0.5\n" + "a 1 2 0\n" * 87, "line 2: level must be a whole number"),
    "nan.vnl": (VNL + "a 1 inf 0\n" * 88, "line 2: y must be a finite number, not 'inf'"),
    "short.vnl": (VNL + "a 1 2\n", "line 2: 3 values where 4 belong"),
    "far.vnl": (VNL + "a 5 721.5 0\n" * 88, "line 2: x 5, y 721.5 is outside the 960x720 image"),
    "none.vnl": (VNL + "a - - -\n", "no corner in it is declared as found"),
    "weight.vnl": ("# filename x y weight\n" + "a 1 2 0\n" * 88, "line 2: weight 0 must be above"),
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
    one = tmp_path / "one.vnl"
    one.write_text(whole("a"))
    given = {"image_size": SIZE, "board": "floor"}
    with pytest.raises(CorrespondenceError, match="another file holds the corners of"):
        read_corner_files([one, one], THREE, **given)
    with pytest.raises(TargetError, match="'flor' is not in the target: did you"):
        read_corner_files([one], THREE, image_size=SIZE, board="flor")
    with pytest.raises(CorrespondenceError, match="no photo in the files is called like 'b\\*'"):
        read_corner_files([one], THREE, only="b*", **given)
    with pytest.raises(CorrespondenceError, match="does not exist"):
        read_corner_files([tmp_path / "no.vnl"], THREE, **given)
    with pytest.raises(CorrespondenceError, match="it is about one board, and which"):
        read_corner_files([one], THREE, image_size=SIZE)
    (tmp_path / "bytes.vnl").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CorrespondenceError, match="is not UTF-8 text"):
        read_corner_files([tmp_path / "bytes.vnl"], THREE, **given)


@given(st.binary(max_size=300), st.booleans())
def test_any_bytes_are_read_or_refused(tmp_path_factory, raw: bytes, headed: bool) -> None:
    path = tmp_path_factory.getbasetemp() / "any"
    path.write_bytes((VNL.encode() if headed else b"") + raw)
    said = ""
    try:
        read_corner_files([path], FLAT, image_size=SIZE)
    except CubicfishError as refusal:
        said = str(refusal)
    assert "\n" not in said


# From the command line to a camera ---------------------------------------------------------------


@pytest.mark.slow
def test_corners_of_others_calibrate_a_camera(tmp_path: Path, run) -> None:
    true = truth(FLAT, photos=8)
    target, table, found = (tmp_path / name for name in ("target.yaml", "c.csv", "found.vnl"))
    found.write_text("\n".join(["# filename x y level", *vnl_rows(true, FLAT)]) + "\n")
    target.write_text(FLAT.text())
    line = ("corners", found, "--target", target, "--size", "{}x{}".format(*SIZE))
    said = run(*line, "-o", table).stdout
    assert f"wrote {table}: {len(true.pixel):,} corners in 8 photos" in said
    fit = run(
        *("calibrate", table, "--target", target, "-o", tmp_path / "c", "--json"),
        *("--no-hold-out", "--refine-target", "off"),
    )
    assert json.loads(fit.stdout)["rms_px"] < 0.15  # noise of 0.1 px along x and y
    run(*line, "-o", table, code=1)
    run("corners", found, "--target", target, code=2)
    run(*line, "--board", "no", "-o", tmp_path / "other.csv", code=1)
    again = run(*line, "-o", table, "--overwrite", "--json")
    assert json.loads(again.stdout)["corners"] == len(true.pixel)
