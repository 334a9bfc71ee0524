"""The cubic in least squares, and the pseudo-observations of its prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cubicfish.fit.decentred import DecentredFit, StillRays
from cubicfish.models.lift import basis_values, cubic_gradients, lift, sphere_basis
from cubicfish.models.pupil import from_pupil, from_pupil_and_slopes
from cubicfish.solve.fit_lens import FitLens
from cubicfish.solve.normal_equations import gram, solve_scaled
from cubicfish.types import BoolArray, FloatArray, IntArray

# From a lens that is near, Gauss-Newton reaches the nearest one in this many steps.
_NEAREST_ROUNDS = 2
# Least squared share of a parameter's effect that no other parameter has.
_DISTINCT = 1e-13
# A cubic's parameters: the rows of C, the third as far as it moves, and the pupil's travel; before
# the travel stand those on which an image of distant points depends.
_FIRST, _SECOND, _THIRD, _TRAVEL = slice(0, 16), slice(16, 32), slice(32, 47), 47
# The columns of these, and that of 1, which follows the travel's.
_FAR = np.array([*range(_TRAVEL), _TRAVEL + 1])
# On which of them x depends, and y: on its own row, and on all that is no row of another.
_SEPARATE = np.array([[*range(16), *range(32, 48)], range(16, 48)])
WEIGHT_BEYOND = 0.1
"""Largest weight of pseudo-observations where no corners are."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NearestCubic:
    """The cubic that is nearest to a radial lens over the field that corners fill.

    Attributes:
        rays: (M, 3) unit rays, past the valid cone.
        within: (M,) which of them are as far from the axis as corners are.
        lens: the cubic, without a prior.
        miss: (M, 2) its pixels less the radial lens's at the rays.
        share: weight of the rays beyond corners by which it was found; 0 where none gave a cubic
            without a pole.

    """

    rays: FloatArray
    within: BoolArray
    lens: CubicFit
    miss: FloatArray
    share: float = 0.0

    @property
    def weights(self) -> FloatArray:
        """(M,) weights of rays in a linear solution: beyond corners the lens is a guess."""
        return np.where(self.within, 1.0, WEIGHT_BEYOND)

    @cached_property
    def parts(self) -> tuple[list[slice], list[slice]]:
        """The rays as far from the axis as corners are; those before, and those after them.

        Rays go outwards, so that each part is a row of them.
        """
        own = np.flatnonzero(self.within)
        first, stop = (int(own[0]), int(own[-1]) + 1) if own.size else (0, 0)
        beyond = slice(0, first), slice(stop, len(self.rays))
        return [slice(first, stop)], [one for one in beyond if one.start < one.stop]

    @cached_property
    def values(self) -> FloatArray:
        """(M, 16) the basis of cubics on the sphere at the rays, which are fixed."""
        return basis_values(self.rays)

    @cached_property
    def still(self) -> StillRays:
        """The rays as the lenses of P's prior see them."""
        return StillRays.of(self.rays)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tie:
    """Pseudo-observations that tie a lens to the nearest decentred one.

    That lens is as free as its kind allows: it follows, so that the prior does not fix what
    corners say about both lenses. Where no cubic can follow it, the prior ties P to the cubic that
    comes nearest: a firm prior would otherwise lead to some other lens, which a cubic meets better.

    Attributes:
        near: the rays, and the nearest cubic, near whose denominators P's are to stay.
        lens: a decentred lens that is near; the nearest cubic misses it as it misses the radial
            lens.
        weight: factor of the residuals, among corners.
        denominator_weight: pixels that a relative change of P3Φ by 1 counts as.

    """

    near: NearestCubic
    lens: DecentredFit
    weight: float
    denominator_weight: float

    @cached_property
    def denominators(self) -> FloatArray:
        """(17, 17) Gram matrix of P3Φ's relative changes, by P3's coefficients and 1."""
        near = self.near
        share = self.denominator_weight / (near.values @ near.lens.coefficients[2])
        unchanged = np.full(len(share), -self.denominator_weight)
        return gram(share[:, None] * near.values, unchanged)

    @cached_property
    def weights(self) -> FloatArray:
        """(M,) factors of the residuals at each ray.

        Where there are no corners that lens is a guess: it is enough to keep poles out there,
        and a firm prior would make P follow the guess at the cost of the corners.
        """
        return np.where(self.near.within, self.weight, min(self.weight, WEIGHT_BEYOND))

    def nearest(self, pixel: FloatArray) -> tuple[DecentredFit, tuple[FloatArray, FloatArray]]:
        """The decentred lens whose nearest cubic is nearest to pixels (M, 2), finite, at the rays.

        The lens sees all of them: where steps lead to one that does not, ``lens`` is as near as
        any.

        Returns:
            The lens; what it sees (M, 2), and its derivatives by the lens's parameters (M, 2, K).

        """
        lens, (seen, by_lens) = self.lens, self._sees
        weights, pixel = self.weights, pixel - self.near.miss
        for _ in range(_NEAREST_ROUNDS):
            rows = np.concatenate([by_lens.transpose(1, 2, 0), (seen - pixel).T[:, None]], axis=1)
            rows *= weights
            square = rows[0] @ rows[0].T + rows[1] @ rows[1].T + lens.pulls()
            step = _follow(square[:-1, :-1], square[:-1, -1:])[:, 0]
            moved = lens.with_parameters(lens.parameters - step)
            sees = moved.seen(self.near.still)
            if not np.isfinite(sees[0]).all():
                return self.lens, self._sees
            lens, (seen, by_lens) = moved, sees
        return lens, (seen, by_lens)

    @cached_property
    def _sees(self) -> tuple[FloatArray, FloatArray]:
        """The lens's pixels of the rays, and their derivatives."""
        return self.lens.seen(self.near.still)


@dataclass(frozen=True, kw_only=True, eq=False)
class CubicFit(FitLens):
    """The ``ray`` lift in the 16 dimensions that cubics span on the sphere (Eq. 5–7).

    P = T C Bᵀ: B is the orthonormal (20, 16) basis, T the Hartley normalisation of pixels. The
    homogeneous scale is fixed by keeping the mean of P3Φ over the prior's rays at 1, which is
    linear, so 47 parameters are free. The prior also fixes the rotation of the camera frame.

    Attributes:
        coefficients: (3, 16) C.
        denominator_basis: (16, 15) the directions in which P3's coefficients may move.
        centre, scale: pixels are (m − centre) / scale inside.
        tie: the pseudo-observations; None without a prior.
        pupil_travel: travel of the entrance pupil (:mod:`cubicfish.models.pupil`), in the unit
            of the points: P is for points that are far away.
        travel_weight: pixels that a travel of 1 counts as, in the prior that pulls it to 0.

    """

    coefficients: FloatArray
    denominator_basis: FloatArray
    centre: FloatArray
    scale: float
    tie: Tie | None = None
    pupil_travel: float = 0.0
    travel_weight: float = 0.0

    @property
    def parameters(self) -> FloatArray:
        """(48,)."""
        first, second, third = self.coefficients
        return np.concatenate(
            [first, second, self.denominator_basis.T @ third, [self.pupil_travel]]
        )

    def with_parameters(self, parameters: FloatArray) -> CubicFit:
        """The same lens with other parameters."""
        third = self.coefficients[2]
        moved = parameters[_THIRD] - self.denominator_basis.T @ third
        rows = parameters[_FIRST], parameters[_SECOND], third + self.denominator_basis @ moved
        return replace(self, coefficients=np.stack(rows), pupil_travel=float(parameters[_TRAVEL]))

    def with_pixels_of(self, other: CubicFit, rays: FloatArray) -> CubicFit:
        """The P of another, pixels and scale normalised as here: the mean of P3Φ over rays is 1.

        Args:
            other: the other.
            rays: (M, 3) those by which this one is normalised.

        """
        coefficients = other.coefficients.copy()
        coefficients[:2] *= other.scale / self.scale
        away = (other.centre - self.centre) / self.scale
        coefficients[:2] += away[:, None] * coefficients[2]
        mean = float((basis_values(rays) @ coefficients[2]).mean())
        return replace(self, coefficients=coefficients / mean)

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`~cubicfish.solve.fit_lens.FitLens`."""
        pixel, by_point, parts, _ = self.separate_slopes(points)
        return pixel, by_point, _join(parts)

    def separate_slopes(
        self, points: FloatArray
    ) -> tuple[FloatArray, FloatArray, Sequence[FloatArray], IntArray]:
        """See :class:`~cubicfish.solve.fit_lens.FitLens`."""
        moved, by_point, by_travel = from_pupil_and_slopes(points, self.pupil_travel)
        pixel, d_point, parts = self._differentiate_far(moved)
        by_depth = d_point[:, 2]
        parts.append((by_depth * by_travel)[:, None])
        d_point = d_point + by_depth[:, None] * by_point.T
        return pixel, d_point.transpose(2, 0, 1), parts, _SEPARATE

    def far_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As :meth:`pixel_and_slopes`, for distant points."""
        pixel, d_point, parts = self._differentiate_far(points)
        return pixel, d_point.transpose(2, 0, 1), _join(parts)

    def _differentiate_far(
        self, points: FloatArray
    ) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
        """Pixel (N, 2), d/d point (2, 3, N), and d/d P in parts: see :meth:`separate_slopes`."""
        length = np.sqrt(np.einsum("ij,ij->i", points, points))
        rays = points / length[:, None]
        lifted = lift(rays).T
        values = (sphere_basis().T @ lifted).T
        pixel, denominator = self._compute_pixel(values)
        # Working on one coordinate of all points after the other is fastest.
        across = cubic_gradients(self.coefficients @ sphere_basis().T, lifted)
        slope = across[:2] - pixel.T[:, None] * across[2]
        slope *= self.scale / denominator
        return (
            pixel * self.scale + self.centre,
            _convert_slope(slope, rays.T, length),
            self._differentiate(values, pixel, denominator),
        )

    def project(self, points: FloatArray) -> FloatArray:
        """See :class:`~cubicfish.solve.fit_lens.FitLens`."""
        return self.far(from_pupil(points, self.pupil_travel))

    def far(self, points: FloatArray) -> FloatArray:
        """Distant points (N, 3) -> pixels (N, 2)."""
        rays = points / np.linalg.norm(points, axis=-1, keepdims=True)
        return self._compute_pixel(basis_values(rays))[0] * self.scale + self.centre

    def pulls(self) -> FloatArray:
        """See :class:`~cubicfish.solve.fit_lens.FitLens`."""
        return self._pulls

    @cached_property
    def _pulls(self) -> FloatArray:
        weight = 0.0 if self.tie is None else self.tie.weight
        return self.pulls_under(np.array([weight]))[0]

    def pulls_under(self, weights: FloatArray) -> FloatArray:
        """(H, 49, 49) the priors under H weights, all at once; see :meth:`pulls`.

        They are weighted differences to the nearest lens of the prior's kind, and to its
        denominators. That lens's own parameters are eliminated (variable projection, Golub &
        Pereyra 1973; the derivatives are Kaufman's, whose gradient is exact); the lens that is
        nearest under the present weight follows linearly.

        Pixels alone leave room for a pole that a zero of both numerators all but cancels (a
        Froissart doublet): it bends the picture at a few corners and nowhere else. A cubic P3Φ that
        vanishes somewhere differs widely from one that is positive on the whole cone.

        Args:
            weights: (H,) weights of the prior; see :attr:`Tie.weight`.

        """
        prior, pull = self.tie, np.array([1, self.pupil_travel]) * self.travel_weight
        grams = np.zeros((len(weights), _TRAVEL + 2, _TRAVEL + 2))
        grams[:, _TRAVEL:, _TRAVEL:] = np.outer(pull, pull)
        if prior is None:
            return grams
        near = prior.near
        pixel, by_P = self.see_still(near.values)
        if not np.isfinite(pixel).all():  # a bad step, which its cost rejects
            return np.full_like(grams, np.inf)
        decentred, (seen, by_lens) = prior.nearest(pixel)
        # Derivatives by P's parameters, those by the lens's, and the miss.
        miss = (pixel - near.miss - seen).T[:, None]
        rows = np.concatenate([by_P, -by_lens.transpose(1, 2, 0), miss], axis=1)
        squares = np.square([weights, np.minimum(weights, WEIGHT_BEYOND)])[:, :, None, None]
        size = _TRAVEL + by_lens.shape[2] + 1
        whole = np.zeros((len(weights), size, size))
        for square, places in zip(squares, near.parts, strict=True):
            for place in places:
                whole += square * gram_of_separate(rows[:, :, place])
        whole[:, _TRAVEL:, _TRAVEL:] += decentred.pulls()
        kept = np.r_[:_TRAVEL, size - 1]
        cross = whole[:, _TRAVEL:-1, kept]
        followed = _follow(whole[:, _TRAVEL:-1, _TRAVEL:-1], cross)
        left = whole[:, kept[:, None], kept] - cross.transpose(0, 2, 1) @ followed
        by_values = np.zeros((len(self.coefficients[2]) + 1, _TRAVEL + 1))
        by_values[:-1, _THIRD], by_values[:-1, -1] = self.denominator_basis, self.coefficients[2]
        by_values[-1, -1] = 1
        grams[:, _FAR[:, None], _FAR] += left + by_values.T @ prior.denominators @ by_values
        return grams

    def see_still(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What the lens sees of distant points that do not move.

        Args:
            values: (M, 16) the basis of cubics on the sphere at their rays.

        Returns:
            Pixel (M, 2); and the derivatives by the parameters of P on which x and y depend
            (2, 31, M), which :func:`gram_of_separate` sums up.

        """
        inside, denominator = self._compute_pixel(values)
        same, apart = self._differentiate(values, inside, denominator)
        by_P = np.empty((2, same.shape[1] + apart.shape[1], len(values)))
        by_P[:, : same.shape[1]], by_P[:, same.shape[1] :] = same, apart
        return inside * self.scale + self.centre, by_P

    def _compute_pixel(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        homogeneous = self.coefficients @ values.T
        denominator = homogeneous[2]
        # A pole on the way is a bad step, not an error: its infinite cost rejects it.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            pixel = homogeneous[:2] / denominator
        pixel[:, ~(denominator > 0)] = np.inf
        return pixel.T, denominator

    def _differentiate(
        self, values: FloatArray, pixel: FloatArray, denominator: FloatArray
    ) -> list[FloatArray]:
        """Pixels, of order 1, by the own row of C, (1, 16, N), and by the third, (2, 15, N)."""
        share = values.T * (self.scale / denominator)
        by_denominator = self.denominator_basis.T @ share
        return [share[None], -pixel.T[:, None] * by_denominator]

    @property
    def P(self) -> FloatArray:
        """(3, 20) in pixels, Frobenius norm 1, P3Φ positive on the prior's rays."""
        scale, (x, y) = self.scale, self.centre
        to_pixels = np.array([[scale, 0, x], [0, scale, y], [0, 0, 1]])
        P = to_pixels @ self.coefficients @ sphere_basis().T
        return P / np.linalg.norm(P)


def gram_of_separate(rows: FloatArray) -> FloatArray:
    """Products of derivatives by P and of other rows, (47 + C, 47 + C).

    Args:
        rows: (2, 31 + C, M) of x and of y: those of :meth:`CubicFit.see_still`, and C others.

    """
    of_P = _SEPARATE[:, :-1]
    size = _TRAVEL + rows.shape[1] - of_P.shape[1]
    products = np.zeros((size, size))
    for row, columns in zip(rows, of_P, strict=True):
        own = np.append(columns, np.arange(_TRAVEL, size))
        products[own[:, None], own] += row @ row.T
    return products


def _join(parts: Sequence[FloatArray]) -> FloatArray:
    """(N, 2, 48) derivatives by all parameters of a cubic, from those of x and y apart."""
    slope = np.zeros((2, _TRAVEL + 1, parts[0].shape[2]))
    first = 0
    for part in parts:
        stop = first + part.shape[1]
        for axis, columns in enumerate(_SEPARATE[:, first:stop]):
            slope[axis, columns] = part[axis if len(part) > 1 else 0]
        first = stop
    return slope.transpose(2, 0, 1)


def _follow(square: FloatArray, cross: FloatArray) -> FloatArray:
    """How parameters follow other things: (..., K, K) JᵀJ and (..., K, n) Jᵀ times these.

    Parameters of a narrow lens can hardly be distinguished; those lost in rounding stay.
    """
    index = np.arange(square.shape[-1])
    square[..., index, index] *= 1 + _DISTINCT
    return solve_scaled(square, cross)


def _convert_slope(slope: FloatArray, rays: FloatArray, length: FloatArray) -> FloatArray:
    """Convert d/d unit ray to d/d point: the derivative of X/‖X‖ is (I − d dᵀ)/‖X‖.

    Args:
        slope: (2, 3, N).
        rays: (3, N).
        length: (N,) of the points.

    """
    radial = (slope * rays).sum(axis=1)
    return np.asarray((slope - radial[:, None] * rays) / length)
