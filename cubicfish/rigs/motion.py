"""How a target moves about the shots of a rig: smoothly, as the shots beside each other say."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from cubicfish.solve.poses import Poses
from cubicfish.types import FloatArray, IntArray


def paths_between(
    poses: Poses, moment: FloatArray, near: float, shot: IntArray, late: FloatArray
) -> FloatArray:
    """(V, 3, 6) how the target moves about each view's shot, by where it was in those beside it.

    Turns in the target's own frame, shifts in the rig's, towards the shot before or after.

    Args:
        poses: rig_from_world of each shot.
        moment: (S,) when it was; NaN where not known.
        near: how far apart neighbours in time are at most.
        shot: (V,) of each view.
        late: (V,) by how much it is later than its shot, roughly.

    """
    found = np.zeros((len(shot), 3, 6))
    time, order = np.unique(moment, return_index=True)
    order = order[np.isfinite(time)]
    for run in np.split(order, np.flatnonzero(np.diff(moment[order]) > near) + 1):
        views = np.flatnonzero(np.isin(shot, run))
        if len(run) < 2 or not len(views):
            continue
        time, turn = moment[run], Rotation.from_matrix(poses.rotation[run]).as_quat()
        turn[1:] *= np.cumprod(np.sign(np.sum(turn[1:] * turn[:-1], axis=1)))[:, None]
        track = smooth_track(time, np.hstack([turn, poses.translation[run]]))
        at, gap = np.searchsorted(time, moment[shot[views]]), np.diff(time)
        step = np.where(late[views] < 0, -np.append(gap[0], gap)[at], np.append(gap, gap[-1])[at])
        since = step[:, None] * np.arange(4) / 3
        when = time[at][:, None] + since
        inside = np.clip(when, time[0], time[-1])
        placed = track(inside) + track(inside, 1) * (when - inside)[:, :, None]
        turns = Rotation.from_quat(placed[:, :, :4].reshape(-1, 4)).as_matrix().reshape(-1, 4, 3, 3)
        turned = turns[:, :1].transpose(0, 1, 3, 2) @ turns[:, 1:]
        way = np.concatenate(
            [
                Rotation.from_matrix(turned.reshape(-1, 3, 3)).as_rotvec().reshape(-1, 3, 3),
                placed[:, 1:, 4:] - placed[:, :1, 4:],
            ],
            axis=2,
        )
        found[views] = np.linalg.solve(since[:, 1:, None] ** np.arange(1, 4), way)
    return found


def smooth_track(time: FloatArray, values: FloatArray) -> CubicSpline:
    """The natural cubic smoothing spline of values (n, k) at increasing times (n,).

    How smooth each of the k is, is chosen by generalised cross-validation (Craven & Wahba 1979;
    Green & Silverman 1994, 2.3): values that are left out are to be predicted best by the others.
    """
    gap = np.diff(time)
    bend = np.zeros((len(time) - 2, len(time)))
    place = np.arange(len(bend))
    bend[place, place], bend[place, place + 2] = 1 / gap[:-1], 1 / gap[1:]
    bend[place, place + 1] = -1 / gap[:-1] - 1 / gap[1:]
    band = np.diag((gap[:-1] + gap[1:]) / 3)
    band[place[1:], place[:-1]] = band[place[:-1], place[1:]] = gap[1:-1] / 6
    rough, basis = np.linalg.eigh(bend.T @ np.linalg.solve(band, bend))
    rough[:2] = 0  # a straight line is smooth
    inside = basis.T @ values
    weights = np.geomspace(1e-3 / rough[-1], 1e3 / rough[2], 200) if len(bend) else np.zeros(1)
    left = weights[:, None] * rough / (1 + weights[:, None] * rough)
    missed = np.square(left) @ np.square(inside)
    free = np.sum(left, axis=1)[:, None]
    best = np.argmin(missed / np.maximum(np.square(free), 1e-300), axis=0)
    return CubicSpline(time, basis @ ((1 - left[best].T) * inside), bc_type="natural")
