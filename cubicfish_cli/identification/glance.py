"""Many photos -> named corners at a glance: enough to tell which of them to look at closely.

Nothing is said of photos or target that do not fit: a closer look tells that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Protocol

import numpy as np

from cubicfish_cli.detection.glance import glance_at_grids, glance_at_markers
from cubicfish_cli.detection.grids import FoundGrids
from cubicfish_cli.detection.markers import MarkedCorners
from cubicfish_cli.errors import PhotoError
from cubicfish_cli.executors.pool import map_photos, workers_for
from cubicfish_cli.identification.marked import marked_corners
from cubicfish_cli.identification.name_grids import name_grids
from cubicfish_cli.observations import Observations
from cubicfish_cli.photos import Picture
from cubicfish_cli.target import Target

Glimpse = FoundGrids | MarkedCorners


class Looked(Protocol):
    """A picture that can be looked at, here or in another process."""

    @property
    def name(self) -> str:
        """What it is called."""
        ...

    def read_grey(self) -> Picture:
        """Its brightness (H, W)."""
        ...


def glance(
    pictures: Sequence[Looked],
    target: Target | None,
    *,
    jobs: int | None = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Glimpse | None]:
    """What each picture shows: corners named by markers, or grids of checkerboards.

    Args:
        pictures: photos, or whatever else is looked at.
        target: the object; None looks for any checkerboard.
        jobs: processes to use; None for one a processor.
        progress: called with pictures done and all pictures.

    Returns:
        None for each that cannot be read.

    """
    found: list[Glimpse | None] = []
    look = partial(_look, marked=target if target is not None and target.has_markers else None)
    for one in map_photos(look, pictures, workers_for(jobs, len(pictures))):
        found.append(one)
        progress(len(found), len(pictures))
    return found


def named_at_a_glance(
    found: Sequence[Glimpse | None],
    targets: Sequence[Target],
    size: tuple[int, int],
    names: Sequence[str],
) -> Observations:
    """Named corners of what was seen, of the target that explains most.

    Args:
        found: of each picture, by :func:`glance` with the first of the targets.
        targets: what the object may be; of those with markers only one.
        size: (width, height) of the pictures; what is not of this size is passed over.
        names: of the pictures; those that show nothing are named in the result all the same.

    """
    if targets[0].has_markers:
        none = glance_at_markers(np.zeros((1, 1), np.uint8), targets[0])
        marked = [one if isinstance(one, MarkedCorners) else none for one in found]
        return marked_corners(marked, targets[0], size, names)
    grids = [
        one.grids if isinstance(one, FoundGrids) and one.image_size == size else () for one in found
    ]
    return max(
        (name_grids(grids, target, size, names).corners for target in targets),
        key=lambda one: len(one.pixel),
    )


def _look(picture: Looked, *, marked: Target | None) -> Glimpse | None:
    try:
        grey = picture.read_grey()
    except PhotoError:
        return None
    return glance_at_grids(grey) if marked is None else glance_at_markers(grey, marked)
