"""Which photos are left out together, to be judged by a camera that never saw them.

Photos from the same place count as one, so that none is judged by a camera that saw its repeat.
"""

from collections.abc import Sequence

import numpy as np

from cubicfish.files.frame_names import FrameName
from cubicfish.fit.radial_reference import RadialReference
from cubicfish.geometry import outermost
from cubicfish.solve.poses import Poses
from cubicfish.target.observations import Observations
from cubicfish.types import FloatArray, IntArray

FOLDS = 5
MIN_PHOTOS = 3
# Photos count as one if the target lies at the same place in them to within this share of the
# longer side: closer than hands, or tripods that are moved on purpose, ever get.
SAME_SHARE = 0.002
# All photos count as from nearly the same place if they agree to within this share of it.
NEAR_SHARE = 0.05


def folds_of(reference: RadialReference) -> list[IntArray]:
    """Indices of a reference's photos that are left out together, see :func:`photo_folds`."""
    return photo_folds(reference.poses, reference.pairs, reference.camera.fx)


def photo_folds(poses: Poses, pairs: Observations, focal: float) -> list[IntArray]:
    """Indices of the photos that are left out together, fold by fold.

    Args:
        poses: camera_from_world of each of ``pairs.images``.
        pairs: pairs of the photos.
        focal: pixels per radian, roughly.

    Returns:
        Empty where photos are from fewer than :data:`MIN_PHOTOS` places.

    """
    group = repeated_groups(poses, pairs, focal)
    places = int(group.max()) + 1
    folds = min(FOLDS, places) if places >= MIN_PHOTOS else 0
    return dealt_out(group, pairs.images, folds) if folds else []


def dealt_out(group: IntArray, images: Sequence[str], parts: int) -> list[IntArray]:
    """Deal photos out into parts, see :func:`dealt`: indices for each part that is not empty."""
    part = dealt(group, images, parts)
    return [np.flatnonzero(part == number) for number in np.unique(part)]


def dealt(group: IntArray, images: Sequence[str], parts: int) -> IntArray:
    """Deal groups of photos out into parts: (M,) numbers from 0 -> (M,) numbers below ``parts``.

    Groups are dealt out by name, so that the order in which photos come does not matter: photos in
    turn, frames of films in blocks of time, since neighbours share their errors.

    Args:
        group: (M,) photos with the same number stay together.
        images: names of the photos.
        parts: how many parts; no more than groups.

    """
    by_name = np.argsort(np.array(images), kind="stable")
    _, first = np.unique(group[by_name], return_index=True)
    of_film = np.array([FrameName.read(images[by_name[photo]]) is not None for photo in first])
    part = np.empty(len(first), np.intp)
    for some, in_blocks in ((of_film, True), (~of_film, False)):
        rank = np.argsort(np.argsort(first[some]))
        part[some] = rank * parts // len(rank) if in_blocks else (rank + np.sum(of_film)) % parts
    return part[group]


def repeated_groups(
    poses: Poses, pairs: Observations, focal: float, share: float = SAME_SHARE
) -> IntArray:
    """Find photos that count as one: (photos,) numbers from 0, in the order of first appearance.

    Where the corners of a photo have no certain names, its pose may be some squares off: the photo
    is compared with all others by where its corners lie in the picture.

    Args:
        poses: camera_from_world of each of ``pairs.images``.
        pairs: pairs of the photos.
        focal: pixels per radian.
        share: the share of the longer side by which the target may lie elsewhere.

    """
    count = len(poses)
    seen = _project_target(poses, pairs.world, focal)
    tolerance = share * max(pairs.image_size) * np.sqrt(seen.shape[1] / 3)
    group = np.full(count, -1, np.intp)
    # Those that are near are near along the first axis too.
    order = np.argsort(seen[:, 0])
    along = seen[order, 0]
    unsure = np.unique(pairs.image[~pairs.certain])
    outlines = np.empty((count, 8, 2))  # the outermost corners of each photo, pixels
    for photo in range(count if len(unsure) else 0):
        outlines[photo] = outermost(pairs.pixel[pairs.image == photo])
    for photo in range(count):
        if group[photo] >= 0:
            continue
        ends = np.searchsorted(along, seen[photo, 0] + tolerance * np.array([-1, 1]))
        near = order[slice(*ends)]
        near = near[np.linalg.norm(seen[near] - seen[photo], axis=1) <= tolerance]
        if len(unsure):
            apart = np.median(np.linalg.norm(outlines - outlines[photo], axis=2), axis=1)
            by_place = np.flatnonzero(apart < share * max(pairs.image_size))
            if photo in unsure:
                near = by_place
            else:
                near = np.union1d(np.setdiff1d(near, unsure), np.intersect1d(by_place, unsure))
        group[near[group[near] < 0]] = group.max() + 1
    return group


def _project_target(poses: Poses, world: FloatArray, focal: float) -> FloatArray:
    """(photos, 3 K) directions to the target's middle and to the ends of its axes, in pixels."""
    middle = world.mean(axis=0)
    _, extent, axes = np.linalg.svd(world - middle, full_matrices=False)
    axis_points = (extent / np.sqrt(len(world)))[:, None] * axes
    points = middle + np.vstack([np.zeros((1, 3)), axis_points, -axis_points])
    camera = points @ poses.rotation.transpose(0, 2, 1) + poses.translation[:, None, :]
    distance = np.linalg.norm(camera, axis=2, keepdims=True)
    return (focal * camera / distance).reshape(len(poses), -1)
