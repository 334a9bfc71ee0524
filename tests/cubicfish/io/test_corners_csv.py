"""corners.csv and correspondences.csv: exact round trips, and every refusal."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from observed import SIZE, TARGET, any_corners, assert_same
from pairs_csv import write_pairs

from cubicfish.errors import CorrespondenceError, OutputError
from cubicfish.io.corners_csv import (
    load_corners,
    load_correspondences,
    save_corners,
)
from cubicfish.target.observations import Observations

HEADER = "# cubicfish corners 1, image_size 1280x800\nimage,board,column,row,x,y\n"
PAIRS_HEADER = "# cubicfish correspondences 1, image_size 1280x800\nimage,X,Y,Z,x,y\n"


def written(tmp_path: Path, text: str | bytes) -> Path:
    path = tmp_path / "in.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.slow
@given(any_corners(), st.booleans(), st.booleans())
def test_corners_read_back_exactly(
    tmp_path_factory: Any, found: Observations, weighted: bool, doubted: bool
) -> None:
    if not weighted:
        found = replace(found, weight=np.ones(len(found.image)))
    if not doubted:
        found = replace(found, certain=np.ones(len(found.image), bool))
    path = tmp_path_factory.mktemp("c") / "corners.csv"
    save_corners(path, found, overwrite=False)
    version = 1 if found.certain.all() else 2
    assert path.read_text().startswith(
        f"# cubicfish corners {version}, image_size 1280x800\nimage,board,column,row,x,y"
    )
    assert_same(load_corners(path, TARGET), found.with_target(TARGET))


def test_tables_that_say_nothing_of_certainty_are_certain(tmp_path: Path) -> None:
    assert load_corners(written(tmp_path, HEADER + ROW), TARGET).certain.tolist() == [True]
    newer = HEADER.replace("corners 1", "corners 2") + ROW
    assert load_corners(written(tmp_path, newer), TARGET).certain.tolist() == [True]
    marked = newer.replace(",y\n", ",y,certain\n").replace(ROW, ROW.strip() + ",0\n")
    assert load_corners(written(tmp_path, marked), TARGET).certain.tolist() == [False]


@given(
    hnp.arrays(float, (6, 3), elements=st.floats(-1e9, 1e9)),
    hnp.arrays(float, (6, 2), elements=st.floats(0, 799)),
)
def test_correspondences_read_back_exactly(
    tmp_path_factory: Any, world: np.ndarray, pixel: np.ndarray
) -> None:
    pairs = Observations(
        image_size=SIZE,
        images=("b.png", "a.png"),
        boards=(),
        image=np.array([0, 0, 0, 1, 1, 1]),
        world=world,
        pixel=pixel,
        weight=np.array([1, 1, 1, 1, 1, 0.5]),
        board=np.full(6, -1, np.intp),
        column=np.arange(6),
        row=np.zeros(6, np.intp),
    )
    path = tmp_path_factory.mktemp("p") / "pairs.csv"
    write_pairs(path, pairs)
    assert_same(load_correspondences(path), pairs)


def test_correspondences_are_sorted_by_photo_and_keep_their_row_numbers(tmp_path: Path) -> None:
    text = "image,X,Y,Z,x,y\nb,0,0,0,1,1\na,1,0,0,2,2\nb,2,0,0,3,3\n"
    pairs = load_correspondences(written(tmp_path, text), image_size=SIZE)
    assert pairs.images == ("b", "a")
    np.testing.assert_array_equal(pairs.image, [0, 0, 1])
    np.testing.assert_array_equal(pairs.world[:, 0], [0, 2, 1])
    np.testing.assert_array_equal(pairs.column, [0, 2, 1])
    np.testing.assert_array_equal(pairs.pixel[:, 0], [1, 3, 2])


def test_windows_files_with_blank_lines_and_other_column_orders_are_read(tmp_path: Path) -> None:
    text = (
        "\ufeff# cubicfish corners 1, image_size 1280x800\r\n"
        " x ,y, weight,row,column,board,image\r\n"
        '\r\n10.5, 20,2,1,3,"wall, left","a ""b"".png"\r\n'
    )
    found = load_corners(written(tmp_path, text), TARGET)
    assert found.images == ('a "b".png',)
    assert (found.board[0], found.column[0], found.row[0], found.weight[0]) == (1, 3, 1, 2)
    np.testing.assert_array_equal(found.pixel, [[10.5, 20]])


def test_a_file_without_the_first_line_needs_the_size(tmp_path: Path) -> None:
    path = written(tmp_path, "image,board,column,row,x,y\na,floor,0,0,1,2\n")
    assert load_corners(path, TARGET, image_size=(64, 48)).image_size == (64, 48)
    with pytest.raises(CorrespondenceError, match=r"the image size is not known: add image_size="):
        load_corners(path, TARGET)


def test_a_size_that_disagrees_with_the_file_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, HEADER + "a,floor,0,0,1,2\n")
    assert load_corners(path, TARGET, image_size=SIZE).image_size == SIZE
    with pytest.raises(CorrespondenceError, match=r"line 1: .* 1280x800 here, but 64x48"):
        load_corners(path, TARGET, image_size=(64, 48))


ROW = "a.png,floor,0,0,10,20\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "",
            "is empty: its header must be image,board,column,row,x,y: make it again, or name "
            "another file$",
        ),
        (HEADER, "has a header and no rows below it: make it again, or name another file$"),
        (
            "# cubicfish corners 1, image_size 1280x800\n" + ROW,
            "line 2: the header must .*'image'",
        ),
        (HEADER.replace(",", ";") + ROW, "line 2: semicolons separate"),
        (HEADER.replace(",y\n", ",y,wieght\n") + ROW, "line 2: .*'wieght': did you mean 'weight'"),
        (HEADER.replace(",y\n", ",y,x\n") + ROW, "line 2: the column 'x' is there twice"),
        (HEADER.replace("corners 1", "corners 3") + ROW, "line 1: format 3 is newer than 2, the"),
        (
            HEADER.replace("corners 1, image_size 1280x800", "corners 12") + ROW,
            "format 12 is newer",
        ),
        (HEADER.replace("corners 1", "corners 0") + ROW, "line 1: it must be"),
        (HEADER.replace("corners 1", "corners 12345678901") + ROW, "line 1: it must be"),
        (HEADER.replace("corners 1,", "corners 2.1, unit px,") + ROW, "line 1: it must be"),
        (
            HEADER.replace("1280x800", "1280x800, x y") + ROW,
            "line 1: it must be",
        ),
        ((HEADER + ROW).replace(",", ";").replace(";", ",", 1), "line 2: semicolons separate"),
        ((HEADER + ROW).replace(",", "\t").replace("\t", ",", 1), "line 2: tabs separate"),
        (HEADER.replace("corners", "correspondences") + ROW, "line 1: it must be"),
        (HEADER.replace("1280x800", "1280x0") + ROW, "line 1: '1280x0' is not an image size"),
        (HEADER.replace("1280x800", "x800") + ROW, "line 1: 'x800' is not an image size"),
        (HEADER.replace("1280x800", "-1280x800") + ROW, "line 1: '-1280x800' is not an image si"),
        (HEADER.replace("1280x800", "9999999x8") + ROW, "line 1: '9999999x8' is not an image si"),
        (HEADER + ROW + "a.png,floor,1,0,10\n", "line 4: 5 values where 6 belong"),
        (HEADER + ROW + "a.png,floor,1,0,10,20,30\n", "line 4: 7 values where 6 belong"),
        (HEADER + ROW + "a.png,flor,1,0,10,20\n", "line 4: board 'flor' .*did you mean 'floor'"),
        (HEADER + ROW + "a.png,x,1,0,10,20\n", "line 4: board 'x' .*known: floor, wall, left"),
        (HEADER + ROW + "a.png,,1,0,10,20\n", "line 4: board must be a name, not ''"),
        (HEADER + ",floor,1,0,10,20\n", "line 3: image must be a name, not ''"),
        (HEADER + '"a\nb",floor,1,0,10,20\n', r"line 4: image must be a name, not 'a\\nb'"),
        (HEADER + ROW + "a.png,floor,5,0,10,20\n", "line 4: column 5, row 0 is outside board 'fl"),
        (HEADER + ROW + "a.png,floor,0,-1,10,20\n", "line 4: .*5x4 corners.*count squares"),
        (HEADER + ROW + "a.png,floor,1.5,0,10,20\n", "line 4: column must be a whole number, not"),
        (HEADER + "a.png,floor," + "9" * 30 + ",0,1,2\n", "line 3: column must be a whole number"),
        (HEADER + "a.png,floor," + "9" * 5000 + ",0,1,2\n", "line 3: column must be a whole num"),
        (HEADER + ROW + "a.png,floor,1,0,nan,20\n", "line 4: x must be a finite number, not 'nan'"),
        (HEADER + ROW + "a.png,floor,1,0,1,inf\n", "line 4: y must be a finite number, not 'inf'"),
        (HEADER + ROW + "a.png,floor,1,0,1,\n", "line 4: y must be a finite number, not ''"),
        (
            HEADER + ROW + 'a.png,floor,1,0,1,"2,5"\n',
            "line 4: y must be a finite .* '2,5'",
        ),
        (
            HEADER + ROW + "a.png,floor,1,0,1300,20\n",
            "line 4: x 1300, y 20 is outside the 12",
        ),
        (HEADER + ROW + "a.png,floor,1,0,-2,20\n", "line 4: x -2, y 20 is outside"),
        (
            HEADER + ROW + "b.png,floor,0,0,1,2\n" + ROW,
            "line 5: column 0, row 0 of board",
        ),
        (HEADER + ROW + 'a.png,"floor,1,0,10,20\n', "not a comma-separated table"),
        (HEADER + "\n\n" + ROW + ROW, "line 6: column 0, row 0 .* twice in this photo"),
        (
            HEADER.replace(",y\n", ",y,weight\n") + "a,floor,0,0,1,2,0\n",
            "line 3: weight 0 must be above 0",
        ),
        (
            HEADER.replace(",y\n", ",y,certain\n") + "a,floor,0,0,1,2,2\n",
            "line 3: certain must be 1, or 0 where",
        ),
        (HEADER.encode() + b"\xff\xfe,floor,0,0,1,2\n", "is not UTF-8 text"),
        (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "is not UTF-8 text"),
        (HEADER + "\0,floor,0,0,1,2\n", "line 3: "),
        (HEADER + "x" * 200_000, "line 3: not a comma-separated table: field larger"),
    ],
)
def test_malformed_corners_are_refused_with_file_and_line(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(CorrespondenceError, match=message) as caught:
        load_corners(path, TARGET)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image,X,Y,Z,x,y\na,0,0,0,1,2\n", "the image size is not known: add image_size="),
        (PAIRS_HEADER + "a,0,0,zero,1,2\n", "line 3: Z must be a finite number, not 'zero'"),
        (PAIRS_HEADER + "a,0,0,1e300,1,2\n", "line 3: X, Y, Z must lie within"),
        (PAIRS_HEADER + "a,0,0,0,1,2000\n", "line 3: x 1, y 2000 is outside the 1280x800"),
        (HEADER + ROW, "line 2: the header must be image,X,Y,Z,x,y: 'X' is missing"),
        (
            PAIRS_HEADER.replace("correspondences", "corners") + "a,0,0,0,1,2\n",
            "line 1: it must be",
        ),
    ],
)
def test_malformed_correspondences_are_refused_with_file_and_line(
    tmp_path: Path, text: str, message: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(CorrespondenceError, match=message) as caught:
        load_correspondences(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(CorrespondenceError, match=r"no\.csv does not exist"):
        load_corners(tmp_path / "no.csv", TARGET)


@pytest.mark.slow
@given(st.text(max_size=60))
def test_any_text_below_the_header_is_read_or_refused_in_one_line(
    tmp_path_factory: Any, text: str
) -> None:
    path = written(tmp_path_factory.mktemp("h"), (HEADER + text).encode("utf-8", "replace"))
    said = ""
    try:
        load_corners(path, TARGET)
    except CorrespondenceError as error:
        said = str(error)
    assert "\n" not in said


def test_files_are_not_replaced_unasked(tmp_path: Path) -> None:
    path = written(tmp_path, HEADER + ROW)
    found = load_corners(path, TARGET)
    with pytest.raises(OutputError, match="overwrite=True"):
        save_corners(path, found, overwrite=False)
    save_corners(path, found, overwrite=True)


@pytest.mark.slow
def test_three_hundred_thousand_rows_take_seconds_not_minutes(tmp_path: Path) -> None:
    count = 300_000
    image = np.repeat(np.arange(count // 20), 20)
    place = np.tile(np.arange(20), count // 20)
    found = Observations(
        image_size=SIZE,
        images=tuple(f"{n:05}.png" for n in range(count // 20)),
        boards=TARGET.board_names,
        image=image,
        board=np.zeros(count, np.intp),
        column=place % 5,
        row=place // 5,
        pixel=np.random.default_rng(1).uniform(0, 800, (count, 2)),
    )
    path = tmp_path / "corners.csv"
    start = time.process_time()
    save_corners(path, found, overwrite=False)
    read = load_corners(path, TARGET)
    assert time.process_time() - start < 10  # measured: 2 s
    assert_same(read, found.with_target(TARGET))
