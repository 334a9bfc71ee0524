"""Photos taken from the same place: many of them say no more than one."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import FloatArray, IntArray

# Photos in which the target lies within this share of the longer side of the same place are one:
# less than hands and tripods that are moved on purpose ever keep.
SAME_SHARE = 0.002
# All photos within this share of it are from nearly the same place.
NEAR_SHARE = 0.05


def repeated_groups(
    poses: Poses, pairs: Observations, focal: float, share: float = SAME_SHARE
) -> IntArray:
    """(photos,) which photos are one: numbers from 0, in the order in which they first appear.

    Args:
        poses: camera_from_world of each of ``pairs.images``.
        pairs: pairs of the photos.
        focal: pixels per radian.
        share: of the longer side, by which the target may lie elsewhere.

    """
    count = len(poses)
    seen = _in_pixels(poses, pairs.world, focal)
    tolerance = share * max(pairs.image_size) * np.sqrt(seen.shape[1] / 3)
    group = np.full(count, -1, np.intp)
    tree = KDTree(seen)
    for photo in range(count):
        if group[photo] >= 0:
            continue
        near = np.array(tree.query_ball_point(seen[photo], tolerance), np.intp)
        group[near[group[near] < 0]] = group.max() + 1
    return group


def _in_pixels(poses: Poses, world: FloatArray, focal: float) -> FloatArray:
    """(photos, 3 K) directions to the target's middle and to the ends of its axes, in pixels."""
    middle = world.mean(axis=0)
    _, extent, axes = np.linalg.svd(world - middle, full_matrices=False)
    reach = (extent / np.sqrt(len(world)))[:, None] * axes
    points = middle + np.vstack([np.zeros((1, 3)), reach, -reach])
    camera = points @ poses.rotation.transpose(0, 2, 1) + poses.translation[:, None, :]
    distance = np.linalg.norm(camera, axis=2, keepdims=True)
    return (focal * camera / distance).reshape(len(poses), -1)
