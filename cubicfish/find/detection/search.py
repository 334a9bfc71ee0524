"""One scale of a photo -> grids of sub-pixel checkerboard corners, and pieces that may be more."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress

import numpy as np

from cubicfish.find.detection.accept import (
    hang_together,
    is_beyond_chance,
    is_board,
    is_large_enough,
)
from cubicfish.find.detection.corners import XCorners, find_corners
from cubicfish.find.detection.crossing import Crossings
from cubicfish.find.detection.growth import clean, grow, measure_contrast
from cubicfish.find.detection.lattice import Lattice, window
from cubicfish.find.detection.links import Patch, find_patches
from cubicfish.find.detection.medians import median
from cubicfish.find.detection.nearby import Tree, nearest
from cubicfish.find.detection.pyramid import Pyramid, enlarged
from cubicfish.find.detection.refine import measures, refine_pixels, whole_corners
from cubicfish.find.detection.seeds import SURE_CORNERS, find_promising
from cubicfish.types import BoolArray, FloatArray, IntArray

# Texture has squares by the hundred. Boards have the largest pieces, so they come first; after
# this many pieces that did not grow into a board the search is over.
_MOST_FAILURES = 40
_SQUARE = 4  # corners
# A grid that has grown to so many times the corners it had, and these at least, goes on growing
# only if it would be a board. That is one that keeps this share of its corners: of a board's nearly
# all stay.
_GROWN, _GROWN_LEAST, _KEPT_SHARE = 2, 64, 0.25
# What is judged by medians is judged by about so many corners of a grid: they are known to a sixth
# of their spread then.
_JUDGED, _BLOCK = 50, 4  # in blocks of cells, since corners are held against those around
# A crossing looks like a grid's when its radius is this share of a side, or as large as rings
# surely are, and it has this share of the contrast.
_LIKE_SHARE, _FAR_PX, _LIKE_CONTRAST = 0.3, 10.0, 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """A grid at one scale.

    Attributes:
        lattice: its corners, pixels of that scale.
        found: their fits, in the order of the lattice's cells.
        zoom: how many times smaller the photo is at that scale.

    """

    lattice: Lattice
    found: Crossings
    zoom: float

    @cached_property
    def pixel(self) -> FloatArray:
        """Its corners (N, 2), pixels of the photo."""
        return enlarged(self.lattice.at(self.lattice.cells()), self.zoom)

    @cached_property
    def side(self) -> FloatArray:
        """Sides of the squares at its corners (N,), pixels of the photo."""
        return self.zoom * self.lattice.fit(self.lattice.cells()).side

    def at(self, zoom: float) -> Lattice:
        """Its corners in pixels of another zoom."""
        lattice = copy.deepcopy(self.lattice)
        lattice.make_room()
        lattice.pixel = enlarged(lattice.pixel, self.zoom / zoom)
        return lattice


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchResult:
    """What one scale of a photo shows.

    Attributes:
        grids: the accepted grids, larger patches first.
        refused: candidate corners that belong to no grid, pixels of that scale.
        pieces: for each patch that is part of no grid its corners (K, 2), the same pixels; the
            larger ones first, and not all where there are very many.
        grown: how many patches were grown, whether they became grids or not.

    """

    grids: list[Seen]
    refused: XCorners
    pieces: list[FloatArray]
    grown: int = 0

    def moved(self, shift: FloatArray, gain: float) -> SearchResult:
        """The same where the first pixel lies at ``shift`` (2,), contrasts times ``gain``."""
        grids = []
        for one in self.grids:
            lattice = copy.deepcopy(one.lattice)
            lattice.pixel += shift
            lattice.contrast *= gain
            found = replace(one.found, pixel=one.found.pixel + shift)
            grids.append(replace(one, lattice=lattice, found=found))
        refused = replace(
            self.refused, pixel=self.refused.pixel + shift, contrast=self.refused.contrast * gain
        )
        pieces = [piece + shift for piece in self.pieces]
        return SearchResult(grids=grids, refused=refused, pieces=pieces, grown=self.grown)


_Fitted = tuple[Lattice, Crossings]
"""A grid, and the fits of those of its corners that stand for all."""
_NO_CORNERS = XCorners(
    pixel=np.zeros((0, 2)), angle=np.zeros((0, 4)), radius=np.zeros(0), contrast=np.zeros(0)
)
NOTHING_SEEN = SearchResult(grids=[], refused=_NO_CORNERS, pieces=[])


def search(pyramid: Pyramid, zoom: float, known: Sequence[Lattice] = ()) -> SearchResult:
    """Find all grids but those that are known in the pyramid of a photo that many times smaller."""
    corners = find_corners(pyramid)
    for lattice in known:
        cells = lattice.cells()
        taken = _find_taken(corners.pixel, lattice.at(cells), lattice.fit(cells).side)
        corners = corners.select(~taken)
    patches = find_patches(pyramid, corners)
    lattices, grid, failures = _grow_patches(pyramid, corners, patches)
    found = [Seen(lattice=one, found=fits, zoom=zoom) for one, fits in lattices]
    unexplained = [
        corners.pixel[patch.corner]
        for patch in patches
        if len(patch.corner) >= _SQUARE and (grid[patch.corner] < 0).all()
    ]
    loose = corners.select(grid < 0)
    kept = [k for k, one in enumerate(found) if is_beyond_chance_among(one.lattice, loose)]
    return SearchResult(
        grids=[found[k] for k in kept],
        refused=corners.select(~np.isin(grid, kept)),
        pieces=unexplained[:_MOST_FAILURES],
        grown=len(found) + failures,
    )


def _grow_patches(
    pyramid: Pyramid, corners: XCorners, patches: Sequence[Patch]
) -> tuple[list[_Fitted], IntArray, int]:
    """Grids, which of them each corner (N,) is part of or -1, and how many patches became none."""
    grid = np.full(len(corners.pixel), -1)
    candidates = Tree(corners.pixel)
    found: list[_Fitted] = []
    failures = 0
    sure = sum(len(patch.corner) >= SURE_CORNERS for patch in patches)
    for group in (patches[:sure], patches[sure:]):
        # Where large pieces became grids the small ones need no look.
        left = [patch for patch in group if (grid[patch.corner] < 0).all()]
        for patch in compress(left, find_promising(pyramid, corners, left, candidates)):
            if failures == _MOST_FAILURES or (grid[patch.corner] >= 0).any():
                continue
            seen = _grow_patch(pyramid, corners, patch, candidates)
            if seen is None:
                failures += 1
                continue
            lattice, _ = seen
            cells = lattice.cells()
            taken = _find_taken(corners.pixel, lattice.at(cells), lattice.fit(cells).side)
            grid[taken & (grid < 0)] = len(found)
            candidates = Tree(corners.pixel[grid < 0])
            found.append(seen)
    return found, grid, failures


def is_beyond_chance_among(lattice: Lattice, crossings: XCorners, zoom: float = 1.0) -> bool:
    """Judge a grid by what crossings like its own there are that no grid explains.

    Args:
        lattice: the grid.
        crossings: those that no grid explains.
        zoom: size of a pixel of the lattice / size of one of the crossings'.

    """
    cells = lattice.cells()
    side = zoom * median(lattice.fit(cells).side)
    contrast = _LIKE_CONTRAST * median(lattice.contrast[lattice.known])
    like = crossings.radius >= min(_LIKE_SHARE * side, _FAR_PX)
    like &= crossings.contrast >= contrast
    return is_beyond_chance(len(cells), int(like.sum()))


def _grow_patch(
    pyramid: Pyramid, corners: XCorners, patch: Patch, candidates: Tree
) -> _Fitted | None:
    """Grow a patch into a grid; None when it turns out not to be a board."""
    lattice = patch.lattice(corners)
    measure_contrast(pyramid, lattice)
    clean(lattice)
    if lattice.known.sum() < _SQUARE:
        return None
    while grow(pyramid, lattice, candidates, max(_GROWN_LEAST, _GROWN * lattice.known.sum())):
        if _judge(pyramid, copy.deepcopy(lattice)) is None:
            return None  # over dots it would grow on and on
    return _judge(pyramid, lattice)


def _judge(pyramid: Pyramid, lattice: Lattice) -> _Fitted | None:
    """Drop what contradicts the rest of a grid or hangs on a single link; None if it is no board.

    Of a large grid some corners stand for all: they are fitted here, and nowhere else.
    """
    clean(lattice)
    if not is_large_enough(lattice):
        return None
    cells = lattice.cells()
    blocks = (cells // _BLOCK).sum(1) % max(1, len(cells) // _JUDGED)
    some = cells[blocks == np.bincount(blocks).argmax()]
    found, good = verify(pyramid, lattice, some, roughly=True)
    lattice.drop(some[~good])
    clean(lattice)
    if good.mean() < _KEPT_SHARE or not is_large_enough(lattice):
        return None
    cells = lattice.cells()
    lattice.drop(cells[~hang_together(lattice.known)[cells[:, 0], cells[:, 1]]])
    kept = lattice.known[some[:, 0], some[:, 1]]
    found = found.select(kept)
    return (lattice, found) if kept.any() and is_board(lattice, some[kept], found) else None


def refine_and_verify(pyramid: Pyramid, lattice: Lattice) -> tuple[Crossings, int]:
    """Move corners to their sub-pixel positions and drop those that fail a test.

    Returns the fits of the corners that stay, in the order of the cells, and how many went.
    """
    lattice.make_room()
    cells = lattice.cells()
    found, good = verify(pyramid, lattice, cells)
    lattice.drop(cells[~good])
    clean(lattice)
    kept = lattice.known[cells[:, 0], cells[:, 1]]
    return found.select(kept), int((~kept).sum())


def judge_whole(lattice: Lattice, found: Crossings) -> bool:
    """Drop corners that hang on a single link, and tell whether the rest is a board.

    ``found`` are the fits of all corners, in the order of the cells.
    """
    cells = lattice.cells()
    connected = hang_together(lattice.known)[cells[:, 0], cells[:, 1]]
    lattice.drop(cells[~connected])
    if not connected.any():
        return False
    return is_board(lattice, cells[connected], found.select(connected))


def verify(
    pyramid: Pyramid, lattice: Lattice, cells: IntArray, *, roughly: bool = False
) -> tuple[Crossings, BoolArray]:
    """Move some corners (N, 2) to their sub-pixel positions: fits, and which pass all tests."""
    fit = lattice.fit(cells)
    pixel = lattice.at(cells)
    found = refine_pixels(pyramid, pixel, fit, roughly=roughly)
    sign = lattice.sign(cells)
    lattice.put(cells, found.pixel, found.contrast(sign))
    around = _take_median_around(measures(found, sign), lattice, cells)
    moved = np.hypot(*(found.pixel - pixel).T)
    return found, whole_corners(found, sign, fit.side, moved, around, pyramid.noise)


def _take_median_around(values: FloatArray, lattice: Lattice, cells: IntArray) -> FloatArray:
    """Medians (N, K) over the known corners of the 5x5 cells around, of (N, K) values of cells."""
    every = np.full((*lattice.known.shape, values.shape[1]), np.inf)
    every[cells[:, 0], cells[:, 1]] = values
    around = cells[:, None] + window(2)
    inorder = np.sort(every[around[..., 0], around[..., 1]], axis=1)
    count = np.isfinite(inorder[..., :1]).sum(1, keepdims=True)
    low = np.take_along_axis(inorder, (count - 1) // 2, axis=1)
    return 0.5 * (low + np.take_along_axis(inorder, count // 2, axis=1))[:, 0]


def _find_taken(points: FloatArray, pixel: FloatArray, side: FloatArray) -> BoolArray:
    if not len(points):
        return np.zeros(0, bool)
    distance, index = nearest(points, pixel, 1)
    return distance[:, 0] < 0.3 * side[index[:, 0]]
