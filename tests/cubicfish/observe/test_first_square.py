"""Boards of markers that begin with the other square, and photos whose markers do not agree."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from cubicfish.judge.codes import Code
from cubicfish.observe.detection import detect
from cubicfish.observe.first_square import boards_begun_otherwise
from cubicfish.observe.photo_detection import detect_in_photo
from cubicfish.photos.photos import Photo
from cubicfish.target.observations import Observations
from tests.cubicfish.diagnosis.test_marker_layout import drawing, photos

DARK = drawing("charuco", (5, 5))


def seen(first_square):
    pictures = photos("charuco", (5, 5), first_square)
    return {f"{number}.png": picture for number, (picture, _) in enumerate(pictures)}


def test_a_board_that_begins_with_the_other_square_is_read_as_it_is():
    found = detect(seen("light"), DARK)
    assert found.corners.target.boards[0].first_square == "light"
    assert len(found.corners.pixel) == 50
    told = found.findings[0]
    assert (told.code, told.case) == (Code.BOARD_ORDER, "first_square")
    assert told.figures["corners"] == 50 > told.figures["named"]


def test_a_board_that_begins_as_the_target_says_is_read_once():
    found = detect(seen("dark"), DARK)
    assert found.corners.target is DARK
    assert not found.findings


@pytest.mark.parametrize(
    ("first_column", "left", "doubted"),
    [(1, 60, True), (1, 15, False), (0, 60, False), (2, 90, False)],
    ids=["room for one more", "out of view", "all seen", "more is hidden"],
)
def test_a_line_that_no_photo_shows_is_missed_where_there_is_room(first_column, left, doubted):
    column, row = np.meshgrid(np.arange(first_column, 5), np.arange(5))
    places = np.column_stack([np.zeros(column.size), column.ravel(), row.ravel()]).astype(int)
    pixel = places[:, 1:] * 30.0 + (left - 30 * first_column, 60)
    corners = Observations.from_corners([places], [pixel], (400, 300), boards=["board"])
    assert bool(boards_begun_otherwise(DARK, corners, [])) == doubted


@pytest.mark.parametrize(("ids", "case"), [((), ""), ((3,), "unplaced"), ((0, 11), "unplaced")])
def test_a_photo_with_markers_of_the_target_is_not_said_to_have_none(ids, case):
    squares = np.kron(np.indices((7, 8)).sum(axis=0) % 2, np.ones((30, 30)))
    photo = np.full((480, 640), 200, np.uint8)
    photo[40:250, 40:280] = 30 + 170 * squares
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_100)
    for number, one in enumerate(ids):
        marker = cv2.aruco.generateImageMarker(dictionary, one, 60)
        photo[340:400, 60 + 400 * number :][:, :60] = marker
    found = detect_in_photo(
        Photo(name="p", path=Path("p"), picture=cv2.GaussianBlur(photo, (0, 0), 0.7)),
        target=DARK,
        cache=None,
    )
    assert (found.refusal.code, found.refusal.case) == (Code.NO_MARKERS, case)
    assert found.refusal.figures.get("markers", 0) == len(ids)
