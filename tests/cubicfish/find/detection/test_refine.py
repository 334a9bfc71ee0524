"""Refining corners that something else predicted."""

import numpy as np
import pytest

from cubicfish.find.detection.pyramid import build_pyramid, measure_noise
from cubicfish.find.detection.refine import refine_corners

SIDE = 20


@pytest.fixture(scope="module")
def board():
    rng = np.random.default_rng(3)
    size, scale = 9 * SIDE, 4
    y, x = np.mgrid[: size * scale, : size * scale] // (SIDE * scale)
    fine = np.where((x + y) % 2 == 0, 40.0, 200.0)
    image = fine.reshape(size, scale, size, scale).mean((1, 3))
    image[:, 7 * SIDE :] = 120.0  # hides the last corners
    image += rng.normal(0, 2, image.shape)
    i, j = np.meshgrid(np.arange(1, 9), np.arange(1, 9))
    cells = np.stack([i.ravel(), j.ravel()], -1)
    return image.clip(0, 255).astype(np.uint8), cells, cells * SIDE - 0.5


def steps(count):
    return np.tile(SIDE * np.eye(2), (count, 1, 1))


def colours(cells):
    return np.where(cells.sum(1) % 2 == 0, -1, 1)


def refined(image, pixel, shapes, sign):
    bends = np.zeros((len(pixel), 2, 3))
    return refine_corners(build_pyramid(image), pixel, shapes, sign, bends)


def test_predictions_a_pixel_off_come_to_their_corners(board):
    image, cells, truth = board
    start = truth + np.random.default_rng(0).uniform(-1, 1, truth.shape)
    pixel, ok = refined(image, start, steps(len(truth)), colours(cells))
    whole = (cells[:, 0] < 7) & (cells[:, 0] < 9)
    assert ok[whole].all()
    assert np.abs(pixel - truth)[whole].max() < 0.1


def test_hidden_corners_are_refused_and_left_where_they_were(board):
    image, cells, truth = board
    pixel, ok = refined(image, truth, steps(len(truth)), colours(cells))
    hidden = cells[:, 0] >= 7
    assert not ok[hidden].any()
    assert np.array_equal(pixel[hidden], truth[hidden])


def test_the_known_colour_refuses_a_lattice_that_is_one_square_off(board):
    image, cells, truth = board
    sign = colours(cells)
    inner = cells[:, 0] < 7
    assert refined(image, truth, steps(len(truth)), sign)[1][inner].all()
    assert not refined(image, truth, steps(len(truth)), -sign)[1].any()


def test_predictions_outside_or_without_shape_are_refused(board):
    image, _, _ = board
    pixel = np.array([[-50.0, 30.0], [1e6, 5.0], [39.5, 39.5], [np.nan, 3.0]])
    shapes = steps(4)
    shapes[2] = 0
    found, ok = refined(image, pixel, shapes, np.ones(4, int))
    assert not ok.any()
    assert np.array_equal(found, pixel, equal_nan=True)
    none = np.zeros(0, int)
    assert refined(image, np.zeros((0, 2)), np.zeros((0, 2, 2)), none)[0].shape == (0, 2)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float64])
def test_noise_is_that_of_the_pyramid_whether_it_is_made_or_not(kind: type) -> None:
    rng = np.random.default_rng(5)
    grey = (rng.normal(110, 7, (301, 402)) + 60 * (np.arange(402) > 200)).astype(kind)
    pyramid = build_pyramid(grey)
    assert measure_noise(grey) == (pyramid.noise, pyramid.gain)
    assert pyramid.noise / pyramid.gain == pytest.approx(7, rel=0.05)
