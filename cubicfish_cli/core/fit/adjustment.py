"""Levenberg–Marquardt over a lens, the poses of all photos and the target (Zhu & Yin, Eq. 10)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.fit import robust
from cubicfish_cli.core.fit.deformable_target import DeformableTarget
from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.linearise import State, huber_cost, runs_linearised
from cubicfish_cli.core.fit.normal_equations import COLD_DAMPING, NormalEquations, NormalSums
from cubicfish_cli.core.fit.pose_refinement import find_stray_poses, refine_poses
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray

L = TypeVar("L", bound=FitLens)

_MAX_ITERATIONS = 100
_RELATIVE_DECREASE = 1e-10
# Below this share, what is left to gain is lost in the rounding of the cost.
_ROUNDING = 1e-13
# Where a straight step leads up, and on from there the cost changes by less than this share, it is
# the bottom as far as many photos tell: there is always one whose pose rocks between two places.
_IMMATERIAL = 1e-8
# What residuals say of their noise is less certain than this share.
_SAME_LIMIT = 0.02
# What an adjustment looks at of its pairs, beside their world points.
_OF_PAIRS = ("image", "pixel", "weight")
WARM_DAMPING = 1e-10
"""For a start at the optimum of nearly the same pairs."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Adjustment(Generic[L]):
    """Where Levenberg–Marquardt stopped.

    Attributes:
        lens: the adjusted lens.
        poses: camera_from_world of every photo; of a rig, rig_from_world of every shot.
        world: the adjusted target.
        residual: (N, 2) projection less pixel, unweighted, pixels.
        cost: robust cost at the end, priors included.
        iterations: how many steps were tried.
        normal: the normal equations at the end.
        pairs: the pairs.
        huber_px: from where on the loss was linear.
        sums: what the pairs put into ``normal``; None where lens, poses and world are a step ahead.

    """

    lens: L
    poses: Poses
    world: DeformableTarget
    residual: FloatArray
    cost: float
    iterations: int
    normal: NormalEquations
    pairs: Observations
    huber_px: float
    sums: NormalSums | None

    @property
    def errors(self) -> FloatArray:
        """(K, 2) residuals of the pairs whose error the fit can tell."""
        return self.residual[self.pairs.tells_error]

    @property
    def state(self) -> State[L]:
        """Where it stopped."""
        return State(self.lens, self.poses, self.world)

    def again(
        self,
        pairs: Observations,
        *,
        world: DeformableTarget | None = None,
        relative_decrease: float = _RELATIVE_DECREASE,
        damping: float = COLD_DAMPING,
        limit: Callable[[FloatArray], float] = robust.wide_px,
    ) -> Adjustment[L]:
        """Adjust on from here, with a loss that follows what residuals there are.

        The arguments are those of :func:`adjust`; the target is by default as free as it was, and
        ``limit`` says of residuals (N, 2) where the loss turns linear, pixels.
        """
        return adjust(
            self.lens,
            self.poses,
            pairs,
            huber_px=limit(self.errors),
            world=self.world if world is None else world,
            relative_decrease=relative_decrease,
            damping=damping,
            known=self,
        )


def adjust(
    lens: L,
    poses: Poses,
    pairs: Observations,
    *,
    huber_px: float,
    world: DeformableTarget | None = None,
    max_iterations: int = _MAX_ITERATIONS,
    relative_decrease: float = _RELATIVE_DECREASE,
    damping: float = COLD_DAMPING,
    trust_last: bool = False,
    known: Adjustment[Any] | None = None,
) -> Adjustment[L]:
    """Minimise the Huber loss of the reprojection error over lens, poses and target.

    Args:
        lens: the start; its prior is part of the cost.
        poses: the start, one for each of ``pairs.images``, or of a rig one for each shot.
        pairs: 2D-3D pairs, sorted by photo.
        huber_px: distance in pixels from which a pair's pull stops growing.
        world: the target's points and what of them is free; by default ``pairs.world``, fixed.
        max_iterations: steps to try at most.
        relative_decrease: stop when a step lowers the cost by less than this share.
        damping: of the first step; less near the optimum.
        trust_last: near the optimum, also take the step that is too small to be worth looking at.
            Lens, poses and target are then right to its square; what is said of residuals, cost
            and equations is of the state before.
        known: an adjustment that may have ended in this start, if perhaps under other priors: what
            it knows of the pairs is not worked out again. Its ``huber_px`` stays where this one is
            nearly the same.

    Returns:
        The best state found. A step that does not lower the cost is never taken.

    Raises:
        FitError: the start itself sees a point at infinity.

    """
    state = State(lens, poses, DeformableTarget(nominal=pairs.world) if world is None else world)
    if known is not None and abs(huber_px / known.huber_px - 1) < _SAME_LIMIT:
        huber_px = known.huber_px
    now = _known(known, state, pairs, huber_px) or _evaluated(state, pairs, huber_px)
    if now.normal is None:
        raise FitError(
            "the start of the fit sees corners at infinity: check that the corners are named "
            "rightly and that the camera belongs to these photos"
        )
    normal, sums = now.normal, now.sums
    near, iterations = damping < COLD_DAMPING, 0
    pose_damping = np.zeros((len(poses), 1))
    while iterations < max_iterations:
        step = normal.solve(damping, pose_damping)
        gain = normal.expected_decrease(step) / max(now.cost, 1e-300)
        # Far from the optimum, or damped, a step says too little of what is left to gain.
        if near and gain < relative_decrease and damping < COLD_DAMPING:
            if trust_last:
                state, sums = state.moved(*step), None
            break
        iterations += 1
        candidate = state.moved(*step)
        new = _evaluated(candidate, pairs, huber_px)
        stray = not new.cost < now.cost and gain > _ROUNDING and iterations < max_iterations
        if stray:
            iterations += 1
            astray = find_stray_poses(candidate, new.residual, now.residual, pairs, huber_px)
            if astray.size:
                candidate = refine_poses(
                    candidate, state.poses, astray, pairs, huber_px, pose_damping
                )
            elif new.normal is not None:
                # A valley that bends: what went straight on is on its side, above its floor.
                candidate = candidate.moved(*new.normal.solve(damping))
            new = _evaluated(candidate, pairs, huber_px)
        least = max(relative_decrease, _IMMATERIAL) if stray else relative_decrease
        if new.normal is not None and new.cost < now.cost:
            decrease = (now.cost - new.cost) / max(now.cost, 1e-300)
            state, now, normal, sums = candidate, new, new.normal, new.sums
            damping = max(damping / 10, 1e-12)
            pose_damping *= 0.1
            if decrease < least:
                break
        else:
            damping *= 10
            if damping > 1e8 or gain < _ROUNDING or new.cost < (1 + least) * now.cost:
                break
    return Adjustment(
        lens=state.lens,
        poses=state.poses,
        world=state.world,
        residual=now.residual,
        cost=now.cost,
        iterations=iterations,
        normal=normal,
        pairs=pairs,
        huber_px=huber_px,
        sums=sums,
    )


@dataclass(frozen=True, eq=False)
class _Evaluation:
    """Cost, residuals and normal equations of a state; None where the cost is infinite."""

    cost: float
    residual: FloatArray
    normal: NormalEquations | None = None
    sums: NormalSums | None = None


def _evaluated(state: State[Any], pairs: Observations, huber_px: float) -> _Evaluation:
    """Evaluate a state with its derivatives at once: nearly every step that is tried is taken."""
    lens, world = state.lens, state.world
    sums = NormalSums(len(lens.parameters), len(world.parameters), len(state.poses), world)
    residual, finite = np.empty_like(pairs.pixel), True
    # A step may lead anywhere: what overflows there has an infinite cost and is turned down.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for photos, run, terms, root in runs_linearised(lens, state.poses, world, pairs, huber_px):
            residual[run] = terms.residual
            finite = finite and bool(np.isfinite(terms.residual).all())
            if finite:
                sums.add(terms, root, photos, pairs.image[run], run)
    if not finite:
        return _Evaluation(np.inf, residual)
    return _with_priors(state, pairs, huber_px, residual, sums)


def _known(
    fit: Adjustment[Any] | None, state: State[Any], pairs: Observations, huber_px: float
) -> _Evaluation | None:
    """A state that another adjustment ended in; None where its sums are not those of this one."""
    if fit is None or fit.sums is None or fit.poses is not state.poses:
        return None
    same = (
        all(getattr(fit.pairs, name) is getattr(pairs, name) for name in _OF_PAIRS)
        and type(fit.lens) is type(state.lens)
        and np.array_equal(fit.lens.parameters, state.lens.parameters)
        and fit.world.offsets.shape == state.world.offsets.shape
        and fit.world.parameters.shape == state.world.parameters.shape
        and np.array_equal(fit.world.points, state.world.points)
    )
    longest = np.hypot(fit.residual[:, 0], fit.residual[:, 1]).max()
    if not same or (longest > min(huber_px, fit.huber_px) and huber_px != fit.huber_px):
        return None
    return _with_priors(state, pairs, huber_px, fit.residual, fit.sums)


def _with_priors(
    state: State[Any],
    pairs: Observations,
    huber_px: float,
    residual: FloatArray,
    sums: NormalSums,
) -> _Evaluation:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        priors = state.lens.prior(), state.world.prior()
        cost = _cost(residual, pairs, huber_px, priors, state.world)
    if not np.isfinite(cost):
        return _Evaluation(np.inf, residual)
    return _Evaluation(cost, residual, sums.equations(priors[0], state.world), sums)


def _cost(
    residual: FloatArray,
    pairs: Observations,
    huber_px: float,
    priors: Sequence[FloatArray],
    world: DeformableTarget,
) -> float:
    distance = np.hypot(residual[:, 0], residual[:, 1])
    offset = (world.offset_weight * world.offsets).reshape(-1)
    pulls = sum(float(prior[-1, -1]) for prior in priors) + offset @ offset
    return float(pairs.weight @ huber_cost(distance, huber_px) + 0.5 * pulls)
