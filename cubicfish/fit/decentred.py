"""The lens of P's prior: the reference, decentred, tilted and skewed as real lenses are.

No glass is centred to the last micron and no sensor is square to its axis. Where corners are few, P
can only be as exact as its prior, and a perfectly symmetric lens is off by up to a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from cubicfish.geometry import decentring, decentring_slope
from cubicfish.models.radial import project_jacobian
from cubicfish.solve.fit_lens import FitLens
from cubicfish.solve.normal_equations import gram
from cubicfish.types import FloatArray, IntArray

# Slopes of so many points are held at once: some megabytes.
_AT_ONCE = 10_000


@dataclass(frozen=True, kw_only=True, eq=False)
class StillRays:
    """Fixed rays, as a radial lens of focal length 1 sees them.

    Attributes:
        theta: (N,) angles from the axis, radians.
        odd: (N, 4) θ³, θ⁵, θ⁷, θ⁹.
        direction: (N, 2) where in the image they lie from its centre, of length 1; 0 on the axis.

    """

    theta: FloatArray
    odd: FloatArray
    direction: FloatArray

    @classmethod
    def of(cls, rays: FloatArray) -> StillRays:
        """Prepare unit rays (N, 3)."""
        rho = np.hypot(rays[:, 0], rays[:, 1])
        theta = np.arctan2(rho, rays[:, 2])
        return cls(
            theta=theta,
            odd=theta[:, None] ** np.array([3, 5, 7, 9]),
            direction=rays[:, :2] / np.maximum(rho, 1e-300)[:, None],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class DecentredFit(FitLens):
    """A Kannala–Brandt lens with Brown's decentring (1966), a tilted sensor and skew.

    With (a, b) = r(θ) (x, y)/√(x² + y²)::

        (a, b) += (2 p1 a b + p2 (r² + 2a²) + skew · b,  p1 (r² + 2b²) + 2 p2 a b)
        (a, b) /= 1 + t1 a + t2 b
        (u, v) = (fx a + cx, fy b + cy)

    Attributes:
        values: (13,) fx, fy, cx, cy, k1..k4, p1, p2, t1, t2, skew.
        terms: how many coefficients of the profile are free.
        noise_px: standard deviation of a corner's coordinate; the weight of the pull to symmetry
            follows it.
        spread: expected size of each of p1, p2, t1, t2 and skew: a hundredth is half a degree of
            tilt. 0 keeps the lens perfectly symmetric.
        anchor: (2,) a point to which the principal point is pulled.
        anchor_px: how far from it the principal point is expected.

    """

    values: FloatArray
    terms: int
    noise_px: float
    spread: float
    anchor: FloatArray = field(default_factory=lambda: np.zeros(2))
    anchor_px: float = np.inf

    @cached_property
    def _free(self) -> IntArray:
        return np.array([*range(4 + self.terms), *range(8, 13 if self.spread else 8)])

    @property
    def parameters(self) -> FloatArray:
        """(K,) the free values."""
        return self.values[self._free]

    def with_parameters(self, parameters: FloatArray) -> DecentredFit:
        """The same lens with other parameters."""
        values = self.values.copy()
        values[self._free] = parameters
        return replace(self, values=values)

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`~cubicfish.solve.fit_lens.FitLens`."""
        plain = np.array([1, 1, 0, 0, *self.values[4:8]])
        flat, flat_by_point, flat_by_values = project_jacobian(plain, points)
        changes = np.concatenate([flat_by_point, flat_by_values[:, :, 4:]], axis=2)
        pixel, moved, by_values = self._map_to_sensor(flat.T, changes.transpose(1, 2, 0))
        by_values[:, 4:8] = moved[:, 3:]
        return pixel, moved[:, :3].transpose(2, 0, 1), self._select_free(by_values)

    def project(self, points: FloatArray) -> FloatArray:
        """See :class:`~cubicfish.solve.fit_lens.FitLens`; slopes are held of some points only."""
        pixel = np.empty((len(points), 2))
        for first in range(0, len(points), _AT_ONCE):
            run = slice(first, first + _AT_ONCE)
            pixel[run] = self.pixel_and_slopes(points[run])[0]
        return pixel

    def seen(self, rays: StillRays) -> tuple[FloatArray, FloatArray]:
        """Pixels (N, 2) of rays and their derivatives by the free parameters (N, 2, K).

        They are those of :meth:`pixel_and_slopes`, at a fraction of the cost.
        """
        radius, outwards = rays.theta + rays.odd @ self.values[4:8], rays.direction.T
        pixel, moved, by_values = self._map_to_sensor(outwards * radius, outwards[:, None])
        by_values[:, 4:8] = moved * rays.odd.T
        return pixel, self._select_free(by_values)

    def _map_to_sensor(
        self, flat: FloatArray, change: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Map the image of the radial lens of focal length 1 to pixels.

        Args:
            flat: (2, N) a and b of points in the radial lens's image.
            change: (2, C, N) their derivatives.

        Returns:
            Pixels (N, 2), their derivatives (2, C, N), and those by all values (2, 13, N), where
            those by the profile are left out.

        """
        p1, p2, t1, t2, skew = self.values[8:]
        (a, b), (da, db) = flat, change
        more_a, more_b = decentring(a, b, p1, p2)
        decentred = np.empty_like(flat)
        decentred[0] = a + more_a + skew * b
        decentred[1] = b + more_b
        depth = 1 + t1 * decentred[0] + t2 * decentred[1]
        # A tilt that turns the sensor edge-on is a bad step, which its cost rejects.
        depth[~(depth > 0)] = np.nan
        tilted, focal = decentred / depth, self.values[:2, None, None]
        pixel = (self.values[:2] * tilted.T) + self.values[2:4]
        pixel[~np.isfinite(pixel)] = np.inf

        def through_tilt(change: FloatArray) -> FloatArray:
            away = t1 * change[0] + t2 * change[1]
            return np.asarray((change - tilted[:, None] * away) * (focal / depth))

        along_a, along_b, across = decentring_slope(a, b, p1, p2)
        moved = np.empty_like(change)
        moved[0] = (1 + along_a) * da + (across + skew) * db
        moved[1] = across * da + (1 + along_b) * db
        by_values = np.zeros((2, len(self.values), len(a)))
        by_values[[0, 1], [0, 1]] = tilted
        by_values[0, 2] = by_values[1, 3] = 1
        bends = np.zeros((2, 3, len(a)))
        bends[0, 0] = bends[1, 1] = 2 * a * b
        bends[1, 0], bends[0, 1], bends[0, 2] = a * a + 3 * b * b, 3 * a * a + b * b, b
        by_values[:, [8, 9, 12]] = through_tilt(bends)
        by_values[:, 10:12] = -focal * tilted[:, None] * tilted
        return pixel, through_tilt(moved), by_values

    def _select_free(self, by_values: FloatArray) -> FloatArray:
        """Select derivatives by the free values, (N, 2, K), from those by all values (2, 13, N)."""
        free = self._free
        if len(free) < by_values.shape[1]:
            by_values = by_values[:, free]
        return by_values.transpose(2, 0, 1)

    def pulls(self) -> FloatArray:
        """The weak pulls to symmetry and to the anchor: see :class:`FitLens`."""
        aim, spread = np.zeros(len(self.values)), np.full(len(self.values), np.inf)
        spread[8:] = self.spread or np.inf
        aim[2:4], spread[2:4] = self.anchor, self.anchor_px
        pull = (self.noise_px / spread)[self._free]
        return gram(np.diag(pull), pull * (self.values - aim)[self._free])
