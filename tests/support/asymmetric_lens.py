"""A Kannala–Brandt lens, decentred (Brown, 1966) and with a sensor not square to its axis.

It is not the cubic's formula, but that of the lens which P is held to (`fit/asymmetric.py`):
what leans on the prior looks better with photos of such a lens than with those of real ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import hypot, radians
from typing import Self

import numpy as np
import numpy.typing as npt

from cubicfish import FloatArray
from cubicfish.angles import columns
from cubicfish.geometry import (
    decentring,
    decentring_slope,
    inverse_of_growing,
    kannala_brandt,
    kannala_brandt_slope,
)
from cubicfish.models import FocalLens, RadialCamera, angle_from_axis

_CHECKED_ANGLES = 4096
_DECENTRING_ROUNDS = 8
_TOLERANCE_PX = 1e-9


@dataclass(frozen=True, kw_only=True)
class AsymmetricLens(FocalLens):
    """A ray (x, y, z) becomes a pixel (u, v) by::

        θ = atan2(√(x² + y²), z)                  must not exceed max_angle_deg
        r = θ + k1·θ³ + k2·θ⁵ + k3·θ⁷ + k4·θ⁹
        (a, b) = r · (x, y) / √(x² + y²)
        (a, b) += (2·p1·a·b + p2·(r² + 2a²), p1·(r² + 2b²) + 2·p2·a·b)
        (a, b) /= 1 + t1·a + t2·b
        (u, v) = (fx·a + cx, fy·b + cy)

    Attributes:
        image_size: (width, height) in pixels; used by renderers, not by the formula.
        k: k1..k4, growth of the radius with the angle; r must grow up to ``max_angle_deg``.
        p: p1, p2, decentring.
        tilt: t1, t2, slopes of the sensor against the axis.
        max_angle_deg: half the field of view.

    """

    name = "asymmetric"
    label = "asymmetric Kannala–Brandt"
    symmetric = False

    k: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    p: tuple[float, float] = (0.0, 0.0)
    tilt: tuple[float, float] = (0.0, 0.0)
    max_angle_deg: float = field(default=95.0, metadata=FocalLens.FIXED)

    def __post_init__(self) -> None:
        angles = np.linspace(0.0, self.max_angle, _CHECKED_ANGLES)
        if not np.all(kannala_brandt_slope(angles, self.k) > 0):
            raise ValueError(
                f"the lens's radius stops growing within {self.max_angle_deg:g}°: "
                "lower max_angle_deg or change k"
            )

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """The radial lens."""
        return (cls.near(radial, k=tuple(radial.k), max_angle_deg=float(np.rad2deg(covered))),)

    @cached_property
    def max_angle(self) -> float:
        """See :class:`Lens`: half the field of view."""
        return radians(self.max_angle_deg)

    def sees(self, points: FloatArray) -> npt.NDArray[np.bool_]:
        """See :class:`Lens`: what lies in the field of view."""
        return angle_from_axis(points) <= self.max_angle

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`: by the formula, any angle's."""
        x, y, z = columns(points)
        across = np.hypot(x, y)
        radius = kannala_brandt(np.arctan2(across, z), self.k)
        flat = self._decentre(points[:, :2] * (radius / np.where(across > 0, across, 1.0))[:, None])
        flat = flat / (1.0 + flat @ np.array(self.tilt))[:, None]
        return np.asarray(flat * (self.fx, self.fy) + (self.cx, self.cy))

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """See :class:`Lens`: a pixel that is met within 1e-9 px, in the field of view."""
        pixel = np.asarray(pixel, float)
        flat = (pixel.reshape(-1, 2) - (self.cx, self.cy)) / (self.fx, self.fy)
        rays = np.full((len(flat), 3), np.nan)
        tilted = 1.0 - flat @ np.array(self.tilt)
        radius_max = float(kannala_brandt(np.array(self.max_angle), self.k))
        # Decentring moves a point by at most 3·|p|·r², so farther ones need not be tried.
        max_radius = radius_max * (1.0 + 3.0 * hypot(*self.p) * radius_max) * 1.01
        with np.errstate(invalid="ignore"):
            near = (tilted > 0) & (np.hypot(flat[:, 0], flat[:, 1]) <= max_radius * tilted)
        index = np.flatnonzero(near)
        bent = flat[index] / tilted[index, None]
        central = self._undo_decentring(bent)
        radius = np.hypot(central[:, 0], central[:, 1])
        error = np.hypot(*((self._decentre(central) - bent) * (self.fx, self.fy)).T)
        in_field = (radius <= radius_max * (1 + 1e-12)) & (error < _TOLERANCE_PX)
        radius, central = np.minimum(radius[in_field], radius_max), central[in_field]
        angle = inverse_of_growing(
            lambda theta: kannala_brandt(theta, self.k),
            lambda theta: kannala_brandt_slope(theta, self.k),
            radius,
            self.max_angle,
        )
        scale = np.sin(angle) / np.where(radius > 0, radius, 1.0)
        rays[index[in_field]] = np.column_stack([central * scale[:, None], np.cos(angle)])
        return rays.reshape(*pixel.shape[:-1], 3)

    def _decentre(self, flat: FloatArray) -> FloatArray:
        return flat + np.stack(decentring(flat[..., 0], flat[..., 1], *self.p), axis=-1)

    def _undo_decentring(self, bent: FloatArray) -> FloatArray:
        flat = bent.copy()
        for _ in range(_DECENTRING_ROUNDS):
            miss = self._decentre(flat) - bent
            along_a, along_b, ab = decentring_slope(flat[:, 0], flat[:, 1], *self.p)
            aa, bb = 1 + along_a, 1 + along_b
            determinant = aa * bb - ab * ab
            step = np.column_stack(
                [bb * miss[:, 0] - ab * miss[:, 1], aa * miss[:, 1] - ab * miss[:, 0]]
            )
            step /= determinant[:, None]
            flat -= step
            if not np.abs(step).max(initial=0.0) * max(self.fx, self.fy) > 1e-12:
                break
        return flat
