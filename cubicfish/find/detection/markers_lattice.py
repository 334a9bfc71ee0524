"""The corners of one board in a photo, by name: prediction, growth and the tests of each corner.

Unlike :mod:`.lattice`, cells have names from the start, columns and rows may stand at uneven
distances (tags and the gaps between them), and markers come close to the corners.
"""

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from cubicfish.find.detection.growth import snap
from cubicfish.find.detection.lattice import (
    CornerMap,
    LocalFit,
    neighbours,
    taylor_terms,
    window,
)
from cubicfish.find.detection.markers_saddles import corners_near
from cubicfish.find.detection.medians import medians
from cubicfish.find.detection.nearby import Tree, nearest
from cubicfish.find.detection.pyramid import Pyramid
from cubicfish.find.detection.refine import refine_corners
from cubicfish.target.boards.board import Board
from cubicfish.types import BoolArray, FloatArray, IntArray

# A local fit looks this many corners to each side: three squares, or two tags.
_HALF_WIDTH = 4
_WINDOW = window(_HALF_WIDTH)
_CENTRE = len(_WINDOW) // 2
# Terms of second and third order are damped until enough neighbours determine them.
_RIDGE = np.diag([1e-9, 1e-6, 1e-6, *[1e-4] * 3, *[1e-3] * 4])
_SOFTEN = 0.3  # weights of neighbours stay finite, square squares from the cell
_WEIGHT_BESIDE = 1 / (_SOFTEN + 1) ** 2
# How far from its prediction a corner may be: half way to the next one (whose squares have the
# opposite colours), and in squares or tags, so as not to reach a marker's inner modules.
_SEARCH, _SEARCH_SQUARES = 0.5, 0.3
# Leave-one-out: a corner that many such distances from what its neighbours say is not one.
_OUTLIER = 0.2
_MOST_ROUNDS = 80
# Sub-pixel windows end at 0.45 cells, fading from 0.35 on.
_WINDOW_CELLS = 0.4
_SMALLEST_CELL_PX = 8.0
# Edges are looked at this far from the corner, and must differ from side to side by this share
# of what the corner's edges usually do.
_ARM_PX = np.array([3.0, 5.0, 7.0])
_ARM_CONTRAST = 0.3


@dataclass(kw_only=True, eq=False)
class BoardLattice(CornerMap):
    """The corners of a board that are known in a photo.

    Attributes:
        board: the board.
        pixel: (columns, rows, 2) where each corner is, NaN where unknown.
        x, y: (columns,), (rows,) places of columns and rows, in squares (tags).
        closest: the shortest distance of neighbouring corners, squares (tags).
        quiet: how far from a corner the next ink is that is not one of its own two edges.
        tried: (columns, rows) known neighbours at the last failed try of a corner.

    """

    half_width: ClassVar[int] = 3
    board: Board
    pixel: FloatArray = field(init=False)
    x: FloatArray = field(init=False)
    y: FloatArray = field(init=False)
    closest: float = field(init=False)
    quiet: float = field(init=False)
    tried: IntArray = field(init=False)

    def __post_init__(self) -> None:
        """Start with no corner known."""
        board = self.board
        self.pixel = np.full((board.columns, board.rows, 2), np.nan)
        self.x = board.plane_points(np.arange(board.columns), 0)[:, 0] / board.square
        self.y = board.plane_points(0, np.arange(board.rows))[:, 1] / board.square
        self.closest, self.quiet = 1.0, 1.0
        if board.kind == "aprilgrid":
            # Frames of tags are at least a tenth of a tag wide in every family.
            self.closest = min(1.0, board.spacing)
            self.quiet = min(0.1, board.spacing)
        elif board.markers is not None:
            self.quiet = 0.5 * (1 - board.markers.side / board.square)
        self.tried = np.zeros(self.pixel.shape[:2], np.intp)

    @property
    def search(self) -> float:
        """How far from its prediction a corner may be, squares (tags)."""
        return min(_SEARCH * self.closest, _SEARCH_SQUARES)

    @property
    def least_side(self) -> float:
        """Squares (tags) of so many pixels hold a window whose pixels show no other ink."""
        return _SMALLEST_CELL_PX / min(1.0, self.quiet / _WINDOW_CELLS)

    def put(self, cells: IntArray, pixel: FloatArray) -> None:
        """Set corners; NaN removes them."""
        self.pixel[cells[:, 0], cells[:, 1]] = pixel

    def inside(self, cells: IntArray) -> BoolArray:
        """Which of (N, 2) cells are corners of the board."""
        columns, rows = self.pixel.shape[:2]
        return np.all((cells >= 0) & (cells < (columns, rows)), axis=-1)

    def sign(self, cells: IntArray) -> IntArray:
        """+1 where the quadrant to the right and below of a corner is bright, else -1."""
        dark = 0 if self.board.first_square == "dark" else 1
        return np.where(cells.sum(axis=-1) % 2 == dark, -1, 1)

    def fit(self, cells: IntArray, *, without_itself: bool = False) -> LocalFit:
        """Position as a cubic function of the place on the board, around (N, 2) cells."""
        around = cells[:, None] + _WINDOW
        inside = self.inside(around)
        i, j = np.where(inside, around[..., 0], 0), np.where(inside, around[..., 1], 0)
        pixel = self.pixel[i, j]
        known = inside & ~np.isnan(pixel[..., 0])
        if without_itself:
            known[:, _CENTRE] = False
        u, v = self.x[i] - self.x[cells[:, :1]], self.y[j] - self.y[cells[:, 1:]]
        weight = known / (_SOFTEN + u * u + v * v) ** 2
        pixel = np.where(known[..., None], pixel, 0.0)
        total = np.maximum(weight.sum(axis=1), 1e-12)
        mean = (weight[..., None] * pixel).sum(axis=1) / total[:, None]
        pixel = np.where(known[..., None], pixel - mean[:, None], 0.0)
        terms = taylor_terms(u, v)
        weighted = (terms * weight[..., None]).transpose(0, 2, 1)
        inverse = np.linalg.inv(weighted @ terms + _RIDGE)
        solution = (inverse @ (weighted @ pixel)).transpose(0, 2, 1)
        leverage = np.asarray(inverse[:, 0, 0] * _WEIGHT_BESIDE, float)
        return LocalFit.of_terms(solution, mean, leverage, known, self.closest)

    def whole_squares(self, corner: IntArray) -> tuple[BoolArray, FloatArray]:
        """Which of squares of cells (N, 4, 2) have all of their corners, and pixels of these."""
        whole = np.asarray(self.inside(corner).all(axis=1))
        pixel = self.at(corner[whole].reshape(-1, 2)).reshape(-1, 4, 2)
        known = ~np.isnan(pixel[..., 0]).any(axis=1)
        whole[whole] = known
        return whole, pixel[known]

    def are_known(self, corner: IntArray) -> BoolArray:
        """Which of squares of cells (N, 4, 2) have no corner of the board that is unknown."""
        inside = self.inside(corner)
        columns, rows = np.where(inside[..., None], corner, 0).transpose(2, 0, 1)
        return np.asarray((self.known[columns, rows] | ~inside).all(axis=1))

    def inside_squares(self, corner: IntArray, place: FloatArray) -> FloatArray:
        """Pixels (N, K, 2) of places (K, 2) in the squares (tags) between known corners.

        ``corner`` (N, 4, 2) are a square's cells, at the places (0, 0), (1, 0), (1, 1) and
        (0, 1). Each corner's local shape says where a place is; the nearer ones count more, so
        that bent sides do not matter.
        """
        flat = corner.reshape(-1, 2)
        fit = replace(self.fit(flat), pixel=self.at(flat))
        anchor = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
        seen = fit.at(np.tile(place[None] - anchor[:, None], (len(corner), 1, 1)))
        seen = seen.reshape(len(corner), 4, len(place), 2)
        share = np.where(anchor[:, None] == 1, place, 1 - place).prod(axis=-1)
        return np.asarray((seen * share[:, :, None]).sum(axis=1), float)

    def refined(
        self,
        pyramid: Pyramid,
        cells: IntArray,
        pixel: FloatArray,
        fit: LocalFit,
        *,
        roughly: bool = False,
    ) -> tuple[FloatArray, BoolArray]:
        """Sub-pixel positions near (N, 2) pixels and which of them are whole corners.

        ``roughly`` is enough while a board grows.
        """
        quiet = min(1.0, self.quiet / _WINDOW_CELLS)
        # Small squares: a window must hold enough pixels, even if a marker's rim enters it.
        scale = np.clip(_SMALLEST_CELL_PX / np.maximum(fit.side, 1e-6), quiet, 1.0)
        sign = self.sign(cells)
        refined, good = refine_corners(
            pyramid,
            pixel,
            fit.step * scale[:, None, None],
            sign,
            fit.bend * np.square(scale)[:, None, None],
            self.quiet / scale,
            roughly=roughly,
        )
        rows = np.nonzero(good)[0]
        good[rows] = self._are_arms_seen(pyramid, refined[rows], sign[rows], fit.select(rows))
        return refined, good

    def _are_arms_seen(
        self, pyramid: Pyramid, pixel: FloatArray, sign: IntArray, fit: LocalFit
    ) -> BoolArray:
        """Whether all four edges go on for some pixels: the lens's rim may cut a corner."""
        length = np.hypot(fit.step[:, 0], fit.step[:, 1])
        along = np.minimum(0.4 * self.closest, _ARM_PX[:, None, None] / length).transpose(1, 0, 2)
        beside = np.maximum(0.5 * self.quiet, 1.0 / length[:, ::-1])
        # (N, arm, distance, side, 2): arms +i, +j, -i, -j, each with both of its sides.
        offset = np.zeros((len(pixel), 4, len(_ARM_PX), 2, 2))
        for arm in range(4):
            axis, ahead = arm % 2, 1 if arm < 2 else -1
            offset[:, arm, :, :, axis] = ahead * along[:, :, axis, None]
            offset[:, arm, :, :, 1 - axis] = (beside[:, None, axis, None]) * (1, -1)
        here = replace(fit, pixel=pixel)
        points = here.at(offset.reshape(len(pixel), 8 * len(_ARM_PX), 2))
        level = pyramid.sample(points, np.ones(len(pixel))).astype(float)
        level = level.reshape(offset.shape[:-1])
        # Along +i and +j the quadrant (+, +) is on the first side, along -i and -j another one.
        shown = (level[..., 0] - level[..., 1]) * sign[:, None, None]
        shown *= np.array([1, 1, -1, -1])[:, None]
        shown = shown.reshape(len(pixel), 4 * len(_ARM_PX))
        return shown.min(axis=1) > _ARM_CONTRAST * medians(shown, axis=1)


def grow(pyramid: Pyramid, lattice: BoardLattice, free: Tree) -> None:
    """Add the corners beside the known ones until nothing changes; ``free``: candidates."""
    looked = np.zeros_like(lattice.tried)
    for _ in range(_MOST_ROUNDS):
        cells = lattice.frontier()
        if len(cells) and try_cells(pyramid, lattice, cells, free):
            continue
        # A closer look where that ends, once for what is known around each cell.
        known = lattice.known
        count = lattice.neighbour_sum(known.astype(float)).astype(np.intp)
        ends = (neighbours(known) > 0) & ~known & (count != looked)
        looked[ends] = count[ends]
        cells = np.argwhere(ends)
        if not len(cells) or not _try_corners_near(pyramid, lattice, cells):
            return


def try_cells(pyramid: Pyramid, lattice: BoardLattice, cells: IntArray, free: Tree) -> bool:
    """Look for (N, 2) unknown cells where their neighbours say; whether any was found."""
    cells, fit = _predict(pyramid, lattice, cells)
    if not len(cells):
        return False
    pixel, good = lattice.refined(pyramid, cells, fit.pixel, fit, roughly=True)
    # Where the prediction is too far off, the nearest saddle is the next best start.
    rows = np.flatnonzero(~good)
    start, found = snap_named(pyramid, lattice, fit.pixel[rows], fit.select(rows), free)
    rows, start = rows[found], start[found]
    pixel[rows], good[rows] = lattice.refined(
        pyramid, cells[rows], start, fit.select(rows), roughly=True
    )
    return _put_good(lattice, cells, pixel, good, fit)


def _try_corners_near(pyramid: Pyramid, lattice: BoardLattice, cells: IntArray) -> bool:
    """As :func:`try_cells`, from the X-corners that are nearest to the predictions."""
    cells, fit = _predict(pyramid, lattice, cells)
    if not len(cells):
        return False
    travel, side = lattice.search * _measure_longest(fit), lattice.closest * fit.side
    place, row = corners_near(pyramid, fit.pixel, travel, side)
    if not len(place):
        return False
    away = fit.select(row).cells_away(place)
    order = np.argsort(away, kind="stable")
    rows, nearest_place = np.unique(row[order], return_index=True)
    start, away = place[order][nearest_place], away[order][nearest_place]
    rows, start = rows[away < lattice.search], start[away < lattice.search]
    if not len(rows):
        return False
    cells, fit = cells[rows], fit.select(rows)
    pixel, good = lattice.refined(pyramid, cells, start, fit, roughly=True)
    return _put_good(lattice, cells, pixel, good, fit)


def _measure_longest(fit: LocalFit) -> FloatArray:
    """Length (N,) of the longest way of one cell, pixels."""
    return np.asarray(np.linalg.norm(fit.step, ord=2, axis=(1, 2)))


def _predict(pyramid: Pyramid, lattice: BoardLattice, cells: IntArray) -> tuple[IntArray, LocalFit]:
    """The cells, of (N, 2), whose neighbours say where in the photo they are, and where."""
    fit = lattice.fit(cells)
    usable = fit.sound & pyramid.inside(fit.pixel, 2.0)
    return cells[usable], fit.select(usable)


def _put_good(
    lattice: BoardLattice, cells: IntArray, pixel: FloatArray, good: BoolArray, fit: LocalFit
) -> bool:
    """Add the corners that are where they may be; whether there is any."""
    good &= fit.cells_away(pixel) < lattice.search
    good[good] &= _find_alone(lattice, pixel[good], fit.select(good))
    lattice.put(cells[good], pixel[good])
    return bool(good.any())


def snap_named(
    pyramid: Pyramid, lattice: BoardLattice, start: FloatArray, fit: LocalFit, free: Tree
) -> tuple[FloatArray, BoolArray]:
    """Saddle points near (N, 2) starts: the nearest candidate, else what the photo shows there."""
    near, travel = fit.side * lattice.closest, lattice.search * fit.side
    return snap(pyramid, start, fit, free, lattice.search, near, travel)


def clean(lattice: BoardLattice) -> None:
    """Drop corners that contradict their neighbours or have none."""
    lattice.clean(_OUTLIER * lattice.closest)


def verify(pyramid: Pyramid, lattice: BoardLattice) -> None:
    """Refine all corners together, each judged among its neighbours, and drop those that fail."""
    cells = lattice.cells()
    if not len(cells):
        return
    pixel, good = lattice.refined(pyramid, cells, lattice.at(cells), lattice.fit(cells))
    lattice.put(cells, np.where(good[:, None], pixel, np.nan))


def _find_alone(lattice: BoardLattice, pixel: FloatArray, fit: LocalFit) -> BoolArray:
    """Which new corners are not on top of a known one or of each other."""
    limit = 0.4 * lattice.closest * fit.side
    known = lattice.pixel[lattice.known]
    alone: BoolArray = nearest(pixel, known, 1)[0][:, 0] > limit
    if len(pixel) > 1:
        alone &= nearest(pixel, pixel, 2)[0][:, 1] > limit
    return alone
