"""The lift Φ: the 20 monomials of degree at most 3 in a 3D point (Zhu & Yin 2010, Eq. 4).

The order of the monomials is the paper's and that of every file; it is written here and
nowhere else.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

MONOMIALS = tuple("XXX YYY ZZZ XXY XXZ YYX YYZ ZZX ZZY XYZ XX YY ZZ XY YZ XZ X Y Z 1".split())
EXPONENTS = np.array([[name.count(axis) for axis in "XYZ"] for name in MONOMIALS])
SIZE = len(MONOMIALS)


def lift(points: npt.ArrayLike) -> FloatArray:
    """Φ of points: (..., 3) -> (..., 20), in the paper's order (Eq. 4)."""
    powers = _powers(np.asarray(points, dtype=float))
    x, y, z = EXPONENTS.T
    return powers[..., 0, x] * powers[..., 1, y] * powers[..., 2, z]


def lift_jacobian(points: npt.ArrayLike) -> FloatArray:
    """dΦ/dX: (..., 3) -> (..., 20, 3)."""
    powers = _powers(np.asarray(points, dtype=float))
    value = [powers[..., axis, EXPONENTS[:, axis]] for axis in range(3)]
    slope = [
        EXPONENTS[:, axis] * powers[..., axis, np.maximum(EXPONENTS[:, axis] - 1, 0)]
        for axis in range(3)
    ]
    return np.stack(
        [
            slope[0] * value[1] * value[2],
            value[0] * slope[1] * value[2],
            value[0] * value[1] * slope[2],
        ],
        axis=-1,
    )


def _powers(points: FloatArray) -> FloatArray:
    """(..., 3) -> (..., 3, 4): each coordinate to the powers 0 to 3."""
    square = points * points
    return np.stack([np.ones_like(points), points, square, square * points], axis=-1)


@cache
def sphere_null_space() -> FloatArray:
    """(20, 4): coefficients of the cubics that vanish on the whole unit sphere.

    They are (X² + Y² + Z² − 1) times 1, X, Y and Z: adding them to a row of P changes no
    projection of a unit ray.
    """
    index = {tuple(exponents): k for k, exponents in enumerate(EXPONENTS.tolist())}
    null = np.zeros((SIZE, 4))
    for column, factor in enumerate(np.vstack([np.zeros(3, int), np.eye(3, dtype=int)])):
        for axis in np.eye(3, dtype=int):
            null[index[tuple((factor + 2 * axis).tolist())], column] += 1
        null[index[tuple(factor.tolist())], column] -= 1
    null.flags.writeable = False
    return null


@cache
def sphere_basis() -> FloatArray:
    """(20, 16): orthonormal coefficients that span every cubic on the unit sphere once.

    ``P = C @ sphere_basis().T`` is the minimum-norm P among all that give its projections.
    """
    q, _ = np.linalg.qr(sphere_null_space(), mode="complete")
    basis = np.ascontiguousarray(q[:, 4:])
    basis.flags.writeable = False
    return basis


@cache
def _interpolation() -> tuple[FloatArray, FloatArray]:
    """Points in general position and the matrix from their values to the 20 coefficients."""
    points = np.random.default_rng(0).uniform(-1, 1, (120, 3))
    return points, np.linalg.pinv(lift(points))


def lift_rotation(rotation: npt.ArrayLike) -> FloatArray:
    """L(R), (20, 20), with Φ(R X) = L(R) Φ(X) for every X: (3, 3) -> (20, 20).

    A rotated camera frame is therefore the same camera with P L(R): this is the gauge.
    """
    points, to_coefficients = _interpolation()
    return (to_coefficients @ lift(points @ np.asarray(rotation, float).T)).T
