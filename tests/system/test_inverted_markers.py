"""ChArUco boards with light markers on dark squares: printed, photographed, read, and told."""

import cv2
import numpy as np
import pytest
import yaml
from told import raises_told

from cubicfish import DetectionError, Target
from cubicfish.find import find_grids
from cubicfish.find.detection.grids import negative_grids, negative_photo
from cubicfish.observe.detection import first_pass
from cubicfish.photos import find_photos
from cubicfish.scene.faces import board_face
from cubicfish.workers.pool import Work
from cubicfish_cli.words.sentences import render
from tests.cubicfish.find.detection.test_markers import errors, find, mixed_photo, photo_of, wall

PLAIN = Target(
    units="mm",
    boards=(
        wall("front", "charuco", (6, 5), 24.0),
        wall("left", "charuco", (5, 5), 26.0, dictionary="DICT_5X5_50"),
        wall("right", "aprilgrid", (4, 3), 34.0),
    ),
)
INVERTED = PLAIN.with_boards({0: PLAIN.boards[0].with_other_colours()})
DATA = {"name": "b", "type": "charuco", "corners": [6, 4], "square": 30, "marker": 22,
        "dictionary": "DICT_4X4_50"}  # fmt: skip


def board_of(**keys):
    return Target.from_data({"units": "mm", "boards": [{**DATA, **keys}]}).boards[0]


def test_an_inverted_board_is_the_negative_of_the_other():
    board, other = board_of(), board_of(inverted=True)
    plane = np.random.default_rng(0).uniform(-29, 29 + 5 * 30, (500, 2))
    plane[:, 1] = np.random.default_rng(1).uniform(-29, 29 + 3 * 30, 500)
    drawn, inverted = (board_face(one, margin=1.0).is_dark(plane) for one in (board, other))
    np.testing.assert_array_equal(inverted, ~drawn)
    np.testing.assert_array_equal(other.marker_cells(), board.marker_cells())


@pytest.mark.slow
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


@pytest.mark.slow
def test_inverted_markers_are_read_beside_others():
    found = find(photo_of(INVERTED, supersample=3), INVERTED)
    error, recall = errors(found, INVERTED)
    assert error.max() < 0.5
    assert recall > 0.97
    assert set(found.board.tolist()) == {0, 1, 2}


@pytest.mark.slow
def test_none_is_read_the_wrong_way_round():
    assert 0 not in find(photo_of(INVERTED), PLAIN).board
    assert 0 not in find(photo_of(PLAIN), INVERTED).board


def test_the_file_says_what_it_said():
    text = yaml.safe_load(INVERTED.text())
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


def photos_of(tmp_path, *pictures):
    for number, shown in enumerate(pictures):
        cv2.imwrite(str(tmp_path / f"{number}.png"), shown)
    return find_photos([tmp_path])


@pytest.mark.slow
def test_a_board_that_is_inverted_is_told_by_its_key(tmp_path):
    detection = first_pass(photos_of(tmp_path, photo_of(INVERTED)), [PLAIN], Work(jobs=1))
    assert 0 not in detection.corners.board
    (finding,) = detection.findings
    assert (finding.code, finding.boards) == ("inverted", ("front0",))
    assert "are light on dark" in render(finding).what
    assert "set inverted: true and first_square: light for it in target.yaml" in render(finding).do


@pytest.mark.slow
def test_a_board_that_is_not_inverted_is_reported_too(tmp_path):
    target = Target(units="mm", boards=INVERTED.boards[:1])
    only = Target(units="mm", boards=PLAIN.boards[:1])
    with raises_told(DetectionError, r"dark on light .* set inverted: false and first_sq"):
        first_pass(photos_of(tmp_path, photo_of(only)), [target], Work(jobs=1))


@pytest.mark.slow
@pytest.mark.parametrize("target", [PLAIN, INVERTED])
def test_mirrored_markers_are_reported(tmp_path, target):
    mirrored = photos_of(tmp_path, photo_of(target)[:, ::-1])
    with raises_told(DetectionError, r"are mirrored .*mirrored: true at the top of target"):
        first_pass(mirrored, [target], Work(jobs=1))
    assert len(first_pass(mirrored, [target.in_mirror()], Work(jobs=1)).corners.pixel) > 50


@pytest.mark.slow
def test_markers_that_are_nowhere_are_not_explained(tmp_path):
    other = Target(
        units="mm", boards=(wall("front", "charuco", (6, 5), 24.0, dictionary="DICT_6X6_50"),)
    )
    with raises_told(DetectionError, "none of the target's markers"):
        first_pass(photos_of(tmp_path, photo_of(PLAIN)), [other], Work(jobs=1))


@pytest.mark.slow
def test_grids_of_the_negative_have_its_colours():
    photo = mixed_photo()
    negative = negative_photo(photo)
    found = negative_grids(find_grids(photo)).grids
    assert found
    for grid in found:
        at = {tuple(cell): pixel for cell, pixel in zip(grid.cells, grid.pixel, strict=True)}
        for i, j in at:
            square = [at.get(cell) for cell in ((i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1))]
            if not any(corner is None for corner in square):
                x, y = np.rint(np.mean(square, axis=0)).astype(int)
                bright = negative[y, x] > 128
                assert bright == (grid.parity * (-1) ** (i + j) > 0)
