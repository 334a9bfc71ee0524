"""A grid that was seen at one scale -> its corners as finer scales show them.

What is missing is looked for beside the known corners, scale by scale, and all corners are refined
where a window sees their blur whole: for a sharp photo that is its full size.
"""

from __future__ import annotations

import copy
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from cubicfish.find.detection.accept import is_large_enough
from cubicfish.find.detection.crossing import Crossings
from cubicfish.find.detection.grids import Grid, Rows
from cubicfish.find.detection.growth import clean, grow
from cubicfish.find.detection.ladder import Ladder
from cubicfish.find.detection.lattice import Lattice
from cubicfish.find.detection.medians import median
from cubicfish.find.detection.nearby import Tree, nearest
from cubicfish.find.detection.pyramid import CLOSE, Pyramid, enlarged
from cubicfish.find.detection.refine import (
    LARGEST_HALF,
    USUAL_HALF,
    find_start,
    least_window,
    refine_at_full_size,
)
from cubicfish.find.detection.search import Seen, judge_whole, refine_and_verify, verify
from cubicfish.types import FloatArray

# A pixel averages light: what is sharp in a reduced photo is blurred by so many of its pixels.
_SHARP = 0.5
# Squares of 6 px are found. Where some of a grid's are of 12 px at the photo's own size, the next
# ones of a fisheye's rim or a slanted board's far side may be of half of that.
SMALL_PX = 12.0
# Where a corner's blur takes this share of the largest window, noise alone may make it fail.
_MOST_OF_WINDOW = 0.7
# A corner is the same as another one that is nearer than this, in squares.
SAME = 0.3
_NOBODY = Tree(np.zeros((0, 2)))
_NO_LIMIT = 2**31


def size_of(lattice: Lattice) -> tuple[int, int] | None:
    """(Fewer, more) columns and rows of corners of a lattice without gaps; None of others."""
    cells = lattice.cells()
    if not len(cells):
        return None
    columns, rows = (np.ptp(cells, axis=0) + 1).tolist()
    return in_order((columns, rows)) if columns * rows == len(cells) else None


def in_order(size: tuple[int, int]) -> tuple[int, int]:
    """Columns and rows, the fewer first: which way round a grid lies is not known."""
    return min(size), max(size)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Places(Rows):
    """Where a scale shows corners.

    Attributes:
        pixel: (N, 2) pixels of the photo.
        window: (N,) half-size of the window that each needs, pixels of the photo.

    """

    pixel: FloatArray
    window: FloatArray

    @classmethod
    def of(cls, found: Crossings, zoom: float) -> _Places:
        """Fits at a zoom."""
        blur = np.sqrt(np.maximum(np.square(found.blur) - _SHARP**2, 0))
        window = zoom * least_window(replace(found, blur=blur))
        return cls(pixel=enlarged(found.pixel, zoom), window=window)


def follow(ladder: Ladder, seen: Seen, sizes: Collection[tuple[int, int]]) -> Grid | None:
    """Complete and refine a grid.

    Args:
        ladder: the photo.
        seen: the grid, which is used up.
        sizes: of the boards that there may be: what is as large as one is whole.

    Returns:
        The grid in pixels of the photo; None where too little of it stays.

    """
    lattice, zoom = seen.lattice, seen.zoom
    places = [_Places.of(seen.found, zoom)]
    last = np.ceil(median(places[0].window) / LARGEST_HALF)
    last = min(max(float(last), ladder.finest), zoom)
    if median(least_window(seen.found)) > USUAL_HALF and ladder.is_possible(2 * zoom):
        zoom = _change(ladder, lattice, zoom, 2 * zoom)
        before = lattice.pixel[lattice.known]
        if size_of(lattice) not in sizes and _grow(ladder.at(zoom), lattice):
            cells = lattice.cells()
            new = nearest(lattice.at(cells), before, 1)[0][:, 0] > 0
            found, good = verify(ladder.at(zoom), lattice, cells)
            lattice.drop(cells[new & ~good])
            places.append(_Places.of(found.select(good), zoom))
    for finer in [*(one for one in ladder.finer(zoom) if one > last), last]:
        if size_of(lattice) in sizes:
            break
        zoom = _change(ladder, lattice, zoom, finer)
        _grow(ladder.at(zoom), lattice)
    zoom = _change(ladder, lattice, zoom, last)
    if not _refine(ladder.at(last), lattice, last, _Places.joined(places)):
        return None
    if last == 1 and size_of(lattice) not in sizes and ladder.is_possible(CLOSE):
        lattice = _add_close(ladder, lattice)
    return _make_grid(ladder, lattice, last)


def _change(ladder: Ladder, lattice: Lattice, zoom: float, other: float) -> float:
    """Change a lattice from one zoom to another, which is returned; cells may be tried again."""
    if zoom != other:
        lattice.make_room()
        lattice.pixel = enlarged(lattice.pixel, zoom / other)
        lattice.contrast *= ladder.at(other).gain / ladder.at(zoom).gain
        lattice.half_gap *= zoom / other
        lattice.tried[:] = 0
    return other


def _grow(pyramid: Pyramid, lattice: Lattice) -> bool:
    """Add what is seen beside the known corners; whether there is any."""
    before = int(lattice.known.sum())
    grow(pyramid, lattice, _NOBODY, _NO_LIMIT)
    if lattice.known.sum() == before:
        return False
    clean(lattice)
    return True


def _refine(pyramid: Pyramid, lattice: Lattice, zoom: float, places: _Places) -> bool:
    """Refine all corners, and tell whether they are a board at this zoom too.

    Those too blurred for any window at this zoom stay where they were seen.
    """
    # Local shapes, to which corners are fitted, are as good as the places around.
    cells = lattice.cells()
    start = find_start(pyramid, lattice.at(cells), lattice.fit(cells).side)
    lattice.pixel[cells[:, 0], cells[:, 1]] = start
    lattice.make_room()
    before = copy.deepcopy(lattice)
    found, _ = refine_and_verify(pyramid, lattice)
    if not is_large_enough(lattice) or not judge_whole(lattice, found):
        return False
    _put_back(before, lattice, zoom, places)
    return True


def _put_back(before: Lattice, lattice: Lattice, zoom: float, places: _Places) -> None:
    """Put corners back that went and are blurred, where another scale shows them."""
    cells = before.cells()
    side, pixel = before.fit(cells).side, enlarged(before.at(cells), zoom)
    distance, index = nearest(pixel, places.pixel, 1)
    back = ~lattice.known[cells[:, 0], cells[:, 1]] & (distance[:, 0] < SAME * zoom * side)
    back &= places.window[index[:, 0]] > _MOST_OF_WINDOW * LARGEST_HALF * zoom
    cells, seen = cells[back], enlarged(places.pixel[index[back, 0]], 1 / zoom)
    lattice.put(cells, seen, before.contrast[cells[:, 0], cells[:, 1]])


def _add_close(ladder: Ladder, lattice: Lattice) -> Lattice:
    """Add corners of squares so small that only twice the photo's size shows them.

    The others stay where the photo's own size has them: that is nearer to the truth.
    """
    lattice.make_room()
    cells, pixel = lattice.cells(), lattice.at(lattice.cells())
    if median(lattice.fit(cells).side) > SMALL_PX:
        return lattice
    larger = copy.deepcopy(lattice)
    _change(ladder, larger, 1, CLOSE)
    if not _grow(ladder.at(CLOSE), larger):
        return lattice
    refine_and_verify(ladder.at(CLOSE), larger)
    _change(ladder, larger, CLOSE, 1)
    if larger.known.sum() <= len(cells):
        return lattice
    # Maps that were widened count cells from another place.
    distance, index = nearest(pixel, larger.at(larger.cells()), 1)
    same = int(distance[:, 0].argmin())
    moved = cells + larger.cells()[index[same, 0]] - cells[same]
    larger.put(moved, pixel, lattice.contrast[lattice.known])
    return larger


def _make_grid(ladder: Ladder, lattice: Lattice, zoom: float) -> Grid:
    pyramid = ladder.at(zoom)
    lattice.make_room()
    if 1 < zoom == ladder.finest:
        cells = lattice.cells()
        lattice.pixel = enlarged(lattice.pixel, zoom)
        fit, noise = lattice.fit(cells), pyramid.noise / pyramid.gain
        found = refine_at_full_size(ladder.image, lattice.at(cells), fit, zoom, noise)
        lattice.put(cells, found, lattice.contrast[cells[:, 0], cells[:, 1]])
        zoom = 1
    grid = lattice.as_grid()
    pixel, step = enlarged(grid.pixel, zoom), zoom * grid.step
    return replace(grid, pixel=pixel, step=step, contrast=grid.contrast / pyramid.gain)
