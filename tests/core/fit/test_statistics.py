"""How likely a mean is positive, against scipy's own t-test."""

import numpy as np
import pytest

from cubicfish_cli.core.fit.statistics import likely_positive


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_one_sided_t_test(seed):
    from scipy.stats import ttest_1samp  # half a second, not whenever tests are collected

    values = np.random.default_rng(seed).normal(0.3, 1, 3 + seed)
    expected = 1 - ttest_1samp(values, 0, alternative="greater").pvalue
    assert likely_positive(values) == pytest.approx(expected)
    assert likely_positive(-values) == pytest.approx(1 - expected)


def test_one_value_says_nothing_and_neither_do_zeros():
    assert likely_positive(np.array([5.0])) == likely_positive(np.zeros(4)) == 0.5


def test_equal_values_leave_no_doubt():
    assert likely_positive(np.full(4, 0.25)) == 1.0
    assert likely_positive(np.full(4, -0.25)) == 0.0
