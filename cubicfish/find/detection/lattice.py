"""A growing grid: dense maps of cells to pixels, and the local fit that predicts neighbours."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import cv2
import numpy as np

from cubicfish.find.detection.grids import Grid, Rows
from cubicfish.find.detection.medians import median
from cubicfish.types import BoolArray, FloatArray, IntArray


def window(half_width: int) -> IntArray:
    """(K, 2) the offsets of all cells within so many columns and rows of a cell, its own too."""
    return np.mgrid[-half_width : half_width + 1, -half_width : half_width + 1].reshape(2, -1).T


def taylor_terms(u: FloatArray, v: FloatArray) -> FloatArray:
    """Taylor's terms up to the third order: (...) offsets -> (..., 10)."""
    uu, vv = u * u, v * v
    second = (uu / 2, u * v, vv / 2)
    third = (uu * u / 6, uu * v / 2, u * vv / 2, vv * v / 6)
    return np.stack([np.ones_like(u), u, v, *second, *third], axis=-1)


# The local fit looks at the 7x7 cells around: three in a row are needed to see how the steps
# change along it, which matters most where a grid is extended.
_HALF_WIDTH = 3
_WINDOW = window(_HALF_WIDTH)
_WEIGHT = 1.0 / (0.3 + (_WINDOW**2).sum(1)) ** 2
_TERMS = taylor_terms(*_WINDOW.T.astype(float))[:, :6].copy()
_PRODUCTS = (_TERMS[:, :, None] * _TERMS[:, None, :]).reshape(len(_WINDOW), 36)
# Second-order terms are damped until enough neighbours determine them.
_RIDGE = np.diag([1e-9, 1e-6, 1e-6, 0.005, 0.005, 0.005])
_CENTRE = len(_WINDOW) // 2
MARGIN = _HALF_WIDTH + 1
_MOST_CLEANINGS = 10
_BESIDE = np.ones((3, 3), np.uint8)


@dataclass(frozen=True, kw_only=True, eq=False)
class LocalFit(Rows):
    """Position as a quadratic function of the cell, around each of N cells.

    ``p(di, dj) = pixel + step @ (di, dj) + bend @ (di^2/2, di dj, dj^2/2)``

    Attributes:
        pixel: (N, 2) the cell's own position as its neighbours predict it.
        step: (N, 2, 2) columns dp/di, dp/dj, pixels.
        bend: (N, 2, 3) second derivatives ii, ij, jj, pixels.
        leverage: (N,) variance of the prediction when each neighbour beside the cell has 1: small
            in the middle of a grid, large where the fit extrapolates.
        side: (N,) the shorter of the two steps, pixels.
        sound: (N,) the steps are not degenerate and turn the right way.

    """

    pixel: FloatArray
    step: FloatArray
    bend: FloatArray
    leverage: FloatArray
    side: FloatArray
    sound: BoolArray

    @classmethod
    def of_terms(
        cls,
        terms: FloatArray,
        mean: FloatArray,
        leverage: FloatArray,
        known: BoolArray,
        closest: float = 1.0,
    ) -> LocalFit:
        """Fits of which :func:`taylor_terms` have been found.

        Args:
            terms: (N, 2, 6 or more) factors of the terms, pixels.
            mean: (N, 2) where pixels are counted from.
            leverage: (N,).
            known: (N, K) the corners that were fitted to.
            closest: the shortest distance of neighbouring corners, cells.

        """
        step = terms[:, :, 1:3]
        length = np.hypot(step[:, 0], step[:, 1])
        area = step[:, 0, 0] * step[:, 1, 1] - step[:, 0, 1] * step[:, 1, 0]
        side = length.min(1)
        return cls(
            pixel=terms[:, :, 0] + mean,
            step=step,
            bend=terms[:, :, 3:6],
            leverage=leverage,
            side=side,
            # Squares seen so flat that their angles fall under about 9 degrees cannot be measured.
            sound=(known.sum(1) >= 3) & (side * closest > 2) & (area > 0.15 * length.prod(1)),
        )

    def at(self, offset: FloatArray) -> FloatArray:
        """Positions at (N, K, 2) or (K, 2) offsets in cells -> (N, K, 2) pixels."""
        di, dj = offset[..., 0], offset[..., 1]
        quadratic = np.stack([0.5 * di * di, di * dj, 0.5 * dj * dj], axis=-1)
        return (
            self.pixel[:, None]
            + offset @ self.step.transpose(0, 2, 1)
            + quadratic @ self.bend.transpose(0, 2, 1)
        )

    def columns_at(self, offset: FloatArray) -> FloatArray:
        """Positions at (2, K, N) or (2, K, 1) offsets in cells -> (2, K, N) pixels.

        As :meth:`at`, for few offsets of many cells.
        """
        di, dj = offset
        bend, step = (
            self.bend.transpose(1, 2, 0)[:, :, None],
            self.step.transpose(1, 2, 0)[:, :, None],
        )
        along = step[:, 0] + (0.5 * di) * bend[:, 0] + dj * bend[:, 1]
        return self.pixel.T[:, None] + di * along + dj * (step[:, 1] + (0.5 * dj) * bend[:, 2])

    def cells_away(self, pixel: FloatArray) -> FloatArray:
        """Distance (N,) of (N, 2) or (N, K, 2) pixels from the prediction, in cells.

        Counted along the grid's own steps, so that it means the same in squares that are seen
        flat. Infinite where the fit is not sound.
        """
        away = pixel - (self.pixel if pixel.ndim == 2 else self.pixel[:, None])
        a, b, c, d = self.step.reshape(-1, 4).T
        area = np.where(self.sound, a * d - b * c, 1.0)
        inverse = np.stack([d, -b, -c, a], axis=-1).reshape(-1, 2, 2) / area[:, None, None]
        cell = (away.reshape(len(away), -1, 2) @ inverse.transpose(0, 2, 1)).reshape(away.shape)
        distance = np.hypot(cell[..., 0], cell[..., 1])
        sound = self.sound if pixel.ndim == 2 else self.sound[:, None]
        return np.where(sound, distance, np.inf)


class CornerMap(ABC):
    """Corners by their cells, in maps of all cells.

    Attributes:
        pixel: (I, J, 2) position of each cell, NaN where there is none.
        tried: (I, J) what was known about an empty cell when it was last tried.

    """

    pixel: FloatArray
    tried: IntArray
    half_width: ClassVar[int]
    """A cell is tried again when so many cells to each side have changed."""

    @property
    def known(self) -> BoolArray:
        """(I, J) which cells have a corner."""
        return ~np.isnan(self.pixel[..., 0])

    def cells(self) -> IntArray:
        """(N, 2) cells that have a corner, in the order of the arrays."""
        return np.argwhere(self.known)

    def at(self, cells: IntArray) -> FloatArray:
        """Pixels (N, 2) of (N, 2) cells, NaN where there is none."""
        return self.pixel[cells[:, 0], cells[:, 1]]

    def drop(self, cells: IntArray) -> None:
        """Remove corners."""
        self.pixel[cells[:, 0], cells[:, 1]] = np.nan

    @abstractmethod
    def fit(self, cells: IntArray, *, without_itself: bool = False) -> LocalFit:
        """Position as a function of the cell around (N, 2) cells."""

    def neighbour_sum(self, values: FloatArray) -> FloatArray:
        """Sum of a map over the cells within :attr:`half_width` of each cell."""
        half_width = self.half_width
        around = 2 * half_width + 1
        total = np.zeros(np.add(values.shape, around))
        total[half_width + 1 : -half_width, half_width + 1 : -half_width] = values
        np.cumsum(total, 0, out=total)
        np.cumsum(total, 1, out=total)
        return (
            total[around:, around:]
            - total[:-around, around:]
            - total[around:, :-around]
            + total[:-around, :-around]
        )

    def frontier(self) -> IntArray:
        """Empty cells (N, 2) beside a corner whose neighbourhood changed since they were tried."""
        known = self.known
        count = self.neighbour_sum(known.astype(float))
        fresh = (neighbours(known) > 0) & ~known & (count != self.tried)
        self.tried[fresh] = count[fresh]
        return np.argwhere(fresh)

    def clean(self, most_miss: float) -> None:
        """Drop corners that have no neighbours, or are so many cells from what these say."""
        for _ in range(_MOST_CLEANINGS):
            cells = self.cells()
            if not len(cells):
                return
            known = self.known
            fit = self.fit(cells, without_itself=True)
            miss = fit.cells_away(self.at(cells)) / (1 + np.sqrt(fit.leverage))
            miss[~fit.sound] = 0
            # One wrong corner spoils the prediction of all its neighbours: only the worst one of a
            # neighbourhood goes.
            spread = np.zeros(known.shape)
            spread[cells[:, 0], cells[:, 1]] = miss
            worst = cv2.dilate(spread, _BESIDE)
            bad = (miss > most_miss) & (miss >= worst[cells[:, 0], cells[:, 1]])
            bad |= neighbours(known)[cells[:, 0], cells[:, 1]] == 0
            if not bad.any():
                return
            self.drop(cells[bad])


def neighbours(known: BoolArray) -> IntArray:
    """How many of the four cells beside each cell (I, J) are known."""
    count = np.zeros(known.shape, int)
    count[1:] += known[:-1]
    count[:-1] += known[1:]
    count[:, 1:] += known[:, :-1]
    count[:, :-1] += known[:, 1:]
    return count


@dataclass(kw_only=True, eq=False)
class Lattice(CornerMap):
    """Cells with their pixels while a grid grows.

    Attributes:
        pixel: (I, J, 2) position of each cell, NaN where there is none.
        contrast: (I, J) bright minus dark level, grey levels.
        tried: (I, J) number of neighbours at the last failed try of an empty cell.
        parity: +1 when the quadrant (+, +) of array cell (0, 0) is bright, else -1.
        half_gap: how far dark squares draw back from their edges where white bleeds, pixels.

    """

    half_width: ClassVar[int] = 2
    pixel: FloatArray
    contrast: FloatArray
    tried: IntArray = field(init=False)
    parity: int
    half_gap: float = 0.0

    def __post_init__(self) -> None:
        """Start with no cell tried."""
        self.tried = np.zeros(self.pixel.shape[:2], int)

    @classmethod
    def from_cells(
        cls, cells: IntArray, pixel: FloatArray, contrast: FloatArray, parity: int
    ) -> Lattice:
        """Build the maps from (N, 2) cells, parity being that of cell (0, 0)."""
        low = cells.min(0) - MARGIN
        shape = cells.max(0) - low + 1 + MARGIN
        lattice = cls(
            pixel=np.full((*shape, 2), np.nan),
            contrast=np.zeros(shape),
            parity=parity if low.sum() % 2 == 0 else -parity,
        )
        lattice.put(cells - low, pixel, contrast)
        return lattice

    def gap_at(self, cells: IntArray) -> FloatArray:
        """Half the gap (N,) at (N, 2) cells, pixels."""
        return np.full(len(cells), self.half_gap)

    def set_gap(self, cells: IntArray, gap: FloatArray) -> None:
        """Set half the gap from what corners show of it: (N, 2), for (N, 2) cells, pixels."""
        self.half_gap = median(gap) if len(cells) else 0.0

    def apart(self, cells: IntArray, pixel: FloatArray) -> FloatArray:
        """Where corners (N, 2) lie that may be in each other's way: (N, 2 or more)."""
        return pixel

    def sign(self, cells: IntArray) -> IntArray:
        """Parity at (N, 2) cells: +1 where the quadrant (+, +) is bright."""
        return np.where(cells.sum(-1) % 2 == 0, self.parity, -self.parity)

    def put(self, cells: IntArray, pixel: FloatArray, contrast: FloatArray) -> None:
        """Set corners."""
        self.pixel[cells[:, 0], cells[:, 1]] = pixel
        self.contrast[cells[:, 0], cells[:, 1]] = contrast

    def drop(self, cells: IntArray) -> None:
        """Remove corners."""
        super().drop(cells)
        self.contrast[cells[:, 0], cells[:, 1]] = 0

    def make_room(self) -> None:
        """Widen the maps where corners come near their border."""
        known = self.known
        if not known.any():
            return
        rows, columns = np.nonzero(known.any(1))[0], np.nonzero(known.any(0))[0]
        sides = (
            (rows[0], known.shape[0] - 1 - rows[-1]),
            (columns[0], known.shape[1] - 1 - columns[-1]),
        )
        if min(min(side) for side in sides) >= MARGIN:
            return
        pad = [tuple(0 if room >= MARGIN else 8 for room in side) for side in sides]
        if (pad[0][0] + pad[1][0]) % 2:
            self.parity = -self.parity
        self.pixel = np.pad(self.pixel, (*pad, (0, 0)), constant_values=np.nan)
        self.contrast = np.pad(self.contrast, pad)
        self.tried = np.pad(self.tried, pad)

    def contrast_around(self, cells: IntArray) -> FloatArray:
        """Mean contrast (N,) of the corners about (N, 2) cells."""
        row, column = cells.T
        count = self.neighbour_sum(self.known.astype(float))[row, column]
        return np.asarray(self.neighbour_sum(self.contrast)[row, column] / np.maximum(count, 1))

    def as_grid(self) -> Grid:
        """The grid, its contrast in the levels of the maps."""
        cells = self.cells()
        origin = cells.min(0)
        steps = np.concatenate([np.diff(self.pixel, axis=axis).reshape(-1, 2) for axis in (0, 1)])
        length = np.hypot(steps[:, 0], steps[:, 1])
        length = length[~np.isnan(length)]
        return Grid(
            cells=cells - origin,
            pixel=self.at(cells),
            parity=int(self.sign(origin[None])[0]),
            step=median(length) if len(length) else np.nan,
            contrast=self.contrast[cells[:, 0], cells[:, 1]],
        )

    def fit(self, cells: IntArray, *, without_itself: bool = False) -> LocalFit:
        """Fit position against cell around (N, 2) cells at least 3 from the maps' border."""
        columns = self.pixel.shape[1]
        around = (cells @ (columns, 1))[:, None] + _WINDOW @ (columns, 1)
        pixel = self.pixel.reshape(-1, 2)[around]
        known = ~np.isnan(pixel[..., 0])
        if without_itself:
            known[:, _CENTRE] = False
        weight = known * _WEIGHT
        products = weight @ _PRODUCTS
        total = np.maximum(products[:, 0], 1e-12)
        right = np.zeros((len(cells), 6, 3))
        mean = np.empty((len(cells), 2))
        for axis in (0, 1):
            weighted = weight * np.where(known, pixel[..., axis], 0.0)
            mean[:, axis] = weighted.sum(1) / total
            # Relative to the mean, so that the ridge does not act on absolute positions.
            right[..., axis] = weighted @ _TERMS - mean[:, axis, None] * products[:, :6]
        right[:, 0, 2] = 1
        answer = np.linalg.solve(products.reshape(-1, 6, 6) + _RIDGE, right)
        solution = answer[..., :2].transpose(0, 2, 1)
        return LocalFit.of_terms(solution, mean, answer[:, 0, 2] * _WEIGHT[_CENTRE + 1], known)
