"""Angles of points and offsets, identical to the last bit for identical numbers.

With vector instructions (AVX-512), numpy 1.26 computes the angles of a column of an array by a
different loop if the result happens to lie right behind that array in memory, and the two loops
round differently. The same is true of exp and powers. Since the same work must give the same bytes,
columns are copied out of their array before such functions see them.
"""

import numpy as np
import numpy.typing as npt

from cubicfish.types import FloatArray


def columns(points: npt.ArrayLike) -> FloatArray:
    """The coordinates of points (..., K), each in memory of its own -> (K, ...)."""
    return np.moveaxis(np.asarray(points, float), -1, 0).copy()


def unit_rays(points: npt.ArrayLike) -> FloatArray:
    """Points (..., 3) of any length -> unit rays (..., 3); NaN where there is no direction.

    The largest coordinate is divided out first, since squares of 1e200 overflow and those of 1e-200
    vanish.
    """
    points = np.asarray(points, float)
    largest = np.max(np.abs(points), axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        near_one = points / largest
        rays: FloatArray = near_one / np.linalg.norm(near_one, axis=-1, keepdims=True)
    return rays


def angle_from_axis(points: npt.ArrayLike) -> FloatArray:
    """Angle from the camera's axis of points or rays (..., 3), any length -> (...), radians."""
    x, y, z = columns(points)
    return np.arctan2(np.hypot(x, y), z)


def azimuth(offset: npt.ArrayLike) -> FloatArray:
    """Direction in the picture of offsets (..., 2): 0 to the right, π/2 down; (...), radians."""
    x, y = columns(offset)
    return np.arctan2(y, x)
