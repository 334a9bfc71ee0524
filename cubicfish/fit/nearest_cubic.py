"""The cubic nearest to a radial lens or to a decentred one: P's prior's centre, its fit's start.

First it is found by linear least squares (Zhu & Yin 2010, Eq. 8–9), then in pixels. The linear
equations u·P3Φ − P1Φ = 0 and v·P3Φ − P2Φ = 0 weight each pair by its unknown denominator P3Φ, which
biases the plain solution. Dividing by the previous round's denominator (Sanathanan & Koerner 1963)
removes that.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from cubicfish.fit.lenses import CubicFit, NearestCubic, gram_of_separate
from cubicfish.models.cubic import pole_or_fold_deg
from cubicfish.models.lift import basis_values
from cubicfish.models.radial import RadialCamera
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.descent import descended
from cubicfish.solve.normal_equations import gram, solve_scaled
from cubicfish.types import FloatArray

ROUNDS = 10
# Rounds end when no denominator changes by more than this share of their mean, and least squares in
# pixels when neither cost nor P does.
_STEADY = 1e-6
# A pair beside a pole must not get an unbounded weight in the next round.
_SMALLEST_SHARE = 0.02
MARGIN_DEG = 5.0
"""The valid cone reaches this far beyond the farthest corner."""
# The prior's cone reaches this far beyond the farthest corner: past the valid cone.
_PRIOR_MARGIN_DEG = 10.0
_PRIOR_RAYS = 300
# This near to half a turn from the axis, a ray's azimuth says nothing.
_LARGEST_ANGLE_DEG = 175.0
# Near its fold the reference's profile is flat; the prior stays short of the fold.
_FOLD_SHARE = 0.98
# Pull in normalised pixels that leads least squares to the nearest cubic without a pole on the way.
DENOMINATOR_PULL = 1e-4
SAFER_PULLS = (1e-2, 1.0, 100.0)
"""Each is safer and less exact than the one before: P3Φ nears a constant."""
# Weights of rays where there are no corners: as small as keeps poles out. The radial lens is a
# guess there, and a profile with many coefficients makes of it what no cubic can follow.
_SHARES_BEYOND = (1e-3, 1e-2, 1e-1, 1.0)
_MOST = 100  # evaluations
# The same for the cubic near which P3Φ is only expected and from which a fit goes on: Gauss-Newton
# steps, at most, and the share of its squared miss to which one must lower it to be worth another.
_DECENTRED_ROUNDS, _WORTH_ANOTHER = 8, 0.5
# As a share of the diagonal: what is lost in rounding stays.
_ROUNDING = 1e-9
_FREE = 47  # numbers of P, its scale fixed
# Far below the noise of any corner.
_CLOSE_PX = 0.01
# Error of a ray that the lens of a step does not see, pixels.
_UNSEEN_PX = 1e3


def linear_ratios(
    values: FloatArray,
    pixel: FloatArray,
    *,
    denominator_pull: float,
    rounds: int = ROUNDS,
    weights: FloatArray | None = None,
) -> FloatArray:
    """C (3, K) whose ratios of rows C · values are the pixels; the mean of C3 · values is 1.

    Solved in the row space of Φ (on the sphere it has 16 dimensions): with all 20 columns the
    smallest singular vector would be one of the cubics that vanish on all points. Rays that a
    smooth lens made leave the solution nearly free even then (numerator and denominator may share
    a factor), with poles wherever rounding puts them; a small pull of P3Φ towards 1 picks the tame
    one.

    Args:
        values: (N, K) Φ of each point in a basis of its row space.
        pixel: (N, 2), best normalised to order 1 (Hartley).
        denominator_pull: weight of C3 · values = 1 at each point; 0 is the homogeneous system of
            the paper.
        rounds: reweighting rounds, at most; 0 is the paper's plain solution.
        weights: (N,) of each point's two equations; 1 by default.

    """
    denominator = np.ones(len(values))
    weight = denominator if weights is None else weights
    coefficients = np.zeros((3, values.shape[1]))
    for _ in range(rounds + 1):
        rows = values * (weight / denominator)[:, None]
        zeros = np.zeros_like(rows)
        system = np.block(
            [[-rows, zeros, pixel[:, :1] * rows], [zeros, -rows, pixel[:, 1:] * rows]]
        )
        if denominator_pull > 0:
            pull = denominator_pull * np.hstack([zeros, zeros, values])
            wanted = np.concatenate([np.zeros(len(system)), np.full(len(pull), denominator_pull)])
            solution = np.linalg.lstsq(np.vstack([system, pull]), wanted, rcond=None)[0]
        else:
            # The triangular factor has the same right singular vectors and is small.
            solution = np.linalg.svd(np.linalg.qr(system, mode="r"))[2][-1]
        coefficients = solution.reshape(3, -1)
        found = values @ coefficients[2]
        scale = found.mean()
        coefficients, found = coefficients / scale, found / scale
        found = np.maximum(found, _SMALLEST_SHARE)
        converged = np.abs(found - denominator).max() < _STEADY
        denominator = found
        if converged:
            break
    return coefficients


def linear_cubic(
    rays: FloatArray,
    pixel: FloatArray,
    camera: RadialCamera,
    *,
    denominator_pull: float,
    weights: FloatArray | None = None,
) -> CubicFit:
    """P by linear least squares (Eq. 8–9, reweighted), without a prior.

    Args:
        rays: (N, 3) unit rays.
        pixel: (N, 2) where they are seen.
        camera: a lens like it, whose centre and focal length normalise pixels.
        denominator_pull: how firmly P3Φ is kept near a constant.
        weights: (N,) of each ray; 1 by default.

    """
    centre, scale = np.array([camera.cx, camera.cy]), (camera.fx + camera.fy) / 2
    values = basis_values(rays)
    return CubicFit(
        coefficients=linear_ratios(
            values, (pixel - centre) / scale, denominator_pull=denominator_pull, weights=weights
        ),
        denominator_basis=_denominator_basis(values),
        centre=centre,
        scale=scale,
    )


def _is_close(known: NearestCubic) -> bool:
    """Whether a cubic meets its lens so well that every start ends at it.

    Where none does, as for a mirror, there are several that are about as near.
    """
    return bool(known.share and np.abs(known.miss[known.within]).max(initial=0.0) < _CLOSE_PX)


def _denominator_basis(values: FloatArray) -> FloatArray:
    """(16, 15) the directions of P3's coefficients that leave its mean over rays (M, 16) alone."""
    return np.asarray(np.linalg.svd(values.mean(axis=0)[None])[2][1:].T)


def _on_other_rays(lens: CubicFit, rays: FloatArray) -> CubicFit:
    """The same P, its scale fixed by other rays (M, 3)."""
    moved = replace(lens, denominator_basis=_denominator_basis(basis_values(rays)))
    return moved.with_pixels_of(lens, rays)


def cone_angle(camera: RadialCamera, covered: float, margin_deg: float) -> float:
    """Half-angle of the cone that reaches so far beyond the corners, but short of a fold, radians.

    Args:
        camera: the radial lens.
        covered: angle from the axis of the farthest corner, radians.
        margin_deg: how far the cone reaches beyond the corner, degrees.

    """
    return min(
        covered + np.deg2rad(margin_deg),
        max(_FOLD_SHARE * camera.max_angle, covered),
        np.deg2rad(_LARGEST_ANGLE_DEG),
    )


def nearest_cubic(
    camera: RadialCamera,
    covered_angles: tuple[float, float],
    known: NearestCubic | None = None,
) -> NearestCubic:
    """Find the cubic nearest to a radial lens.

    The least squares of its pixels, all numbers of P free: the linear solution (Eq. 8–9), whose
    P3Φ is pulled to a constant, is up to a tenth of a pixel off on lenses of strong curvature.

    Args:
        camera: the radial lens.
        covered_angles: angles from the axis of the nearest and of the farthest corner, radians.
        known: the cubic nearest to a lens that is nearly this one, to start from.

    """
    first, last = covered_angles
    rays = cone_rays(cone_angle(camera, last, _PRIOR_MARGIN_DEG), _PRIOR_RAYS)
    within = (rays[:, 2] >= np.cos(last)) & (rays[:, 2] <= np.cos(first))
    pixel = camera.project(rays)
    valid_deg = float(np.rad2deg(cone_angle(camera, last, MARGIN_DEG)))

    def starts() -> Iterator[tuple[float, CubicFit]]:
        if known is not None and _is_close(known):
            yield known.share, _on_other_rays(known.lens, rays)
        for share, pull in product(_SHARES_BEYOND, (DENOMINATOR_PULL, *SAFER_PULLS)):
            weights = np.where(within, 1.0, share)
            yield (
                share,
                linear_cubic(rays, pixel, camera, denominator_pull=pull, weights=weights),
            )

    for share, start in starts():
        lens = refined_cubic(start, rays, pixel, weights=np.where(within, 1.0, share))
        miss = lens.far(rays) - pixel
        # The rays reach beyond the valid cone, and no pole may be there either.
        if np.isfinite(miss).all() and pole_or_fold_deg(lens.P, valid_deg) is None:
            return NearestCubic(rays=rays, within=within, lens=lens, miss=miss, share=share)
    # Every start has a pole: take the safest, whose P3Φ is nearly constant; no miss is known.
    return NearestCubic(rays=rays, within=within, lens=start, miss=np.zeros_like(pixel))


def nearest_decentred_cubic(
    near: NearestCubic, pixel: FloatArray, firm: float, valid_deg: float
) -> NearestCubic:
    """Find the cubic nearest to a decentred lens, from the one nearest to the radial lens.

    What the radial lens's cubic misses is no part of it: see
    :class:`~cubicfish.fit.lenses.Tie`.

    Args:
        near: the cubic nearest to the radial lens.
        pixel: (M, 2) where the decentred lens sees its rays; not finite where it sees none.
        firm: pixels that a relative change of P3Φ by 1 counts as, at each ray: what hardly changes
            pixels stays.
        valid_deg: half-angle of the valid cone, degrees.

    Returns:
        The cubic with the rays and the miss of ``near``; that one itself where the other has a pole
        or a fold in the valid cone.

    """
    lens, found, least = near.lens, near.lens, np.inf
    stiff, first = firm * near.values, near.lens.coefficients[2]
    index = np.arange(_FREE)
    for _ in range(_DECENTRED_ROUNDS):
        with np.errstate(all="ignore"):  # a step to a pole is not taken
            seen, by_P = lens.see_still(near.values)
            rows = np.concatenate([by_P, (seen - pixel - near.miss).T[:, None]], axis=1)
            square = gram_of_separate(rows * near.weights)
        drift = stiff @ (lens.coefficients[2] - first)
        square[32:, 32:] += gram(stiff @ lens.denominator_basis, drift)
        before, least = least, float(square[-1, -1])
        if not least < before:
            break
        found = lens
        if least > _WORTH_ANOTHER * before:
            break
        square[index, index] *= 1 + _ROUNDING
        step = solve_scaled(square[:-1, :-1], square[:-1, -1:])[:, 0]
        lens = lens.with_parameters(lens.parameters - np.append(step, 0.0))
    sees_all = np.isfinite(found.far(near.rays)).all()
    sound = sees_all and pole_or_fold_deg(found.P, valid_deg) is None
    return replace(near, lens=found) if sound else near


def refined_cubic(
    start: CubicFit,
    rays: FloatArray,
    pixel: FloatArray,
    *,
    weights: FloatArray | None = None,
    stiffness: float = 0.0,
) -> CubicFit:
    """Refine a cubic to see rays where they are seen, by least squares in pixels.

    The same numbers give the same cubic to the last bit.

    Args:
        start: a cubic that is near.
        rays: (M, 3) unit rays.
        pixel: (M, 2) where they are seen.
        weights: (M,) of each ray's miss; 1 by default.
        stiffness: pixels that a relative change of P3Φ by 1 counts as, at each ray.

    """
    root, values = 1.0 if weights is None else weights, basis_values(rays)
    stiff = stiffness * values if stiffness else np.zeros((0, 16))

    def square_of(lens: CubicFit) -> FloatArray:
        with np.errstate(all="ignore"):  # a step to a pole is not taken
            seen, by_P = lens.see_still(values)
            miss = np.nan_to_num(root * (seen - pixel).T, nan=_UNSEEN_PX, posinf=_UNSEEN_PX)
            by_P *= root
            by_P[~np.isfinite(by_P)] = 0
            square = gram_of_separate(np.concatenate([by_P, miss[:, None]], axis=1))
        drift = stiff @ (lens.coefficients[2] - start.coefficients[2])
        square[32:, 32:] += gram(stiff @ lens.denominator_basis, drift)
        return square

    return descended(start, square_of, _STEADY, _MOST)[0]
