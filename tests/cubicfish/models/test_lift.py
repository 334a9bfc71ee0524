"""The lift against monomials multiplied out by hand, and its algebra."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lenses import numeric_jacobian
from scipy.spatial.transform import Rotation

from cubicfish.models.lift import (
    MONOMIALS,
    evaluate_cubics,
    lift,
    lift_rotation,
    sphere_basis,
    sphere_null_space,
)

RNG = np.random.default_rng(5)
POINTS = RNG.uniform(-1.5, 1.5, (40, 3))
RAYS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)


def test_order_is_the_papers():
    x, y, z = 2.0, 3.0, 5.0
    expected = [
        x**3, y**3, z**3, x*x*y, x*x*z, y*y*x, y*y*z, z*z*x, z*z*y, x*y*z,
        x*x, y*y, z*z, x*y, y*z, x*z, x, y, z, 1,
    ]  # fmt: skip
    np.testing.assert_allclose(lift([x, y, z]), expected, rtol=1e-15)
    assert len(set(MONOMIALS)) == 20


def test_lift_keeps_leading_axes():
    assert lift(np.zeros((4, 5, 3))).shape == (4, 5, 20)
    np.testing.assert_array_equal(lift(POINTS.reshape(8, 5, 3)).reshape(40, 20), lift(POINTS))


def test_symmetric_forms_give_values_and_gradients():
    coefficients = RNG.standard_normal((3, 20))
    value, gradient = evaluate_cubics(coefficients, POINTS)
    np.testing.assert_allclose(value, lift(POINTS) @ coefficients.T, rtol=1e-12, atol=1e-12)
    numeric = numeric_jacobian(lambda p: lift(p) @ coefficients.T, POINTS)
    # Central differences of a cubic at step 1e-6: truncation 1e-12, rounding about 1e-9.
    np.testing.assert_allclose(gradient, numeric, atol=2e-8)


def test_null_space_vanishes_on_the_sphere_only():
    np.testing.assert_allclose(lift(RAYS) @ sphere_null_space(), 0, atol=1e-14)
    assert np.abs(lift(POINTS) @ sphere_null_space()).max() > 0.1


def test_basis_spans_every_cubic_on_the_sphere_once():
    basis = sphere_basis()
    assert basis.shape == (20, 16)
    np.testing.assert_allclose(basis.T @ basis, np.eye(16), atol=1e-14)
    np.testing.assert_allclose(basis.T @ sphere_null_space(), 0, atol=1e-14)
    assert np.linalg.matrix_rank(lift(RAYS)) == 16
    row = RNG.standard_normal(20)
    shortest = basis @ (basis.T @ row)
    np.testing.assert_allclose(lift(RAYS) @ shortest, lift(RAYS) @ row, atol=1e-12)
    assert np.linalg.norm(shortest) < np.linalg.norm(row)


@given(st.lists(st.floats(-4, 4), min_size=3, max_size=3))
def test_rotation_of_the_lift(vector):
    rotation = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(
        lift(POINTS @ rotation.T), lift(POINTS) @ lift_rotation(rotation).T, atol=1e-10
    )


@pytest.mark.parametrize(("planes", "rank"), [(1, 10), (2, 16), (3, 19), (4, 20)])
def test_rank_by_number_of_planes(planes, rank):
    """Points on planes: the rank that the point lift has to live with."""
    flat = np.zeros((60, 2))
    flat[:] = RNG.uniform(-1, 1, flat.shape)
    axes = [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
    points = [np.column_stack([flat, np.zeros(60)])[:, axes[i]] for i in range(min(planes, 3))]
    if planes == 4:
        points.append(np.column_stack([flat, 1 + 0.4 * flat[:, 0] - 0.7 * flat[:, 1]]))
    assert np.linalg.matrix_rank(lift(np.vstack(points)), tol=1e-9) == rank
