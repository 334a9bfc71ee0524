"""Boards of small squares of which only a part was found: searched again where they lie."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.types import BoolArray
from cubicfish_cli.corners.detection.finder import find_grids
from cubicfish_cli.corners.detection.grids import FoundGrids, Grid
from cubicfish_cli.corners.detection.nearby import nearest

# Squares of 6 px are found. Where a board's are 12 px, some of it has smaller ones: a fisheye's rim
# and a slanted board's far side shrink them to half.
_SMALL_PX = 12.0
# The squares around a board's corners, and one that the prediction may be off by.
_MARGIN = 2
# A corner of one grid is one of another grid's when they are nearer than this, in squares. A grid
# is a part of another when it has most of its corners in it.
_SAME, _MOST = 0.3, 0.5


def is_part(grid: Grid, sizes: Collection[tuple[int, int]]) -> bool:
    """Whether a grid of small squares may be a part of a board that has more corners.

    Args:
        grid: the grid.
        sizes: (columns, rows) of inner corners of the target's boards.

    """
    return _count_missing(grid, sizes) is not None


def complete_grids(
    image: npt.NDArray[np.generic], found: FoundGrids, sizes: Collection[tuple[int, int]]
) -> FoundGrids:
    """Search at twice the photo's size for the rest of boards of which a part was found.

    Args:
        image: (H, W) grey levels.
        found: what was found in it.
        sizes: as in :func:`is_part`.

    """
    grids = list(found.grids)
    for part in found.grids:
        missing = _count_missing(part, sizes)
        if missing is None or not any(part is one for one in grids):
            continue
        margin = part.step * (missing + _MARGIN)
        first = np.maximum(np.floor(part.pixel.min(axis=0) - margin), 0).astype(int)
        x, y = np.ceil(part.pixel.max(axis=0) + margin).astype(int)
        closer = find_grids(image[first[1] : y + 1, first[0] : x + 1], closely=True)
        for grid in closer.grids:
            whole = replace(grid, pixel=grid.pixel + first)
            if len(whole) > len(part) and _find_shared(part, whole).mean() > _MOST:
                grids = [one for one in grids if _find_shared(one, whole).mean() <= _MOST]
                grids.append(_take_pixels(whole, part))
                break
    grids.sort(key=lambda grid: -len(grid))
    return replace(found, grids=tuple(grids))


def _count_missing(grid: Grid, sizes: Collection[tuple[int, int]]) -> int | None:
    """How many rows or columns some board has more than a part of it; None of what is none."""
    if grid.step > _SMALL_PX or any(len(grid) == columns * rows for columns, rows in sizes):
        return None
    own = np.sort(np.ptp(grid.cells, axis=0) + 1)
    more = [np.sort(size) - own for size in sizes]
    return max((int(one.max()) for one in more if one.min() >= 0), default=None)


def _find_shared(one: Grid, other: Grid) -> BoolArray:
    """Which corners of a grid are corners of the other one too."""
    distance, _ = nearest(one.pixel, other.pixel, 1)
    same: BoolArray = distance[:, 0] < _SAME * other.step
    return same


def _take_pixels(grid: Grid, part: Grid) -> Grid:
    """A grid with the pixels of its part where that has them: nearer at the photo's own size."""
    same = _find_shared(grid, part)
    _, index = nearest(grid.pixel, part.pixel, 1)
    return replace(grid, pixel=np.where(same[:, None], part.pixel[index[:, 0]], grid.pixel))
