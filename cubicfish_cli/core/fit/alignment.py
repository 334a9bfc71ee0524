"""How far two lenses differ, after the rotation between their camera frames is taken out."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.lenses.cubic import CubicCamera, check_validity
from cubicfish_cli.core.lenses.lift import lift_rotation
from cubicfish_cli.core.lenses.sphere import all_around, cone_rays
from cubicfish_cli.core.types import FloatArray

_HUBER_PX = 1.0
# A ray and the one whose pixel is nearest in the other lens say how the frames are turned; the
# farthest of such pairs come from outside the other's field and are left out in the next round.
_START_ROUNDS = 4
_START_SHARE = 0.8
# Rounds of least squares: each takes the rays that are in both fields under the last rotation.
_FIT_ROUNDS = 3
_FRAME_RAYS = 2000


class ProjectingLens(Protocol):
    """Any lens: camera-frame points (..., 3) -> pixels (..., 2), NaN outside its field."""

    def project(self, points: FloatArray, /) -> FloatArray:
        """Camera-frame points (..., 3) -> pixels (..., 2)."""


def aligned_difference(
    first: ProjectingLens, second: ProjectingLens, rays: FloatArray, *, near: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Pixel differences of two lenses under the rotation that makes them smallest.

    A calibration determines the camera frame only as well as its corners do, and the poses make
    up for the rest: two calibrations of one lens may differ by a small rotation and still be the
    same camera. The rotation may also be large, such as between frames with other axes.

    Args:
        first: one lens.
        second: the other.
        rays: (N, 3) unit rays in the second lens's frame; best spread over its whole field.
        near: whether the frames are nearly the same already.

    Returns:
        Differences first(R d) − second(d), (N, 2) pixels, NaN where either lens
        has no pixel; and R (3, 3).

    """
    return aligned_to_pixels(first, rays, second.project(rays), near=near)


def aligned_to_pixels(
    first: ProjectingLens, rays: FloatArray, wanted: FloatArray, *, near: bool = False
) -> tuple[FloatArray, FloatArray]:
    """:func:`aligned_difference`, of a second lens that sees the rays at pixels (N, 2)."""
    from scipy.optimize import least_squares  # it takes long to load

    rotation = Rotation.identity() if near else _start(first, rays, wanted)
    common = np.zeros(0, np.intp)
    for _ in range(_FIT_ROUNDS):
        miss = first.project(rotation.apply(rays)) - wanted
        before, common = common, np.flatnonzero(np.isfinite(miss).all(axis=1))
        if len(common) < 3 or np.array_equal(before, common):
            break

        def difference(turn: FloatArray) -> FloatArray:
            turned = (Rotation.from_rotvec(turn) * rotation).apply(rays[common])  # noqa: B023
            # A ray that leaves the field as R changes pulls neither way.
            return np.nan_to_num(first.project(turned) - wanted[common]).ravel()  # noqa: B023

        found = least_squares(
            difference, np.zeros(3), loss="huber", f_scale=_HUBER_PX, xtol=1e-12, ftol=1e-12
        )
        rotation = Rotation.from_rotvec(found.x) * rotation
    return first.project(rotation.apply(rays)) - wanted, rotation.as_matrix()


def _start(first: ProjectingLens, rays: FloatArray, wanted: FloatArray) -> Rotation:
    """Turn each ray onto that ray whose pixel in ``first`` is nearest to its own (Wahba 1965)."""
    # Rays of the whole sphere: the first lens may look along any axis of its frame.
    probes = all_around(max(4 * len(rays), 4000))
    seen = first.project(probes)
    good = np.isfinite(seen).all(axis=1)
    pairs = np.isfinite(wanted).all(axis=1)
    if good.sum() < 3 or pairs.sum() < 3:
        return Rotation.identity()
    distance, nearest = KDTree(seen[good]).query(wanted[pairs])
    matched = probes[good][nearest]
    own = rays[pairs]
    near = distance <= np.quantile(distance, _START_SHARE)
    rotation = Rotation.identity()
    for _ in range(_START_ROUNDS):
        if near.sum() < 3:
            break
        rotation, _ = Rotation.align_vectors(matched[near], own[near])
        off = np.linalg.norm(rotation.apply(own) - matched, axis=1)
        near = off <= np.quantile(off, _START_SHARE)
    return rotation


def in_references_frame(
    camera: CubicCamera, poses: Poses, covered: float
) -> tuple[CubicCamera, Poses]:
    """The same camera and poses with the frame turned to where P is nearest to the reference.

    Corners leave the frame's turn open (poses make up for it, P L(R) for the lens), and what P is
    held to is not quite symmetric, so that the frames of the two lenses, which stand beside each
    other in one file, differ by a little.

    Args:
        camera: P with its reference.
        poses: camera_from_world of the photos.
        covered: angle from the axis up to which there are corners, radians.

    """
    rays = cone_rays(covered, _FRAME_RAYS)
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
