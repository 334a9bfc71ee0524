"""ChArUco boards with light markers on dark squares: printed, photographed, read, and told."""

import cv2
import numpy as np
import pytest
import yaml
from test_detection_markers import errors, find, photo_of, wall

from cubicfish_cli.detection.photo_as import negative_photo
from cubicfish_cli.formats.target_yaml import target_text
from cubicfish_cli.rendering.faces import face
from cubicfish_cli.target import Target

PLAIN = Target(
    units="mm",
    boards=(
        wall("front", "charuco", (6, 5), 24.0),
        wall("left", "charuco", (5, 5), 26.0, dictionary="DICT_5X5_50"),
        wall("right", "aprilgrid", (4, 3), 34.0),
    ),
)
INVERTED = PLAIN.with_boards({0: PLAIN.boards[0].with_negative_markers()})
DATA = {"name": "b", "type": "charuco", "corners": [6, 4], "square": 30, "marker": 22,
        "dictionary": "DICT_4X4_50"}  # fmt: skip


def board_of(**keys):
    return Target.from_data({"units": "mm", "boards": [{**DATA, **keys}]}).boards[0]


def test_an_inverted_board_is_the_negative_of_the_other():
    board, other = board_of(), board_of(inverted=True)
    plane = np.random.default_rng(0).uniform(-29, 29 + 5 * 30, (500, 2))
    plane[:, 1] = np.random.default_rng(1).uniform(-29, 29 + 3 * 30, 500)
    drawn, inverted = face(board, margin=1.0).is_dark(plane), face(other, margin=1.0).is_dark(plane)
    np.testing.assert_array_equal(inverted, ~drawn)
    np.testing.assert_array_equal(other.marker_cells(), board.marker_cells())


def test_it_is_laid_out_as_opencv_does():
    """An inverted picture of OpenCV's board, at its usual layout, needs no first_square."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    drawn = cv2.aruco.CharucoBoard((7, 5), 30, 22, dictionary).generateImage((700, 500))
    photo = np.pad(cv2.bitwise_not(drawn), 60, constant_values=255)
    target = Target.from_data({"units": "mm", "boards": [{**DATA, "inverted": True}]})
    found = find(photo, target)
    assert len(found) == 24
    expected = np.stack([found.column + 1, found.row + 1], axis=-1) * 100.0 + 59.5
    np.testing.assert_allclose(found.pixel, expected, atol=0.6)


def test_inverted_markers_are_read_beside_others():
    found = find(photo_of(INVERTED, supersample=3), INVERTED)
    error, recall = errors(found, INVERTED)
    assert error.max() < 0.5
    assert recall > 0.97
    assert set(found.board.tolist()) == {0, 1, 2}


def test_none_is_read_the_wrong_way_round():
    assert 0 not in find(photo_of(INVERTED), PLAIN).board
    assert 0 not in find(photo_of(PLAIN), INVERTED).board


def test_the_file_says_what_it_said():
    text = yaml.safe_load(target_text(INVERTED))
    assert text["boards"][0]["inverted"] is True
    assert text["boards"][0]["first_square"] == "light"
    assert "inverted" not in text["boards"][1]
    again = Target.from_data(text).boards[0]
    np.testing.assert_array_equal(again.marker_cells(), INVERTED.boards[0].marker_cells())


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, float])
def test_the_negative_of_a_negative_is_the_photo(dtype):
    photo = np.arange(12, dtype=dtype).reshape(3, 4)
    negative = negative_photo(photo)
    assert negative.dtype == photo.dtype
    assert (np.diff(negative.ravel().astype(float)) == -1).all()
    np.testing.assert_array_equal(negative_photo(negative), photo)
