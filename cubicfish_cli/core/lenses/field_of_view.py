"""The field-of-view model (Devernay & Faugeras 2001): r = atan(2 tan θ tan(ω/2)) / ω.

With the arc tangent of two arguments it holds beyond 180° too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from cubicfish_cli.core.angles import columns
from cubicfish_cli.core.lenses.lens import SymmetricLens
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.types import FloatArray

# Below this share of ρ in |X| the series replaces quotients that are 0/0 on the axis.
_NEAR_AXIS = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldOfViewLens(SymmetricLens):
    """The shape's parameter ``omega`` is ω in radians."""

    name = "fov"
    label = "field of view"
    compared = True

    omega: float

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """2 tan(ω/2) = 1 makes it the equidistant lens."""
        omega = 2 * np.arctan(0.5)
        return (cls.near(radial, stretch=omega, omega=omega),)

    def scale(self, points: FloatArray) -> FloatArray:
        """The profile over ρ: s = atan2(aρ, Z) / (ωρ) with a = 2 tan(ω/2)."""
        omega = self.omega
        if not 0 < omega < np.pi:
            return np.full(len(points), np.inf)
        a = 2 * np.tan(omega / 2)
        x, y, z = columns(points)
        rho = np.hypot(x, y)
        axis = (rho < _NEAR_AXIS * np.abs(z)) & (z > 0)
        value = np.where(axis, a / z, np.arctan2(a * rho, z) / np.where(axis, 1, rho)) / omega
        return np.where((z != 0) | (rho > 0), value, np.inf)
