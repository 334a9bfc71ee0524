"""A grid without the few corners that hang on it beyond its board.

Behind a board's margin something dark may look like one more corner or like a whole cell of
them. Such strays make lines at the grid's rim that hold hardly any corner. They must not hide the
board, so they are cut off, at a cost: only as many lines as must go, the weakest first, and never
one that may be part of a larger board.

A line that need not go may be a stray as well, of a board that is cut on its other side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cubicfish_cli.detection.believe import MOST_MISS
from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.detection.lattice import Lattice
from cubicfish_cli.types import BoolArray, IntArray

# A line at the rim is weak with at most so many corners, or with so small a share of what the
# fullest line beside it has; with more than the other share it is none.
_WEAK, _WEAK_SHARE, _STRONG_SHARE = 2, 0.25, 0.5
# Corners that may be cut off: a few in any case, else a share of all; and never too many.
_FEW, _FEW_SHARE, _MOST_SHARE = 4, 0.125, 0.25
# A corner vouches for its line at the rim where it lies as near to what the rest of the grid
# predicts as corners of boards do, and where its squares differ by no smaller share of what those
# of the corners around do: light falls off by less from one line to the next.
_SAME_CONTRAST = 0.4


def without_strays(grid: Grid, sizes: IntArray) -> Grid | None:
    """The grid, cut as little as makes it fit a box; None where no few corners are in the way.

    Args:
        grid: the grid.
        sizes: (S, 2) boxes along the grid's i and j that it may fill.

    """
    return _cut(grid, sizes)


def solid(grid: Grid) -> Grid:
    """The grid without any weak line at its rim."""
    cut = _cut(grid, None)
    return grid if cut is None else cut


def solid_size(grid: Grid) -> tuple[int, int]:
    """Columns and rows of the grid's box, lines of hardly any corners left out."""
    columns, rows = (np.ptp(solid(grid).cells, axis=0) + 1).tolist()
    return columns, rows


def doubtful_rims(grid: Grid) -> list[BoolArray]:
    """The lines at the rim for which hardly any corner vouches: for each, its cells (N,)."""
    lattice = Lattice.from_cells(grid.cells, grid.pixel, grid.contrast, grid.parity)
    place = grid.cells + (lattice.cells().min(axis=0) - grid.cells.min(axis=0))
    found = []
    for axis in (0, 1):
        along = grid.cells[:, axis]
        fullest = int(np.bincount(along).max())
        for rim in (along == along.min(), along == along.max()):
            lattice.drop(place[rim])
            fit = lattice.fit(place[rim])
            around = lattice.contrast_around(place[rim])
            away = fit.cells_away(grid.pixel[rim]) / (1 + np.sqrt(fit.leverage))
            vouched = (away < MOST_MISS) | ~fit.sound  # where nothing is predicted nothing speaks
            vouched &= grid.contrast[rim] >= _SAME_CONTRAST * around
            if vouched.sum() <= max(_WEAK, _WEAK_SHARE * fullest):
                found.append(rim)
            lattice.put(place[rim], grid.pixel[rim], grid.contrast[rim])
    return found


def _cut(grid: Grid, sizes: IntArray | None) -> Grid | None:
    keep = np.ones(len(grid), bool)
    while True:
        cells = grid.cells[keep]
        extent = np.ptp(cells, axis=0) + 1
        if sizes is not None and (extent <= sizes).all(axis=1).any():
            break
        axes = [0, 1] if sizes is None else _axes_in_the_way(extent, sizes)
        weakest = _weakest_lines(cells, axes)
        if weakest is None:
            if sizes is not None:
                return None
            break
        keep[keep] = ~weakest
        if not _are_few(int((~keep).sum()), len(grid)):
            return None
    return _part(grid, keep)


def _axes_in_the_way(extent: IntArray, sizes: IntArray) -> list[int]:
    """The axes along which the grid must be shorter to come nearer to a box."""
    over = np.maximum(extent - sizes, 0)
    nearest = over[over.sum(axis=1) == over.sum(axis=1).min()]
    return [axis for axis in (0, 1) if nearest[:, axis].any()]


def _weakest_lines(cells: IntArray, axes: list[int]) -> BoolArray | None:
    """Which cells (N,) are on the weakest lines at the rim; None where no line is weak.

    Where two are equally weak, nothing tells which of them is of the board: both go.
    """
    fewest, lines = np.inf, np.zeros(len(cells), bool)
    for axis in axes:
        along = cells[:, axis]
        count = np.bincount(along - along.min())
        for end in (0, -1):
            own = int(count[end])
            weak = own <= max(_WEAK, _WEAK_SHARE * count.max())
            if not weak or own > _STRONG_SHARE * count.max() or own > fewest:
                continue
            here: BoolArray = along == (along.min() if end == 0 else along.max())
            lines = here if own < fewest else lines | here
            fewest = own
    return lines if np.isfinite(fewest) else None


def _are_few(cut: int, corners: int) -> bool:
    return cut <= max(_FEW, _FEW_SHARE * corners) and cut <= _MOST_SHARE * corners


def _part(grid: Grid, keep: BoolArray) -> Grid:
    cells = grid.cells[keep]
    first = cells.min(axis=0)
    return replace(
        grid,
        cells=cells - first,
        pixel=grid.pixel[keep],
        # Every step along i or j flips the colours.
        parity=grid.parity * (-1) ** int(first.sum()),
        contrast=grid.contrast[keep],
    )
