"""Fitting the target with the camera: boards' shapes and places, or each corner's place too."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from cubicfish.fit.cubic_fit import CameraFit, fit_cubic
from cubicfish.fit.folds import folds_of
from cubicfish.fit.prior import RADIAL, choose_prior
from cubicfish.fit.radial_reference import refit_radial
from cubicfish.judge.verdict import FEWEST_OF_A_CUBIC
from cubicfish.solve.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish.solve.deformable_target import NominalTarget, TargetModel
from cubicfish.solve.fit_lens import FitLens
from cubicfish.solve.normal_equations import solve_scaled
from cubicfish.solve.statistics import huber_px, noise_px, weighed
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import IntArray

L = TypeVar("L", bound=FitLens)

_ROUGH_DECREASE = 1e-5
# Median length of a 3D normal vector of unit standard deviation per component.
_MEDIAN_OF_MAXWELL = 1.53817
FIRST_SPREAD = 3e-3
"""Corners' offsets start from this share of the target's typical extent, which is more than prints
have. From there the spread that the data show is found in a few rounds, from below in hundreds: a
firm prior shows nothing but itself."""
_SMALLEST_SPREAD = 1e-7
_SPREAD_ROUNDS = 6
_SPREAD_CONVERGED = 0.1


def fit_nominal_target(rough: CameraFit, target: Target | None, scale: float) -> CameraFit:
    """Fit to the nominal target, with photos weighted by their noise, under the chosen prior of P.

    Args:
        rough: a fit to pairs with nominal world points, divided by ``scale``.
        target: the nominal target; None for pairs without one.
        scale: the target's units in one unit of these pairs.

    Raises:
        FitError: no prior gives a sound camera.

    """
    nominal = NominalTarget(target=target, pairs=rough.reference.pairs, scale=scale)
    pairs = weighed(nominal.pairs, rough.residual)
    reference = refit_radial(rough.reference, pairs, rough.poses)
    start = replace(rough, nominal=nominal)
    if len(pairs.pixel) < FEWEST_OF_A_CUBIC:
        return fit_cubic(reference, RADIAL, start=start)
    return choose_prior(reference, folds_of(reference), start=start, everywhere=True)


def refine_object(fit: CameraFit, level: TargetModel, groups: Sequence[IntArray]) -> CameraFit:
    """Let the target depart from the nominal one, as far as the pairs show, at the next level.

    Args:
        fit: a fit at a lower level, from whose camera and poses to start.
        level: ``shape`` or ``points``.
        groups: photos that are left out together to choose the prior of P; see
            :func:`~cubicfish.fit.cubic_fit.choose_prior`.

    The fit is good to compare and to continue from; :func:`to_the_bottom` converges it fully.

    Raises:
        FitError: no sound camera was found.
        ValueError: the nominal target is unknown.

    """
    nominal, spread = fit.nominal, FIRST_SPREAD if level == "points" else None
    free = nominal.free(noise=noise_px(fit.errors), offset_spread=spread).started(fit.world)
    pairs = replace(nominal.pairs_at(level), weight=fit.reference.pairs.weight)
    # Roughly first: the reference and the joint fit follow. Residuals to the nominal target are too
    # large to set the scale of the loss by.
    lens, poses, limit = fit.lens, fit.poses, 2 * huber_px(np.full((1, 2), free.noise))
    adjusted = estimate_spread(
        adjust(lens, poses, pairs, limit, world=free, relative_decrease=1e-3, damping=WARM_DAMPING),
        pairs,
    ).without_equations()
    # With the target near its place: the reference again, the prior of P, then the joint fit.
    pairs = weighed(nominal.pairs_at(level), adjusted.residual)
    pairs = pairs.with_world(adjusted.world.points)
    reference = refit_radial(fit.reference, pairs, adjusted.poses)
    world = replace(adjusted.world, noise=noise_px(adjusted.errors))
    near = replace(fit, **{**vars(adjusted), "world": world})
    return choose_prior(reference, groups, start=near).followed()


def to_the_bottom(fit: CameraFit) -> CameraFit:
    """Converge a fit to the last digit that counts, which comparisons do not need."""
    found = fit_cubic(fit.reference, fit.prior, start=fit)
    found = replace(
        found, runners_up=fit.runners_up, held_out=fit.held_out, other_levels=fit.other_levels
    )
    return found.followed()


def estimate_spread(fit: Adjustment[L], pairs: Observations) -> Adjustment[L]:
    """Let the prior's spreads of shapes, places and offsets follow the data.

    Expectation and maximisation in turn: a variance is the squared estimate plus what the pairs
    leave open. Loose pulls would leave a board that few photos show wherever their noise puts it.
    """
    for _ in range(_SPREAD_ROUNDS):
        before, noise = fit.world, noise_px(fit.errors)
        world, count = replace(before, noise=noise), len(before.parameters)
        if count:
            hessian = fit.normal.reduced_shared()
            inverse = solve_scaled(hessian, np.eye(len(hessian))[:, -count:])
            world = world.with_spreads(noise**2 * np.diagonal(inverse[-count:]))
        if len(world.offsets):
            world = replace(world, offset_spread=_estimate_offset_spread(fit, noise))
        fit = fit.without_equations()
        fit = fit.again(
            pairs,
            world=world,
            relative_decrease=_ROUGH_DECREASE,
            damping=WARM_DAMPING,
            limit=huber_px,
        )
        change = np.log(world.spread / before.spread)
        if len(world.offsets):
            change = np.append(change, np.log(world.offset_spread / before.offset_spread))
        if np.all(np.abs(change) < _SPREAD_CONVERGED):
            break
    return fit


def _estimate_offset_spread(fit: Adjustment[Any], noise: float) -> float:
    """Estimate the spread of corners' own offsets; it stays where no corner is seen twice.

    Medians stand for means, since a few corners (a smudge, a knock) are off by much more.
    """
    world = fit.world
    often = np.bincount(world.corner, minlength=len(world.offsets)) >= 2
    if not often.any():
        return world.offset_spread
    length = np.linalg.norm(world.offsets[often], axis=1)
    covariance = noise**2 * np.linalg.inv(fit.normal.corner[often])
    left_open = np.trace(covariance, axis1=1, axis2=2) / 3
    found = np.median(length) / _MEDIAN_OF_MAXWELL
    return max(float(np.sqrt(found**2 + np.median(left_open))), _SMALLEST_SPREAD)
