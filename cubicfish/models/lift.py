"""The lift Φ: the 20 monomials of degree at most 3 in a 3D point (Zhu & Yin 2010, Eq. 4).

The order of the monomials is the paper's and that of every file; it is written here and
nowhere else.
"""

from functools import cache

import numpy as np
import numpy.typing as npt

from cubicfish.types import FloatArray

_ORDER = "XXX YYY ZZZ XXY XXZ YYX YYZ ZZX ZZY XYZ XX YY ZZ XY YZ XZ X Y Z 1"
MONOMIALS = tuple(_ORDER.split())
EXPONENTS = np.array([[name.count(axis) for axis in "XYZ"] for name in MONOMIALS])
SIZE = len(MONOMIALS)
_ONE, _LINEAR = MONOMIALS.index("1"), [MONOMIALS.index(axis) for axis in "XYZ"]


def _list_steps() -> list[tuple[int, int, int]]:
    """Monomials of degree 2 and 3: index, that of one of a degree less, times which coordinate.

    The coordinate is the last one of those with the smallest power: squares come first.
    """
    place = {tuple(exponents): k for k, exponents in enumerate(EXPONENTS.tolist())}
    found = []
    for exponents in sorted((e for e in place if sum(e) > 1), key=sum):
        axis = min(np.flatnonzero(exponents)[::-1].tolist(), key=lambda a: exponents[a])
        lower = tuple(power - (k == axis) for k, power in enumerate(exponents))
        found.append((place[exponents], place[lower], _LINEAR[axis]))
    return found


_STEPS = _list_steps()


def lift(points: npt.ArrayLike) -> FloatArray:
    """Φ of points: (..., 3) -> (..., 20), in the paper's order (Eq. 4)."""
    axes = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
    lifted = np.empty((SIZE, *axes.shape[1:]))
    lifted[_ONE], lifted[_LINEAR] = 1, axes
    for monomial, lower, coordinate in _STEPS:
        np.multiply(lifted[lower, ...], lifted[coordinate, ...], out=lifted[monomial, ...])
    return np.moveaxis(lifted, 0, -1)


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
def _slopes_of_monomials() -> FloatArray:
    """(20, 3, 10): the derivative of each by X, Y and Z, as a cubic of the last ten monomials.

    These are of degree two at most.
    """
    index = {tuple(exponents): k for k, exponents in enumerate(EXPONENTS.tolist())}
    slopes = np.zeros((SIZE, 3, SIZE))
    for exponents, monomial in index.items():
        for axis, power in enumerate(exponents):
            if power:
                lower = tuple(p - (k == axis) for k, p in enumerate(exponents))
                slopes[monomial, axis, index[lower]] = power
    first = int(np.flatnonzero(EXPONENTS.sum(axis=1) < 3)[0])
    return np.ascontiguousarray(slopes[:, :, first:])


def evaluate_cubics(coefficients: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values and gradients of cubics: (R, 20) rows, (N, 3) points -> (N, R), (N, R, 3).

    The same as ``lift(points) @ coefficients.T`` and its derivative, at a fraction of the cost.
    """
    lifted = lift(points).T
    return (coefficients @ lifted).T, cubic_gradients(coefficients, lifted).transpose(2, 0, 1)


def cubic_gradients(coefficients: FloatArray, lifted: FloatArray) -> FloatArray:
    """Gradients of cubics, from points that are lifted already: (R, 20), (20, N) -> (R, 3, N)."""
    slopes = np.einsum("rk,kcp->rcp", coefficients, _slopes_of_monomials())
    products = slopes.reshape(-1, slopes.shape[2]) @ lifted[SIZE - slopes.shape[2] :]
    return np.asarray(products.reshape(len(coefficients), 3, -1))


def basis_values(rays: FloatArray) -> FloatArray:
    """The cubics of :func:`sphere_basis` at unit rays: (N, 3) -> (N, 16), ray by ray in memory.

    One cubic of all rays stands after the other, since that is what sums run over.
    """
    return np.asarray((sphere_basis().T @ lift(rays).T).T)


def lift_rotation(rotation: npt.ArrayLike) -> FloatArray:
    """L(R), (20, 20), with Φ(R X) = L(R) Φ(X) for every X: (3, 3) -> (20, 20).

    A rotated camera frame is therefore the same camera with P L(R): this is the gauge.
    """
    points = np.random.default_rng(0).uniform(-1, 1, (120, 3))  # in general position
    to_coefficients = np.linalg.pinv(lift(points))
    return (to_coefficients @ lift(points @ np.asarray(rotation, float).T)).T
