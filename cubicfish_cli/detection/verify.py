"""Last word on each corner: is it whole, sharp, and like its neighbours?"""

from __future__ import annotations

import numpy as np

from cubicfish_cli.detection.crossing import Crossings
from cubicfish_cli.detection.grids import BoolArray, FloatArray, IntArray

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
_TURN, _MOST_TURN = 0.25, 0.32  # radians
# Times the median around: bent paper, a camera that moved while it read its rows out, and gaps
# where white bleeds turn the edges of all corners alike. Only where the blur is this small a share
# of the side: a blur that rounds the squares turns edges anyhow.
_TURN_AROUND, _SHARP = 3.0, 0.05
_TRAVEL = 0.15  # of the side
_MOST_SPREAD = 0.05  # predicted standard deviation, of the side
# Times the median around: the edge of a shadow or of the paper within the window shows as a model
# that fits worse than it does next door.
_SPREAD = 3.0
# Of the side: so well placed a corner is good enough, however well those around are placed.
_FINE = 0.012


def whole_corners(
    found: Crossings,
    sign: IntArray,
    side: FloatArray,
    moved: FloatArray,
    contrast_around: FloatArray,
    blur_around: FloatArray,
    spread_around: FloatArray,
    turn_around: FloatArray,
    noise: float,
) -> BoolArray:
    """Tell which of N corners pass every test."""
    bright, dark = found.bright(sign), found.dark(sign)
    contrast = found.contrast(sign)
    good = found.ok & (bright.min(1) - dark.max(1) > _SEPARATION * contrast)
    good &= contrast > np.maximum(_CONTRAST * contrast_around, _LEAST_SIGNAL * noise)
    good &= found.misfit < np.maximum(_MISFIT * contrast, 1.5 * noise)
    good &= found.blur.max(1) < _BLUR * blur_around + 0.5
    most_turn = np.clip(_TURN_AROUND * turn_around, _TURN, _MOST_TURN)
    good &= found.turn < np.where(found.blur.max(1) < _SHARP * side, most_turn, _TURN)
    good &= moved < np.maximum(_TRAVEL * side, 0.5)
    good &= found.spread < np.minimum(
        _MOST_SPREAD * side, np.maximum(_SPREAD * spread_around, _FINE * side)
    )
    return good
