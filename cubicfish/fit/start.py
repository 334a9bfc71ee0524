"""Poses of all photos without any guess, for any lens or a known one."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from cubicfish.fit.radial_pose import (
    MIN_POINTS_ON_PLANE,
    RadialPose,
    depth_shift,
    poses_of_rays,
    radial_poses,
)
from cubicfish.models.radial import RadialCamera
from cubicfish.solve.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import wide_px
from cubicfish.solve.subset import select
from cubicfish.target.observations import Observations
from cubicfish.types import FloatArray, IntArray

# Angles from the axis that the farthest corner may have, in the scan of focal lengths.
_FARTHEST_ANGLE_DEG = np.geomspace(4, 160, 40)
NONE_PLACED = (
    "no photo has enough corners to be placed: each needs at least 7 (5 on a flat board) that are "
    "not on one line"
)
# While poses are far off, every corner must still count in the loss.
_WIDE_HUBER_PX = 50.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Start:
    """An equidistant lens and the photos' poses under it.

    Attributes:
        focal: pixels per radian.
        poses: camera_from_world of every photo; NaN where none was found.
        error: (M,) median error of each photo, pixels; inf where there is no pose.

    """

    focal: float
    poses: Poses
    error: FloatArray

    @property
    def score(self) -> float:
        """Mean error of the photos that could be placed at all, pixels; lower is better."""
        placed = np.isfinite(self.error)
        return float(self.error[placed].mean()) if placed.any() else np.inf


def start_at_centre(pairs: Observations, centre: FloatArray) -> Start:
    """Scan focal lengths of an equidistant lens r = fθ about ``centre``: (2,) pixels.

    Every photo is placed by the linear radial equations, then its depth follows from the focal
    length in closed form; the focal length with the smallest errors over all photos wins.
    """
    bounds = np.searchsorted(pairs.image, np.arange(len(pairs.images) + 1))
    photos = [slice(*own) for own in pairwise(bounds.tolist())]
    world, offset = pairs.world, pairs.pixel - centre
    radius = np.hypot(offset[:, 0], offset[:, 1])
    focals = float(radius.max(initial=0)) / np.deg2rad(_FARTHEST_ANGLE_DEG)
    candidates = [candidate_poses(world[own], offset[own], pairs.board[own]) for own in photos]
    by_candidate = [
        np.stack(
            [_measure_errors(pose, world[own], offset[own], radius[own], focals) for pose in poses]
        )
        if poses
        else np.full((1, len(focals)), np.inf)
        for poses, own in zip(candidates, photos, strict=True)
    ]
    errors = np.stack([each.min(axis=0) for each in by_candidate])
    # So few corners always fit: they say nothing about the lens, and little about their pose.
    spare = np.diff(bounds) > MIN_POINTS_ON_PLANE
    if np.isfinite(errors[spare]).any():
        errors[~spare] = np.inf
    placed = np.isfinite(errors).any(axis=1)
    # The mean over photos of an error that is capped: one broken photo must not decide.
    cap = 0.05 * max(pairs.image_size)
    total = np.minimum(errors[placed], cap).mean(axis=0) if placed.any() else np.zeros(len(focals))
    chosen = int(np.argmin(total))
    focal = float(focals[chosen])
    poses, error = unplaced(len(photos)), np.full(len(photos), np.inf)
    for photo in np.flatnonzero(placed).tolist():
        own = by_candidate[photo][:, chosen]
        best = int(np.argmin(own))
        pose = candidates[photo][best]
        depth, _ = depth_shift(pose, world[photos[photo]], radius[photos[photo]] / focal)
        poses.rotation[photo] = pose.rotation
        poses.translation[photo] = [*pose.shift, depth]
        error[photo] = own[best]
    return Start(focal=focal, poses=poses, error=error)


def unplaced(photos: int) -> Poses:
    """Poses of photos that are not known yet."""
    return Poses(rotation=np.full((photos, 3, 3), np.nan), translation=np.full((photos, 3), np.nan))


def candidate_poses(world: FloatArray, offset: FloatArray, board: npt.NDArray) -> list[RadialPose]:
    """Find poses from all points, and from the largest board alone.

    Two boards of which one shows few corners are nearly a plane; the board's own two-fold solution
    is steadier then.
    """
    candidates = radial_poses(world, offset)
    names, counts = np.unique(board, return_counts=True)
    if len(names) > 1:
        largest = board == names[np.argmax(counts)]
        candidates = candidates + radial_poses(world[largest], offset[largest])
    return candidates


def _measure_errors(
    pose: RadialPose,
    world: FloatArray,
    offset: FloatArray,
    radius: FloatArray,
    focals: FloatArray,
) -> FloatArray:
    """Median distance to the pixels of a photo under each focal length: (F,), pixels."""
    angle = np.minimum(radius / focals[:, None], 3.1)
    _, found = depth_shift(pose, world, angle)
    camera = world @ pose.rotation[:2].T + pose.shift
    direction = camera / np.maximum(np.hypot(camera[:, 0], camera[:, 1]), 1e-300)[:, None]
    predicted = (focals[:, None] * found)[:, :, None] * direction
    return np.median(np.linalg.norm(predicted - offset, axis=-1), axis=-1)


def fit_poses(
    camera: RadialCamera, pairs: Observations, known: Poses | None = None
) -> tuple[Adjustment[FixedLens] | None, Observations, IntArray]:
    """Poses under a known radial lens, refined by Levenberg–Marquardt.

    Args:
        camera: the lens.
        pairs: 2D-3D pairs.
        known: a start for each photo; NaN where there is none.

    Returns:
        The adjustment (None when no photo has enough corners to be placed), the pairs of the
        photos that have, and each such photo's index in ``pairs.images``.

    """
    count = len(pairs.images)
    poses, error = unplaced(count), np.full(count, np.inf)
    offset = (pairs.pixel - [camera.cx, camera.cy]) / np.array([camera.fx, camera.fy])
    angle = camera.angle(np.hypot(offset[:, 0], offset[:, 1]))
    seen = np.flatnonzero(np.isfinite(angle))
    seen = seen[np.argsort(pairs.image[seen], kind="stable")]
    bounds = np.searchsorted(pairs.image[seen], np.arange(count + 1))
    if known is not None:
        poses, error = known, np.where(np.isfinite(known.translation[:, 0]), 0.0, np.inf)
    for photo in np.flatnonzero(np.isinf(error)).tolist():
        own = seen[bounds[photo] : bounds[photo + 1]]
        world = pairs.world[own]
        for pose in _find_known_poses(world, offset[own], angle[own], pairs.board[own]):
            miss = camera.project(world @ pose.rotation.T + pose.shift) - pairs.pixel[own]
            length = np.hypot(miss[:, 0], miss[:, 1])
            found = float(np.median(np.where(np.isfinite(length), length, np.inf)))
            if found < error[photo]:
                poses.rotation[photo], poses.translation[photo] = pose.rotation, pose.shift
                error[photo] = found
    placed = np.flatnonzero(np.isfinite(error))
    if not placed.size:
        return None, pairs, placed
    kept, _ = select(pairs, np.isin(pairs.image, placed))
    lens = FixedLens(camera=camera)
    fit = adjust(lens, poses[placed], kept, _WIDE_HUBER_PX, max_iterations=30)
    near = adjust(lens, fit.poses, kept, wide_px(fit.errors), damping=WARM_DAMPING)
    return near, kept, placed


def _find_known_poses(
    world: FloatArray, offset: FloatArray, angle: FloatArray, board: IntArray
) -> list[RadialPose]:
    """Find candidate poses with their depths, from directions and angles of some points."""
    found = [
        replace(pose, shift=np.append(pose.shift, depth_shift(pose, world, angle)[0]))
        for pose in candidate_poses(world, offset, board)
    ]
    away = offset / np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 1e-300)[:, None]
    rays = np.column_stack([np.sin(angle)[:, None] * away, np.cos(angle)])
    return [*found, *poses_of_rays(world, rays)]
