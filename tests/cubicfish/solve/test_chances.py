"""Student's t and F: as another library has them, and what they must be at their ends."""

import numpy as np
import pytest
from scipy import special

from cubicfish.solve.chances import (
    beyond_f,
    incomplete_beta,
    normal_quantile,
    student,
    student_quantile,
)


@pytest.mark.parametrize(("a", "b"), [(0.5, 0.5), (1, 4), (3, 30), (10, 0.3), (3, 3000), (9000, 2)])
def test_incomplete_beta(a, b):
    x = np.random.default_rng(1).uniform(size=100)
    found = [incomplete_beta(a, b, one) for one in x.tolist()]
    np.testing.assert_allclose(found, special.betainc(a, b, x), rtol=1e-10)
    assert [incomplete_beta(a, b, one) for one in (0.0, 1.0)] == [0, 1]


@pytest.mark.parametrize("freedom", [1, 2, 5, 19, 300])
def test_student(freedom):
    for t in (-50.0, -2.0, -0.1, 0.0, 0.3, 4.0, 1e3):
        assert student(freedom, t) == pytest.approx(special.stdtr(freedom, t), abs=1e-12)
    for share in (0.01, 0.4, 0.5, 0.95):
        found = student_quantile(freedom, share)
        assert student(freedom, found) == pytest.approx(share, abs=1e-12)
        # The oldest scipy has nine digits.
        assert found == pytest.approx(special.stdtrit(freedom, share), rel=1e-8, abs=1e-12)


@pytest.mark.parametrize("first", [3, 14])
def test_chance_of_a_ratio_of_variances(first):
    rng = np.random.default_rng(2)
    second, ratio = 10 ** rng.uniform(0, 4, 100), 10 ** rng.uniform(-3, 1.5, 100)
    wanted = special.fdtrc(first, second, ratio)
    np.testing.assert_allclose(beyond_f(first, second, ratio), wanted, rtol=1e-9, atol=1e-300)
    assert beyond_f(first, 5, [0, np.inf]).tolist() == [1, 0]


def test_normal_quantile():
    share = np.array([1e-9, 0.02, 0.5, 0.95])
    found = [normal_quantile(one) for one in share.tolist()]
    np.testing.assert_allclose(found, special.ndtri(share), atol=1e-12)
