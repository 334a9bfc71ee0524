"""Photo -> grids of sub-pixel checkerboard corners."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.believe import is_board, is_large_enough
from cubicfish_cli.detection.corners import XCorners, find_corners
from cubicfish_cli.detection.grids import BoolArray, FloatArray, FoundGrids, Grid, IntArray
from cubicfish_cli.detection.growth import clean, grow, measure_contrast
from cubicfish_cli.detection.lattice import Lattice
from cubicfish_cli.detection.links import find_links, keep_squares
from cubicfish_cli.detection.nearby import nearest
from cubicfish_cli.detection.patches import Patch, find_patches
from cubicfish_cli.detection.pyramid import Pyramid, build_pyramid
from cubicfish_cli.detection.refine import refine_pixels
from cubicfish_cli.detection.verify import whole_corners


def find_grids(image: npt.NDArray[np.generic]) -> FoundGrids:
    """Find all checkerboard grids, whole or in part, in a 2-D grey photo (uint8/uint16/float)."""
    height, width = image.shape
    if min(height, width) < 8:
        return FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=(width, height))
    pyramid = build_pyramid(image)
    corners = find_corners(pyramid)
    patches = find_patches(keep_squares(find_links(pyramid, corners)))
    free = np.ones(len(corners.pixel), bool)
    grids = []
    for patch in patches:
        if len(patch.corner) < 4 or not free[patch.corner].all():
            continue
        lattice = _raise(pyramid, corners, patch, free)
        if not is_large_enough(lattice) or not _is_board(pyramid, lattice):
            continue
        cells = lattice.cells()
        pixel = lattice.pixel[cells[:, 0], cells[:, 1]]
        free &= ~_taken(corners.pixel, pixel, lattice.fit(cells).side)
        grids.append(_grid(lattice, pyramid.gain))
    grids.sort(key=lambda grid: -len(grid))
    return FoundGrids(grids=tuple(grids), refused=corners.pixel[free], image_size=(width, height))


def _raise(pyramid: Pyramid, corners: XCorners, patch: Patch, free: BoolArray) -> Lattice:
    lattice = Lattice.from_cells(
        patch.cells, corners.pixel[patch.corner], corners.contrast[patch.corner], patch.parity
    )
    measure_contrast(pyramid, lattice)
    for _ in range(2):
        clean(lattice)
        if lattice.known.sum() < 4:
            break
        grow(pyramid, lattice, corners.pixel[free])
        clean(lattice)
        refine_and_verify(pyramid, lattice)
    return lattice


def refine_and_verify(pyramid: Pyramid, lattice: Lattice) -> None:
    """Move corners to their sub-pixel positions and drop those that fail a test."""
    lattice.make_room()
    cells = lattice.cells()
    if not len(cells):
        return
    fit = lattice.fit(cells)
    pixel = lattice.pixel[cells[:, 0], cells[:, 1]]
    found = refine_pixels(pyramid, pixel, fit)
    sign = lattice.sign(cells)
    lattice.put(cells, found.pixel, found.contrast(sign))
    blur = np.zeros(lattice.known.shape)
    blur[cells[:, 0], cells[:, 1]] = found.blur.max(1)
    good = whole_corners(
        found,
        sign,
        fit.side,
        np.hypot(*(found.pixel - pixel).T),
        _median_around(lattice.contrast, lattice.known, cells),
        _median_around(blur, lattice.known, cells),
        pyramid.noise,
    )
    lattice.drop(cells[~good])
    clean(lattice)


def _median_around(values: FloatArray, known: BoolArray, cells: IntArray) -> FloatArray:
    offset = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 2, indexing="ij"), -1).reshape(-1, 2)
    around = cells[:, None] + offset
    value = np.where(
        known[around[..., 0], around[..., 1]], values[around[..., 0], around[..., 1]], np.nan
    )
    return np.nanmedian(value, axis=1)


def _is_board(pyramid: Pyramid, lattice: Lattice) -> bool:
    lattice.make_room()
    cells = lattice.cells()
    pixel = lattice.pixel[cells[:, 0], cells[:, 1]]
    found = refine_pixels(pyramid, pixel, lattice.fit(cells))
    return is_board(lattice, cells, found, _median_around(lattice.contrast, lattice.known, cells))


def _taken(points: FloatArray, pixel: FloatArray, side: FloatArray) -> BoolArray:
    if not len(points):
        return np.zeros(0, bool)
    distance, index = nearest(points, pixel, 1)
    return distance[:, 0] < 0.3 * side[index[:, 0]]


def _grid(lattice: Lattice, gain: float) -> Grid:
    cells = lattice.cells()
    origin = cells.min(0)
    pixel = lattice.pixel[cells[:, 0], cells[:, 1]]
    right = np.diff(lattice.pixel, axis=0)
    down = np.diff(lattice.pixel, axis=1)
    lengths = np.concatenate(
        [
            np.hypot(right[..., 0], right[..., 1]).ravel(),
            np.hypot(down[..., 0], down[..., 1]).ravel(),
        ]
    )
    return Grid(
        cells=cells - origin,
        pixel=pixel,
        parity=int(lattice.sign(origin[None])[0]),
        step=float(np.nanmedian(lengths)),
        contrast=lattice.contrast[cells[:, 0], cells[:, 1]] / gain,
    )
