"""NVIDIA's f-theta lens: the angle from the axis as a polynomial of the distance in the picture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.polynomial import polynomial

from cubicfish_cli.angles import angle_from_axis, unit_rays
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.lens import Lens
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.types import FloatArray

_ROUNDS = 30
_TOLERANCE = 1e-9  # radians


@dataclass(frozen=True, kw_only=True, eq=False)
class FThetaLens(Lens):
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

    @classmethod
    def nearest_to(cls, camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> FThetaLens:
        """See :class:`Lens`: by angles between rays, which needs no inverse.

        Times the focal length they are pixels.
        """
        from scipy.optimize import least_squares  # it takes long to load, and is seldom asked

        start = cls.starts(camera.radial, 0.0)[0]
        rays = unit_rays(rays)
        focal = 0.5 * (camera.radial.fx + camera.radial.fy)

        def lens(values: FloatArray) -> FThetaLens:
            scaled = values[2:7] / focal ** np.arange(1, 6)
            return replace(
                start,
                cx=float(values[0]),
                cy=float(values[1]),
                polynomial=np.concatenate([[0.0], scaled]),
                linear=values[7:],
            )

        def residual(values: FloatArray) -> FloatArray:
            centre, k, linear = values[:2], values[2:7], values[7:]
            offset = (pixel - centre) @ np.linalg.inv(_matrix(linear)).T
            r = np.hypot(offset[:, 0], offset[:, 1])
            theta = polynomial.polyval(r / focal, np.concatenate([[0.0], k]))
            way = offset / np.maximum(r, 1e-300)[:, None]
            seen = np.column_stack([np.sin(theta)[:, None] * way, np.cos(theta)])
            return np.asarray((focal * (seen - rays)).ravel())

        first = np.array([start.cx, start.cy, 1.0, 0, 0, 0, 0, *start.linear])
        return lens(least_squares(residual, first, x_scale="jac", max_nfev=200).x)


def _matrix(linear: FloatArray) -> FloatArray:
    c, d, e = linear
    return np.array([[c, d], [e, 1.0]])
