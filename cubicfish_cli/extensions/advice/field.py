"""The field over which uncertainty is told, and the lens as far as a target may be seen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from cubicfish_cli.app.viewpoints.views import WholeLens
from cubicfish_cli.core.angles import angle_from_axis
from cubicfish_cli.core.assess.uncertainty import FieldUncertainty, summed
from cubicfish_cli.core.fit.uncertainty import field_grid
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.extensions.advice.information import Information

GRID = (80, 60)
"""Columns and rows over the photo of the uncertainty that the picture shows."""
_BEYOND_DEG = 10.0


@dataclass(frozen=True, eq=False)
class Field:
    """The trusted field without where the camera sees itself: what uncertainty is told of.

    Attributes:
        camera: whose field it is.
        blind: how far from its axis the camera sees itself, radians.

    """

    camera: CubicCamera
    blind: float

    @cached_property
    def _rays(self) -> FloatArray:
        """(N, 3) rays over it, those that camera.yaml's figures are of."""
        rays = field_grid(self.camera, self.blind)[2].reshape(-1, 3)
        return np.asarray(rays[np.isfinite(rays[:, 0])])

    def sigma_px(self, known: Information) -> FloatArray:
        """(rows, columns) the uncertainty over the photo, NaN outside the field."""
        x, y = (
            (np.arange(n) + 0.5) / n * size - 0.5
            for n, size in zip(GRID, self.camera.image_size, strict=True)
        )
        rays = self.camera.unproject(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
        seen = angle_from_axis(rays) >= self.blind
        sigma = np.full(len(rays), np.nan)
        sigma[seen] = known.uncertainty().sigma_px(rays[seen])
        return sigma.reshape(GRID[::-1])

    def summed(self, known: Information) -> FieldUncertainty:
        """The uncertainty over all of it."""
        return summed(known.uncertainty().sigma_px(self._rays))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Reach:
    """The radial reference as far as it may be asked where a target would be seen."""

    camera: RadialCamera
    limit: float
    blind: float

    def project(self, points: npt.ArrayLike, /) -> FloatArray:
        angle = angle_from_axis(points)
        seen = (angle >= self.blind) & (angle <= self.limit)
        return np.where(seen[..., None], self.camera.project(points), np.nan)

    def unproject(self, pixel: npt.ArrayLike, /) -> FloatArray:
        rays = self.camera.unproject(pixel)
        with np.errstate(invalid="ignore"):
            inside = rays[..., 2] >= np.cos(self.limit)
        return np.where(inside[..., None], rays, np.nan)


def reach_of(camera: CubicCamera, more_deg: float = 0.0, blind: float = 0.0) -> WholeLens:
    """A lens for where a target would be seen, somewhat beyond the trusted field too.

    Within ``blind`` radians of the axis nothing is.
    """
    limit = float(np.deg2rad(camera.max_angle_deg + _BEYOND_DEG + more_deg))
    return _Reach(camera=camera.radial, limit=min(limit, camera.radial.max_angle), blind=blind)
