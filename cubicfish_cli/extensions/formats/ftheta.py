"""NVIDIA's f-theta lens: the angle from the axis as a polynomial of the distance in the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.polynomial import polynomial

from cubicfish_cli.app.lenses.foreign_lens import ForeignLens
from cubicfish_cli.core.angles import angle_from_axis
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.types import FloatArray

_ROUNDS = 30
_TOLERANCE = 1e-9  # radians


@dataclass(frozen=True, kw_only=True, eq=False)
class FThetaLens(ForeignLens):
    """A ray at r and azimuth φ is seen at (cx, cy) + [[c, d], [e, 1]] r (cos φ, sin φ).

    Attributes:
        cx, cy: the centre, pixels.
        polynomial: (6,) of θ = k0 + k1 r + ... + k5 r⁵, radians and pixels.
        linear: (3,) c, d, e.

    """

    name = "ftheta"
    label = "f-theta"
    fixed = ("polynomial1",)

    cx: float
    cy: float
    polynomial: FloatArray
    linear: FloatArray

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """The equidistant lens."""
        k = np.array([0.0, 2 / (radial.fx + radial.fy), 0, 0, 0, 0])
        linear = np.array([radial.fx / radial.fy, 0.0, 0.0])
        return (
            cls(
                image_size=radial.image_size,
                cx=radial.cx,
                cy=radial.cy,
                polynomial=k,
                linear=linear,
            ),
        )

    @property
    def units(self) -> FloatArray:
        """See :class:`Lens`: radii count in focal lengths."""
        focal = 1 / self.polynomial[1]
        return np.array([focal, focal, *focal ** -np.arange(6.0), 1, 1, 1])

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`."""
        k, slope = self.polynomial, polynomial.polyder(self.polynomial)
        theta = angle_from_axis(points)
        r = (theta - k[0]) / k[1]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for _ in range(_ROUNDS):  # Newton's, each step no longer than half the way
                step = (polynomial.polyval(r, k) - theta) / polynomial.polyval(r, slope)
                r = r - np.clip(step, -0.5 * r - 1, 0.5 * r + 1)
            found = np.abs(polynomial.polyval(r, k) - theta) < _TOLERANCE
            found &= (polynomial.polyval(r, slope) > 0) & (r > -1)
            across = np.hypot(points[:, 0], points[:, 1])
            way = np.where(across[:, None] > 0, points[:, :2] / across[:, None], 0.0)
        pixel = (way * r[:, None]) @ _matrix(self.linear).T + [self.cx, self.cy]
        return np.where(found[:, None], pixel, np.nan)


def _matrix(linear: FloatArray) -> FloatArray:
    c, d, e = linear
    return np.array([[c, d], [e, 1.0]])
