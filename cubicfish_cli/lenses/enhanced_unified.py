"""The enhanced unified camera model (Khomutenko, Garcia & Martinet 2016)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from cubicfish_cli.lenses.lens import ALPHA, Scale, SymmetricLens
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class EnhancedUnifiedLens(SymmetricLens):
    """The shape's parameters ``alpha`` and ``beta`` are α and β."""

    name = "eucm"
    limits = ALPHA
    label = "enhanced unified"

    alpha: float
    beta: float

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """α = 1/2, β = 1 is the stereographic lens; the others lie towards flatter profiles."""
        return tuple(
            cls.near(radial, alpha=alpha, beta=beta)
            for alpha, beta in ((0.5, 1.0), (0.6, 1.1), (0.7, 0.8))
        )

    def scale(self, points: FloatArray) -> Scale:
        """See the paper: s = 1 / (α d + (1 − α) Z) with d = √(β ρ² + Z²)."""
        alpha, beta = self.alpha, self.beta
        z = points[:, 2]
        rho_squared = np.sum(points[:, :2] ** 2, axis=1)
        d = np.sqrt(np.maximum(beta, 0) * rho_squared + z * z)
        bottom = alpha * d + (1 - alpha) * z
        value = np.where(bottom > 0, 1 / bottom, np.inf)
        minus_square = -value * value
        return Scale(
            value=value,
            d_across=minus_square * alpha * beta / d,
            d_along=minus_square * (alpha * z / d + 1 - alpha),
            d_shape=minus_square[:, None]
            * np.stack([d - z, alpha * rho_squared / (2 * d)], axis=-1),
        )
