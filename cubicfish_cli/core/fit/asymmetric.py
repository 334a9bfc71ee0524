"""The lens that P is held to: the reference, decentred, tilted and skewed as real lenses are.

No glass is centred to the last micron and no sensor is square to its axis. Where corners are few,
P can only be as right as what holds it, and a lens of perfect symmetry is off by up to a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cubicfish_cli.core.fit.normal_equations import gram
from cubicfish_cli.core.geometry import decentring, decentring_slope
from cubicfish_cli.core.lenses.radial import project_jacobian
from cubicfish_cli.core.types import FloatArray, IntArray

_BENDS = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class StillRays:
    """Rays that never move, as a radial lens of focal length 1 sees them.

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
        """Of unit rays (N, 3)."""
        rho = np.hypot(rays[:, 0], rays[:, 1])
        theta = np.arctan2(rho, rays[:, 2])
        return cls(
            theta=theta,
            odd=theta[:, None] ** np.array([3, 5, 7, 9]),
            direction=rays[:, :2] / np.maximum(rho, 1e-300)[:, None],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class BentFit:
    """A Kannala–Brandt lens with Brown's decentring (1966), a tilted sensor and skew.

    With (a, b) = r(θ) (x, y)/√(x² + y²)::

        (a, b) += (2 p1 a b + p2 (r² + 2a²) + skew · b,  p1 (r² + 2b²) + 2 p2 a b)
        (a, b) /= 1 + t1 a + t2 b
        (u, v) = (fx a + cx, fy b + cy)

    Attributes:
        values: (13,) fx, fy, cx, cy, k1..k4, p1, p2, t1, t2, skew.
        terms: how many coefficients of the profile are free.
        noise_px: of a corner's coordinate; the weight of the pull to symmetry follows it.
        spread: expected size of each of p1, p2, t1, t2 and skew: a hundredth is half a degree of
            tilt. 0 holds the lens to perfect symmetry.
        anchor: (2,) a point that the principal point is pulled to; None where it is not.
        anchor_px: how far from it the principal point is expected.

    """

    values: FloatArray
    terms: int
    noise_px: float
    spread: float
    anchor: FloatArray | None = None
    anchor_px: float = np.inf

    @cached_property
    def _free(self) -> IntArray:
        return np.array([*range(4 + self.terms), *range(8, 8 + (_BENDS if self.spread else 0))])

    @property
    def parameters(self) -> FloatArray:
        """(K,) those that are free."""
        return self.values[self._free]

    def with_parameters(self, parameters: FloatArray) -> BentFit:
        """The same lens with other parameters."""
        values = self.values.copy()
        values[self._free] = parameters
        return replace(self, values=values)

    def project(self, points: FloatArray) -> FloatArray:
        """See :class:`~cubicfish_cli.core.fit.fit_lens.FitLens`."""
        return self.project_jacobian(points)[0]

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`~cubicfish_cli.core.fit.fit_lens.FitLens`."""
        plain = np.array([1, 1, 0, 0, *self.values[4:8]])
        flat, flat_by_point, flat_by_values = project_jacobian(plain, points)
        onto = _Onto.sensor(self.values, flat.T)
        changes = np.concatenate([flat_by_point, flat_by_values[:, :, 4:]], axis=2)
        moved = onto.moved(changes.transpose(1, 2, 0))
        by_point, by_profile = moved[:, :3], moved[:, 3:]
        return onto.pixel, by_point.transpose(2, 0, 1), self._by_free(onto.by_values(by_profile))

    def seen(self, rays: StillRays) -> tuple[FloatArray, FloatArray]:
        """Pixels (N, 2) of rays and their derivatives by the free parameters (N, 2, K).

        What :meth:`project_jacobian` says of them, at a fraction of the cost.
        """
        radius = rays.theta + rays.odd @ self.values[4:8]
        onto = _Onto.sensor(self.values, rays.direction.T * radius)
        outwards = onto.moved(rays.direction.T[:, None])
        return onto.pixel, self._by_free(onto.by_values(outwards * rays.odd.T))

    def _by_free(self, by_values: FloatArray) -> FloatArray:
        """(N, 2, K) of derivatives by all values (2, 13, N)."""
        free = self._free
        if len(free) < by_values.shape[1]:
            by_values = by_values[:, free]
        return np.ascontiguousarray(by_values.transpose(2, 0, 1))

    def prior(self) -> FloatArray:
        """The pulls to symmetry and to the anchor, weak: see :class:`FitLens`."""
        aim, spread = np.zeros(len(self.values)), np.full(len(self.values), np.inf)
        spread[8:] = self.spread or np.inf
        if self.anchor is not None:
            aim[2:4], spread[2:4] = self.anchor, self.anchor_px
        pull = (self.noise_px / spread)[self._free]
        return gram(np.diag(pull), pull * (self.values - aim)[self._free])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Onto:
    """From the image of the radial lens of focal length 1 to pixels, by a lens's ``values``.

    Attributes:
        values: (13,) as :class:`BentFit` has them.
        flat: (2, N) a and b in the radial lens's image.
        tilted: (2, N) decentred, skewed and tilted.
        depth: (N,) what the tilt divides by.
        pixel: (N, 2).

    """

    values: FloatArray
    flat: FloatArray
    tilted: FloatArray
    depth: FloatArray
    pixel: FloatArray

    @classmethod
    def sensor(cls, values: FloatArray, flat: FloatArray) -> _Onto:
        """Where points (2, N) of the radial lens's image meet the sensor."""
        p1, p2, t1, t2, skew = values[8:]
        a, b = flat
        more_a, more_b = decentring(a, b, p1, p2)
        moved = np.empty_like(flat)
        moved[0] = a + more_a + skew * b
        moved[1] = b + more_b
        depth = 1 + t1 * moved[0] + t2 * moved[1]
        # A tilt that turns the sensor edge-on is a bad step: its cost turns it down.
        depth[~(depth > 0)] = np.nan
        tilted = moved / depth
        pixel = (values[:2] * tilted.T) + values[2:4]
        pixel[~np.isfinite(pixel)] = np.inf
        return cls(values=values, flat=flat, tilted=tilted, depth=depth, pixel=pixel)

    def moved(self, change: FloatArray) -> FloatArray:
        """How pixels move (2, C, N) when points of the radial lens's image do (2, C, N)."""
        p1, p2, _, _, skew = self.values[8:]
        (a, b), (da, db) = self.flat, change
        along_a, along_b, across = decentring_slope(a, b, p1, p2)
        decentred = np.empty_like(change)
        decentred[0] = (1 + along_a) * da + (across + skew) * db
        decentred[1] = across * da + (1 + along_b) * db
        return self._tilted(decentred)

    def _tilted(self, change: FloatArray) -> FloatArray:
        """How pixels move (2, C, N) when points before the tilt do (2, C, N)."""
        focal, (t1, t2) = self.values[:2, None, None], self.values[10:12]
        away = t1 * change[0] + t2 * change[1]
        return np.asarray((change - self.tilted[:, None] * away) * (focal / self.depth))

    def by_values(self, by_profile: FloatArray) -> FloatArray:
        """(2, 13, N) derivatives of pixels; those by the profile (2, 4, N) are known."""
        (a, b), (u, v) = self.flat, self.tilted
        by_values = np.zeros((2, 8 + _BENDS, len(a)))
        by_values[0, 0], by_values[1, 1] = u, v
        by_values[0, 2] = by_values[1, 3] = 1
        by_values[:, 4:8] = by_profile
        bends = np.zeros((2, 3, len(a)))
        bends[0, 0] = bends[1, 1] = 2 * a * b
        bends[1, 0], bends[0, 1], bends[0, 2] = a * a + 3 * b * b, 3 * a * a + b * b, b
        by_values[:, [8, 9, 12]] = self._tilted(bends)
        by_values[:, 10:12] = -self.values[:2, None, None] * self.tilted[:, None] * self.tilted
        return by_values
