"""The lens of a camera, as far as it may predict where a target would be seen."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish import CubicCamera, FloatArray
from cubicfish.models import Lens, angle_from_axis

_BEYOND_DEG = 10.0


@dataclass(frozen=True, kw_only=True, eq=False)
class LimitedLens:
    """The radial reference, as far as it may predict where a target would be seen."""

    camera: Lens
    limit: float
    blind: float

    def project(self, points: npt.ArrayLike, /) -> FloatArray:
        """Project points in the camera frame (..., 3) to pixels (..., 2), NaN where it may not."""
        angle = angle_from_axis(points)
        seen = (angle >= self.blind) & (angle <= self.limit)
        return np.where(seen[..., None], self.camera.project(points), np.nan)

    def unproject(self, pixel: npt.ArrayLike, /) -> FloatArray:
        """Turn pixels (..., 2) into unit rays (..., 3), NaN where it may not."""
        rays = self.camera.unproject(pixel)
        with np.errstate(invalid="ignore"):
            inside = rays[..., 2] >= np.cos(self.limit)
        return np.where(inside[..., None], rays, np.nan)


def limited_lens(camera: CubicCamera, more_deg: float = 0.0, blind: float = 0.0) -> LimitedLens:
    """Return a lens that predicts where a target would be seen, also a little beyond the field.

    It sees nothing within ``blind`` radians of the axis.
    """
    limit = float(np.deg2rad(camera.max_angle_deg + _BEYOND_DEG + more_deg))
    return LimitedLens(camera=camera.radial, limit=min(limit, camera.radial.max_angle), blind=blind)
