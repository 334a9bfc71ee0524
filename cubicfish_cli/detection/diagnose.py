"""Why a photo shows no grid: one short phrase for the user."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.candidates import find_saddles
from cubicfish_cli.detection.finder import MOST_PIXELS
from cubicfish_cli.detection.grids import FoundGrids
from cubicfish_cli.detection.pyramid import SMALLEST_SIDE, build_pyramid, reduced

# Of the range of the photo's number type: brightest and darkest that 99 % of the pixels keep to.
_DARK, _BRIGHT = 0.08, 0.97
_FLAT = 8  # times the noise: less between dark and bright is no pattern
# Squares of a grid must be at least this large to be found.
_SMALLEST_SQUARE = 6


def explain_no_grids(image: npt.NDArray[np.generic], found: FoundGrids) -> str:
    """Say in a few words what is wrong with a photo in which no grid was found.

    Args:
        image: (H, W) grey levels.
        found: what :func:`~.finder.find_grids` found in it.

    """
    if found.grids:
        return "a checkerboard was found"
    height, width = image.shape
    if min(height, width) < SMALLEST_SIDE:
        return f"too small a photo ({width}x{height})"
    zoom = 1
    while height * width > MOST_PIXELS * zoom * zoom:
        zoom *= 2
    small = np.asarray(reduced(image, zoom))
    full = float(np.iinfo(small.dtype).max) if np.issubdtype(small.dtype, np.integer) else None
    sample = small[:: max(1, height // 500), :: max(1, width // 500)]
    low, high = np.percentile(sample, [1, 99])
    if full is not None and high < _DARK * full:
        return "too dark"
    if full is not None and low > _BRIGHT * full:
        return "too bright (overexposed)"
    if high <= low:
        return "an even picture without any pattern"
    pyramid = build_pyramid(small)
    if (high - low) * pyramid.gain < _FLAT * pyramid.noise:
        return "too little contrast above the noise"
    fine = _strong_saddles(pyramid.levels[0], pyramid.noise)
    coarse = sum(_strong_saddles(level, pyramid.noise) for level in pyramid.levels[2:4])
    if len(found.refused) == 0 and fine + coarse == 0:
        return "no checkerboard corner in sight"
    if coarse > 4 * fine:
        return "too blurred (out of focus or moved)"
    if fine > 400 and coarse < 0.02 * fine:
        return f"corners too close together (squares must be {_SMALLEST_SQUARE} px or more)"
    return "corner-like points, but no checkerboard pattern"


def _strong_saddles(level: npt.NDArray[np.float32], noise: float) -> int:
    return int((find_saddles(level, 1.0, max(noise, 3.0)).response > 0.2).sum())
