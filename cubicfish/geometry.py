"""Maths that several parts share: similarities, rotations, polygons, the Kannala–Brandt profile."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish.types import BoolArray, FloatArray

# Number of points that are compared with all edges of a polygon at once.
_BLOCK = 4096
_DIRECTIONS = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]])
# Newton's method squares the error: a table of so many steps gives 1e-6, and two rounds the rest.
_TABLE = 1024
_NEWTON_ROUNDS = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Similarity:
    """x -> scale · rotation · x + shift.

    Attributes:
        scale, rotation, shift: the map; (3, 3) and (3,).
        error: the largest distance that it leaves, in units of the points it maps to.

    """

    scale: float
    rotation: FloatArray
    shift: FloatArray
    error: float

    def __call__(self, points: FloatArray) -> FloatArray:
        """Points (N, 3) where the map takes them (N, 3)."""
        return self.scale * points @ self.rotation.T + self.shift


def similarity(source: FloatArray, goal: FloatArray, *, scaled: bool = True) -> Similarity:
    """The similarity that carries points (N, 3) onto points (N, 3) best (Umeyama 1991).

    Args:
        source: points.
        goal: where they should go.
        scaled: whether the scale is free; else it is 1.

    """
    middle, target = source.mean(axis=0), goal.mean(axis=0)
    a, b = source - middle, goal - target
    left, size, right = np.linalg.svd(b.T @ a)
    sign = np.array([1.0, 1.0, -1.0 if np.linalg.det(left @ right) < 0 else 1.0])
    rotation = (left * sign) @ right
    scale = float((size * sign).sum() / np.sum(a * a)) if scaled else 1.0
    rest = b - scale * a @ rotation.T
    return Similarity(
        scale=scale,
        rotation=rotation,
        shift=target - scale * rotation @ middle,
        error=float(np.sqrt(np.square(rest).sum(axis=1).max())),
    )


def nearest_rotation(matrix: FloatArray) -> FloatArray:
    """The rotations nearest to matrices (..., 3, 3)."""
    left, _, right = np.linalg.svd(matrix)
    sign = np.ones(matrix.shape[:-1])
    sign[..., 2] = np.where(np.linalg.det(left @ right) < 0, -1.0, 1.0)
    return (left * sign[..., None, :]) @ right


def mean_rotation(rotations: FloatArray, weight: FloatArray) -> FloatArray:
    """The weighted mean of rotations (N, 3, 3) by weights (N,): (3, 3)."""
    return nearest_rotation(np.einsum("k,kij->ij", weight, rotations))


def outermost(points: FloatArray) -> FloatArray:
    """The point furthest out in each of eight directions, of points (N, 2): (8, 2)."""
    return np.asarray(points[np.argmax(points @ _DIRECTIONS.T, axis=0)])


def inside_polygon(points: FloatArray, polygon: FloatArray) -> BoolArray:
    """Whether points (N, 2) lie in a polygon (K, 2), by crossings of a ray; false for NaN."""
    ax, ay = polygon.T
    bx, by = np.roll(polygon, -1, axis=0).T
    inside = np.zeros(len(points), bool)
    for begin in range(0, len(points), _BLOCK):
        x, y = points[begin : begin + _BLOCK].T[:, :, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = ax + (y - ay) * (bx - ax) / (by - ay)
        spans = (ay > y) != (by > y)
        inside[begin : begin + _BLOCK] = (spans & (x < crossing)).sum(axis=1) % 2 == 1
    return inside & np.isfinite(points).all(axis=1)


def kannala_brandt(theta: FloatArray, k: npt.ArrayLike) -> FloatArray:
    """r(θ) = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸): radians (...,) -> (...,).

    Args:
        theta: angles from the axis.
        k: (4,) k1..k4.

    """
    s = theta * theta
    k1, k2, k3, k4 = np.asarray(k, float)
    return theta * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4))))


def kannala_brandt_slope(theta: FloatArray, k: npt.ArrayLike) -> FloatArray:
    """dr/dθ of :func:`kannala_brandt`: radians (...,) -> (...,)."""
    s = theta * theta
    k1, k2, k3, k4 = np.asarray(k, float)
    return 1 + s * (3 * k1 + s * (5 * k2 + s * (7 * k3 + s * 9 * k4)))


def decentring(x: FloatArray, y: FloatArray, p1: float, p2: float) -> tuple[FloatArray, FloatArray]:
    """The shift of points (...,) each by Brown's decentring (1966), at focal length 1."""
    across, xx, yy = 2 * x * y, x * x, y * y
    return p1 * across + p2 * (3 * xx + yy), p1 * (xx + 3 * yy) + p2 * across


def decentring_slope(
    x: FloatArray, y: FloatArray, p1: float, p2: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives (...,) of :func:`decentring`: along x, along y, and either across."""
    return 2 * p1 * y + 6 * p2 * x, 6 * p1 * y + 2 * p2 * x, 2 * (p1 * x + p2 * y)


def inverse_of_growing(
    function: Callable[[FloatArray], FloatArray],
    slope: Callable[[FloatArray], FloatArray],
    value: npt.ArrayLike,
    end: float,
) -> FloatArray:
    """Invert a function that grows from 0 on, by a table and Newton's method.

    Args:
        function: (...,) -> (...,), growing from 0 to ``end``.
        slope: its derivative.
        value: (...,) the values.
        end: up to where the function is to be inverted.

    Returns:
        (...,) the arguments; NaN where the value lies beyond that of ``end``.

    """
    value = np.asarray(value, float)
    table = np.linspace(0, end, _TABLE)
    with np.errstate(invalid="ignore"):
        inside = value <= function(np.asarray(end))
        found = np.interp(value, function(table), table)
        for _ in range(_NEWTON_ROUNDS):
            step = (function(found) - value) / np.maximum(slope(found), 1e-9)
            found = np.clip(found - step, 0, end)
    return np.where(inside, found, np.nan)


def camera_centre(rotation: FloatArray, translation: FloatArray) -> FloatArray:
    """(3,) where a camera stands in the frame of points X that it sees at R X + t."""
    return np.asarray(-rotation.T @ translation)


def pixel_grid(image_size: tuple[int, int], count: int) -> FloatArray:
    """About ``count`` pixels spread evenly over a photo: (N, 2), row by row."""
    width, height = image_size
    step = max(1.0, float(np.sqrt(width * height / count)))
    x = np.linspace(0, width - 1, max(2, round(width / step)))
    y = np.linspace(0, height - 1, max(2, round(height / step)))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
