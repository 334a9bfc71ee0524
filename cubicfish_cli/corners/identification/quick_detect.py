"""Quick detection: pictures -> named corners, enough to choose which of them to detect in fully.

The first steps of the finder alone, on reduced photos: corners are good to a few tenths of a pixel,
and those that only growth finds are missing, as are boards with small squares. Photos or a target
that do not fit are not reported: full detection does that.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.target import Target
from cubicfish_cli.corners.detection.accept import is_beyond_chance, is_large_enough
from cubicfish_cli.corners.detection.corners import find_corners
from cubicfish_cli.corners.detection.grids import FoundGrids
from cubicfish_cli.corners.detection.growth import clean
from cubicfish_cli.corners.detection.links import find_patches
from cubicfish_cli.corners.detection.markers import MarkedCorners, outlined_corners
from cubicfish_cli.corners.detection.pyramid import SMALLEST_SIDE, build_pyramid, enlarged, reduced
from cubicfish_cli.corners.identification.identified import Identified, marked_corners
from cubicfish_cli.corners.identification.name_grids import name_grids

# Photos are reduced to fewer pixels than these: squares show at 6 px, modules of markers at 1.6.
_MOST_PIXELS, _MOST_FOR_MARKERS = 250_000, 2_000_000
QuickDetection = FoundGrids | MarkedCorners


def quick_detect_grids(image: npt.NDArray[np.generic]) -> FoundGrids:
    """Checkerboards in a grey photo (H, W) of uint8, uint16 or floats, larger ones first."""
    height, width = image.shape
    zoom = _choose_zoom(image, _MOST_PIXELS)
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


def quick_detect_markers(image: npt.NDArray[np.generic], target: Target) -> MarkedCorners:
    """Find corners of the boards with markers; the photo as for :func:`quick_detect_grids`."""
    zoom = _choose_zoom(image, _MOST_FOR_MARKERS)
    found = outlined_corners(reduced(image, zoom), target)
    return replace(found, pixel=enlarged(found.pixel, zoom))


def _choose_zoom(image: npt.NDArray[np.generic], most: int) -> int:
    return max(1, math.ceil(math.sqrt(image.size / most)))


def name_quick_detections(
    found: Sequence[QuickDetection | None],
    targets: Sequence[Target],
    size: tuple[int, int],
    names: Sequence[str],
) -> tuple[Observations, Identified | None]:
    """Named corners of what was seen, of the target that explains most.

    Args:
        found: of each picture what markers of the first of the targets name, or its grids; None
            where it cannot be read.
        targets: what the target may be; of those with markers only one.
        size: (width, height) of the pictures; what is not of this size is passed over.
        names: of the pictures; those that show nothing are named in the result all the same.

    Returns:
        The corners with their target, and what became of grids; None where markers have the names.

    """
    if targets[0].has_markers:
        none = quick_detect_markers(np.zeros((1, 1), np.uint8), targets[0])
        marked = [one if isinstance(one, MarkedCorners) else none for one in found]
        return marked_corners(marked, targets[0], size, names), None
    grids = [
        one.grids if isinstance(one, FoundGrids) and one.image_size == size else () for one in found
    ]
    named = [name_grids(grids, target, size, names) for target in targets]
    best = max(named, key=lambda one: len(one.corners.pixel))
    return best.corners, best
