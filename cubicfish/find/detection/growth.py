"""Growth: predict the neighbours of a grid's corners and look for them in the photo.

What is there is judged by the brightness of the four squares, seen through the grid's local shape.
"""

from dataclasses import dataclass

import numpy as np

from cubicfish.find.detection.lattice import Lattice, LocalFit
from cubicfish.find.detection.links import (
    ALONG_EDGE,
    ASIDE,
    LEAST_ASIDE,
    edge_difference,
    edge_is_seen,
)
from cubicfish.find.detection.medians import medians
from cubicfish.find.detection.nearby import Tree, nearest
from cubicfish.find.detection.pyramid import Pyramid
from cubicfish.find.detection.saddle import fit_saddles
from cubicfish.types import BoolArray, FloatArray, IntArray

# Along the diagonal of each square, in sides: within the white margin that ChArUco boards leave
# around a marker (0.1 to 0.15 of a square), but beyond the blur where squares are small.
_DIAGONAL, _LEAST_DIAGONAL_PX, _LONGEST_DIAGONAL = 0.09, 1.2, 0.25
_INMOST_DIAGONAL = 0.35
_ALONG_DIAGONAL = np.array([0.7, 1.0, 1.3])
# Where the profile of a dark square is taken, and which of it is its inside.
_PROFILE = np.linspace(0.02, 0.42, 17)
_DEEP = slice(11, None)
# Quadrants (+,+), (-,+), (-,-), (+,-): clockwise; the first and third share their colour.
_QUADRANTS = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
SEPARATION = 0.30  # darker bright minus brighter dark quadrant, of the corner's contrast
LEAST_CONTRAST = 0.15  # of the contrast around
NEIGHBOUR_STEPS = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
_ALONG = ALONG_EDGE[:, None]
_MOST_ROUNDS = 60
# A prediction extrapolates by one cell. From two rows it is linear, and near a board held close
# to the lens one square can be 1.6 times as long as the last; the next corner is a cell away.
_SEARCH = 0.5
# Leave-one-out: a corner that many cells from what its neighbours say is not a corner; more where
# the neighbours lie on one side only.
_OUTLIER = 0.15


@dataclass(frozen=True, kw_only=True, eq=False)
class Quadrants:
    """Brightness of the squares around N corners, grey levels.

    Attributes:
        bright: (N, 2, K) the two squares that should be bright, at K distances.
        dark: (N, 2, K) the two that should be dark.

    """

    bright: FloatArray
    dark: FloatArray

    @property
    def contrast(self) -> FloatArray:
        """(N,) mean bright minus mean dark."""
        return self.bright.mean((1, 2)) - self.dark.mean((1, 2))

    @property
    def separation(self) -> FloatArray:
        """(N,) the darker bright square minus the brighter dark one."""
        return self.bright.mean(2).min(1) - self.dark.mean(2).max(1)


def quadrants(
    pyramid: Pyramid, pixel: FloatArray, fit: LocalFit, sign: IntArray, half_gap: FloatArray
) -> Quadrants:
    """Sample the four squares at (N, 2) pixels.

    Args:
        pyramid: the photo.
        pixel: (N, 2) the corners.
        fit: local fit around each.
        sign: (N,) +1 where quadrant (+, +) is bright.
        half_gap: (N,) how far dark squares draw back from their edges, pixels.

    """
    side = np.maximum(fit.side, 1e-6)  # 0 where corners that chance put together lie in a line
    away = np.clip(_LEAST_DIAGONAL_PX / side, _DIAGONAL, _LONGEST_DIAGONAL)
    away = np.minimum(away + half_gap / side, _INMOST_DIAGONAL)
    return _sample_diagonals(pyramid, pixel, fit, sign, away, _ALONG_DIAGONAL)


def measure_half_gap(
    pyramid: Pyramid, pixel: FloatArray, fit: LocalFit, sign: IntArray
) -> FloatArray:
    """How far the two dark squares at each corner draw back from their edges: (N, 2) pixels.

    Along each diagonal brightness falls through the middle between the levels of the bright
    squares and of the dark ones where the dark square begins: at the corner itself unless white
    bleeds. The arguments are those of :func:`quadrants`.
    """
    square = _sample_diagonals(pyramid, pixel, fit, sign, np.full(len(pixel), 1.0), _PROFILE)
    bright = medians(square.bright.reshape(len(pixel), -1), axis=1)
    level = 0.5 * (bright + square.dark[..., _DEEP].mean((1, 2)))
    begins = _PROFILE[np.argmax(square.dark < level[:, None, None], axis=2)]
    return np.asarray((begins - _PROFILE[0]) * fit.side[:, None], float)


def _sample_diagonals(
    pyramid: Pyramid,
    pixel: FloatArray,
    fit: LocalFit,
    sign: IntArray,
    away: FloatArray,
    along: FloatArray,
) -> Quadrants:
    offset = (_QUADRANTS[:, None, :] * along[None, :, None]).reshape(-1, 2).T
    points = fit.columns_at(away * offset[:, :, None])
    points += (pixel - fit.pixel).T[:, None]
    level = pyramid.sample_columns(points, fit.side).astype(np.float64)
    level = level.reshape(4, len(along), len(pixel))
    level = np.where(sign > 0, level, level[[1, 2, 3, 0]]).T  # (N, K, 4), bright ones are even
    return Quadrants(bright=level[..., 0::2].swapaxes(1, 2), dark=level[..., 1::2].swapaxes(1, 2))


def edges_seen(
    pyramid: Pyramid,
    pixel: FloatArray,
    fit: LocalFit,
    sign: IntArray,
    contrast: FloatArray,
    neighbour: FloatArray,
    half_gap: FloatArray,
) -> BoolArray:
    """Which of the four edges to known neighbours can be seen: (N, 4).

    Args:
        pyramid: the photo.
        pixel: (N, 2) the corners.
        fit: local fit around each.
        sign: (N,) parity.
        contrast: (N,) grey levels.
        neighbour: (N, 4, 2) positions of the neighbours along NEIGHBOUR_STEPS, NaN if unknown.
        half_gap: (N,) how far dark squares draw back from their edges, pixels.

    """
    row, arm = np.nonzero(~np.isnan(neighbour[..., 0]))
    seen = np.zeros(neighbour.shape[:2], bool)
    if not len(row):
        return seen
    part = fit.select(row)
    start, end = pixel[row].T, neighbour[row, arm].T
    direction = NEIGHBOUR_STEPS[arm].astype(float).T
    points = part.columns_at(direction[:, None] * _ALONG)
    points += (start - part.pixel.T)[:, None]
    # The fit's curve, moved so that it ends at the neighbour.
    miss = end - start - part.columns_at(direction[:, None])[:, 0] + part.pixel.T
    points += _ALONG * miss[:, None]
    length = np.hypot(*(end - start))
    # To the clockwise side along the grid's other axis: it does not leave the two squares, however
    # flat they are seen. There lies quadrant (+, +) for +i, quadrant (-, +) for +j, and so on.
    step = part.step.transpose(1, 2, 0)
    across = step[:, 1] * direction[0] - step[:, 0] * direction[1]
    ahead = step[:, 0] * direction[0] + step[:, 1] * direction[1]
    area = np.abs(step[0, 0] * step[1, 1] - step[0, 1] * step[1, 0])
    height = area / np.hypot(*ahead)
    share = np.minimum(np.clip(LEAST_ASIDE / height, ASIDE, 0.4) + half_gap[row] / height, 0.4)
    difference = edge_difference(pyramid, points, (share * across)[:, None], length)
    difference *= sign[row] * np.where(arm % 2 == 0, 1, -1) / np.maximum(contrast[row], 1e-6)
    seen[row, arm] = edge_is_seen(difference)
    return seen


def grow(pyramid: Pyramid, lattice: Lattice, free: Tree, most: int) -> bool:
    """Add corners to the lattice until nothing changes, or it has more than ``most`` corners.

    Args:
        pyramid: the photo.
        lattice: what grows.
        free: candidates to snap to.
        most: corners.

    Returns:
        Whether it may grow on.

    """
    for _ in range(_MOST_ROUNDS):
        if lattice.known.sum() > most:
            return True
        lattice.make_room()
        cells = lattice.frontier()
        if not len(cells) or not grow_once(pyramid, lattice, free, cells):
            return False
    return False


def grow_once(pyramid: Pyramid, lattice: Lattice, free: Tree, cells: IntArray) -> bool:
    """Add corners in some of (N, 2) empty cells of the lattice, if any; whether there are."""
    fit = lattice.fit(cells)
    usable = fit.sound & pyramid.inside(fit.pixel, 2.0)
    cells, fit = cells[usable], fit.select(usable)
    if not len(cells):
        return False
    pixel, found = snap(pyramid, fit.pixel, fit, free, _SEARCH, fit.side, 0.3 * fit.side)
    found &= ~_find_crowded(lattice, cells, pixel, fit)
    cells, pixel, fit = cells[found], pixel[found], fit.select(found)
    if not len(cells):
        return False
    good, contrast = looks_like_corner(pyramid, lattice, cells, pixel, fit)
    lattice.put(cells[good], pixel[good], contrast[good])
    return bool(good.any())


def snap(
    pyramid: Pyramid,
    start: FloatArray,
    fit: LocalFit,
    free: Tree,
    search: float,
    near: FloatArray,
    travel: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """Saddle points near (N, 2) starts, and which were found.

    The nearest of the free candidates that is fewer than ``search`` cells away, else what the photo
    shows within ``travel`` pixels (N,), where the next corners are ``near`` pixels (N,) away.
    """
    pixel, found = start.copy(), np.zeros(len(start), bool)
    if len(free) and len(start):
        _, index = nearest(start, free, 4)
        place = free.points[index]
        away = fit.cells_away(place - (start - fit.pixel)[:, None])
        rows, best = np.arange(len(start)), away.argmin(1)
        found = away[rows, best] < search
        pixel[found] = place[rows, best][found]
    rest = ~found
    if rest.any():
        half = np.clip(0.2 * near[rest], 2.0, 6.0)
        most = np.maximum(travel[rest], 1.0)
        pixel[rest], found[rest] = fit_saddles(pyramid.levels[0], start[rest], half, most)
    return pixel, found & pyramid.inside(pixel, 2.0)


def _find_crowded(lattice: Lattice, cells: IntArray, pixel: FloatArray, fit: LocalFit) -> BoolArray:
    """Tell which positions lie on top of a corner that is there already, or of each other."""
    known = lattice.cells()
    place, limit = lattice.apart(cells, pixel), 0.4 * fit.side
    crowded = nearest(place, lattice.apart(known, lattice.at(known)), 1)[0][:, 0] < limit
    if len(pixel) > 1:
        distance, index = nearest(place, place, 2)
        crowded |= (distance[:, 1] < limit) & (np.arange(len(pixel)) > index[:, 1])
        crowded |= (distance[:, 1] < limit) & (index[:, 0] != np.arange(len(pixel)))
    return crowded


def looks_like_corner(
    pyramid: Pyramid, lattice: Lattice, cells: IntArray, pixel: FloatArray, fit: LocalFit
) -> tuple[BoolArray, FloatArray]:
    """Test brightness of the four squares and of the edges to known neighbours."""
    sign = lattice.sign(cells)
    half_gap = lattice.gap_at(cells)
    square = quadrants(pyramid, pixel, fit, sign, half_gap)
    around = cells[:, None] + NEIGHBOUR_STEPS
    neighbour = lattice.pixel[around[..., 0], around[..., 1]]
    expected = np.maximum(lattice.contrast_around(cells), 1e-6)
    # Light falls off steeply towards the rim, and shadows take part of it: only a corner's own
    # contrast says what its edges must show.
    own = np.maximum(square.contrast, 1e-6)
    good = square.separation > SEPARATION * own
    good &= own > np.maximum(LEAST_CONTRAST * expected, 3.0 * pyramid.noise)
    seen = edges_seen(pyramid, pixel, fit, sign, np.minimum(own, expected), neighbour, half_gap)
    good &= 2 * seen.sum(1) >= (~np.isnan(neighbour[..., 0])).sum(1)
    good &= seen.any(1)
    return good, square.contrast


def measure_contrast(pyramid: Pyramid, lattice: Lattice) -> None:
    """Set the gap of the lattice, and the contrast of all corners from the squares around them."""
    cells = lattice.cells()
    fit = lattice.fit(cells)
    pixel = lattice.at(cells)
    sign = lattice.sign(cells)
    lattice.set_gap(cells, measure_half_gap(pyramid, pixel, fit, sign))
    contrast = quadrants(pyramid, pixel, fit, sign, lattice.gap_at(cells)).contrast
    lattice.put(cells, pixel, np.maximum(contrast, 0))


def clean(lattice: Lattice) -> None:
    """Drop corners that contradict their neighbours or have none."""
    lattice.make_room()
    lattice.clean(_OUTLIER)
