"""Sub-pixel refinement of corners whose place and local shape are known, and the last word on each.

That is whether it is whole, sharp, and like its neighbours.
"""

from functools import partial

import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.crossing import ROUNDS, Crossings, Gaps, Quiet, fit_crossings
from cubicfish.find.detection.lattice import LocalFit
from cubicfish.find.detection.medians import medians
from cubicfish.find.detection.nearby import nearest
from cubicfish.find.detection.pyramid import Pyramid
from cubicfish.find.detection.saddle import fit_saddles
from cubicfish.types import BoolArray, FloatArray, IntArray

# Each bound is relative to the corner's own surroundings, so that dim and blurred boards count
# as much as bright and sharp ones.
_SEPARATION = 0.30  # darker bright minus brighter dark square, of the corner's contrast
_CONTRAST = 0.15  # of the median contrast around: a shadow may take that much
# Times the noise: with less contrast a corner could not be placed to better than a third of a
# pixel, and the rim of the image circle begins to look like one.
_LEAST_SIGNAL = 5.0
_MISFIT = 0.18  # of the contrast
_MOST_BLUR = 2.5  # times the median around
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
# Steps of a fit that only tells a board from texture: nine in ten corners have converged by then.
_ROUGH_ROUNDS = 6
# Half-size of the window, pixels.
_SMALLEST_HALF, USUAL_HALF, LARGEST_HALF = 3.0, 5.0, 12.0
_OF_SIDE, _OF_BLUR, _OF_GAP = 0.4, 3.5, 1.0
# Corners whose gaps should be alike, and how alike at least, pixels.
_AROUND, _GAP_SPREAD = 7, 0.15
_ODD_GAP = 3.0  # a corner whose gap stays that far away, in such spreads, is none
_BURNT = 3.0  # times the noise
# How far a crossing moves towards the saddle point, and from what distance on it does not.
_SADDLE_SHARE, _SADDLE_TRAVEL = 1 / 3, 0.5


def whole_corners(
    found: Crossings,
    sign: IntArray,
    side: FloatArray,
    moved: FloatArray,
    around: FloatArray,
    noise: float,
    most_turn: float = MOST_TURN,
) -> BoolArray:
    """Tell which of N corners pass every test.

    ``around`` are medians (N, 3) of their neighbours' :func:`measures`; ``most_turn`` is in
    radians.
    """
    contrast_around, blur_around, spread_around = around.T
    bright, dark = found.bright(sign), found.dark(sign)
    contrast = found.contrast(sign)
    good = found.ok & (bright.min(1) - dark.max(1) > _SEPARATION * contrast)
    good &= contrast > np.maximum(_CONTRAST * contrast_around, _LEAST_SIGNAL * noise)
    good &= found.misfit < np.maximum(_MISFIT * contrast, 1.5 * noise)
    good &= found.blur.max(1) < _MOST_BLUR * blur_around + 0.5
    good &= found.turn < most_turn
    good &= moved < np.maximum(_TRAVEL * side, 0.5)
    harmless = np.maximum(_HARMLESS, _TRUE_TO * side)
    most_spread = np.hypot(_SPREAD * spread_around, harmless)
    good &= found.spread < np.minimum(_MOST_SPREAD * side, most_spread)
    return good


def measures(found: Crossings, sign: IntArray) -> FloatArray:
    """(N, 3) contrast, blur and spread, in which a corner is like those around it."""
    return np.stack([found.contrast(sign), found.blur.max(1), found.spread], axis=-1)


def find_start(pyramid: Pyramid, pixel: FloatArray, side: FloatArray) -> FloatArray:
    """Move corners (N, 2) of squares of sides (N,) to saddle points, where there are any."""
    half, travel = np.clip(0.2 * side, 2.0, 2.5), np.maximum(1.5, 0.1 * side)
    saddle, ok = fit_saddles(pyramid.levels[0], pixel, half, travel)
    return np.where(ok[:, None], saddle, pixel)


def refine_pixels(
    pyramid: Pyramid,
    pixel: FloatArray,
    fit: LocalFit,
    quiet: Quiet | None = None,
    *,
    roughly: bool = False,
) -> Crossings:
    """Sub-pixel positions of N corners, starting within half a pixel: see :func:`find_start`.

    Two crossing edges are fitted to the pixels, as far as these are ``quiet``. ``roughly`` is
    enough to judge a grid by.
    """
    return _cross(pyramid.levels[0], pixel, fit, pyramid.noise, LARGEST_HALF, quiet, roughly)


def least_window(found: Crossings) -> FloatArray:
    """Half-size (N,) that the window around each corner needs to reach beyond its blur and gap."""
    return np.asarray(_OF_BLUR * found.blur.max(1) + _OF_GAP * np.abs(found.gap))


def _cross(
    image: npt.NDArray[np.generic],
    start: FloatArray,
    fit: LocalFit,
    noise: float,
    largest: float,
    quiet: Quiet | None = None,
    roughly: bool = False,
) -> Crossings:
    half = np.clip(_OF_SIDE * fit.side, _SMALLEST_HALF, USUAL_HALF)
    # Of the windows as they are when it is called.
    rounds = _ROUGH_ROUNDS if roughly else ROUNDS
    crossings = partial(fit_crossings, image, start, fit, half, noise, quiet=quiet, rounds=rounds)
    found = crossings()
    for _ in range(3):
        # A window within the blur, or the gap, sees no more than a slope.
        wider = np.clip(least_window(found), half, largest)
        wider = np.minimum(wider, np.maximum(_OF_SIDE * fit.side, half))
        rows = np.nonzero(wider > half + 0.5)[0]
        if not len(rows):
            break
        half[rows] = wider[rows]
        found.replace(rows, crossings(rows=rows))
    rows, usual = _find_odd_gaps(image, start, found, noise)
    if len(rows):
        found.replace(rows, crossings(rows=rows, gap=usual))
        odd = np.abs(found.gap[rows] - usual.mean) > _ODD_GAP * usual.spread
        found.ok[rows[odd]] = False
    _lean_on_saddles(image, found, half)
    return found


def _find_odd_gaps(
    image: npt.NDArray[np.generic], start: FloatArray, found: Crossings, noise: float
) -> tuple[IntArray, Gaps]:
    """Find the corners whose gap is not like those around them, and how these are.

    White bleeds alike all over a part of a board, and a blur along one diagonal (a moved camera)
    parts all dark squares that meet along the one and joins those along the other. A gap of its own
    has a corner that uses it to follow something else: the edge of a shadow, the border of the
    image circle. Where a lamp is mirrored, though, white burns out, and bleeds more at one corner
    than at the next: those with both bright squares there may have wider gaps than others.
    """
    alike = found.contrast(np.ones(len(start), int)) > 0
    mean, spread = np.zeros(len(start)), np.full(len(start), np.inf)
    for group in (alike, ~alike):
        if group.sum() >= _AROUND:
            around = nearest(start[group], start[group], _AROUND)[1]
            gap = found.gap[group][around]
            mean[group] = medians(gap, axis=1)
            scatter = medians(np.abs(gap - mean[group, None]), axis=1)
            spread[group] = np.maximum(1.5 * scatter, _GAP_SPREAD)
    rows = np.nonzero(np.abs(found.gap - mean) > 2 * spread)[0]
    rows = rows[~_does_bleed_more(image, found.select(rows), mean[rows], noise)]
    return rows, Gaps(mean=mean[rows], spread=spread[rows])


def _does_bleed_more(
    image: npt.NDArray[np.generic], found: Crossings, usual: FloatArray, noise: float
) -> BoolArray:
    """Tell which gaps are wider than ``usual`` (N,) between squares as bright as photos get."""
    bright = np.maximum(found.level[:, 0::2].min(1), found.level[:, 1::2].min(1))
    brightest = float(image[::3, ::3].max())  # white that burns out covers more than that
    return np.asarray((found.gap > usual) & (bright > brightest - _BURNT * noise - 1))


def _lean_on_saddles(image: npt.NDArray[np.generic], found: Crossings, half: FloatArray) -> None:
    """Move crossings a third of the way to the saddle point of the same window, in place.

    The two err apart: light that falls off within a square pulls edges towards the dark side,
    curved edges pull a saddle. On rendered photos with noise, blur and light that falls off to
    the rim the mean of both, so weighted, is nearer to the truth than either.
    """
    saddle, ok = fit_saddles(image, found.pixel, half, np.full(len(half), _SADDLE_TRAVEL))
    found.pixel[ok] += _SADDLE_SHARE * (saddle - found.pixel)[ok]


def refine_at_full_size(
    image: npt.NDArray[np.generic], pixel: FloatArray, fit: LocalFit, zoom: float, noise: float
) -> FloatArray:
    """Refine corners of a photo that was searched at 1/zoom of its size.

    Args:
        image: (H, W) the photo.
        pixel: (N, 2) corners, pixels of the photo.
        fit: their local shape, pixels of the photo.
        zoom: how many times smaller the photo was that they were found in.
        noise: standard deviation of the noise of the photo that was searched, its grey levels.

    Returns:
        (N, 2) refined pixels; the given ones where the photo shows nothing better.

    """
    found = _cross(image, pixel, fit, noise * zoom, LARGEST_HALF * max(zoom, 1.0))
    near = found.ok & (np.hypot(*(found.pixel - pixel).T) < zoom)
    near &= found.spread < _MOST_SPREAD * fit.side
    return np.where(near[:, None], found.pixel, pixel)


def refine_corners(
    pyramid: Pyramid,
    pixel: FloatArray,
    jacobians: FloatArray,
    sign: IntArray,
    bends: FloatArray,
    quiet: FloatArray | None = None,
    *,
    roughly: bool = False,
) -> tuple[FloatArray, BoolArray]:
    """Move predicted corners to where the photo has them, and tell which are really there.

    The same sub-pixel method and the same tests as in :func:`~.finder.find_grids`.

    Args:
        pyramid: built from a grey photo.
        pixel: (N, 2) predictions, within about a tenth of a square.
        jacobians: (N, 2, 2) columns dp/di and dp/dj: pixels per step along the grid's i and j.
        sign: (N,) +1 where the square between the steps +i and +j is bright, -1 where it is
            dark.
        bends: (N, 2, 3) second derivatives d2p/di2, d2p/didj, d2p/dj2.
        quiet: (N,) how far from both of its edges a bright square is clean, steps; None: wholly.
        roughly: whether their places only need to be good enough to predict others.

    Returns:
        (N, 2) refined pixels (the prediction itself where not ok) and (N,) ok.

    """
    refined, good = pixel.copy(), np.zeros(len(pixel), bool)
    side = np.hypot(jacobians[:, 0], jacobians[:, 1]).min(1)
    area = np.abs(np.linalg.det(jacobians))
    usable = pyramid.inside(pixel, 3.0) & (side > 2.0) & (area > 2.0) & np.isfinite(side)
    rows = np.nonzero(usable)[0]
    if not len(rows):
        return refined, good
    fit = LocalFit(
        pixel=pixel[rows],
        step=jacobians[rows],
        bend=bends[rows],
        leverage=np.zeros(len(rows)),
        side=side[rows],
        sound=np.ones(len(rows), bool),
    )
    seen = sign[rows]
    clean = None if quiet is None else Quiet(sign=seen, steps=quiet[rows])
    start = find_start(pyramid, pixel[rows], fit.side)
    found = refine_pixels(pyramid, start, fit, clean, roughly=roughly)
    _, index = nearest(pixel[rows], pixel[rows], 12)
    ok = whole_corners(
        found,
        seen,
        side[rows],
        np.hypot(*(found.pixel - pixel[rows]).T),
        medians(measures(found, seen)[index], axis=1),
        pyramid.noise,
        MOST_TURN if clean is None else MOST_TURN_MARKED,
    )
    refined[rows[ok]], good[rows[ok]] = found.pixel[ok], True
    return refined, good
