"""The rotation between the frames of two lenses that are nearly the same."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cubicfish.models.cubic import CubicCamera, pole_or_fold_deg
from cubicfish.models.lift import lift_rotation
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.poses import Poses
from cubicfish.types import FloatArray

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_HUBER_PX = 1.0
# Rounds of least squares: each takes the rays that the last rotation puts into both fields.
_FIT_ROUNDS = 3
_FRAME_RAYS = 2000
Project = Callable[[FloatArray], FloatArray]
"""Any lens: camera-frame points (..., 3) -> pixels (..., 2), NaN outside its field."""


def turned_onto(
    project: Project, rays: FloatArray, wanted: FloatArray, rotation: Rotation
) -> tuple[FloatArray, FloatArray]:
    """Pixel differences of a lens from given pixels, under the rotation that makes them smallest.

    Args:
        project: the lens.
        rays: (N, 3) unit rays.
        wanted: (N, 2) where they should be seen, NaN where they are not.
        rotation: a rotation to start from, near the best one.

    Returns:
        Differences project(R d) − wanted, (N, 2) pixels, NaN where either has none; and R (3, 3).

    """
    from scipy.optimize import least_squares  # slow to load
    from scipy.spatial.transform import Rotation

    common = np.zeros(0, np.intp)
    for _ in range(_FIT_ROUNDS):
        miss = project(rotation.apply(rays)) - wanted
        before, common = common, np.flatnonzero(np.isfinite(miss).all(axis=1))
        if len(common) < 3 or np.array_equal(before, common):
            break

        def difference(turn: FloatArray) -> FloatArray:
            turned = (Rotation.from_rotvec(turn) * rotation).apply(rays[common])  # noqa: B023
            found = project(turned) - wanted[common]  # noqa: B023
            # A ray that leaves the field as R changes keeps its residual: it neither pulls nor
            # gains.
            return np.where(np.isnan(found), miss[common], found).ravel()  # noqa: B023

        found = least_squares(
            difference, np.zeros(3), loss="huber", f_scale=_HUBER_PX, xtol=1e-12, ftol=1e-12
        )
        rotation = Rotation.from_rotvec(found.x) * rotation
    return project(rotation.apply(rays)) - wanted, rotation.as_matrix()


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
    from scipy.spatial.transform import Rotation  # slow to load

    rays = cone_rays(covered, _FRAME_RAYS)
    wanted = camera.radial.project(rays)
    miss, rotation = turned_onto(camera.project, rays, wanted, Rotation.identity())
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
