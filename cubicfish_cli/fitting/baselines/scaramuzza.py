"""Scaramuzza's polynomial (Scaramuzza, Martinelli & Siegwart 2006), the OCam toolbox's model.

A pixel less the centre, straightened by an affine matrix, is (x, y); its ray is (x, y, f(r)) with
f(r) = a0 + a2 r² + a3 r³ + a4 r⁴ and r = hypot(x, y). The model maps pixels to rays; the way back
solves f(sρ) = s Z for the scale s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from cubicfish_cli.angles import columns
from cubicfish_cli.fitting.baselines.base import BaselineLens, FloatArray, Scale
from cubicfish_cli.model.radial import RadialCamera

_TABLE = 2048
_NEWTON_ITERATIONS = 5
# Radii are looked for up to this one, in units of the start's focal length: past any half-turn.
_LARGEST_RADIUS = 6.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaramuzzaLens(BaselineLens):
    """Values: cx, cy, c, d, e (the affine matrix is [[c, d], [e, 1]]), a0, a2, a3, a4.

    Attributes:
        unit: pixels that count as 1 in a2..a4, so that all values are of order 1 to 100.

    """

    name = "Scaramuzza"
    unit: float

    @classmethod
    def starts(cls, camera: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Linear least squares of f on the reference's profile."""
        theta = np.linspace(0.02, covered, 200)
        radius = camera.profile(theta)
        powers = np.stack([np.ones_like(radius), radius**2, radius**3, radius**4], axis=-1)
        # Along the ray's direction the equation stays finite at 90°, where f crosses 0.
        rows = powers * np.sin(theta)[:, None]
        a = np.linalg.lstsq(rows, radius * np.cos(theta), rcond=None)[0]
        lens = cls(
            values=np.array([camera.cx, camera.cy, camera.fx / camera.fy, 0, 0, *a]),
            units=np.array([camera.fy, camera.fy, *np.ones(7)]),
            unit=camera.fy,
        )
        return (lens,)

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`BaselineLens`; derivatives by the implicit function theorem."""
        cx, cy, c, d, e = self.values[:5]
        a0, a2, a3, a4 = self.values[5:]
        x, y, z = columns(points)
        rho = np.hypot(x, y)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            radius = self._radius(rho, z)
            # On the axis r/ρ is 0/0, and a0/Z in the limit.
            s = np.where(rho > 1e-9 * np.abs(z), radius / rho, a0 / z)
            # g(s, ρ, Z) = f(sρ) − sZ = 0; f'(r)/r is finite everywhere.
            slope_share = 2 * a2 + radius * (3 * a3 + radius * 4 * a4)
            g_s = rho * radius * slope_share - z
            powers = np.stack([np.ones_like(radius), radius**2, radius**3, radius**4], axis=-1)
            plane, d_plane, d_shape = Scale(
                value=s,
                d_across=-s * s * slope_share / g_s,
                d_along=s / g_s,
                d_shape=-powers / g_s[:, None],
            ).point(points)
        matrix = self.unit * np.array([[c, d], [e, 1.0]])
        d_values = np.zeros((len(points), 2, 9))
        d_values[:, 0, 0] = 1
        d_values[:, 1, 1] = 1
        d_values[:, 0, 2] = self.unit * plane[:, 0]
        d_values[:, 0, 3] = self.unit * plane[:, 1]
        d_values[:, 1, 4] = self.unit * plane[:, 0]
        d_values[:, :, 5:] = matrix @ d_shape
        pixel = plane @ matrix.T + [cx, cy]
        return (
            np.where(np.isfinite(s)[:, None], pixel, np.inf),
            matrix @ d_plane,
            d_values,
        )

    def _radius(self, rho: FloatArray, z: FloatArray) -> FloatArray:
        """The smallest r at which the ray (r, f(r)) has the direction (ρ, Z); NaN without one."""
        a0, a2, a3, a4 = self.values[5:]
        table = np.linspace(0, _LARGEST_RADIUS, _TABLE)
        angle = np.arctan2(table, a0 + table**2 * (a2 + table * (a3 + table * a4)))
        falls = np.flatnonzero(np.diff(angle) <= 0)
        end = falls[0] + 1 if falls.size else _TABLE
        theta = np.arctan2(rho, z)
        radius = np.interp(theta, angle[:end], table[:end], right=np.nan)
        for _ in range(_NEWTON_ITERATIONS):
            f = a0 + radius**2 * (a2 + radius * (a3 + radius * a4))
            f_slope = radius * (2 * a2 + radius * (3 * a3 + radius * 4 * a4))
            radius = radius - (f * rho - radius * z) / (f_slope * rho - z)
        return radius
