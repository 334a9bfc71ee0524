"""The lenses as least squares sees them: free parameters, derivatives and prior."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cubicfish_cli.fitting.asymmetric import BentFit, StillRays
from cubicfish_cli.fitting.fit_lens import FitLens
from cubicfish_cli.fitting.normal_equations import solve_scaled
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.lift import evaluate_cubics, lift, sphere_basis
from cubicfish_cli.lenses.radial import RadialCamera, project_jacobian
from cubicfish_cli.types import BoolArray, FloatArray

# From a lens that is near, Gauss and Newton get to the nearest one in this many steps.
_NEAREST_ROUNDS = 2
# Squared: a share of a parameter's own effect that no other has.
_TOLD_APART = 1e-13
WEIGHT_BEYOND = 0.1
"""Largest weight of pseudo-observations where no corners are."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialFit:
    """A Kannala–Brandt lens of which fx, fy, cx, cy and the first ``terms`` of k1..k4 are free.

    Attributes:
        values: (8,) fx, fy, cx, cy, k1..k4.
        terms: how many coefficients of the profile are free.

    """

    values: FloatArray
    terms: int = 4

    @property
    def parameters(self) -> FloatArray:
        """(4 + terms,)."""
        return self.values[: 4 + self.terms]

    def with_parameters(self, parameters: FloatArray) -> RadialFit:
        """The same lens with other parameters."""
        return replace(self, values=np.concatenate([parameters, self.values[4 + self.terms :]]))

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`cubicfish_cli.fitting.adjustment.FitLens`."""
        pixel, d_point, d_values = project_jacobian(self.values, points)
        return pixel, d_point, d_values[:, :, : 4 + self.terms]

    def project(self, points: FloatArray) -> FloatArray:
        """See :class:`cubicfish_cli.fitting.adjustment.FitLens`."""
        return project_jacobian(self.values, points)[0]

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """None: few parameters hold this lens."""
        return np.zeros(0), np.zeros((0, 4 + self.terms))


@dataclass(frozen=True, kw_only=True, eq=False)
class FixedLens:
    """A known lens, or one that was fitted: only poses are free."""

    camera: CubicCamera | RadialCamera | FitLens

    @property
    def parameters(self) -> FloatArray:
        """(0,)."""
        return np.zeros(0)

    def with_parameters(self, parameters: FloatArray) -> FixedLens:
        """Itself: nothing is free."""
        return self

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`cubicfish_cli.fitting.adjustment.FitLens`."""
        if isinstance(self.camera, CubicCamera):
            length = np.linalg.norm(points, axis=-1)
            rays = points / length[:, None]
            pixel, slope = self.camera.pixel_and_slope(rays)
            across = _through_unit_ray(slope.transpose(1, 2, 0), rays.T, length)
            d_point = across.transpose(2, 0, 1)
        elif isinstance(self.camera, RadialCamera):
            pixel, d_point, _ = project_jacobian(self.camera.parameters, points)
        else:
            pixel, d_point, _ = self.camera.project_jacobian(points)
        return pixel, d_point, np.zeros((len(points), 2, 0))

    def project(self, points: FloatArray) -> FloatArray:
        """See :class:`cubicfish_cli.fitting.adjustment.FitLens`."""
        return self.project_jacobian(points)[0]

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """None."""
        return np.zeros(0), np.zeros((0, 0))


@dataclass(frozen=True, kw_only=True, eq=False)
class RayPrior:
    """Pseudo-observations that tie a lens to the nearest bent one.

    That lens is as free as its kind allows: it follows, so that it is not what corners say
    about both that is held fast.

    Attributes:
        rays: (M, 3) unit rays.
        lens: a bent one that is near.
        within: (M,) which rays are as far from the axis as corners are.
        weight: residuals are multiplied by this, among corners.
        denominator: (M,) P3Φ of that lens at the rays.
        denominator_weight: pixels that a relative change of P3Φ by 1 counts as.

    """

    rays: FloatArray
    lens: BentFit
    within: BoolArray
    weight: float
    denominator: FloatArray
    denominator_weight: float

    @cached_property
    def values(self) -> FloatArray:
        """(M, 16) the basis of cubics on the sphere at the rays, which never move."""
        return lift(self.rays) @ sphere_basis()

    @cached_property
    def denominators(self) -> FloatArray:
        """(L, 17) from P3's coefficients and 1 to what has the squares of P3Φ's relative changes.

        Changes at all rays are linear in 16 coefficients: their triangular factor says as much.
        """
        share = self.denominator_weight / self.denominator
        changes = np.column_stack(
            [share[:, None] * self.values, np.full(len(share), -self.denominator_weight)]
        )
        return np.asarray(np.linalg.qr(changes, mode="r"))

    @cached_property
    def weights(self) -> FloatArray:
        """(M,) what the residuals at each ray are multiplied by.

        Where no corners are that lens is a guess: there it is enough that no pole comes in,
        and a firm hold would have P follow the guess at the cost of what corners say.
        """
        return np.where(self.within, self.weight, min(self.weight, WEIGHT_BEYOND))

    def nearest(self, pixel: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted misses of the bent lens nearest to pixels, its own prior's after them.

        Args:
            pixel: (M, 2), finite.

        Returns:
            (2M + L,) and its derivatives by that lens's parameters (2M + L, K).

        """
        return self._nearest(pixel)[1:]

    def nearest_lens(self, pixel: FloatArray) -> BentFit:
        """The bent lens nearest to pixels (M, 2) at the rays.

        It sees all of them: where steps lead to one that does not, ``lens`` is as near as any.
        """
        return self._nearest(pixel)[0]

    def _nearest(self, pixel: FloatArray) -> tuple[BentFit, FloatArray, FloatArray]:
        """The nearest lens and what :meth:`_misses` says of it."""
        seen, own, to_step = self._first_step
        miss = (self.weights[:, None] * (pixel - seen)).reshape(-1)
        lens = self.lens
        lens = lens.with_parameters(lens.parameters + to_step @ np.concatenate([miss, own]))
        miss, by_lens = self._misses(pixel, lens)
        for _ in range(_NEAREST_ROUNDS - 1):
            if not np.isfinite(miss).all():
                break
            step = _follow(by_lens.T @ by_lens, by_lens.T @ miss[:, None])[:, 0]
            lens = lens.with_parameters(lens.parameters - step)
            miss, by_lens = self._misses(pixel, lens)
        if not np.isfinite(miss).all():
            lens = self.lens
            miss, by_lens = self._misses(pixel, lens)
        return lens, miss, by_lens

    @cached_property
    def _first_step(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pixels of ``lens`` (M, 2), its own prior's misses (L,), and (K, 2M + L) from misses to
        its step to the nearest lens.
        """
        seen, by_lens = self._seen
        own, own_by_lens = self.lens.prior()
        by_lens = -self.weights[:, None, None] * by_lens
        slope = np.vstack([by_lens.reshape(seen.size, -1), own_by_lens])
        return seen, own, -_follow(slope.T @ slope, slope.T)

    @cached_property
    def _seen(self) -> tuple[FloatArray, FloatArray]:
        return self.lens.seen(self.still)

    @cached_property
    def still(self) -> StillRays:
        """The rays as lenses that P is held to see them."""
        return StillRays.of(self.rays)

    def _misses(self, pixel: FloatArray, lens: BentFit) -> tuple[FloatArray, FloatArray]:
        seen, by_lens = lens.seen(self.still)
        own, own_by_lens = lens.prior()
        miss = self.weights[:, None] * (pixel - seen)
        by_lens = -self.weights[:, None, None] * by_lens
        return (
            np.concatenate([miss.reshape(-1), own]),
            np.vstack([by_lens.reshape(pixel.size, -1), own_by_lens]),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class CubicFit:
    """The ``ray`` lift in the 16 dimensions that cubics span on the sphere (Eq. 5–7).

    P = T C Bᵀ: B is the orthonormal (20, 16) basis, T the Hartley normalisation of pixels. The
    homogeneous scale is fixed by holding the mean of P3Φ over the prior's rays at 1, which is
    linear, so 47 parameters are free. The prior also fixes the rotation of the camera frame.

    Attributes:
        coefficients: (3, 16) C.
        denominator_basis: (16, 15) the directions in which P3's coefficients may move.
        centre, scale: pixels are (m − centre) / scale inside.
        ray_prior: the pseudo-observations.

    """

    coefficients: FloatArray
    denominator_basis: FloatArray
    centre: FloatArray
    scale: float
    ray_prior: RayPrior

    @property
    def parameters(self) -> FloatArray:
        """(47,)."""
        return np.concatenate(
            [
                self.coefficients[0],
                self.coefficients[1],
                self.denominator_basis.T @ self.coefficients[2],
            ]
        )

    def with_parameters(self, parameters: FloatArray) -> CubicFit:
        """The same lens with other parameters."""
        moved = parameters[32:] - self.denominator_basis.T @ self.coefficients[2]
        return replace(
            self,
            coefficients=np.stack(
                [
                    parameters[:16],
                    parameters[16:32],
                    self.coefficients[2] + self.denominator_basis @ moved,
                ]
            ),
        )

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`cubicfish_cli.fitting.adjustment.FitLens`."""
        length = np.sqrt(np.einsum("ij,ij->i", points, points))
        rays = points / length[:, None]
        values = lift(rays) @ sphere_basis()
        pixel, denominator = self._pixel(values)
        _, gradient = evaluate_cubics(self.coefficients @ sphere_basis().T, rays)
        # One coordinate of all points after the other is the quickest to work on.
        across = gradient.transpose(1, 2, 0)
        slope = across[:2] - pixel.T[:, None] * across[2]
        slope *= self.scale / denominator
        return (
            pixel * self.scale + self.centre,
            _through_unit_ray(slope, rays.T, length).transpose(2, 0, 1),
            self._d_parameters(values, pixel, denominator, np.empty((len(points), 2, 47))),
        )

    def project(self, points: FloatArray) -> FloatArray:
        """See :class:`cubicfish_cli.fitting.adjustment.FitLens`."""
        rays = points / np.linalg.norm(points, axis=-1, keepdims=True)
        return self._pixel(lift(rays) @ sphere_basis())[0] * self.scale + self.centre

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """See :class:`cubicfish_cli.fitting.adjustment.FitLens`."""
        return self._prior

    @cached_property
    def _prior(self) -> tuple[FloatArray, FloatArray]:
        """Weighted misses of the nearest lens of the prior's kind, and of its denominators.

        That lens's own parameters are eliminated (variable projection, Golub & Pereyra 1973; the
        derivatives are Kaufman's, whose gradient is exact).

        Pixels alone leave room for a pole that a zero of both numerators all but cancels
        (a Froissart doublet): it bends the picture at a few corners and nowhere else. A cubic
        P3Φ that vanishes somewhere differs widely from one that is positive on the whole cone.
        """
        prior = self.ray_prior
        inside, denominator = self._pixel(prior.values)
        pixel = inside * self.scale + self.centre
        if not np.isfinite(pixel).all():  # a bad step: its cost turns it down
            return np.full(1, np.inf), np.zeros((1, 47))
        miss, by_lens = prior.nearest(pixel)
        change, of_change = self._denominators()
        slope = np.empty((len(miss) + len(change), 47))
        direct = slope[: len(miss)]
        by_pixel = slope[: pixel.size].reshape(-1, 2, 47)
        self._d_parameters(prior.values, inside, denominator, by_pixel, prior.weights[:, None])
        direct[pixel.size :] = 0
        direct -= by_lens @ _follow(by_lens.T @ by_lens, by_lens.T @ direct)
        slope[len(miss) :] = of_change
        return np.concatenate([miss, change]), slope

    def _denominators(self) -> tuple[FloatArray, FloatArray]:
        """Weighted relative changes of P3Φ over the prior's rays, and their derivatives (L, 47)."""
        by_values = self.ray_prior.denominators
        change = by_values[:, :-1] @ self.coefficients[2] + by_values[:, -1]
        slope = np.zeros((len(change), 47))
        slope[:, 32:] = by_values[:, :-1] @ self.denominator_basis
        return change, slope

    def priors(self, lens: BentFit, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What other priors put into the equations, all at once and to first order.

        The lens that is nearest under the weight of today follows linearly.

        Args:
            lens: what P is held to.
            weights: (H,) how firmly; see :attr:`RayPrior.weight`.

        Returns:
            Hessians (H, 47, 47) and gradients (H, 47).

        """
        prior = self.ray_prior
        inside, denominator = self._pixel(prior.values)
        pixel = inside * self.scale + self.centre
        near = replace(prior, lens=lens).nearest_lens(pixel)
        seen, by_lens = near.seen(prior.still)
        own, own_by_lens = near.prior()
        count, columns = len(self.parameters), len(self.parameters) + by_lens.shape[2] + 1
        # What moves P's pixels, what moves the lens's, and the miss.
        rows = np.empty((len(seen), 2, columns))
        rows[:, :, :count] = self._d_parameters(
            prior.values, inside, denominator, np.empty((len(seen), 2, count))
        )
        rows[:, :, count:-1] = -by_lens
        rows[:, :, -1] = pixel - seen
        pulls = np.zeros((len(own), columns))
        pulls[:, count:-1], pulls[:, -1] = own_by_lens, own
        among, beyond = (
            part.T @ part
            for part in (
                rows[which].reshape(-1, columns) for which in (prior.within, ~prior.within)
            )
        )
        squares = np.square([weights, np.minimum(weights, WEIGHT_BEYOND)])[:, :, None, None]
        gram = squares[0] * among + squares[1] * beyond + pulls.T @ pulls
        kept = np.r_[:count, columns - 1]
        cross = gram[:, count:-1, kept]
        followed = _follow(gram[:, count:-1, count:-1], cross)
        left = gram[:, kept[:, None], kept] - cross.transpose(0, 2, 1) @ followed
        change, slope = self._denominators()
        return left[:, :-1, :-1] + slope.T @ slope, left[:, :-1, -1] + slope.T @ change

    def _pixel(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        homogeneous = values @ self.coefficients.T
        denominator = homogeneous[:, 2]
        # A pole on the way is a bad step, not an error: its infinite cost turns it down.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            pixel = homogeneous[:, :2] / denominator[:, None]
        return np.where(denominator[:, None] > 0, pixel, np.inf), denominator

    def _d_parameters(
        self,
        values: FloatArray,
        pixel: FloatArray,
        denominator: FloatArray,
        out: FloatArray,
        weight: FloatArray | float = 1.0,
    ) -> FloatArray:
        """Weighted d pixel / d parameters, into (N, 2, 47); ``pixel`` is of order 1."""
        share = values * (self.scale * weight / denominator[:, None])
        out[:, 0, :16] = out[:, 1, 16:32] = share
        out[:, 0, 16:32] = out[:, 1, :16] = 0
        by_denominator = share @ self.denominator_basis
        np.multiply(-pixel[:, :, None], by_denominator[:, None, :], out=out[:, :, 32:])
        return out

    @property
    def P(self) -> FloatArray:
        """(3, 20) in pixels, Frobenius norm 1, P3Φ positive on the prior's rays."""
        normalisation = np.array(
            [
                [self.scale, 0, self.centre[0]],
                [0, self.scale, self.centre[1]],
                [0, 0, 1],
            ]
        )
        P = normalisation @ self.coefficients @ sphere_basis().T
        return P / np.linalg.norm(P)


def _follow(square: FloatArray, cross: FloatArray) -> FloatArray:
    """What parameters follow other things by: (..., K, K) JᵀJ and (..., K, n) Jᵀ of these.

    Parameters of a narrow lens are hardly told apart; what is lost in rounding stays.
    """
    index = np.arange(square.shape[-1])
    square[..., index, index] *= 1 + _TOLD_APART
    return solve_scaled(square, cross)


def _through_unit_ray(slope: FloatArray, rays: FloatArray, length: FloatArray) -> FloatArray:
    """From d/d unit ray to d/d point: the derivative of X/‖X‖ is (I − d dᵀ)/‖X‖.

    Args:
        slope: (2, 3, N).
        rays: (3, N).
        length: (N,) of the points.

    """
    radial = (slope * rays).sum(axis=1)
    return np.asarray((slope - radial[:, None] * rays) / length)
