"""Lens models of few parameters: a unit sphere's, and symmetric ones by their profile.

- ``unified`` (Mei & Rives 2007), with radial-tangential distortion, as cv2.omnidir;
- ``double_sphere`` (Usenko, Demmel & Cremers 2018), which descends from it;
- ``division`` (Fitzgibbon 2001): the ray of (x, y) is (x, y, 1 + λ(x² + y²));
- ``fov``, the field-of-view model (Devernay & Faugeras 2001): r = atan(2 tan θ tan(ω/2)) / ω.

Written with rays, and with the arc tangent of two arguments, the last two hold beyond 180° too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from cubicfish_cli.app.lenses.foreign_lens import FocalLens, SymmetricLens
from cubicfish_cli.core.angles import columns
from cubicfish_cli.core.geometry import decentring
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.types import FloatArray

# Below this share of ρ in |X| the series replaces quotients that are 0/0 on the axis.
_NEAR_AXIS = 1e-5


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


@dataclass(frozen=True, kw_only=True, eq=False)
class DivisionLens(SymmetricLens):
    """The shape's parameter ``bend`` is λ."""

    name = "division"
    label = "division"

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


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldOfViewLens(SymmetricLens):
    """The shape's parameter ``omega`` is ω in radians."""

    name = "fov"
    label = "field of view"

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
