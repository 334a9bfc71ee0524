"""The division model (Fitzgibbon 2001): the ray of (x, y) is (x, y, 1 + λ(x² + y²)).

Written with rays it holds beyond 180° too, for λ < 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from cubicfish_cli.core.lenses.lens import SymmetricLens
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class DivisionLens(SymmetricLens):
    """The shape's parameter ``bend`` is λ."""

    name = "division"
    label = "division"
    compared = True

    bend: float

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """λ = −1/4 is the stereographic lens."""
        return (cls.near(radial, bend=-0.25),)

    def scale(self, points: FloatArray) -> FloatArray:
        """The s that solves λρ²s² − Zs + 1 = 0: the root that is 1/Z on the axis."""
        z = points[:, 2]
        rho_squared = np.sum(points[:, :2] ** 2, axis=1)
        root = np.sqrt(z * z - 4 * self.bend * rho_squared)
        # Where Z < 0 the two terms cancel: the other form of the same root is exact there.
        value = np.where(z > 0, 2 / (z + root), (z - root) / (2 * self.bend * rho_squared))
        return np.where(value > 0, value, np.inf)
