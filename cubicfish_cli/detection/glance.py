"""What a photo shows, at a glance: enough to tell which of many photos are worth a closer look.

The first steps of the finder alone, on a reduced photo: corners are good to a few tenths of a
pixel, and those that only growth finds are missing, as are boards with small squares.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.believe import is_beyond_chance, is_large_enough
from cubicfish_cli.detection.corners import find_corners
from cubicfish_cli.detection.grids import FoundGrids
from cubicfish_cli.detection.growth import clean
from cubicfish_cli.detection.links import find_patches
from cubicfish_cli.detection.markers import MarkedCorners, outlined_corners
from cubicfish_cli.detection.pyramid import SMALLEST_SIDE, build_pyramid, enlarged, reduced
from cubicfish_cli.target import Target

# Photos are reduced to fewer pixels than these: squares show at 6 px, modules of markers at 1.6.
_MOST_PIXELS, _MOST_FOR_MARKERS = 250_000, 2_000_000


def glance_at_grids(image: npt.NDArray[np.generic]) -> FoundGrids:
    """Checkerboards in a grey photo (H, W) of uint8, uint16 or floats, larger ones first."""
    height, width = image.shape
    zoom = _zoom(image, _MOST_PIXELS)
    small = reduced(image, zoom)
    if min(small.shape) < SMALLEST_SIDE:
        return FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=(width, height))
    pyramid = build_pyramid(small)
    corners = find_corners(pyramid)
    free = np.ones(len(corners.pixel), bool)
    found = []
    for patch in find_patches(pyramid, corners):
        lattice = patch.lattice(corners)
        clean(lattice)
        if is_large_enough(lattice):
            found.append(lattice)
            free[patch.corner] = False
    grids = [lattice.as_grid() for lattice in found]
    grids = [
        replace(grid, pixel=enlarged(grid.pixel, zoom), step=zoom * grid.step)
        for grid in grids
        if is_beyond_chance(len(grid), int(free.sum()))
    ]
    return FoundGrids(
        grids=tuple(sorted(grids, key=lambda grid: -len(grid))),
        refused=enlarged(corners.pixel[free], zoom),
        image_size=(width, height),
    )


def glance_at_markers(image: npt.NDArray[np.generic], target: Target) -> MarkedCorners:
    """Corners of the target's boards with markers, in a photo as :func:`glance_at_grids` takes."""
    zoom = _zoom(image, _MOST_FOR_MARKERS)
    found = outlined_corners(reduced(image, zoom), target)
    return replace(found, pixel=enlarged(found.pixel, zoom))


def _zoom(image: npt.NDArray[np.generic], most: int) -> int:
    return max(1, math.ceil(math.sqrt(image.size / most)))
