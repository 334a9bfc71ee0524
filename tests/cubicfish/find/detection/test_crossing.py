"""The sub-pixel fit against edges drawn with exact formulas."""

import cv2
import numpy as np
import pytest
from scipy.special import erf

from cubicfish.find.detection.crossing import Quiet, fit_crossings
from cubicfish.find.detection.lattice import LocalFit

SIDE = 24.0


def drawn_corners(count, *, blur, levels=(200.0, 40.0, 200.0, 40.0), curve=0.0, noise=0.0, seed=0):
    """One photo with ``count`` corners in a row, at random sub-pixel places and angles."""
    rng = np.random.default_rng(seed)
    tile = 41
    image = np.zeros((tile, tile * count))
    place = np.stack([tile * np.arange(count) + 20.0, np.full(count, 20.0)], -1)
    place += rng.uniform(-0.5, 0.5, place.shape)
    turn = rng.uniform(0, np.pi, count)
    lean = rng.uniform(-0.4, 0.4, count)
    step = SIDE * np.stack(
        [
            np.stack([np.cos(turn), np.sin(turn)], -1),
            np.stack([-np.sin(turn + lean), np.cos(turn + lean)], -1),
        ],
        -1,
    )
    bend = np.zeros((count, 2, 3))
    bend[:, :, 0], bend[:, :, 2] = curve * step[:, :, 1], curve * step[:, :, 0]
    y, x = np.mgrid[:tile, :tile].astype(float)
    for k in range(count):
        apart = np.stack([x + tile * k, y], -1) - place[k]
        i, j = np.moveaxis(apart @ np.linalg.inv(step[k]).T, -1, 0)
        across_j, across_i = j - 0.5 * curve * i * i, i - 0.5 * curve * j * j
        height = SIDE * np.cos(lean[k])
        u, v = (erf(c * height / (blur * np.sqrt(2))) for c in (across_i, across_j))
        a, b, c, d = levels
        image[:, tile * k : tile * (k + 1)] = (
            (1 + u) * (1 + v) * a + (1 - u) * (1 + v) * b + (1 - u) * (1 - v) * c
        ) / 4 + (1 + u) * (1 - v) * d / 4
    image += rng.normal(0, noise, image.shape) if noise else 0.0
    fit = LocalFit(
        pixel=place,
        step=step,
        bend=bend,
        leverage=np.zeros(count),
        side=np.full(count, SIDE),
        sound=np.ones(count, bool),
    )
    return image, place, fit


def fitted(image, place, fit, noise=0.5, half=5.0):
    start = place + np.random.default_rng(1).uniform(-0.3, 0.3, place.shape)
    return fit_crossings(image, start, fit, np.full(len(place), half), noise)


@pytest.mark.parametrize("blur", [0.6, 1.0, 2.0])
def test_exact_corners_are_found_to_a_hundredth_of_a_pixel(blur):
    image, place, fit = drawn_corners(60, blur=blur)
    found = fitted(image, place, fit)
    assert found.ok.all()
    error = found.pixel - place
    assert np.abs(error).max() < 0.02  # the rest is what tanh differs from the Gaussian
    assert np.hypot(*error.mean(0)) < 0.002


def test_a_shadow_along_an_edge_does_not_pull_the_corner():
    image, place, fit = drawn_corners(60, blur=1.0, levels=(200.0, 40.0, 110.0, 30.0))
    assert np.abs(fitted(image, place, fit).pixel - place).max() < 0.02


def test_bent_edges_do_not_pull_the_corner_because_the_grid_tells_the_bend():
    image, place, fit = drawn_corners(60, blur=0.8, curve=0.3)
    straight = LocalFit(**{**vars(fit), "bend": np.zeros_like(fit.bend)})
    bent_error = np.hypot(*(fitted(image, place, fit).pixel - place).T)
    straight_error = np.hypot(*(fitted(image, place, straight).pixel - place).T)
    assert np.median(bent_error) < 0.02
    assert np.median(straight_error) > 2 * np.median(bent_error)


def test_levels_blur_and_parity_come_out():
    image, place, fit = drawn_corners(20, blur=1.5)
    found = fitted(image, place, fit)
    assert np.allclose(found.level, [200, 40, 200, 40], atol=8)
    assert np.allclose(found.blur, 1.5, atol=0.25)
    assert np.allclose(found.contrast(np.ones(20, int)), 160, atol=16)
    assert np.allclose(found.contrast(-np.ones(20, int)), -160, atol=16)
    assert found.turn.max() < 0.02


def test_the_spread_with_noise_is_near_the_lower_bound():
    # Cramer-Rao: the Fisher information of the weightless round window of radius 5 for the
    # two coordinates alone, from numerical derivatives of the drawn corner.
    noise, blur, count = 5.0, 1.0, 400
    image, place, fit = drawn_corners(count, blur=blur, noise=noise)
    found = fitted(image, place, fit, noise=noise)
    error = (found.pixel - place)[found.ok]
    assert found.ok.mean() > 0.99
    spread = np.sqrt((error**2).mean())
    offset = np.stack(np.meshgrid(*[np.arange(-5, 6)] * 2), -1).reshape(-1, 2)
    offset = offset[(offset**2).sum(1) <= 25].astype(float)
    u, v = (erf(c / (blur * np.sqrt(2))) for c in offset.T)
    slope = 80 * np.sqrt(2 / np.pi) / blur * np.exp(-(offset**2) / (2 * blur**2))
    information = np.stack([slope[:, 0] * v, slope[:, 1] * u])
    bound = noise / np.sqrt((information**2).sum(1).mean())
    assert bound < spread < 2.0 * bound
    # The fit's own prediction also pays for the unknown angles, blur and levels.
    assert np.median(found.spread) == pytest.approx(spread, rel=0.3)


def test_a_corner_at_the_photo_s_border_is_refused_not_read_beyond_it():
    image, place, fit = drawn_corners(3, blur=1.0)
    found = fit_crossings(image[:24], place, fit, np.full(3, 5.0), 0.5)
    assert not found.ok.any()
    assert np.array_equal(found.pixel, place)


@pytest.mark.parametrize("dark_first", [True, False])
@pytest.mark.parametrize("gap", [1.0, pytest.param(2.0, marks=pytest.mark.slow), 4.0])
def test_the_place_is_the_middle_of_the_gap_that_bleeding_leaves(gap, dark_first):
    _, place, fit = drawn_corners(60, blur=0.7, seed=3)
    image = np.full((41, 41 * len(place)), 255.0)
    sub = (np.arange(41 * 5) + 0.5) / 5 - 0.5
    x, y = np.meshgrid(sub, sub)
    for k in range(len(place)):
        apart = np.stack([x + 41 * k, y], -1) - place[k]
        cell = apart @ np.linalg.inv(fit.step[k]).T
        area = abs(np.linalg.det(fit.step[k]))
        u, v = (np.moveaxis(cell, -1, 0) * area / SIDE) * [[[1.0]], [[1.0 if dark_first else -1]]]
        half = gap / 2
        dark = ((u > half) & (v > half)) | ((u < -half) & (v < -half))
        light = np.where(dark, 60.0, 255.0).reshape(41, 5, 41, 5).mean((1, 3))
        image[:, 41 * k : 41 * (k + 1)] = light
    image += np.random.default_rng(0).normal(0, 1, image.shape)
    found = fitted(np.minimum(image, 255.0), place, fit, noise=1.0, half=7.0)
    error = found.pixel - place
    assert found.ok.all()
    assert np.median(found.gap) == pytest.approx(gap, abs=0.15)
    assert np.hypot(*error.mean(0)) < 0.01
    assert np.sqrt((error**2).sum(1).mean()) < 0.05
    assert found.turn.max() < 0.1


def test_ink_inside_a_bright_square_is_passed_over():
    image, place, fit = drawn_corners(40, blur=0.7)
    quiet = Quiet(sign=np.ones(40, int), steps=np.full(40, 0.09))
    y, x = np.mgrid[: image.shape[0], : image.shape[1]].astype(float)
    pixel = np.stack([x, y], -1)
    for k in range(40):
        own = (x // 41) == k
        i, j = np.moveaxis((pixel - place[k]) @ np.linalg.inv(fit.step[k]).T, -1, 0)
        # The marker of one square alone: that of the other one is burnt out, or not printed.
        image[own & (i > 0.11) & (j > 0.11)] = 40.0
    start = place + np.random.default_rng(1).uniform(-0.3, 0.3, place.shape)
    half = np.full(40, 5.0)
    found = fit_crossings(image, start, fit, half, 0.5, quiet=quiet)
    taken_in = fit_crossings(image, start, fit, half, 0.5)
    assert np.median(found.misfit) < 0.1 * np.median(taken_in.misfit)
    assert np.median(np.hypot(*(found.pixel - place).T)) < 0.015
    assert np.median(np.hypot(*(taken_in.pixel - place).T)) > 0.05


def test_blur_does_not_draw_corners_into_the_bend():
    # Sharp bent squares, blurred as a lens out of focus does it: not along the grid's own lines.
    image, place, fit = drawn_corners(60, blur=0.4, curve=0.5)
    soft = cv2.GaussianBlur(image, (0, 0), 2.5, borderType=cv2.BORDER_REPLICATE)
    found = fitted(soft, place, fit, half=9.0)
    straight = fitted(image, place, fit)
    bend = fit.bend[:, :, 0] + fit.bend[:, :, 2]
    bend /= np.hypot(*bend.T)[:, None]
    drawn = ((found.pixel - straight.pixel) * bend).sum(1)
    assert abs(np.median(drawn)) < 0.04  # without the grid's bend it is 0.12
