"""Last word on each corner: is it whole, sharp, and like its neighbours?"""

from __future__ import annotations

import numpy as np

from cubicfish_cli.detection.grids import BoolArray, FloatArray
from cubicfish_cli.detection.squares import Quadrants

# Each bound is relative to the corner's own surroundings, so that dim and blurred boards count
# as much as bright and sharp ones.
_BRIGHT_ALIKE = 0.58  # darker / brighter of the two bright squares
_SEPARATION = 0.55  # of the corner's own contrast
_CONTRAST = 0.42  # of the median contrast around
_LEVEL = 0.34  # brightness near / far along the diagonals: cut by the image circle?
_SHARPNESS = 0.45  # of the median around


def whole_corners(
    square: Quadrants,
    curvature: FloatArray,
    contrast_around: FloatArray,
    curvature_around: FloatArray,
    noise: float,
) -> BoolArray:
    """Tell which of N corners pass every test."""
    contrast = square.contrast
    dark = square.dark.mean((1, 2))
    # Levels above the dark squares: a black level that is not zero must not hide a shadow.
    bright = square.bright.mean(2) - dark[:, None]
    good = bright.min(1) > _BRIGHT_ALIKE * bright.max(1)
    good &= square.separation > _SEPARATION * contrast
    good &= contrast > np.maximum(_CONTRAST * contrast_around, 3 * noise)
    rise = square.bright - dark[:, None, None]
    near, far = rise[..., 0], rise[..., -1]
    good &= (far > _LEVEL * near).all(1)
    good &= curvature > _SHARPNESS * curvature_around
    return good
