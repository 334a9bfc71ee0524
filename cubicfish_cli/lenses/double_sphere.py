"""The double sphere model (Usenko, Demmel & Cremers 2018)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from cubicfish_cli.lenses.lens import ALPHA, Scale, SymmetricLens
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class DoubleSphereLens(SymmetricLens):
    """The shape's parameters ``xi`` and ``alpha`` are ξ and α."""

    name = "double_sphere"
    limits = ALPHA
    label = "double sphere"
    compared = True

    xi: float
    alpha: float

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """ξ = 0 and α = 1/2 is the stereographic lens; the others lie towards flatter profiles."""
        return tuple(
            cls.near(radial, stretch=1 + xi, xi=xi, alpha=alpha)
            for xi, alpha in ((0.0, 0.5), (-0.2, 0.6), (0.3, 0.6), (0.8, 0.5))
        )

    def scale(self, points: FloatArray) -> Scale:
        """See the paper: s = 1 / (α d2 + (1 − α)(ξ d1 + Z)), d1 = |X|, d2 = hypot(ρ, ξ d1 + Z)."""
        xi, alpha = self.xi, self.alpha
        z = points[:, 2]
        rho_squared = np.sum(points[:, :2] ** 2, axis=1)
        d1 = np.sqrt(rho_squared + z * z)
        shifted = xi * d1 + z
        d2 = np.sqrt(rho_squared + shifted * shifted)
        bottom = alpha * d2 + (1 - alpha) * shifted
        value = np.where(bottom > 0, 1 / bottom, np.inf)
        minus_square = -value * value
        # How the denominator moves with ξ d1 + Z, through both of its terms.
        by_shifted = alpha * shifted / d2 + (1 - alpha)
        return Scale(
            value=value,
            d_across=minus_square * (alpha / d2 + by_shifted * xi / d1),
            d_along=minus_square * by_shifted * (xi * z / d1 + 1),
            d_shape=minus_square[:, None] * np.stack([by_shifted * d1, d2 - shifted], axis=-1),
        )
