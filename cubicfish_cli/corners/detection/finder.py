"""Photo -> grids of sub-pixel checkerboard corners."""

import copy
from dataclasses import replace
from itertools import compress

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.corners.detection.accept import (
    hang_together,
    is_beyond_chance,
    is_board,
    is_large_enough,
)
from cubicfish_cli.corners.detection.corners import XCorners, find_corners
from cubicfish_cli.corners.detection.crossing import Crossings
from cubicfish_cli.corners.detection.grids import FoundGrids, Grid
from cubicfish_cli.corners.detection.growth import clean, grow, measure_contrast
from cubicfish_cli.corners.detection.lattice import Lattice, window
from cubicfish_cli.corners.detection.links import Patch, find_patches
from cubicfish_cli.corners.detection.nearby import nearest
from cubicfish_cli.corners.detection.pyramid import (
    CLOSE,
    SMALLEST_SIDE,
    Pyramid,
    build_pyramid,
    enlarged,
    reduced,
)
from cubicfish_cli.corners.detection.refine import (
    measures,
    refine_at_full_size,
    refine_pixels,
    whole_corners,
)
from cubicfish_cli.corners.detection.seeds import SURE_CORNERS, find_promising

# A photo of more pixels is searched at half its size, or a quarter...
MOST_PIXELS = 16_000_000
# Texture has squares by the hundred. Boards have the largest pieces, so they come first; after
# this many pieces that did not grow into a board the search is over.
_MOST_FAILURES = 40
# Growing again after wrong corners went: they may have stood in the way.
_PASSES = 2
# A grid that has grown to so many times the corners it had, and these at least, goes on growing
# only if it would be a board and keep this share of its corners: nearly all stay of a board's.
_GROWN, _GROWN_LEAST, _KEPT_SHARE = 2, 64, 0.25
# A crossing looks like a grid's when its radius is this share of a side, or as large as rings
# surely are, and it has this share of the contrast.
_LIKE_SHARE, _FAR_PX, _LIKE_CONTRAST = 0.3, 10.0, 0.5


def find_grids(image: npt.NDArray[np.generic], *, closely: bool = False) -> FoundGrids:
    """Find all checkerboard grids, whole or in part, in a grey photo.

    Boards may be cut by the photo's border, the image circle or each other, bent by a fisheye
    lens beyond 180 degrees, dim or bright. Squares may be 6 px small, in a photo of more than
    MOST_PIXELS 6 px of the reduced photo that it is searched in; corners are then refined in
    the photo itself. Memory beyond the photo's own stays under 1 GB.

    Args:
        image: (H, W) grey levels, uint8, uint16 or float.
        closely: search a photo of at most MOST_PIXELS / 4 at twice its size, for squares half as
            small.

    """
    height, width = image.shape
    size = (width, height)
    if min(height, width) < SMALLEST_SIDE:
        return FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=size)
    zoom = CLOSE if closely else 1.0
    while height * width > MOST_PIXELS * zoom * zoom:
        zoom *= 2
    pyramid = build_pyramid(reduced(image, zoom))
    lattices, refused = _search(pyramid)
    grids = [_make_grid(lattice, image, pyramid, zoom) for lattice in lattices]
    grids.sort(key=lambda grid: -len(grid))
    return FoundGrids(grids=tuple(grids), refused=enlarged(refused, zoom), image_size=size)


def _search(pyramid: Pyramid) -> tuple[list[Lattice], FloatArray]:
    """All grids in the pyramid, and the corners that belong to none."""
    corners = find_corners(pyramid)
    grid = np.full(len(corners.pixel), -1)  # which each corner is part of
    candidates = cKDTree(corners.pixel)
    lattices: list[Lattice] = []
    failures = 0
    patches = find_patches(pyramid, corners)
    sure = sum(len(patch.corner) >= SURE_CORNERS for patch in patches)
    for group in (patches[:sure], patches[sure:]):
        # Where large pieces became grids the small ones need no look.
        left = [patch for patch in group if (grid[patch.corner] < 0).all()]
        for patch in compress(left, find_promising(pyramid, corners, left, candidates)):
            if failures == _MOST_FAILURES or (grid[patch.corner] >= 0).any():
                continue
            lattice = _grow_patch(pyramid, corners, patch, candidates)
            if lattice is None:
                failures += 1
                continue
            cells = lattice.cells()
            taken = _find_taken(corners.pixel, lattice.at(cells), lattice.fit(cells).side)
            grid[taken & (grid < 0)] = len(lattices)
            candidates = cKDTree(corners.pixel[grid < 0])
            lattices.append(lattice)
    kept = [
        k for k, lattice in enumerate(lattices) if _is_beyond_chance(lattice, corners, grid < 0)
    ]
    return [lattices[k] for k in kept], corners.pixel[~np.isin(grid, kept)]


def _is_beyond_chance(lattice: Lattice, corners: XCorners, free: BoolArray) -> bool:
    """Judge a grid by what crossings like its own there are that no grid explains."""
    cells = lattice.cells()
    least_radius = min(_LIKE_SHARE * float(np.median(lattice.fit(cells).side)), _FAR_PX)
    # A large square holds many candidates besides its corner, weak ones of noise.
    _, own = nearest(lattice.at(cells), corners.pixel, 1)
    contrast = _LIKE_CONTRAST * float(np.median(corners.contrast[own[:, 0]]))
    like = free & (corners.radius >= least_radius) & (corners.contrast >= contrast)
    return is_beyond_chance(len(cells), int(like.sum()))


def _grow_patch(
    pyramid: Pyramid, corners: XCorners, patch: Patch, candidates: cKDTree
) -> Lattice | None:
    """Grow a patch into a grid; None when it turns out not to be a board."""
    lattice = patch.lattice(corners)
    measure_contrast(pyramid, lattice)
    for _ in range(_PASSES):
        clean(lattice)
        if lattice.known.sum() < 4:
            return None
        before = lattice.known.sum()
        while grow(pyramid, lattice, candidates, max(_GROWN_LEAST, _GROWN * lattice.known.sum())):
            if not _is_board_so_far(pyramid, lattice):
                return None
        clean(lattice)
        if not is_large_enough(lattice):
            return None
        grown = lattice.known.sum() > before
        found, dropped = refine_and_verify(pyramid, lattice)
        if not is_large_enough(lattice):
            return None
        if not (grown and dropped):
            break
    return lattice if _is_board_at_last(lattice, found) else None


def _is_board_so_far(pyramid: Pyramid, lattice: Lattice) -> bool:
    """Judge what still grows: over dots it would grow on and on."""
    trial = copy.deepcopy(lattice)
    clean(trial)
    found, _ = refine_and_verify(pyramid, trial)
    stays = trial.known.sum() >= _KEPT_SHARE * lattice.known.sum()
    return bool(stays) and is_large_enough(trial) and _is_board_at_last(trial, found)


def _is_board_at_last(lattice: Lattice, found: Crossings) -> bool:
    """Drop corners that hang on a single link, and judge the rest."""
    cells = lattice.cells()
    connected = hang_together(lattice.known)[cells[:, 0], cells[:, 1]]
    lattice.drop(cells[~connected])
    return is_board(lattice, cells[connected], found.select(connected))


def refine_and_verify(pyramid: Pyramid, lattice: Lattice) -> tuple[Crossings, int]:
    """Move corners to their sub-pixel positions and drop those that fail a test.

    Returns the fits of the corners that stay, in the order of the cells, and how many went.
    """
    lattice.make_room()
    cells = lattice.cells()
    fit = lattice.fit(cells)
    pixel = lattice.at(cells)
    found = refine_pixels(pyramid, pixel, fit)
    sign = lattice.sign(cells)
    lattice.put(cells, found.pixel, found.contrast(sign))
    around = _take_median_around(measures(found, sign), lattice, cells)
    moved = np.hypot(*(found.pixel - pixel).T)
    good = whole_corners(found, sign, fit.side, moved, around, pyramid.noise)
    lattice.drop(cells[~good])
    clean(lattice)
    kept = lattice.known[cells[:, 0], cells[:, 1]]
    return found.select(kept), int((~kept).sum())


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


def _make_grid(
    lattice: Lattice, image: npt.NDArray[np.generic], pyramid: Pyramid, zoom: float
) -> Grid:
    lattice.make_room()
    if zoom != 1:
        cells = lattice.cells()
        lattice.pixel = enlarged(lattice.pixel, zoom)
        found = refine_at_full_size(
            image, lattice.at(cells), lattice.fit(cells), zoom, pyramid.noise / pyramid.gain
        )
        lattice.put(cells, found, lattice.contrast[cells[:, 0], cells[:, 1]])
    grid = lattice.as_grid()
    return replace(grid, contrast=grid.contrast / pyramid.gain)
