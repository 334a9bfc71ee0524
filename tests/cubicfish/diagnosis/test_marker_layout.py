"""Boards with markers whose counts or gaps are not the target's: what their markers say of it."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from asymmetric_lens import AsymmetricLens
from looking import look_at

from cubicfish.diagnosis.diagnose import find_faults
from cubicfish.diagnosis.evidence import MarkerEvidence
from cubicfish.find.detection.finder import find_grids
from cubicfish.find.detection.markers import find_marked_corners
from cubicfish.find.identification.identified import marked_corners
from cubicfish.judge.codes import Code, Severity
from cubicfish.scene.photos import render
from cubicfish.target.boards.markers import Markers
from cubicfish.target.boards.types import BOARD_TYPES
from cubicfish.target.target import Target

SIZE = (480, 400)
LENS = AsymmetricLens(
    image_size=SIZE, fx=210.0, fy=210.3, cx=241.0, cy=198.0, k=(-0.02, -0.003, 0, 0)
)
FACING = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
NAMES = ["a.png", "b.png", "c.png"]


def drawing(kind, counts, first_square="dark"):
    """A flat board; counts of corners, or of tags."""
    columns, rows = counts
    tags = kind == "aprilgrid"
    dictionary = "DICT_APRILTAG_36h11" if tags else "DICT_4X4_100"
    cells = columns * rows if tags else (columns + 1) * (rows + 1)
    count = cells if tags else (cells + (first_square == "light")) // 2
    board = BOARD_TYPES[kind](
        name="board",
        columns=columns * (1 + tags),
        rows=rows * (1 + tags),
        square=30.0,
        origin=np.zeros(3),
        x_axis=np.array(FACING[0]),
        y_axis=np.array(FACING[1]),
        first_square=first_square,
        markers=None
        if kind == "checkerboard"
        else Markers(dictionary=dictionary, side=30.0 if tags else 22.0, first=0, count=count),
        spacing=0.3 if tags else 0.0,
    )
    return Target(units="mm", boards=(board,))


@cache
def photos(kind, counts, first_square="dark"):
    """Photos of a board, each with the grids that are found in it."""
    target = drawing(kind, counts, first_square)
    board = target.boards[0]
    middle = board.world_points(board.columns - 1, board.rows - 1) / 2
    seen = []
    for place in ((30.0, -20.0, -230.0), (-60.0, 50.0, -240.0)):
        pose = look_at(middle + np.array(place), middle, up=np.array([0.0, -1.0, 0.0]))
        picture = render(target, LENS.unproject, pose, SIZE, noise=1.5, supersample=2)
        seen.append((picture, find_grids(picture)))
    return tuple(seen)


def evidence(photos, target):
    pictures, grids = zip(*photos, strict=True)
    marked = [
        find_marked_corners(picture, target, found)
        for picture, found in zip(pictures, grids, strict=True)
    ]
    return MarkerEvidence(
        photos=len(pictures),
        names=NAMES[: len(pictures)],
        picture=lambda number: pictures[number],
        target=target,
        with_boards=len(pictures),
        lost=(),
        corners=marked_corners(marked, target, SIZE, NAMES[: len(pictures)]),
        grids=list(grids),
    )


@pytest.mark.parametrize(
    "drawn",
    [
        pytest.param((6, 4), id="exchanged", marks=pytest.mark.slow),
        pytest.param((5, 6), id="more", marks=pytest.mark.slow),
        pytest.param((3, 6), id="fewer", marks=pytest.mark.slow),
        pytest.param((5, 7), id="squares", marks=pytest.mark.slow),
    ],
)
def test_the_markers_tell_how_long_their_rows_are(drawn):
    pictures = photos("charuco", (4, 6))
    (reported,) = find_faults(evidence(pictures, drawing("charuco", drawn)))
    assert (reported.code, reported.severity, reported.case) == (
        Code.CORNER_COUNT,
        Severity.BAD,
        "markers",
    )
    assert (reported.figures["columns"], reported.figures["rows"]) == (4, 6)
    assert reported.figures["first_square"] == "dark"


@pytest.mark.slow
def test_the_older_layout_is_named_where_rows_are_of_an_even_number_of_squares():
    pictures = photos("charuco", (5, 4), "light")
    (reported,) = find_faults(evidence(pictures, drawing("charuco", (5, 4))))
    assert (reported.code, reported.case) == (Code.CORNER_COUNT, "markers")
    assert (reported.figures["columns"], reported.figures["rows"]) == (5, 4)
    assert reported.figures["first_square"] == "light"


@pytest.mark.slow
def test_tags_tell_it_too():
    pictures = photos("aprilgrid", (4, 3))
    (reported,) = find_faults(evidence(pictures, drawing("aprilgrid", (3, 4))))
    assert (reported.code, reported.severity, reported.case) == (
        Code.CORNER_COUNT,
        Severity.BAD,
        "tags",
    )
    assert (reported.figures["columns"], reported.figures["rows"]) == (4, 3)


@pytest.mark.slow
def test_a_few_wrong_names_in_one_photo_of_three_hide_nothing():
    pictures = photos("charuco", (4, 6))
    three = (*pictures, pictures[1])
    right, wrong = (evidence(three, drawing("charuco", counts)) for counts in ((4, 6), (5, 7)))
    assert not len(wrong.corners.pixel)
    some = (right.corners.image == 0) & (right.corners.column < 2) & (right.corners.row < 3)
    (reported,) = find_faults(replace(wrong, corners=right.corners.select(some)))
    assert (reported.code, reported.severity, reported.case) == (
        Code.CORNER_COUNT,
        Severity.BAD,
        "markers",
    )
    assert (reported.figures["columns"], reported.figures["rows"]) == (4, 6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("other", "seen"),
    [
        ({"dictionary": "DICT_5X5_100"}, "DICT_4X4_50"),
        ({"dictionary": "DICT_4X4_250", "first": 60}, "DICT_4X4_250"),
    ],
    ids=["family", "first"],
)
def test_the_markers_that_photos_show_instead_are_named(other, seen):
    target = drawing("charuco", (4, 6))
    (board,) = target.boards
    drawn = target.with_boards({0: replace(board, markers=replace(board.markers, **other))})
    (reported,) = find_faults(evidence(photos("charuco", (4, 6)), drawn))
    assert (reported.code, reported.case) == (Code.NO_MARKERS, "others")
    assert (reported.figures["first"], reported.figures["last"]) == (0, 16)
    assert reported.figures["seen"] == seen


@pytest.mark.slow
def test_photos_without_any_markers_have_no_other_cause():
    target = drawing("charuco", (4, 6))
    plain = drawing("checkerboard", (4, 6))
    middle = np.array([45.0, 75.0, 0.0])
    pose = look_at(middle + np.array([20.0, -10.0, -240.0]), middle, up=np.array([0.0, -1.0, 0.0]))
    picture = render(plain, LENS.unproject, pose, SIZE, noise=1.5, supersample=2)
    (reported,) = find_faults(evidence([(picture, find_grids(picture))], target))
    assert (reported.code, reported.case) == (Code.NO_MARKERS, "all")


@pytest.mark.parametrize(
    "spacing", [0.36, *(pytest.param(one, marks=pytest.mark.slow) for one in (0.2, 5.0))]
)
def test_tags_tell_how_far_apart_they_are(spacing):
    target = drawing("aprilgrid", (4, 3))
    (board,) = target.boards
    drawn = target.with_boards({0: replace(board, spacing=spacing)})
    (reported,) = find_faults(evidence(photos("aprilgrid", (4, 3)), drawn))
    assert (reported.code, reported.case) == (Code.BOARD_SQUARE, "spacing")
    assert reported.severity is Severity.BAD
    assert reported.figures["spacing"] == pytest.approx(0.3, abs=0.03)


@pytest.mark.parametrize(("kind", "counts"), [("charuco", (4, 6)), ("aprilgrid", (4, 3))])
def test_a_right_drawing_is_left_alone(kind, counts):
    seen = evidence(photos(kind, counts), drawing(kind, counts))
    assert len(seen.corners.pixel) > 40
    assert find_faults(seen) == []


@pytest.mark.slow
def test_a_board_that_shows_too_little_is_not_blamed():
    """Its markers lie as the target says; what is missing are its corners."""
    seen = evidence(photos("charuco", (4, 6)), drawing("charuco", (4, 6)))
    none = seen.corners.select(np.zeros(len(seen.corners.pixel), bool))
    (reported,) = find_faults(replace(seen, corners=none))
    assert reported.code == Code.NO_MARKERS


@pytest.mark.slow
def test_markers_of_another_size_than_drawn_name_the_same_corners():
    target, pictures = drawing("charuco", (4, 6)), photos("charuco", (4, 6))
    (board,) = target.boards
    right = evidence(pictures, target).corners
    for side in (9.0, 14.0):
        drawn = target.with_boards({0: replace(board, markers=replace(board.markers, side=side))})
        seen = evidence(pictures, drawn).corners
        for name in ("image", "column", "row"):
            np.testing.assert_array_equal(getattr(seen, name), getattr(right, name))
        np.testing.assert_allclose(seen.pixel, right.pixel, atol=0.2)


def test_one_marker_that_cannot_be_read_does_not_outweigh_those_that_agree():
    """Most corners are covered: few markers are seen through corners, and one of them is spoilt."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_100)
    board = cv2.aruco.CharucoBoard((5, 7), 0.03, 0.022, dictionary)
    sheet = cv2.copyMakeBorder(board.generateImage((300, 420)), 30, 30, 30, 30, 0, value=255)
    for row in range(3, 6):
        for column in range(4):
            cv2.circle(sheet, (90 + 60 * column, 90 + 60 * row), 11, 128, -1)
    code = sheet[105:135, 165:195]  # its modules without their frame, between rows 0 and 1
    sheet[105:135, 165:195] = 255 - code
    picture = cv2.GaussianBlur(sheet, (0, 0), 0.8)
    target = drawing("charuco", (4, 6))
    found = find_marked_corners(picture, target, find_grids(picture))
    assert len(found) == 12
    assert found.contradictory == ()
