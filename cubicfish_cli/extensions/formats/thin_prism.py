"""A fisheye lens with tangential and thin-prism terms, as COLMAP has it (sensor/models.h).

COLMAP calls it RAD_TAN_THIN_PRISM_FISHEYE, Project Aria Fisheye624. A point at the angle θ from
the axis is first (u, v), θ along its azimuth. With (a, b) = (1 + k1 θ² + ... + k6 θ¹²) (u, v),
ρ² = a² + b² and

    T(a, b) = (t1 (ρ² + 2a²) + 2 t2 a b + s1 ρ² + s2 ρ⁴,
               t2 (ρ² + 2b²) + 2 t1 a b + s3 ρ² + s4 ρ⁴),

the pixel is f · ((a, b) + T) + c.

T follows a tilted axis too, so this lens keeps the camera's own frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
import numpy.typing as npt

from cubicfish_cli.app.lenses.foreign_lens import FocalLens
from cubicfish_cli.core.angles import angle_from_axis, columns
from cubicfish_cli.core.geometry import decentring
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.types import FloatArray

# Profiles are looked through for a fold in such steps.
_STEP_RAD = np.deg2rad(0.05)


@dataclass(frozen=True, kw_only=True, eq=False)
class RadTanThinPrismLens(FocalLens):
    """See above.

    Attributes:
        k: (6,) of the radial part.
        t: (2,) t1, t2, tangential.
        s: (4,) s1..s4, of thin prisms.

    """

    name = "rad_tan_thin_prism_fisheye"
    label = "radial, tangential, thin prism fisheye"
    symmetric = False

    k: FloatArray
    t: FloatArray
    s: FloatArray

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """The radial lens."""
        k = np.append(radial.k, [0.0, 0.0])
        return (cls.near(radial, k=k, t=np.zeros(2), s=np.zeros(4)),)

    @cached_property
    def max_angle(self) -> float:
        """See :class:`Lens`: at most where the radial part stops growing."""
        return min(super().max_angle, _fold_rad(self.k))

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`."""
        uv = _fisheye(points)
        powers = (uv**2).sum(axis=1)[:, None] ** np.arange(1, len(self.k) + 1)
        a, b = (uv * (1 + powers @ self.k)[:, None]).T
        (t1, t2), (s1, s2, s3, s4) = self.t, self.s
        square = a * a + b * b
        more_a, more_b = decentring(a, b, t2, t1)
        u = a + more_a + square * (s1 + square * s2)
        v = b + more_b + square * (s3 + square * s4)
        return np.stack([self.fx * u + self.cx, self.fy * v + self.cy], axis=-1)

    def sees(self, points: FloatArray) -> npt.NDArray[np.bool_]:
        """See :class:`Lens`: as far as the radial part grows."""
        return angle_from_axis(points) <= _fold_rad(self.k)


def _fisheye(points: FloatArray) -> FloatArray:
    """(u, v) (N, 2) of camera-frame points; NaN straight behind, where none is told."""
    x, y, z = columns(points)
    rho = np.hypot(x, y)
    theta = np.arctan2(rho, z)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(rho > 0, theta / rho, np.where(z > 0, 0.0, np.nan))
        return np.asarray(points[:, :2] * scale[:, None])


def _fold_rad(k: FloatArray) -> float:
    """The angle up to which the radial part grows, at most π."""
    theta = np.arange(0, np.pi, _STEP_RAD)
    slope = np.ones_like(theta)
    for index, value in enumerate(k, start=1):
        slope += (2 * index + 1) * value * theta ** (2 * index)
    falls = np.flatnonzero(slope <= 0)
    return float(theta[max(falls[0] - 1, 0)]) if falls.size else float(np.pi)
