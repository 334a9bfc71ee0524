"""Levenberg–Marquardt over a lens, the poses of all photos and the target (Zhu & Yin, Eq. 10)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.fit import robust
from cubicfish_cli.core.fit.deformable_target import DeformableTarget
from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.linearise import State, huber_cost, linearise
from cubicfish_cli.core.fit.normal_equations import NormalEquations
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.rig_lens import body_of
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import BoolArray, FloatArray

L = TypeVar("L", bound=FitLens)

_MAX_ITERATIONS = 100
_RELATIVE_DECREASE = 1e-10
# Below this share, what is left to gain is lost in the rounding of the cost.
_ROUNDING = 1e-13
# Where a straight step leads up, and on from there the cost changes by less than this share, it is
# the bottom as far as many photos tell: there is always one whose pose rocks between two places.
_IMMATERIAL = 1e-8
# Of the poses that went astray, at least.
_FIRM = 1.0
COLD_DAMPING = 1e-4
"""First damping for a start that may be far from the optimum."""
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

    Returns:
        The best state found. A step that does not lower the cost is never taken.

    Raises:
        FitError: the start itself sees a point at infinity.

    """
    state = State(lens, poses, DeformableTarget(nominal=pairs.world) if world is None else world)
    now = _evaluated(state, pairs, huber_px)
    if now.normal is None:
        raise FitError(
            "the start of the fit sees corners at infinity: check that the corners are named "
            "rightly and that the camera belongs to these photos"
        )
    normal = now.normal
    near, iterations = damping < COLD_DAMPING, 0
    pose_damping = np.zeros((len(poses), 1))
    while iterations < max_iterations:
        step = normal.solve(damping, pose_damping)
        gain = normal.expected_decrease(step) / max(now.cost, 1e-300)
        # Far from the optimum, or damped, a step says too little of what is left to gain.
        if near and gain < relative_decrease and damping < COLD_DAMPING:
            break
        iterations += 1
        candidate = state.moved(*step)
        new = _evaluated(candidate, pairs, huber_px)
        least = relative_decrease
        if not new.cost < now.cost and gain > _ROUNDING and iterations < max_iterations:
            iterations += 1
            least = max(relative_decrease, _IMMATERIAL)
            astray = _astray(state, pairs, huber_px, now, new)
            if astray.any():  # these alone are held firmly, and stop no others
                pose_damping[astray] = np.maximum(10 * pose_damping[astray], _FIRM)
                candidate = state.moved(*normal.solve(damping, pose_damping))
                new = _evaluated(candidate, pairs, huber_px)
            elif new.normal is not None:
                # A valley that bends: what went straight on is on its side, above its floor.
                candidate = candidate.moved(*new.normal.solve(damping))
                new = _evaluated(candidate, pairs, huber_px)
        if new.normal is not None and new.cost < now.cost:
            decrease = (now.cost - new.cost) / max(now.cost, 1e-300)
            state, now, normal = candidate, new, new.normal
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
    )


@dataclass(frozen=True, eq=False)
class _Evaluation:
    """Cost, residuals and normal equations of a state; None where the cost is infinite."""

    cost: float
    residual: FloatArray
    normal: NormalEquations | None = None


def _evaluated(state: State[Any], pairs: Observations, huber_px: float) -> _Evaluation:
    """Evaluate a state with its derivatives at once: nearly every step that is tried is taken."""
    normal, world = NormalEquations.zeros(*state.size), state.world
    residual, cost = np.empty_like(pairs.pixel), 0.0
    # A step may lead anywhere: what overflows there has an infinite cost and is turned down.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for run, terms in linearise(state, pairs, huber_px):
            residual[run] = terms.residual
            length = np.hypot(terms.residual[:, 0], terms.residual[:, 1])
            cost += float(pairs.weight[run] @ huber_cost(length, huber_px))
            if np.isfinite(cost):
                normal.add(terms, world.corner[run])
        prior = state.lens.prior()
        offset = (world.offset_weight * world.offsets).reshape(-1)
        cost += 0.5 * float(prior[-1, -1] + world.prior()[-1, -1] + offset @ offset)
        if not np.isfinite(cost):
            return _Evaluation(np.inf, residual)
        return _Evaluation(cost, residual, normal.held(prior, world))


def _astray(
    state: State[Any], pairs: Observations, huber_px: float, now: _Evaluation, new: _Evaluation
) -> BoolArray:
    """(M,) poses whose cost a step raised by far, where it lowers that of the others; else none.

    Of many photos there is always one whose pose goes astray.
    """
    count = len(state.poses)
    shot = body_of(state.lens, count).shot_of(pairs.image)
    rise = np.zeros(count)
    for sign, of in ((1, new), (-1, now)):
        cost = huber_cost(np.hypot(of.residual[:, 0], of.residual[:, 1]), huber_px)
        rise += sign * np.bincount(shot, pairs.weight * cost, count)
    known = np.isfinite(rise)
    risen = ~known | (rise > np.abs(rise[known]).sum() / count)
    return risen & bool(rise[~risen].sum() < 0)
