"""How far the cameras' places on the body may be off.

A lens may turn its rays a little and its camera turn back: what counts is where the rays of a
camera's pixels go on the body. So the turn that is judged is that of the place and of the lens
together, beside that of the first camera, whose frame is the rig's.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish.fit.folds import MIN_PHOTOS, dealt_out
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.photo_spread import MOST_CLUSTERS, variance_of_few
from cubicfish.fit.uncertainty import Gauge, corner_noise_px
from cubicfish.rigs.rig_lens import RigLens
from cubicfish.rigs.times import Timing
from cubicfish.solve.adjustment import Adjustment
from cubicfish.solve.fit_lens import FitLens
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.solve.poses import cross_matrix
from cubicfish.types import FloatArray, IntArray

# Blocks of time that are left out where that takes a fit anew of each. Of 16 simulated rigs whose
# cameras run free, true errors are 1.2 times what these state, and halves of their shots are 0.8
# times as far apart. Fewer blocks state less; shots that tell nothing at all any more, not even of
# the motion beside them, make halves only 0.6 times as far apart as stated.
_BLOCKS = 8


def place_covariances(
    fit: Adjustment[RigLens],
    rays: list[FloatArray],
    shots: Sequence[str],
    places: IntArray,
    runners_up: Sequence[Sequence[tuple[FitLens, float]]],
    timing: Timing | None,
) -> FloatArray:
    """Covariance (C, 6, 6) of camera_from_rig: turn (radians, camera frame), then shift.

    The corners' own noise carried through the fit is a lower bound; what shots' shared errors add
    shows when shots are left out (see ``photo_spread.py``). Where photos have times of their own,
    blocks of time are, and the rig is fitted anew: how the target moves depends on shots beside.

    Args:
        fit: the adjustment, at its optimum.
        rays: for each camera (M, 3) unit rays over its field.
        shots: names of the shots.
        places: (S,) numbers from 0: shots of one place have one.
        runners_up: for each camera its lens under other priors, and how likely each is the best.
        timing: how the photos' times were fitted, where they were.

    """
    lens = fit.lens
    by_shared = _differentiate_by_shared(lens, rays)
    noise = _compute_noise_covariance(fit)
    count = len(fit.lens.parameters)
    found = [by @ noise[:count, :count] @ by.T for by in by_shared]
    parts, clusters = min(int(places.max()) + 1, MOST_CLUSTERS), []
    if parts >= MIN_PHOTOS:
        by_chance = dealt_out(places, shots, parts)
        clusters = by_chance if timing is None else timing.blocks(_BLOCKS)
    leave_one_out = LeaveOneOut(fit, clusters)
    if clusters:
        left_out = np.array([shared[:count] for shared, _, _ in leave_one_out.steps()])
        influence, anew = leave_one_out.influence()[:, :count], left_out
        if timing is not None:
            anew = np.array([_change(lens, timing.without(fit, own)) for own in clusters])
        found = [
            _take_larger(
                one, _measure_shot_covariance(anew @ by.T, left_out @ by.T, influence @ by.T)
            )
            for one, by in zip(found, by_shared, strict=True)
        ]
    for step in _measure_runner_up_steps(leave_one_out, lens, runners_up):
        found = [
            one + np.outer(by @ step, by @ step) for one, by in zip(found, by_shared, strict=True)
        ]
    return np.array(found)


def _measure_runner_up_steps(
    leave_one_out: LeaveOneOut,
    lens: RigLens,
    runners_up: Sequence[Sequence[tuple[FitLens, float]]],
) -> list[FloatArray]:
    """Steps (K,) to the rig with each lens under a runner-up: how it should be is in doubt.

    Each times the root of how likely that is the best one.
    """
    rigs, roots = [], []
    for camera, own in enumerate(lens.lenses):
        for runner_up, probability in runners_up[camera] if len(own.parameters) else ():
            others = list(lens.lenses)
            others[camera] = runner_up.with_parameters(own.parameters)
            rigs.append(lens.with_lenses(others))
            roots.append(np.sqrt(probability))
    if not rigs:
        return []
    steps = leave_one_out.steps_under(rigs)
    return list(np.array(roots)[:, None] * steps[:, : len(lens.parameters)])


def _differentiate_by_shared(lens: RigLens, rays: list[FloatArray]) -> list[FloatArray]:
    """For each camera (6, K): its place by the shared unknowns, lens and place together."""
    count = len(lens.parameters)
    turns = []
    for own, one, columns in zip(lens.lenses, rays, lens.columns, strict=True):
        turn = np.zeros((3, count))
        if isinstance(own, CubicFit):
            common = Gauge.over(own, one).turn
            turn[:, columns.start : columns.start + common.shape[1]] = common
        turns.append(turn)
    found = [np.zeros((6, count))]
    for camera in range(1, len(lens.lenses)):
        by = np.zeros((6, count))
        by[:, lens.place_columns(camera)] = np.eye(6)
        by[:3] += turns[camera] - lens.places.rotation[camera] @ turns[0]
        by[3:] -= cross_matrix(lens.places.translation[camera]) @ turns[camera]
        found.append(by)
    return found


def _compute_noise_covariance(fit: Adjustment[RigLens]) -> FloatArray:
    """(K, K) of the shared unknowns, from the corners' noise."""
    hessian = fit.normal.reduced_shared()
    scale = 1 / np.sqrt(np.maximum(np.diagonal(hessian), 1e-300))
    both = scale * scale[:, None]
    inverse = both * np.linalg.pinv(hessian * both, hermitian=True, rcond=1e-14)
    return np.asarray(inverse * corner_noise_px(fit) ** 2)


def _change(lens: RigLens, other: RigLens) -> FloatArray:
    """(K,) the step of the parameters from a rig to another, of the same cameras."""
    step = other.parameters - lens.parameters
    for camera in range(1, len(lens.lenses)):
        turn = other.places.rotation[camera] @ lens.places.rotation[camera].T
        first = lens.place_columns(camera).start
        step[first : first + 3] = Rotation.from_matrix(turn).as_rotvec()
    return np.asarray(step)


def _measure_shot_covariance(
    anew: FloatArray, left_out: FloatArray, influence: FloatArray
) -> FloatArray:
    """Covariance (6, 6) of what changes so, (G, 6), without each cluster of shots.

    The geometric mean with the influence, as ``PhotoSpread`` takes it and for its reasons.
    """
    whole, first, second = (
        (change - change.mean(axis=0)).T @ (change - change.mean(axis=0))
        for change in (anew, left_out, influence)
    )
    scale = (np.diagonal(second) / np.maximum(np.diagonal(first), 1e-300)) ** 0.25
    return np.asarray(variance_of_few(whole, len(anew)) * scale * scale[:, None])


def _take_larger(noise: FloatArray, of_shots: FloatArray) -> FloatArray:
    """The shots' covariance with no unknown surer than the corners' noise leaves it."""
    short = np.maximum(np.diagonal(noise) - np.diagonal(of_shots), 0)
    return np.asarray(of_shots + np.diag(short))
