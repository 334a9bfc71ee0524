"""Angles: what they are, and that memory has no say in their last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from cubicfish.angles import angle_from_axis, azimuth, columns

COORDINATE = st.floats(-1e6, 1e6)


@pytest.mark.parametrize(
    ("point", "degrees"),
    [((0, 0, 2), 0), ((3, 0, 3), 45), ((0, -5, 0), 90), ((0, 1, -1), 135), ((0, 0, -1), 180)],
)
def test_angle_from_axis(point, degrees):
    np.testing.assert_allclose(np.rad2deg(angle_from_axis(point)), degrees, atol=1e-13)


@pytest.mark.parametrize(
    ("offset", "degrees"), [((2, 0), 0), ((1, 1), 45), ((0, 3), 90), ((-1, 0), 180), ((0, -1), -90)]
)
def test_azimuth(offset, degrees):
    np.testing.assert_allclose(np.rad2deg(azimuth(offset)), degrees, atol=1e-13)


@given(
    arrays.arrays(
        float, st.tuples(st.integers(0, 4), st.integers(0, 5), st.just(3)), elements=COORDINATE
    )
)
def test_any_shape_is_taken_apart(points):
    x, y, z = columns(points)
    np.testing.assert_array_equal(np.stack([x, y, z], axis=-1), points)
    assert angle_from_axis(points).shape == azimuth(points[..., :2]).shape == points.shape[:-1]
    assert not np.shares_memory(columns(points), points)


def test_the_last_bit_does_not_hang_on_where_a_result_lies():
    points = np.random.default_rng(0).normal(size=(300, 3))
    angle, turn = angle_from_axis(points), azimuth(points[:, :2])
    kept = []
    # In some of these the result lies right behind the points that it comes from.
    for count in range(2, 300):
        some = points[:count].copy()
        kept += [some, angle_from_axis(some), azimuth(some[:, :2])]
        np.testing.assert_array_equal(kept[-2], angle[:count])
        np.testing.assert_array_equal(kept[-1], turn[:count])
