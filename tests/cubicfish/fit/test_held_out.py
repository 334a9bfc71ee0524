"""What held-out errors say of two fits of the same photos."""

import numpy as np
import pytest
from scipy.special import stdtr

from cubicfish.fit.held_out import HeldOut


def held_out(*photos_px):
    square = np.repeat(np.square(np.array(photos_px, float)), 10)
    image = np.repeat(np.arange(len(photos_px)), 10)
    return HeldOut(square=square, radial_square=square, image=image, folds=5)


def test_many_photos_that_agree_leave_no_doubt():
    errors = np.random.default_rng(0).uniform(0.1, 0.3, 20)
    worse = errors * np.random.default_rng(1).uniform(1.1, 1.5, 20)
    assert held_out(*errors).doubt(held_out(*worse)) < 1e-4
    assert held_out(*worse).doubt(held_out(*errors)) > 1 - 1e-4


def test_few_photos_that_disagree_leave_much():
    doubt = held_out(0.2, 0.2, 0.2).doubt(held_out(0.5, 0.1, 0.3))
    assert 0.2 < doubt < 0.5


def test_it_is_the_one_sided_t_test_of_photos_ratios():
    errors = np.random.default_rng(2).uniform(0.1, 0.3, 5)
    other = errors * np.random.default_rng(3).uniform(0.8, 1.4, 5)
    mine, theirs = held_out(*errors), held_out(*other)
    ratios = np.log(errors / other)
    mean = np.log(mine.times(theirs))
    expected = stdtr(4, mean / (np.std(ratios, ddof=1) / np.sqrt(5)))
    assert mine.doubt(theirs) == pytest.approx(expected)
    assert mine.doubt(theirs) + theirs.doubt(mine) == pytest.approx(1)


@pytest.mark.parametrize("other", [(0.3,), (np.nan, 0.4)])
def test_one_photo_tells_nothing(other):
    assert held_out(*(0.2 for _ in other)).doubt(held_out(*other)) == 0.5


def test_an_error_of_some_pairs_counts_those_alone():
    both = held_out(0.2, np.nan, 0.4)
    assert np.isfinite(both.square).sum() == 20
    assert both.photos_px == pytest.approx([0.2, np.nan, 0.4], nan_ok=True)
    assert both.rms_px == pytest.approx(np.sqrt(0.1))
    assert both.of(both.image < 2).rms_px == pytest.approx(0.2)
