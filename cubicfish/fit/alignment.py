"""The rotation between the frames of two lenses that are nearly the same."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cubicfish.models.cubic import CubicCamera, pole_or_fold_deg
from cubicfish.models.lift import lift_rotation
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.adjustment import huber_cost, huber_weight
from cubicfish.solve.poses import Poses, rotation_from_vector
from cubicfish.types import FloatArray

_HUBER_PX = 1.0
# Rounds of least squares: each takes the rays that the last rotation puts into both fields.
_FIT_ROUNDS = 3
_FRAME_RAYS = 2000
_MOST_STEPS, _STEADY = 100, 1e-10
# Step of a difference that stands for a derivative, radians.
_STEP = 1e-7
# Of a step that raises the loss, these shares are tried.
_SHARES = 0.25 ** np.arange(6)
Project = Callable[[FloatArray], FloatArray]
"""Any lens: camera-frame points (..., 3) -> pixels (..., 2), NaN outside its field."""


def turned_onto(
    project: Project, rays: FloatArray, wanted: FloatArray, rotation: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Pixel differences of a lens from given pixels, under the rotation that makes them smallest.

    Args:
        project: the lens.
        rays: (N, 3) unit rays.
        wanted: (N, 2) where they should be seen, NaN where they are not.
        rotation: (3, 3) to start from, near the best one.

    Returns:
        Differences project(R d) − wanted, (N, 2) pixels, NaN where either has none; and R (3, 3).

    """
    common = np.zeros(0, np.intp)
    for _ in range(_FIT_ROUNDS):
        miss = project(rays @ rotation.T) - wanted
        before, common = common, np.flatnonzero(np.isfinite(miss).all(axis=1))
        if len(common) < 3 or np.array_equal(before, common):
            break
        rotation = _turn_further(project, rays[common], wanted[common], rotation)
    return project(rays @ rotation.T) - wanted, rotation


def _turn_further(
    project: Project, rays: FloatArray, wanted: FloatArray, rotation: FloatArray
) -> FloatArray:
    """Find the rotation (3, 3) with the least Huber loss by Gauss–Newton, from one that is near."""
    started = project(rays @ rotation.T) - wanted

    def difference(turn: FloatArray) -> FloatArray:
        found = project(rays @ (rotation_from_vector(turn) @ rotation).T) - wanted
        # A ray that leaves the field as R changes keeps its residual: it neither pulls nor gains.
        return np.where(np.isnan(found), started, found)

    def loss(miss: FloatArray) -> float:
        return float(huber_cost(np.abs(miss), _HUBER_PX).sum())

    turn, miss = np.zeros(3), started
    for _ in range(_MOST_STEPS):
        sides = [difference(turn + side) - miss for side in _STEP * np.eye(3)]
        root = np.sqrt(huber_weight(np.abs(miss), _HUBER_PX))
        slope = np.stack([root * side / _STEP for side in sides], axis=-1).reshape(-1, 3)
        step = -np.linalg.lstsq(slope, (root * miss).reshape(-1), rcond=None)[0]
        least = loss(miss)
        for share in _SHARES:
            moved = difference(turn + share * step)
            if loss(moved) < least:
                break
        else:
            break
        turn, miss = turn + share * step, moved
        if loss(miss) > (1 - _STEADY) * least:
            break
    return rotation_from_vector(turn) @ rotation


def in_references_frame(
    camera: CubicCamera, poses: Poses, covered: float
) -> tuple[CubicCamera, Poses]:
    """Turn the frame of a camera and its poses to where P is nearest to the reference.

    Corners do not determine the turn of the frame (poses and P L(R) compensate it), and the lens of
    P's prior is not quite symmetric. So the frames of P and the reference, which stand beside each
    other in one file, would differ a little.

    Args:
        camera: P with its reference.
        poses: camera_from_world of the photos.
        covered: angle from the axis up to which there are corners, radians.

    """
    rays = cone_rays(covered, _FRAME_RAYS)
    wanted = camera.radial.project(rays)
    miss, rotation = turned_onto(camera.project, rays, wanted, np.eye(3))
    if not np.isfinite(miss).any():
        return camera, poses
    P = camera.P @ lift_rotation(rotation)
    turned = replace(camera, P=P / np.linalg.norm(P))
    # The cone turns too, by far less than its margin to the farthest corner.
    if pole_or_fold_deg(turned.P, turned.max_angle_deg) is not None:
        return camera, poses
    return turned, Poses(
        rotation=rotation.T @ poses.rotation, translation=poses.translation @ rotation
    )
