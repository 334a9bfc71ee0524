"""The camera's frame: that of the radial reference, which stands beside P in one file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cubicfish_cli.core.fit.alignment import aligned_difference
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.lenses.cubic import CubicCamera, check_validity
from cubicfish_cli.core.lenses.lift import lift_rotation
from cubicfish_cli.core.lenses.sphere import cone_rays

_RAYS = 2000


def in_references_frame(
    camera: CubicCamera, poses: Poses, covered: float
) -> tuple[CubicCamera, Poses]:
    """The same camera and poses with the frame turned to where P is nearest to the reference.

    Corners leave the frame's turn open (poses make up for it, P L(R) for the lens), and what P is
    held to is not quite symmetric, so that the frames of the two lenses differ by a little.

    Args:
        camera: P with its reference.
        poses: camera_from_world of the photos.
        covered: angle from the axis up to which there are corners, radians.

    """
    rays = cone_rays(covered, _RAYS)
    miss, rotation = aligned_difference(camera, camera.radial, rays, near=True)
    if not np.isfinite(miss).any():
        return camera, poses
    P = camera.P @ lift_rotation(rotation)
    turned = replace(camera, P=P / np.linalg.norm(P))
    # The cone turns along, by far less than its margin to the farthest corner.
    if not check_validity(turned.P, turned.max_angle_deg).valid:
        return camera, poses
    return turned, Poses(
        rotation=rotation.T @ poses.rotation, translation=poses.translation @ rotation
    )
