"""Lens models that project from unit spheres.

- ``unified`` (Mei & Rives 2007), with radial-tangential distortion, as cv2.omnidir;
- ``double_sphere`` (Usenko, Demmel & Cremers 2018), which descends from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from cubicfish_cli.app.lenses.foreign_lens import FocalLens, SymmetricLens
from cubicfish_cli.core.geometry import decentring
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.types import FloatArray


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

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`: to the sphere, to the plane, bent, then K."""
        k1, k2, p1, p2 = self.d
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            bottom = points[:, 2] + self.xi * np.linalg.norm(points, axis=1)
            x, y = (points[:, :2] / np.where(bottom > 0, bottom, np.nan)[:, None]).T
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * k2)
            more_x, more_y = decentring(x, y, p1, p2)
            x, y = x * radial + more_x, y * radial + more_y
            pixel = np.stack([self.fx * x + self.skew * y + self.cx, self.fy * y + self.cy], -1)
        return np.where(np.isfinite(pixel), pixel, np.inf)


@dataclass(frozen=True, kw_only=True, eq=False)
class DoubleSphereLens(SymmetricLens):
    """The shape's parameters ``xi`` and ``alpha`` are ξ and α."""

    name = "double_sphere"
    # Other programs read an α from 0 on and below 1.
    limits: ClassVar[Mapping[str, tuple[float, float]]] = {"alpha": (0.0, 0.9999)}
    label = "double sphere"

    xi: float
    alpha: float

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """ξ = 0 and α = 1/2 is the stereographic lens; the others lie towards flatter profiles."""
        return tuple(
            cls.near(radial, stretch=1 + xi, xi=xi, alpha=alpha)
            for xi, alpha in ((0.0, 0.5), (-0.2, 0.6), (0.3, 0.6), (0.8, 0.5))
        )

    def scale(self, points: FloatArray) -> FloatArray:
        """See the paper: s = 1 / (α d2 + (1 − α)(ξ d1 + Z)), d1 = |X|, d2 = hypot(ρ, ξ d1 + Z)."""
        shifted = self.xi * np.linalg.norm(points, axis=1) + points[:, 2]
        d2 = np.sqrt(np.sum(points[:, :2] ** 2, axis=1) + shifted * shifted)
        bottom = self.alpha * d2 + (1 - self.alpha) * shifted
        return np.where(bottom > 0, 1 / bottom, np.inf)
