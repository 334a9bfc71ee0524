"""Last word on each corner: is it whole, sharp, and like its neighbours?"""

from __future__ import annotations

import numpy as np

from cubicfish_cli.detection.crossing import Crossings
from cubicfish_cli.types import BoolArray, FloatArray, IntArray

# Each bound is relative to the corner's own surroundings, so that dim and blurred boards count
# as much as bright and sharp ones.
_SEPARATION = 0.30  # darker bright minus brighter dark square, of the corner's contrast
_CONTRAST = 0.15  # of the median contrast around: a shadow may take that much
# Times the noise: with less contrast a corner could not be placed to better than a third of a
# pixel, and the rim of the image circle begins to look like one.
_LEAST_SIGNAL = 5.0
_MISFIT = 0.18  # of the contrast
_BLUR = 2.5  # times the median around
# Edges follow the grid, within what its local fit may be wrong by. A lattice of knight's moves, the
# likeliest wrong one, is off by 0.46.
MOST_TURN = 0.25  # radians
# Beside markers blur mixes their ink into the edges, and the markers vouch for the lattice.
MOST_TURN_MARKED = 0.4
_TRAVEL = 0.15  # of the side
_MOST_SPREAD = 0.05  # predicted standard deviation, of the side
# Times the median around: the edge of a shadow or of the paper within the window shows as a model
# that fits worse than it does next door. Next door may fit to hundredths of a pixel, though, and
# prints and paper are not true to more than an eightieth of a square: on rendered photos corners of
# a spread under a tenth of a pixel are as good as it says, whatever is next to them.
_SPREAD, _HARMLESS, _TRUE_TO = 3.5, 0.1, 0.0125  # times that around, px, of the side


def whole_corners(
    found: Crossings,
    sign: IntArray,
    side: FloatArray,
    moved: FloatArray,
    contrast_around: FloatArray,
    blur_around: FloatArray,
    spread_around: FloatArray,
    noise: float,
    most_turn: float = MOST_TURN,
) -> BoolArray:
    """Tell which of N corners pass every test; ``most_turn`` is in radians."""
    bright, dark = found.bright(sign), found.dark(sign)
    contrast = found.contrast(sign)
    good = found.ok & (bright.min(1) - dark.max(1) > _SEPARATION * contrast)
    good &= contrast > np.maximum(_CONTRAST * contrast_around, _LEAST_SIGNAL * noise)
    good &= found.misfit < np.maximum(_MISFIT * contrast, 1.5 * noise)
    good &= found.blur.max(1) < _BLUR * blur_around + 0.5
    good &= found.turn < most_turn
    good &= moved < np.maximum(_TRAVEL * side, 0.5)
    harmless = np.maximum(_HARMLESS, _TRUE_TO * side)
    most_spread = np.hypot(_SPREAD * spread_around, harmless)
    good &= found.spread < np.minimum(_MOST_SPREAD * side, most_spread)
    return good
