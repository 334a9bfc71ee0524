"""Medians of small arrays: the same as numpy's."""

import numpy as np
import pytest

from cubicfish.find.detection.medians import median, medians


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize("count", [1, 2, 3, 8, 101, 5_000])
def test_median_is_that_of_numpy(count, kind):
    values = np.random.default_rng(count).normal(size=count).astype(kind)
    assert median(values) == np.median(values)


def test_median_of_a_table_is_that_of_all_its_values_which_stay_where_they_are():
    values = np.random.default_rng(0).normal(size=(5, 7))
    before = values.copy()
    assert median(values) == np.median(values)
    np.testing.assert_array_equal(values, before)


def test_median_takes_infinity_and_hands_nan_on():
    assert median(np.array([np.inf, 3.0, 1.0, np.inf, 2.0])) == 3
    assert np.isnan(median(np.array([2.0, np.nan, 1.0])))


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("shape", [(4, 6, 3), (5, 7, 1), (3, 1, 4)])
def test_medians_along_an_axis_are_those_of_numpy(shape, axis):
    values = np.random.default_rng(0).normal(size=shape)
    np.testing.assert_array_equal(medians(values, axis), np.median(values, axis=axis))
