"""A camera's lens as it sees what is near by: photos of a target are taken with such ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.pupil import pupil_profile
from cubicfish_cli.types import FloatArray


@runtime_checkable
class WanderingPupil(Protocol):
    """A lens whose rays do not all start in one point."""

    def ray_starts(self, rays: FloatArray) -> FloatArray:
        """Where rays (..., 3) of ``unproject`` start: z (...) on the axis, in points' units."""


@dataclass(frozen=True, kw_only=True)
class NearLens:
    """A camera for points whose distance counts, in its units.

    Attributes:
        camera: the camera.

    """

    camera: CubicCamera

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Points in the camera frame (..., 3) -> pixels (..., 2), NaN outside the field."""
        return self.camera.project(points, near=True)

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> unit directions (..., 3); rays start where :meth:`ray_starts` says."""
        return self.camera.unproject(pixel)

    def ray_starts(self, rays: FloatArray) -> FloatArray:
        """See :class:`WanderingPupil`."""
        return self.camera.pupil_travel * np.nan_to_num(pupil_profile(np.asarray(rays, float)))
