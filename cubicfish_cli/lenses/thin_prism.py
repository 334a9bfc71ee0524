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

from cubicfish_cli.angles import angle_from_axis, columns
from cubicfish_cli.lenses.lens import FocalLens
from cubicfish_cli.lenses.radial import RadialCamera, project_jacobian
from cubicfish_cli.types import FloatArray

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
        bent = _bent(uv, self.k, self._shape)[0]
        return np.asarray(bent * [self.fx, self.fy] + [self.cx, self.cy])

    def sees(self, points: FloatArray) -> npt.NDArray[np.bool_]:
        """See :class:`Lens`: as far as the radial part grows."""
        return angle_from_axis(points) <= _fold_rad(self.k)

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`Lens`."""
        bent, by_uv, by_shape = _bent(_fisheye(points), self.k, self._shape)
        plain = np.array([1, 1, 0, 0, 0, 0, 0, 0], float)
        return self.through_focal(bent, by_uv @ project_jacobian(plain, points)[1], by_shape)

    @property
    def _shape(self) -> FloatArray:
        return np.concatenate([self.t, self.s])


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


def _terms(xy: FloatArray) -> FloatArray:
    """T = _terms @ (t1, t2, s1, s2, s3, s4): (N, 2, 6)."""
    x, y = xy.T
    square = x * x + y * y
    terms = np.zeros((len(xy), 2, 6))
    terms[:, 0, 0] = square + 2 * x * x
    terms[:, 0, 1] = terms[:, 1, 0] = 2 * x * y
    terms[:, 1, 1] = square + 2 * y * y
    terms[:, 0, 2] = terms[:, 1, 4] = square
    terms[:, 0, 3] = terms[:, 1, 5] = square * square
    return terms


def _terms_slope(xy: FloatArray, shape: FloatArray) -> FloatArray:
    """dT/d(x, y) for the six values of T: (N, 2, 2)."""
    x, y = xy.T
    t1, t2, s1, s2, s3, s4 = shape
    square = x * x + y * y
    slope = np.empty((len(xy), 2, 2))
    slope[:, 0, 0] = 6 * t1 * x + 2 * t2 * y + 2 * x * (s1 + 2 * s2 * square)
    slope[:, 0, 1] = 2 * t1 * y + 2 * t2 * x + 2 * y * (s1 + 2 * s2 * square)
    slope[:, 1, 0] = 2 * t2 * x + 2 * t1 * y + 2 * x * (s3 + 2 * s4 * square)
    slope[:, 1, 1] = 6 * t2 * y + 2 * t1 * x + 2 * y * (s3 + 2 * s4 * square)
    return slope


def _bent(
    uv: FloatArray, k: FloatArray, shape: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where (u, v) go (N, 2), d/d(u, v) (N, 2, 2), and d/dk, d/d the values of T (N, 2, K + 6)."""
    powers = (uv**2).sum(axis=1)[:, None] ** np.arange(1, len(k) + 1)
    radial = uv * (1 + powers @ k)[:, None]
    by_k = uv[:, :, None] * powers[:, None, :]
    # d radial / d(u, v) = (1 + k1 θ² + ...) I + (u, v)ᵀ(u, v) (2 k1 + 4 k2 θ² + ...)
    steep = np.concatenate([np.ones((len(uv), 1)), powers[:, :-1]], axis=1) @ (
        2 * np.arange(1, len(k) + 1) * k
    )
    by_uv = (1 + powers @ k)[:, None, None] * np.eye(2)
    by_uv = by_uv + steep[:, None, None] * uv[:, :, None] * uv[:, None, :]
    terms, slope = _terms(radial), _terms_slope(radial, shape)
    by_k = by_k + slope @ by_k
    by_uv = by_uv + slope @ by_uv
    return radial + terms @ shape, by_uv, np.concatenate([by_k, terms], axis=2)
