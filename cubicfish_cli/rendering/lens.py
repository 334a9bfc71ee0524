"""A made-up fisheye lens with exact formulas: the truth that rendered photos are made with.

An angle polynomial in the ray's angle from the axis (Kannala and Brandt, 2006), bent by decentring
(Brown, 1966) and by a sensor that is not square to the axis, about a principal point off the
image's centre. That is not the cubic's formula, but it is that of the lens which P is held to
(`fitting/asymmetric.py`): what leans on the prior looks better with it than with real lenses.
Those of :mod:`cubicfish_cli.rendering.outside` do not flatter.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, radians

import numpy as np
import numpy.typing as npt

from cubicfish_cli.angles import columns
from cubicfish_cli.geometry import kannala_brandt, kannala_brandt_slope

FloatArray = npt.NDArray[np.float64]

# Newton from a table's value squares its error: 4096 steps give 1e-7, two rounds the rest.
_TABLE_STEPS = 4096
_RADIAL_ROUNDS = 3
_DECENTRING_ROUNDS = 8
_TOLERANCE_PX = 1e-9


@dataclass(frozen=True, kw_only=True)
class TrueLens:
    """A central fisheye lens.

    A ray (x, y, z) becomes a pixel (u, v) by::

        θ = atan2(√(x² + y²), z)                  must not exceed max_angle_deg
        r = θ + k1·θ³ + k2·θ⁵ + k3·θ⁷ + k4·θ⁹
        (a, b) = r · (x, y) / √(x² + y²)
        (a, b) += (2·p1·a·b + p2·(r² + 2a²), p1·(r² + 2b²) + 2·p2·a·b)
        (a, b) /= 1 + t1·a + t2·b
        (u, v) = (fx·a + cx, fy·b + cy)

    Attributes:
        image_size: (width, height) in pixels; used by renderers, not by the formula.
        fx, fy: pixels a radian along x and y, at the axis.
        cx, cy: the pixel that the axis meets.
        k: k1..k4, growth of the radius with the angle; r must grow up to ``max_angle_deg``.
        p: p1, p2, decentring.
        tilt: t1, t2, slopes of the sensor against the axis.
        max_angle_deg: half the field of view.

    """

    image_size: tuple[int, int]
    fx: float
    fy: float
    cx: float
    cy: float
    k: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    p: tuple[float, float] = (0.0, 0.0)
    tilt: tuple[float, float] = (0.0, 0.0)
    max_angle_deg: float = 95.0

    def __post_init__(self) -> None:
        angles = np.linspace(0.0, radians(self.max_angle_deg), _TABLE_STEPS)
        if not np.all(self._radius_slope(angles) > 0):
            raise ValueError(
                f"the lens's radius stops growing within {self.max_angle_deg:g}°: "
                "lower max_angle_deg or change k"
            )

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Points or rays in the camera frame (..., 3) -> pixels (..., 2).

        NaN where the angle from the axis exceeds ``max_angle_deg`` and for the zero vector.
        """
        points = np.asarray(points, float)
        x, y, z = columns(points)
        across = np.hypot(x, y)
        angle = np.arctan2(across, z)
        seen = (angle <= radians(self.max_angle_deg)) & ((across > 0) | (z > 0))
        angle = np.where(seen, angle, 0.0)
        scale = self._radius(angle) / np.where(across > 0, across, 1.0)
        flat = self._decentre(points[..., :2] * scale[..., None])
        flat = flat / (1.0 + flat @ np.array(self.tilt))[..., None]
        pixel = flat * (self.fx, self.fy) + (self.cx, self.cy)
        return np.where(seen[..., None], pixel, np.nan)

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> unit rays in the camera frame (..., 3); NaN outside the field.

        Newton's rounds end within 1e-9 px of the pixel; a pixel that does not get there is
        outside the field.
        """
        pixel = np.asarray(pixel, float)
        shape = pixel.shape[:-1]
        flat = (pixel.reshape(-1, 2) - (self.cx, self.cy)) / (self.fx, self.fy)
        rays = np.full((len(flat), 3), np.nan)
        tilted = 1.0 - flat @ np.array(self.tilt)
        radius_max = float(self._radius(np.array(radians(self.max_angle_deg))))
        # Decentring moves a point by at most 3·|p|·r², so farther ones need not be tried.
        reach = radius_max * (1.0 + 3.0 * hypot(*self.p) * radius_max) * 1.01
        with np.errstate(invalid="ignore"):
            near = (tilted > 0) & (np.hypot(flat[:, 0], flat[:, 1]) <= reach * tilted)
        near_index = np.flatnonzero(near)
        bent = flat[near_index] / tilted[near_index, None]
        central = self._undo_decentring(bent)
        radius = np.hypot(central[:, 0], central[:, 1])
        error = np.hypot(*((self._decentre(central) - bent) * (self.fx, self.fy)).T)
        in_field = (radius <= radius_max * (1 + 1e-12)) & (error < _TOLERANCE_PX)
        radius, central = radius[in_field], central[in_field]
        angle = self._angle(radius)
        scale = np.sin(angle) / np.where(radius > 0, radius, 1.0)
        rays[near_index[in_field]] = np.column_stack([central * scale[:, None], np.cos(angle)])
        return rays.reshape(*shape, 3)

    def _radius(self, angle: FloatArray) -> FloatArray:
        return kannala_brandt(angle, self.k)

    def _radius_slope(self, angle: FloatArray) -> FloatArray:
        return kannala_brandt_slope(angle, self.k)

    def _angle(self, radius: FloatArray) -> FloatArray:
        table = np.linspace(0.0, radians(self.max_angle_deg), _TABLE_STEPS)
        angle = np.interp(radius, self._radius(table), table)
        for _ in range(_RADIAL_ROUNDS):
            angle = angle - (self._radius(angle) - radius) / self._radius_slope(angle)
        return angle

    def _decentre(self, flat: FloatArray) -> FloatArray:
        a, b = flat[..., 0], flat[..., 1]
        p1, p2 = self.p
        square = a * a + b * b
        return np.stack(
            [
                a + 2 * p1 * a * b + p2 * (square + 2 * a * a),
                b + p1 * (square + 2 * b * b) + 2 * p2 * a * b,
            ],
            axis=-1,
        )

    def _undo_decentring(self, bent: FloatArray) -> FloatArray:
        flat = bent.copy()
        p1, p2 = self.p
        for _ in range(_DECENTRING_ROUNDS):
            miss = self._decentre(flat) - bent
            a, b = flat[:, 0], flat[:, 1]
            aa = 1 + 2 * p1 * b + 6 * p2 * a
            ab = 2 * p1 * a + 2 * p2 * b  # the Jacobian is symmetric
            bb = 1 + 6 * p1 * b + 2 * p2 * a
            determinant = aa * bb - ab * ab
            step = np.column_stack(
                [bb * miss[:, 0] - ab * miss[:, 1], aa * miss[:, 1] - ab * miss[:, 0]]
            )
            step /= determinant[:, None]
            flat -= step
            if not np.abs(step).max(initial=0.0) * max(self.fx, self.fy) > 1e-12:
                break
        return flat
