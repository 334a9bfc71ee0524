"""How far two lenses differ, after the rotation between their camera frames is taken out."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

FloatArray = npt.NDArray[np.float64]

_HUBER_PX = 1.0


class ProjectingLens(Protocol):
    """Any lens: camera-frame points (..., 3) -> pixels (..., 2), NaN outside its field."""

    def project(self, points: FloatArray, /) -> FloatArray:
        """Camera-frame points (..., 3) -> pixels (..., 2)."""


def aligned_difference(
    first: ProjectingLens, second: ProjectingLens, rays: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Pixel differences of two lenses under the rotation that makes them smallest.

    A calibration determines the camera frame only as well as its corners do, and the poses make
    up for the rest: two calibrations of one lens may differ by a small rotation and still be the
    same camera.

    Args:
        first: one lens.
        second: the other.
        rays: (N, 3) unit rays in the second lens's frame.

    Returns:
        Differences first(R d) − second(d), (N, 2) pixels, NaN where either lens
        has no pixel; and R (3, 3).

    """
    wanted = second.project(rays)

    def difference(vector: FloatArray) -> FloatArray:
        return first.project(Rotation.from_rotvec(vector).apply(rays)) - wanted

    def finite(vector: FloatArray) -> FloatArray:
        # A ray that leaves the field as R changes pulls neither way.
        return np.nan_to_num(difference(vector)).ravel()

    fit = least_squares(
        finite, np.zeros(3), loss="huber", f_scale=_HUBER_PX, xtol=1e-14, gtol=1e-12
    )
    return difference(fit.x), Rotation.from_rotvec(fit.x).as_matrix()
