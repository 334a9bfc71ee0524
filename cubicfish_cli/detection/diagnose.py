"""Why a photo shows no grid."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.candidates import find_saddles
from cubicfish_cli.detection.finder import MOST_PIXELS
from cubicfish_cli.detection.grids import FoundGrids
from cubicfish_cli.detection.pyramid import SMALLEST_SIDE, build_pyramid, reduced
from cubicfish_cli.words.codes import Code
from cubicfish_cli.words.finding import Finding

# Of the range of the photo's number type: brightest and darkest that 99 % of the pixels keep to.
_DARK, _BRIGHT = 0.08, 0.97
_FLAT = 8  # times the noise: less between dark and bright is no pattern
# Squares of a grid must be at least this large to be found.
_SMALLEST_SQUARE = 6


def explain_no_grids(image: npt.NDArray[np.generic], found: FoundGrids) -> Finding:
    """What is wrong with a photo in which no grid was found.

    Args:
        image: (H, W) grey levels.
        found: what :func:`~.finder.find_grids` found in it.

    """
    height, width = image.shape
    if min(height, width) < SMALLEST_SIDE:
        return Finding(code=Code.PHOTO_TOO_SMALL, figures={"width": width, "height": height})
    zoom = 1
    while height * width > MOST_PIXELS * zoom * zoom:
        zoom *= 2
    small = np.asarray(reduced(image, zoom))
    full = float(np.iinfo(small.dtype).max) if np.issubdtype(small.dtype, np.integer) else None
    sample = small[:: max(1, height // 500), :: max(1, width // 500)]
    low, high = np.percentile(sample, [1, 99])
    if full is not None and high < _DARK * full:
        return Finding(code=Code.TOO_DARK)
    if full is not None and low > _BRIGHT * full:
        return Finding(code=Code.TOO_BRIGHT)
    if high <= low:
        return Finding(code=Code.NO_PATTERN)
    pyramid = build_pyramid(small)
    if (high - low) * pyramid.gain < _FLAT * pyramid.noise:
        return Finding(code=Code.LOW_CONTRAST)
    fine = _strong_saddles(pyramid.levels[0], pyramid.noise)
    coarse = sum(_strong_saddles(level, pyramid.noise) for level in pyramid.levels[2:4])
    if len(found.refused) == 0 and fine + coarse == 0:
        return Finding(code=Code.NO_CORNER)
    if coarse > 4 * fine:
        return Finding(code=Code.BLURRED)
    if fine > 400 and coarse < 0.02 * fine:
        return Finding(code=Code.SQUARES_TOO_SMALL, figures={"least_px": _SMALLEST_SQUARE})
    return Finding(code=Code.NO_CHECKERBOARD)


def _strong_saddles(level: npt.NDArray[np.float32], noise: float) -> int:
    return int((find_saddles(level, 1.0, max(noise, 3.0)).response > 0.2).sum())
