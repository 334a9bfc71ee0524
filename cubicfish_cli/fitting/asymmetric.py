"""The lens that P is held to: the reference, decentred, tilted and skewed as real lenses are.

No glass is centred to the last micron and no sensor is square to its axis. Where corners are few,
P can only be as right as what holds it, and a lens of perfect symmetry is off by up to a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.fitting.adjustment import adjust
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.robust import huber_px, noise_px
from cubicfish_cli.lenses.radial import RadialCamera, project_jacobian

FloatArray = npt.NDArray[np.float64]

_BENDS = 5
# It only holds another lens, and starts the search for the nearest one.
_DECREASE = 1e-6
# A turn of the camera with decentring and tilt does what a shift of the principal point does, to
# well below any noise. So that the frame is not left to chance, a lens that only holds P stays
# within about this share of the focal length of the principal point that the corners gave.
_CENTRE_SPREAD = 0.01


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

    @classmethod
    def unbent(
        cls, camera: RadialCamera, *, terms: int = 4, noise_px: float = 1.0, spread: float = 0.0
    ) -> BentFit:
        """A radial lens as the perfectly symmetric one of these."""
        values = np.concatenate([camera.parameters, np.zeros(_BENDS)])
        return cls(values=values, terms=terms, noise_px=noise_px, spread=spread)

    @property
    def _free(self) -> npt.NDArray[np.intp]:
        return np.r_[0 : 4 + self.terms, 8 : 8 + (_BENDS if self.spread else 0)]

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
        """See :class:`cubicfish_cli.fitting.adjustment.FitLens`."""
        return self.project_jacobian(points)[0]

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`cubicfish_cli.fitting.adjustment.FitLens`."""
        plain = np.array([1, 1, 0, 0, *self.values[4:8]])
        flat, flat_by_point, flat_by_values = project_jacobian(plain, points)
        pixel, by_flat, by_values = self._bent(flat)
        by_values[:, :, 4:8] = by_flat @ flat_by_values[:, :, 4:]
        return pixel, by_flat @ flat_by_point, by_values[:, :, self._free]

    def seen(self, rays: StillRays) -> tuple[FloatArray, FloatArray]:
        """Pixels (N, 2) of rays and their derivatives by the free parameters (N, 2, K).

        What :meth:`project_jacobian` says of them, at a fraction of the cost.
        """
        radius = rays.theta + rays.odd @ self.values[4:8]
        pixel, by_flat, by_values = self._bent(rays.direction * radius[:, None])
        outwards = (by_flat @ rays.direction[:, :, None])[:, :, 0]
        by_values[:, :, 4:8] = outwards[:, :, None] * rays.odd[:, None, :]
        return pixel, by_values[:, :, self._free]

    def _bent(self, flat: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """From the radial lens of focal length 1 on: (N, 2) -> pixels and their derivatives.

        By the point in that lens's image (N, 2, 2), and by ``values`` (N, 2, 13), of which the
        profile's are left to the caller.
        """
        focal, centre = self.values[:2], self.values[2:4]
        p1, p2, t1, t2, skew = self.values[8:]
        a, b = flat.T
        square = a * a + b * b
        moved = np.stack(
            [
                a + 2 * p1 * a * b + p2 * (square + 2 * a * a) + skew * b,
                b + p1 * (square + 2 * b * b) + 2 * p2 * a * b,
            ],
            axis=-1,
        )
        moved_by_flat = np.empty((len(a), 2, 2))
        moved_by_flat[:, 0, 0] = 1 + 2 * p1 * b + 6 * p2 * a
        moved_by_flat[:, 1, 0] = 2 * p1 * a + 2 * p2 * b
        moved_by_flat[:, 0, 1] = moved_by_flat[:, 1, 0] + skew
        moved_by_flat[:, 1, 1] = 1 + 6 * p1 * b + 2 * p2 * a
        depth = 1 + t1 * moved[:, 0] + t2 * moved[:, 1]
        # A tilt that turns the sensor edge-on is a bad step: its cost turns it down.
        depth = np.where(depth > 0, depth, np.nan)
        tilted = moved / depth[:, None]
        tilted_by_moved = (np.eye(2) - tilted[:, :, None] * np.array([t1, t2])) / depth[
            :, None, None
        ]
        by_flat = focal[:, None] * (tilted_by_moved @ moved_by_flat)

        moved_by_bends = np.zeros((len(a), 2, 3))
        moved_by_bends[:, 0, 0] = moved_by_bends[:, 1, 1] = 2 * a * b
        moved_by_bends[:, 1, 0] = square + 2 * b * b
        moved_by_bends[:, 0, 1] = square + 2 * a * a
        moved_by_bends[:, 0, 2] = b
        by_bends = focal[:, None] * (tilted_by_moved @ moved_by_bends)
        by_values = np.zeros((len(a), 2, 8 + _BENDS))
        by_values[:, 0, 0] = tilted[:, 0]
        by_values[:, 1, 1] = tilted[:, 1]
        by_values[:, 0, 2] = by_values[:, 1, 3] = 1
        by_values[:, :, 8:10] = by_bends[:, :, :2]
        by_values[:, :, 10:12] = -(focal * tilted)[:, :, None] * tilted[:, None, :]
        by_values[:, :, 12] = by_bends[:, :, 2]
        pixel = np.where(np.isfinite(tilted), focal * tilted + centre, np.inf)
        return pixel, by_flat, by_values

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """The pulls to symmetry and to the anchor, weak: (L,) pixels, (L, K)."""
        count = len(self._free)
        residual, jacobian = np.zeros(0), np.zeros((0, count))
        if self.spread:
            pull = self.noise_px / self.spread
            residual = pull * self.values[8:]
            jacobian = pull * np.eye(count)[-_BENDS:]
        if self.anchor is not None:
            pull = self.noise_px / self.anchor_px
            residual = np.append(residual, pull * (self.values[2:4] - self.anchor))
            jacobian = np.vstack([jacobian, pull * np.eye(count)[2:4]])
        return residual, jacobian


def bend(
    camera: RadialCamera,
    terms: int,
    poses: Poses,
    pairs: Correspondences,
    residual: FloatArray,
    spread: float,
) -> tuple[BentFit, Poses]:
    """The bent lens nearest to corners, anchored there, and the poses that go with it.

    Args:
        camera: the radial lens to start from.
        terms: how many of its coefficients are free.
        poses: camera_from_world of each photo under it.
        pairs: the corners.
        residual: (N, 2) of the radial lens, pixels.
        spread: expected asymmetry, see :class:`BentFit`.

    """
    noise = max(noise_px(residual), 1e-3)
    lens = BentFit.unbent(camera, terms=terms, noise_px=noise, spread=spread)
    if spread:
        fit = adjust(lens, poses, pairs, huber_px=huber_px(residual), relative_decrease=_DECREASE)
        if not isinstance(fit.lens, BentFit):
            raise TypeError("the adjustment must be of a bent lens")
        lens, poses = fit.lens, fit.poses
    return replace(
        lens, anchor=lens.values[2:4], anchor_px=_CENTRE_SPREAD * float(lens.values[:2].mean())
    ), poses
