"""Which photos are left out together, to be judged by a camera that never saw them.

Photos from the same place count as one, so that none is judged by a camera that saw its repeat.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.radial_reference import RadialReference
from cubicfish_cli.core.fit.repeats import repeated_groups
from cubicfish_cli.core.frame_names import film_and_time
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import IntArray

FOLDS = 5
MIN_PHOTOS = 3


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
    """Indices of the photos of each part, see :func:`dealt`; parts that stay empty are left out."""
    part = dealt(group, images, parts)
    return [np.flatnonzero(part == number) for number in np.unique(part)]


def dealt(group: IntArray, images: Sequence[str], parts: int) -> IntArray:
    """Deal groups of photos out into parts: (M,) numbers from 0 -> (M,) numbers below ``parts``.

    By name, so that the order in which photos come does not matter: photos in turn, frames of films
    in blocks of time, since neighbours share their errors.

    Args:
        group: which photos stay together.
        images: names of the photos.
        parts: how many parts; no more than groups.

    """
    by_name = np.argsort(np.array(images), kind="stable")
    _, first = np.unique(group[by_name], return_index=True)
    of_film = np.array([film_and_time(images[by_name[photo]]) is not None for photo in first])
    part = np.empty(len(first), np.intp)
    for some, in_blocks in ((of_film, True), (~of_film, False)):
        rank = np.argsort(np.argsort(first[some]))
        part[some] = rank * parts // len(rank) if in_blocks else (rank + np.sum(of_film)) % parts
    return part[group]
