"""Models that go by a unit sphere: the unified one and one that descends from it.

- ``unified`` (Mei & Rives 2007), with radial-tangential distortion, as cv2.omnidir;
- ``double_sphere`` (Usenko, Demmel & Cremers 2018).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from cubicfish_cli.geometry import decentring, decentring_slope
from cubicfish_cli.lenses.lens import FocalLens, Scale, SymmetricLens
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class UnifiedLens(FocalLens):
    """The point on the unit sphere, seen from ξ behind its middle, bent, then through a matrix.

    Attributes:
        skew: pixels, as cv2.omnidir has it; other tools have none.
        xi: ξ.
        d: (4,) k1, k2, p1, p2 of radial-tangential distortion.

    """

    name = "unified"
    label = "unified (Mei)"
    compared = True
    unwritten = ("skew",)

    skew: float = 0.0
    xi: float
    d: FloatArray

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Without distortion ξ = 1 is the stereographic lens; ξ and k1, k2 play together.

        Least squares over them has several minima, so it starts at several ξ.
        """
        return tuple(
            cls.near(radial, stretch=1 + xi, xi=xi, d=np.zeros(4)) for xi in (1.0, 2.0, 4.0)
        )

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`Lens`: to the sphere, to the plane, bent, then K."""
        fx, fy, cx, cy, skew, xi, k1, k2, p1, p2 = self.parameters
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            d1 = np.linalg.norm(points, axis=1)
            bottom = points[:, 2] + xi * d1
            value = np.where(bottom > 0, 1 / bottom, np.inf)
            square = value * value
            plane, d_plane, d_xi = Scale(
                value=value,
                d_across=-square * xi / d1,
                d_along=-square * (1 + xi * points[:, 2] / d1),
                d_shape=-(square * d1)[:, None],
            ).point(points)
            x, y = plane.T
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * k2)
            slope = 2 * (k1 + 2 * k2 * r2)
            more_x, more_y = decentring(x, y, p1, p2)
            bent = np.stack([x * radial + more_x, y * radial + more_y], axis=-1)
            along_x, along_y, across = decentring_slope(x, y, p1, p2)
            bend = np.empty((len(points), 2, 2))
            bend[:, 0, 0] = radial + slope * x * x + along_x
            bend[:, 0, 1] = bend[:, 1, 0] = slope * x * y + across
            bend[:, 1, 1] = radial + slope * y * y + along_y
            d_bent = np.stack(
                [
                    np.stack([x * r2, y * r2], axis=-1),
                    np.stack([x * r2 * r2, y * r2 * r2], axis=-1),
                    np.stack([2 * x * y, r2 + 2 * y * y], axis=-1),
                    np.stack([r2 + 2 * x * x, 2 * x * y], axis=-1),
                ],
                axis=-1,
            )
            matrix = np.array([[fx, skew], [0, fy]])
            d_values = np.zeros((len(points), 2, 10))
            d_values[:, 0, 0] = bent[:, 0]
            d_values[:, 1, 1] = bent[:, 1]
            d_values[:, 0, 2] = 1
            d_values[:, 1, 3] = 1
            d_values[:, 0, 4] = bent[:, 1]
            d_values[:, :, 5:6] = matrix @ bend @ d_xi
            d_values[:, :, 6:] = matrix @ d_bent
            pixel = bent @ matrix.T + [cx, cy]
            d_point = matrix @ bend @ d_plane
        return np.where(np.isfinite(value)[:, None], pixel, np.inf), d_point, d_values


@dataclass(frozen=True, kw_only=True, eq=False)
class DoubleSphereLens(SymmetricLens):
    """The shape's parameters ``xi`` and ``alpha`` are ξ and α."""

    name = "double_sphere"
    # Other programs read an α from 0 on and below 1.
    limits: ClassVar[Mapping[str, tuple[float, float]]] = {"alpha": (0.0, 0.9999)}
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
