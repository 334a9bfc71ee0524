"""Acceptance of grids: the image of a checkerboard, or an accident of texture."""

import cv2
import numpy as np

from cubicfish.find.detection.crossing import Crossings
from cubicfish.find.detection.lattice import Lattice, neighbours
from cubicfish.find.detection.medians import median
from cubicfish.types import BoolArray, FloatArray, IntArray

# Chance closes single squares now and then: random black and white cells make four whole squares
# that hang together once in some ten thousand places.
LEAST_CORNERS = 8
LEAST_SQUARES = 4
# In cells that are black or white at random, each crossing of edges is part of a flawless piece of
# chequerboard of N corners or more, in closed squares, with a chance of 2^-(1.7 + 0.93 N): counted
# in 150 million cells for N of 8 to 24. So many such pieces per picture are accepted by mistake, if
# cells fill it: fewer than there are photos in which a border or hand leaves so little of a board.
_PIECE_BITS, _CORNER_BITS = 1.7, 0.93
_BY_CHANCE = 1e-2
# What a printed board keeps low, as medians over its corners: the distance from what the other
# corners predict (cells, relative to the fit's own uncertainty), the blur (sides), and how far a
# corner's contrast is from that of the second likest of the eight around it (natural logarithm): a
# shadow's edge leaves most corners two that lie in the same light. Grids that grow in smooth noise
# have about 0.06, 0.17 and 0.11; boards on rendered and on real fisheye photos stay under 0.03,
# 0.13 (squares of 6 px) and 0.07, mostly far under.
MOST_MISS, USUAL_BLUR, _CONTRAST = 0.04, 0.15, 0.12
_AROUND = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)])
# The gaps between dark squares are alike where white bleeds (and by colour where the camera moved),
# and edges follow the grid: gaps of boards on rendered photos scatter by up to 0.035 sides, edges
# turn by up to 0.054 radians. In grids of text, lines and dots either is 0.1 to 0.2.
_GAP, _TURN = 0.1, 0.15
# Light spills over dark, and hardly ever the other way: bright squares that draw back are dots.
_PULLED_BACK = 0.25  # of the side
# The sum of squares may be 1 for the smallest grids, and more for large ones, which chance cannot
# make.
_LARGE = 40
# Share of its own extent, in cells, that a grid fills at least: boards that hands hide or borders
# cut fill most of it, what grows along a lattice of dots less than a twentieth.
_FILLED = 0.1
# A sum or product of sines is a grid of perfect saddles, with the edges of a blur of a quarter of
# a side: nothing that a lens in use does to a print.
_MOST_BLUR = 0.2


def is_large_enough(lattice: Lattice) -> bool:
    """Tell whether there are corners enough, and enough whole squares that hang together.

    Growth can join what chance made in two places, as in random black and white cells.
    """
    known = lattice.known
    if known.sum() < LEAST_CORNERS:
        return False
    pieces = cv2.connectedComponentsWithStats(find_squares(known).astype(np.uint8))[2]
    return bool(pieces[1:, cv2.CC_STAT_AREA].max(initial=0) >= LEAST_SQUARES)


def is_beyond_chance(corners: int, crossings: int) -> bool:
    """Tell whether chance could not make a grid of so many corners of crossings like its own.

    A few chequers alone in a picture are a board, or a part of one. Where a code, a mosaic or
    cloth fills the picture with crossings that belong to no grid, some of them lie like that.

    Args:
        corners: of the grid.
        crossings: how many there are in the picture that no grid explains, as large and clear.

    """
    return bool(crossings * 2.0 ** -(_PIECE_BITS + _CORNER_BITS * corners) < _BY_CHANCE)


def median_miss(lattice: Lattice, cells: IntArray) -> float:
    """How far corners are from what the others predict, relative to that prediction's own error.

    The median over the corners ``cells`` (N, 2), cells; NaN where nothing can be predicted.
    """
    fit = lattice.fit(cells, without_itself=True)
    miss = fit.cells_away(lattice.at(cells))[fit.sound] / (1 + np.sqrt(fit.leverage[fit.sound]))
    return median(miss) if len(miss) else np.nan


def is_regular(lattice: Lattice, cells: IntArray) -> bool:
    """Tell whether corners lie as those of a board do, whatever the squares look like."""
    return is_large_enough(lattice) and median_miss(lattice, cells) < MOST_MISS


def hang_together(known: BoolArray) -> BoolArray:
    """Tell which corners (I, J) are part of the grid's mesh: of squares, or of chains between.

    What remains when corners with fewer than two neighbours go, one after the other. One of
    those hangs on a single link, as where a dark square's outer corner meets something dark
    behind the board's margin: the grid says nothing for it. A chain that two parts of the grid
    hold at either end, as along a reflection, is where both say that it is.
    """
    while True:
        loose = known & (neighbours(known) < 2)
        if not loose.any():
            return known
        known = known & ~loose


def find_squares(known: BoolArray) -> BoolArray:
    """(I - 1, J - 1) the squares of which all four corners are known."""
    return np.asarray(known[1:, 1:] & known[:-1, 1:] & known[1:, :-1] & known[:-1, :-1])


def is_board(lattice: Lattice, cells: IntArray, found: Crossings) -> bool:
    """Judge a whole grid.

    Args:
        lattice: the grid.
        cells: (N, 2) corners of it that stand for all.
        found: the sub-pixel fits of these corners.

    """
    every = lattice.cells()
    if len(every) < _FILLED * np.prod(np.ptp(every, axis=0) + 1):
        return False
    unlikeness = _measure_unlikeness(lattice, cells)
    if not len(unlikeness):
        return False
    side = np.maximum(lattice.fit(cells).side, 1.0)
    blur = median(found.blur.max(1) / side)
    score = np.array(
        [
            median_miss(lattice, every) / MOST_MISS,
            blur / USUAL_BLUR,
            median(unlikeness) / _CONTRAST,
            median(_measure_gap_scatter(found.gap, lattice.sign(cells)) / side) / _GAP,
            median(found.turn) / _TURN,
            max(0.0, -_find_middle_gap(found.gap, lattice.sign(cells)) / median(side))
            / _PULLED_BACK,
        ]
    )
    limit = 1 + min(1.0, max(0.0, (len(every) - LEAST_CORNERS) / (_LARGE - LEAST_CORNERS)))
    return bool((score**2).sum() < limit and blur < _MOST_BLUR)  # never where a score is NaN


def _measure_unlikeness(lattice: Lattice, cells: IntArray) -> FloatArray:
    """How far the contrast of corners (N, 2) is from the second likest around: logarithms (N,).

    From the likest, where there is one only; corners beside none of these are left out.
    """
    level = np.full(np.add(lattice.known.shape, 2), np.nan)
    row, column = cells.T
    level[row + 1, column + 1] = np.log(np.maximum(lattice.contrast[row, column], 1e-6))
    around = (cells + 1)[:, None] + _AROUND
    unlike = np.sort(np.abs(level[around[..., 0], around[..., 1]] - level[*(cells + 1).T, None]))
    second = np.where(np.isnan(unlike[:, 1]), unlike[:, 0], unlike[:, 1])
    return np.asarray(second[~np.isnan(second)], float)


def _find_middle_gap(gap: FloatArray, sign: IntArray) -> float:
    """The gap that corners of both colours have: a moved camera parts one and joins the other."""
    of_colour = [median(gap[sign == colour]) for colour in (-1, 1) if (sign == colour).any()]
    return float(np.mean(of_colour))


def _measure_gap_scatter(gap: FloatArray, sign: IntArray) -> FloatArray:
    """How far each gap is from the median of its colour's gaps, pixels (N,)."""
    scatter = np.zeros(len(gap))
    for colour in (-1, 1):
        of_colour = sign == colour
        if of_colour.any():
            scatter[of_colour] = np.abs(gap[of_colour] - median(gap[of_colour]))
    return scatter
