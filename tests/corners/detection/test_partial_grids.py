"""Boards of small squares: what was found in part is searched again at twice the size."""

import cv2
import numpy as np
import pytest

from cubicfish_cli.app import photo_detection
from cubicfish_cli.app.photo_detection import GridCache, detect_in_photo
from cubicfish_cli.app.photos import Photo
from cubicfish_cli.core.boards.types import Checkerboard
from cubicfish_cli.core.target import Target
from cubicfish_cli.corners.detection import partial_grids
from cubicfish_cli.corners.detection.finder import find_grids
from cubicfish_cli.corners.detection.partial_grids import complete_grids, is_part

COLUMNS, ROWS = 9, 7
SIZES = [(ROWS, COLUMNS)]  # the order is not known of a grid
BOARD = Checkerboard(
    name="board",
    columns=COLUMNS,
    rows=ROWS,
    square=10.0,
    origin=np.zeros(3),
    x_axis=np.array([1.0, 0, 0]),
    y_axis=np.array([0, 1.0, 0]),
)
TARGET = Target(units="mm", boards=(BOARD,))
_DRAWN = 40


def slanted(near, far, scale=1.0, finer=4):
    """A board whose squares are ``near`` px wide in its first row and ``far`` px in its last.

    It is drawn ``finer`` times as large first.

    Returns the photo and the pixels (N, 2) of its corners.
    """
    cells = np.indices((ROWS + 1, COLUMNS + 1)).sum(axis=0) % 2
    drawn = np.kron(np.where(cells, 215, 40), np.ones((_DRAWN, _DRAWN)))
    drawn = np.pad(drawn, _DRAWN, constant_values=215).astype(np.uint8)
    corners = np.stack(np.meshgrid(range(1, COLUMNS + 1), range(1, ROWS + 1)), -1).reshape(-1, 2)
    corners = (corners + 1.0) * _DRAWN - 0.5
    height, width = drawn.shape
    wide, narrow, tall = near * (COLUMNS + 3), far * (COLUMNS + 3), 0.75 * (near + far) / 2 * 10
    to = np.array([(0, tall), (wide, tall), ((wide + narrow) / 2, 0), ((wide - narrow) / 2, 0)])
    to = (to + np.array([62.3, 41.7])) * scale
    source = np.array([(0, 0), (width, 0), (width, height), (0, height)]) - 0.5
    move = cv2.getPerspectiveTransform(source.astype(np.float32), to.astype(np.float32))
    size = np.array([320, 240]) * scale
    larger = np.diag([finer, finer, 1.0]) @ move
    larger[:2] += (finer - 1) / 2 * larger[2]
    big = tuple(int(side) for side in size * finer)
    photo = cv2.warpPerspective(drawn, larger, big, flags=cv2.INTER_AREA, borderValue=120)
    photo = cv2.resize(photo, None, fx=1 / finer, fy=1 / finer, interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(0).normal(0, 1.5, photo.shape)
    pixel = cv2.perspectiveTransform(corners[None].astype(np.float64), move)[0]
    return np.clip(np.rint(photo + noise), 0, 255).astype(np.uint8), pixel


def away(pixel, truth):
    """How far each of some corners (N, 2) is from the nearest true one."""
    return np.linalg.norm(pixel[:, None] - truth[None], axis=-1).min(axis=1)


@pytest.fixture(scope="module")
def photo():
    return slanted(10, 4)


def test_the_rest_of_a_board_is_found(photo):
    picture, truth = photo
    found = find_grids(picture)
    (part,) = found.grids
    assert is_part(part, SIZES)
    (whole,) = complete_grids(picture, found, SIZES).grids
    assert len(part) < len(whole) == COLUMNS * ROWS
    assert away(whole.pixel, truth).max() < 0.5
    assert np.sqrt(np.mean(away(whole.pixel, truth) ** 2)) < 0.15
    same = (whole.pixel[:, None] == part.pixel[None]).all(axis=2).any(axis=1)
    assert same.sum() == len(part)


def test_what_is_no_part_is_not_searched_again(monkeypatch, photo):
    picture, _ = photo
    whole = complete_grids(picture, find_grids(picture), SIZES)
    large, _ = slanted(11, 4.5, scale=3, finer=1)
    large[:] = np.where(np.arange(large.shape[1]) > 400, 120, large)  # a cut board, large squares
    cut = find_grids(large)
    assert 0 < len(cut.grids[0]) < COLUMNS * ROWS
    monkeypatch.setattr(partial_grids, "find_grids", None)
    assert complete_grids(picture, whole, SIZES).grids == whole.grids
    assert complete_grids(large, cut, SIZES).grids == cut.grids
    (other,) = find_grids(picture).grids
    assert not is_part(other, [(4, 3)])


@pytest.mark.parametrize("squares", ["a part", "too small"])
def test_a_completed_grid_is_remembered(tmp_path, monkeypatch, photo, squares):
    picture = photo[0] if squares == "a part" else slanted(4.2, 4)[0]
    path = tmp_path / "photo.png"
    cv2.imwrite(str(path), picture)
    shot = Photo(name="photo.png", path=path)
    cache = GridCache(folder=tmp_path / "cache")
    first = detect_in_photo(shot, target=TARGET, cache=cache)
    assert first.refusal is None
    assert first.grids is not None
    assert len(first.grids.grids[0]) == COLUMNS * ROWS
    for name in ("find_grids", "complete_grids", "decode_picture"):
        monkeypatch.setattr(photo_detection, name, None)
    again = detect_in_photo(shot, target=TARGET, cache=cache)
    assert again.grids is not None
    np.testing.assert_array_equal(again.grids.grids[0].pixel, first.grids.grids[0].pixel)
