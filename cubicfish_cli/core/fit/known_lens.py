"""Poses of photos when the lens is known."""

from __future__ import annotations

import numpy as np

from cubicfish_cli.core.fit.adjustment import Adjustment, adjust
from cubicfish_cli.core.fit.lenses import FixedLens
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.radial_pose import RadialPose, depth_shift, poses_of_rays
from cubicfish_cli.core.fit.start import candidate_poses
from cubicfish_cli.core.fit.subset import select
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

# While poses are far off, the loss must still feel every corner.
_WIDE_HUBER_PX = 50.0


def place_photos(camera: RadialCamera, pairs: Observations) -> tuple[Poses, FloatArray]:
    """Start poses of all photos under a known radial lens.

    Returns:
        camera_from_world of every photo, and each photo's median error in pixels; NaN and inf
        where a photo has too few corners to be placed.

    """
    count = len(pairs.images)
    rotation = np.full((count, 3, 3), np.nan)
    translation = np.full((count, 3), np.nan)
    error = np.full(count, np.inf)
    focal = np.array([camera.fx, camera.fy])
    offset = (pairs.pixel - [camera.cx, camera.cy]) / focal
    angle = camera.angle(np.hypot(offset[:, 0], offset[:, 1]))
    seen = np.flatnonzero(np.isfinite(angle))
    seen = seen[np.argsort(pairs.image[seen], kind="stable")]
    bounds = np.searchsorted(pairs.image[seen], np.arange(count + 1))
    for photo in range(count):
        own = seen[bounds[photo] : bounds[photo + 1]]
        world = pairs.world[own]
        for pose in _candidates(world, offset[own], angle[own], pairs.board[own]):
            shift = pose.shift
            miss = camera.project(world @ pose.rotation.T + shift) - pairs.pixel[own]
            length = np.hypot(miss[:, 0], miss[:, 1])
            found = float(np.median(np.where(np.isfinite(length), length, np.inf)))
            if found < error[photo]:
                rotation[photo], translation[photo], error[photo] = pose.rotation, shift, found
    return Poses(rotation=rotation, translation=translation), error


def _candidates(
    world: FloatArray, offset: FloatArray, angle: FloatArray, board: IntArray
) -> list[RadialPose]:
    """Poses with their depths, from directions and angles of some points."""
    found = []
    for pose in candidate_poses(world, offset, board):
        depth, _ = depth_shift(pose, world, angle)
        found.append(RadialPose(rotation=pose.rotation, shift=np.append(pose.shift, depth)))
    away = offset / np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 1e-300)[:, None]
    rays = np.column_stack([np.sin(angle)[:, None] * away, np.cos(angle)])
    return [*found, *poses_of_rays(world, rays)]


def fit_poses(
    camera: RadialCamera, pairs: Observations
) -> tuple[Adjustment[FixedLens] | None, Observations, IntArray]:
    """Poses under a known radial lens, refined by Levenberg–Marquardt.

    Returns:
        The adjustment (None when no photo could be placed), the pairs of the photos that could,
        and each such photo's index in ``pairs.images``.

    """
    poses, error = place_photos(camera, pairs)
    placed = np.flatnonzero(np.isfinite(error))
    if not placed.size:
        return None, pairs, placed
    own, _ = select(pairs, np.isin(pairs.image, placed))
    lens = FixedLens(camera=camera)
    fit = adjust(lens, poses[placed], own, huber_px=_WIDE_HUBER_PX, max_iterations=30)
    return fit.again(own), own, placed
