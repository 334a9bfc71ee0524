"""Poses of all photos without any guess, whatever the lens or under a known one."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.fit.adjustment import Adjustment, adjust
from cubicfish_cli.core.fit.lenses import FixedLens
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.radial_pose import (
    MIN_POINTS_ON_PLANE,
    RadialPose,
    depth_shift,
    poses_of_rays,
    radial_poses,
)
from cubicfish_cli.core.fit.subset import select
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

# Angles from the axis that the farthest corner may have, in the scan of focal lengths.
_FARTHEST_ANGLE_DEG = np.geomspace(4, 160, 40)
# While poses are far off, the loss must still feel every corner.
_WIDE_HUBER_PX = 50.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Start:
    """An equidistant lens and the photos' poses under it.

    Attributes:
        centre: (2,) pixels.
        focal: pixels per radian.
        poses: camera_from_world of every photo; NaN where none was found.
        error: (M,) median error of each photo, pixels; inf where there is no pose.

    """

    centre: FloatArray
    focal: float
    poses: Poses
    error: FloatArray

    @property
    def score(self) -> float:
        """Mean of the photos' errors that could be placed at all, pixels; lower is better."""
        placed = np.isfinite(self.error)
        return float(self.error[placed].mean()) if placed.any() else np.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class _Photo:
    world: FloatArray
    offset: FloatArray
    radius: FloatArray
    candidates: list[RadialPose]


def start_at_centre(pairs: Observations, centre: FloatArray) -> Start:
    """Scan focal lengths of an equidistant lens r = fθ about ``centre``: (2,) pixels.

    Every photo is placed by the linear radial equations, then its depth follows from the focal
    length in closed form; the focal length with the smallest errors over all photos wins.
    """
    bounds = np.searchsorted(pairs.image, np.arange(len(pairs.images) + 1))
    photos = [_photo(pairs, slice(*own), centre) for own in pairwise(bounds.tolist())]
    farthest = max(float(photo.radius.max(initial=0)) for photo in photos)
    focals = farthest / np.deg2rad(_FARTHEST_ANGLE_DEG)
    by_candidate = [_errors(photo, focals) for photo in photos]
    errors = np.stack([each.min(axis=0) for each in by_candidate])
    # Any so few corners fit, so they say nothing of the lens, and little of their pose.
    spare = np.array([len(photo.world) > MIN_POINTS_ON_PLANE for photo in photos])
    if np.isfinite(errors[spare]).any():
        errors[~spare] = np.inf
    placed = np.isfinite(errors).any(axis=1)
    # The mean over photos of an error that is capped: one broken photo must not choose.
    cap = 0.05 * max(pairs.image_size)
    total = np.minimum(errors[placed], cap).mean(axis=0) if placed.any() else np.zeros(len(focals))
    chosen = int(np.argmin(total))
    focal = float(focals[chosen])
    rotation = np.full((len(photos), 3, 3), np.nan)
    translation = np.full((len(photos), 3), np.nan)
    error = np.full(len(photos), np.inf)
    for image, photo in enumerate(photos):
        if not placed[image]:
            continue
        own = by_candidate[image][:, chosen]
        best = int(np.argmin(own))
        pose = photo.candidates[best]
        depth, _ = depth_shift(pose, photo.world, photo.radius / focal)
        rotation[image] = pose.rotation
        translation[image] = [*pose.shift, depth]
        error[image] = own[best]
    return Start(
        centre=centre,
        focal=focal,
        poses=Poses(rotation=rotation, translation=translation),
        error=error,
    )


def _photo(pairs: Observations, own: slice, centre: FloatArray) -> _Photo:
    world, offset = pairs.world[own], pairs.pixel[own] - centre
    return _Photo(
        world=world,
        offset=offset,
        radius=np.hypot(offset[:, 0], offset[:, 1]),
        candidates=candidate_poses(world, offset, pairs.board[own]),
    )


def candidate_poses(world: FloatArray, offset: FloatArray, board: npt.NDArray) -> list[RadialPose]:
    """Poses from all points, and from the largest board alone.

    Two boards of which one shows few corners are nearly a plane; then the board's own
    two-fold solution is the steadier one.
    """
    candidates = radial_poses(world, offset)
    names, counts = np.unique(board, return_counts=True)
    if len(names) > 1:
        largest = board == names[np.argmax(counts)]
        candidates = candidates + radial_poses(world[largest], offset[largest])
    return candidates


def _errors(photo: _Photo, focals: FloatArray) -> FloatArray:
    """Median distance to the pixels, each candidate and focal length: (C, F), pixels."""
    if not photo.candidates:
        return np.full((1, len(focals)), np.inf)
    return np.stack([_candidate_errors(pose, photo, focals) for pose in photo.candidates])


def _candidate_errors(pose: RadialPose, photo: _Photo, focals: FloatArray) -> FloatArray:
    angle = np.minimum(photo.radius / focals[:, None], 3.1)
    _, found = depth_shift(pose, photo.world, angle)
    camera = photo.world @ pose.rotation[:2].T + pose.shift
    direction = camera / np.maximum(np.hypot(camera[:, 0], camera[:, 1]), 1e-300)[:, None]
    predicted = (focals[:, None] * found)[:, :, None] * direction
    return np.median(np.linalg.norm(predicted - photo.offset, axis=-1), axis=-1)


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
