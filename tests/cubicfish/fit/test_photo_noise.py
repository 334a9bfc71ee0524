"""How much each photo says."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic

from cubicfish.comparison import aligned_difference
from cubicfish.fit import refinement
from cubicfish.fit.calibrate import calibrate
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.statistics import photo_weights, weighed

NOISE = 0.05
TARGET = synthetic.corner_of_three()


@pytest.fixture(scope="module")
def pairs():
    poses = synthetic.poses_around(TARGET, 9, seed=13)
    return synthetic.synthetic_correspondences(TARGET, poses)


def spoilt(pairs, times):
    """Residuals of photos whose noise is so many times NOISE."""
    noise = np.random.default_rng(14).normal(0, NOISE, pairs.pixel.shape)
    return noise * np.asarray(times, float)[pairs.image][:, None]


def test_photos_alike_weigh_the_same(pairs):
    assert np.array_equal(photo_weights(pairs, spoilt(pairs, np.ones(9))), np.ones(9))


def test_noisier_photos_weigh_less_by_their_variance(pairs):
    times = np.array([1, 1, 1, 1, 1, 1, 1, 4, 4])
    weight = photo_weights(pairs, spoilt(pairs, times))
    ratio = weight[:7].mean() / weight[7:].mean()
    # A little is held back: that so few photos differ by so much may be chance.
    assert 8 < ratio <= 16
    count = np.bincount(pairs.image)
    assert weight @ count / count.sum() == pytest.approx(1)


def test_few_corners_are_drawn_to_the_others(pairs):
    times = np.array([1, 1, 1, 1, 2, 2, 2, 2, 0.2])
    few = pairs.image == 8
    few &= np.cumsum(few) > 6
    own = pairs.select(~few)
    residual = spoilt(pairs, times)[~few]
    weight = photo_weights(own, residual)
    assert weight[8] < 2 * weight[:4].mean()
    assert weight[8] < photo_weights(pairs, spoilt(pairs, times))[8] / 3


def test_weights_given_to_corners_count_as_their_noise(pairs):
    times = np.array([1, 1, 1, 1, 1, 1, 1, 4, 4])
    known = replace(pairs, weight=1 / times[pairs.image] ** 2)
    assert photo_weights(known, spoilt(pairs, times)) == pytest.approx(np.ones(9), rel=0.2)


@pytest.mark.parametrize("photos", [1, 2])
def test_two_photos_do_not_tell(pairs, photos):
    own, _ = pairs.select(pairs.image < photos).only_seen()
    residual = spoilt(pairs, np.linspace(1, 5, 9))[pairs.image < photos]
    assert np.array_equal(weighed(own, residual).weight, own.weight)


@pytest.mark.slow
def test_blurred_photos_spoil_a_camera_less(pairs, monkeypatch):
    times = np.where(np.arange(9) < 5, 1, 9)
    noisy = replace(pairs, pixel=pairs.pixel + spoilt(pairs, times))
    found = calibrate(noisy)
    # What came with the corners is given back, not what the fit made of it.
    assert np.array_equal(found.pairs.weight, np.ones(len(found.pairs.weight)))
    monkeypatch.setattr(refinement, "weighed", lambda pairs, residual: pairs)
    alike = calibrate(noisy)
    rays = cone_rays(np.deg2rad(80), 1000)
    off = [
        np.square(aligned_difference(one.camera, synthetic.TRUE_LENS, rays)[0]).mean()
        for one in (found, alike)
    ]
    assert off[0] < 0.5 * off[1]


def test_given_weights_that_are_undone_change_no_scale(pairs):
    """Photos that are as sharp as the others, and were said to be a thousand times noisier."""
    given = np.where(np.arange(9) % 2, 1.0, 1e-6)[pairs.image]
    undone = weighed(replace(pairs, weight=given), spoilt(pairs, np.ones(9)))
    assert undone.weight.mean() == pytest.approx(1)
    assert undone.weight.min() > 0.3
