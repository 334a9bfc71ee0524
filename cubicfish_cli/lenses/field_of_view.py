"""The field-of-view model (Devernay & Faugeras 2001): r = atan(2 tan θ tan(ω/2)) / ω.

With the arc tangent of two arguments it holds beyond 180° too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from cubicfish_cli.angles import columns
from cubicfish_cli.lenses.lens import Scale, SymmetricLens
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.types import FloatArray

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

    def scale(self, points: FloatArray) -> Scale:
        """The profile over ρ: s = atan2(aρ, Z) / (ωρ) with a = 2 tan(ω/2)."""
        omega = self.omega
        a = 2 * np.tan(omega / 2)
        x, y, z = columns(points)
        rho_squared = x * x + y * y
        rho = np.sqrt(rho_squared)
        axis = (rho < _NEAR_AXIS * np.abs(z)) & (z > 0)
        bottom = z * z + a * a * rho_squared
        safe = np.where(axis, 1, rho)
        value = np.where(axis, a / (omega * z), np.arctan2(a * rho, z) / (omega * safe))
        # da/dω = 1 + (a/2)²; d atan2(aρ, Z)/da = ρZ/(Z² + a²ρ²).
        d_omega = (1 + a * a / 4) * z / (omega * bottom) - value / omega
        d_across = np.where(
            axis,
            -2 * a**3 / (3 * omega * z**3),
            (a * z / (omega * bottom) - value) / (safe * safe),
        )
        usable = 0 < omega < np.pi
        return Scale(
            value=np.where(usable & (bottom > 0), value, np.inf),
            d_across=d_across,
            d_along=-a / (omega * bottom),
            d_shape=d_omega[:, None],
        )
