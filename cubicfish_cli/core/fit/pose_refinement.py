"""Pose refinement of photos whose cost a step raises by far: alone, so that they stop no others.

Of many photos there is always one whose pose goes astray.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from cubicfish_cli.core.fit.deformable_target import DeformableTarget
from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.linearise import State, huber_cost, runs_linearised
from cubicfish_cli.core.fit.normal_equations import COLD_DAMPING, damped
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.rig_lens import RigLens, body_of
from cubicfish_cli.core.fit.subset import select
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

L = TypeVar("L", bound=FitLens)

# Steps of a photo that goes on by itself, each of which has to lower its cost by this share.
_POSE_ROUNDS = 20
_POSE_DECREASE = 1e-6


def find_stray_poses(
    state: State[Any],
    residual: FloatArray,
    before: FloatArray,
    pairs: Observations,
    huber_px: float,
) -> IntArray:
    """Poses whose cost a step raised by far, where it lowers that of the others; else none."""
    count = len(state.poses)
    shot = body_of(state.lens, count).shot_of(pairs.image)
    rise = _by_pose(residual, pairs, huber_px, shot, count)
    rise -= _by_pose(before, pairs, huber_px, shot, count)
    known = np.isfinite(rise)
    risen = ~known | (rise > np.abs(rise[known]).sum() / count)
    return np.flatnonzero(risen) if rise[~risen].sum() < 0 else np.zeros(0, np.intp)


def refine_poses(
    candidate: State[L],
    before: Poses,
    chosen: IntArray,
    pairs: Observations,
    huber_px: float,
    pose_damping: FloatArray,
) -> State[L]:
    """A candidate in which some poses are at an optimum of their own, each near where it was.

    How firmly they have to be held (M, 1) for their steps to lead down is written into the last
    argument.
    """
    body = body_of(candidate.lens, len(before))
    shot = body.shot_of(pairs.image)
    own_pairs = np.isin(shot, chosen)
    own, views = select(pairs, own_pairs)
    world = DeformableTarget(nominal=candidate.world.points[own_pairs])
    seen_from = np.searchsorted(chosen, body.shot[views])
    body = replace(body, camera=body.camera[views], shot=seen_from)
    poses = before[chosen]
    damping = np.full((len(chosen), 1), COLD_DAMPING)
    firm = damping.copy()
    cost, equations = _pose_equations(State(body, poses, world), own, huber_px)
    for _ in range(_POSE_ROUNDS):
        hessian = damped(equations[:, :, :6], damping)
        step = np.asarray(np.linalg.solve(hessian, -equations[:, :, 6:]), float)
        tried = poses.moved(step[:, :, 0])
        less, by_tried = _pose_equations(State(body, tried, world), own, huber_px)
        better = less < cost
        more_to_gain = np.where(better, less < (1 - _POSE_DECREASE) * cost, damping[:, 0] < 1e8)
        lower = np.flatnonzero(better)
        poses = poses.with_photos(lower, tried[lower])
        equations[lower], cost[lower] = by_tried[lower], less[lower]
        firm = np.where(better[:, None], damping, firm)
        damping *= np.where(better, 0.1, 10.0)[:, None]
        if not more_to_gain.any():
            break
    pose_damping[chosen] = np.maximum(100 * pose_damping[chosen], 10 * firm)
    return replace(candidate, poses=candidate.poses.with_photos(chosen, poses))


def _pose_equations(
    state: State[RigLens], pairs: Observations, huber_px: float
) -> tuple[FloatArray, FloatArray]:
    """Cost (M,) of each pose's pairs, and their normal equations for it (M, 6, 7)."""
    count = len(state.poses)
    residual, equations = np.empty_like(pairs.pixel), np.zeros((count, 6, 7))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        runs = runs_linearised(state.lens, state.poses, state.world, pairs, huber_px)
        for _, run, terms, root in runs:
            residual[run] = terms.residual
            rows = np.concatenate([terms.d_turn, terms.d_shift, terms.residual[:, :, None]], axis=2)
            rows *= root[:, None, None]
            np.add.at(equations, terms.pose, rows[:, :, :6].transpose(0, 2, 1) @ rows)
        shot = state.lens.shot_of(pairs.image)
        return _by_pose(residual, pairs, huber_px, shot, count), equations


def _by_pose(
    residual: FloatArray, pairs: Observations, huber_px: float, shot: IntArray, count: int
) -> FloatArray:
    """(M,) what each pose's pairs put into the cost."""
    distance = np.hypot(residual[:, 0], residual[:, 1])
    return np.bincount(shot, pairs.weight * huber_cost(distance, huber_px), count).astype(float)
