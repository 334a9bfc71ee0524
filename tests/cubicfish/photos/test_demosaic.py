"""Raw Bayer mosaics saved as grey pictures: boards look as a grey sensor sees them."""

from functools import cache

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubicfish.find.detection.finder import find_grids
from cubicfish.photos.demosaic import evened
from cubicfish.photos.photos import grey

RNG = np.random.default_rng(4)
# How much of white each filter lets through, by rows and columns of even and odd numbers.
FILTERS = {
    "RGGB": [[0.5, 0.95], [0.95, 0.7]],
    "BGGR": [[0.7, 0.95], [0.95, 0.5]],
    "GRBG": [[0.95, 0.5], [0.7, 0.95]],
    "GBRG": [[0.95, 0.7], [0.5, 0.95]],
}


@cache
def board(dtype=np.uint8):
    """A chequered board that lies askew in front of a grey wall, a little out of focus."""
    squares = np.kron(np.indices((7, 9)).sum(axis=0) % 2, np.ones((40, 40))) * 150 + 40
    sheet = cv2.copyMakeBorder(squares, 30, 30, 30, 30, cv2.BORDER_CONSTANT, value=200)
    turn = cv2.getRotationMatrix2D((210, 170), 17, 0.9)
    picture = cv2.warpAffine(sheet, turn, (421, 341), flags=cv2.INTER_AREA, borderValue=110)
    picture = cv2.GaussianBlur(picture, (0, 0), 0.9) + RNG.normal(0, 1.5, picture.shape)
    return np.rint(picture * (np.iinfo(dtype).max / 255)).astype(dtype)


@cache
def corners(dtype):
    """Of the board as a grey sensor sees it (48, 2), in an order of their own."""
    (grid,) = find_grids(board(dtype)).grids
    return ordered(grid)


def ordered(grid):
    return grid.pixel[np.lexsort(np.rint(grid.pixel).T)]


def mosaic_of(picture, filters):
    height, width = picture.shape
    through = np.tile(filters, (height // 2 + 1, width // 2 + 1))[:height, :width]
    return np.rint(picture * through).astype(picture.dtype)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("filters", FILTERS.values(), ids=FILTERS)
def test_corners_are_where_a_grey_sensor_sees_them(filters, dtype):
    (seen,) = find_grids(grey(mosaic_of(board(dtype), filters))).grids
    assert len(corners(dtype)) == len(seen) == 48
    assert np.abs(corners(dtype) - ordered(seen)).max() < 0.03


def test_a_mosaic_is_evened_in_grey_pictures_of_one_layer_too():
    mosaic = mosaic_of(board(), FILTERS["RGGB"])
    np.testing.assert_array_equal(grey(mosaic[..., None]), grey(mosaic))
    assert not np.array_equal(grey(mosaic), mosaic)


def test_a_grey_picture_is_left_alone():
    picture = board()
    assert grey(picture) is picture


@given(
    sides=st.tuples(st.integers(1, 90), st.integers(1, 90)),
    dtype=st.sampled_from([np.uint8, np.uint16]),
    gains=st.lists(st.floats(0, 1), min_size=4, max_size=4),
)
def test_any_picture_keeps_its_kind_and_its_pixels_become_alike(sides, dtype, gains):
    noise = np.random.default_rng(7).integers(0, np.iinfo(dtype).max, sides, endpoint=True)
    picture = mosaic_of(noise.astype(dtype), np.reshape(gains, (2, 2)))
    even = evened(picture)
    assert (even.shape, even.dtype) == (picture.shape, picture.dtype)
    if even is not picture:
        means = [even[row::2, column::2].mean() for row in (0, 1) for column in (0, 1)]
        # Rounding, and white that cannot become brighter.
        assert max(means) <= picture.mean() * 1.3 + 1


def test_pure_noise_is_no_mosaic():
    for side in range(2, 80):
        noise = np.random.default_rng(side).integers(0, 256, (side, 80), np.uint8)
        assert evened(noise) is noise
