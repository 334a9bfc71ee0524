"""Reading all markers of a grid together, where blur leaves none that can be read alone.

Each of a board's few dozen markers that is too blurred to be read still looks more like itself
than like others. A grid's place on a board says which marker lies in which of its squares: the
right place shows in all of them at once, and a board of other markers in none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.detection.markers_detect import Family
from cubicfish_cli.detection.markers_lattice import BoardLattice
from cubicfish_cli.detection.markers_read import (
    marker_ratio,
    module_levels,
    module_places,
    shortest_side,
)
from cubicfish_cli.detection.pyramid import Pyramid
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray, IntArray

# Standard deviations above what the same markers' likeness to all others of the dictionary would
# give, for the best place, and between it and the next; nothing near comes about by chance.
_CERTAIN, _APART = 5.0, 2.5
# Share of the markers that look more like themselves than others do on the whole: nearly all, so
# that no board with a part of the same markers, or another order of them, is taken for this one.
_SHARE = 0.8
# Fewer markers are too few to tell, and more places than that are not looked through.
_FEWEST, _MOST_PLACES = 4, 150
_QUARTER = np.array([(0, 1), (-1, 0)])


@dataclass(frozen=True, kw_only=True, eq=False)
class NamedGrid:
    """A grid's place.

    Attributes:
        board: index into the target's boards.
        cells: (N, 2) column and row of each of the grid's corners.
        markers: how many were compared.

    """

    board: int
    cells: IntArray
    markers: int


def read_together(
    pyramid: Pyramid, target: Target, all_families: list[Family], grid: Grid
) -> NamedGrid | None:
    """Find where on which board with markers in its bright squares a grid lies.

    None where no place stands out, or the grid shows fewer than four markers.
    """
    found: list[tuple[float, float, NamedGrid]] = []
    for family in all_families:
        if family.joined:
            continue
        for board in np.unique(family.board).tolist():
            places = _places(BoardLattice(board=target.boards[board]), grid)
            if len(places) > _MOST_PLACES:
                continue
            for cells in places:
                likeness, share, markers = _likeness(pyramid, target, family, board, grid, cells)
                one = NamedGrid(board=board, cells=cells, markers=markers)
                found.append((likeness, share, one))
    found.sort(key=lambda one: -one[0])
    if not found or found[0][0] < _CERTAIN or found[0][1] < _SHARE:
        return None
    if len(found) > 1 and found[0][0] - found[1][0] < _APART:
        return None
    return found[0][2]


def _places(lattice: BoardLattice, grid: Grid) -> list[IntArray]:
    """All names (N, 2) that a grid's corners may have, by the board's size and colours."""
    places = []
    columns, rows = lattice.known.shape
    for turn in range(4):
        cells = grid.cells @ np.linalg.matrix_power(_QUARTER, turn)
        cells = cells - cells.min(axis=0)
        # Quarter turns; every other one swaps which quadrant lies right and below.
        sign = grid.parity * (-1) ** (grid.cells.sum(axis=1) + turn)
        width, height = cells.max(axis=0)
        for column in range(columns - int(width)):
            for row in range(rows - int(height)):
                named = cells + np.array([column, row])
                if (lattice.sign(named[:1]) == sign[:1]).all():
                    places.append(named)
    return places


def _likeness(
    pyramid: Pyramid, target: Target, family: Family, index: int, grid: Grid, cells: IntArray
) -> tuple[float, float, int]:
    """How much a grid's squares look like the markers that a place puts there.

    In standard deviations of what other markers would give; then the share of markers that look
    more like themselves than the mean of others, and how many there are.
    """
    lattice = BoardLattice(board=target.boards[index])
    lattice.put(cells, grid.pixel)
    own = np.nonzero(family.board == index)[0]
    corner = (family.cell[own] - 1)[:, None] + np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    whole = np.asarray(lattice.inside(corner).all(axis=1))
    corner, own = corner[whole], own[whole]
    pixel = lattice.at(corner.reshape(-1, 2)).reshape(-1, 4, 2)
    seen = ~np.isnan(pixel).any(axis=(1, 2))
    corner, own, pixel = corner[seen], own[seen], pixel[seen]
    if len(own) < _FEWEST:
        return 0.0, 0.0, len(own)
    ratio = marker_ratio(target, index)
    points = lattice.inside_squares(corner, module_places(family, ratio))
    level = module_levels(pyramid, points, ratio * shortest_side(pixel), family)
    alike = _correlation(level, family)
    inside = np.asarray(
        pyramid.inside(points.reshape(-1, 2), 1.0).reshape(len(own), -1).all(axis=1)
    )
    alike, own = alike[inside], own[inside]
    if len(own) < _FEWEST:
        return 0.0, 0.0, len(own)
    mean, spread = alike.mean(axis=1), np.maximum(alike.std(axis=1), 1e-6)
    excess = alike[np.arange(len(own)), own] - mean
    return (
        float(excess.sum() / np.sqrt((spread**2).sum())),
        float((excess > 0).mean()),
        len(own),
    )


def _correlation(level: FloatArray, family: Family) -> FloatArray:
    """Correlation (N, 4 M) of N markers' levels with M blurred codes, upright ones first."""
    border = family.border
    inner = slice(border, -border)
    turned = np.concatenate([np.rot90(family.codes, k, axes=(1, 2)) for k in range(4)])
    codes = np.pad(turned.astype(float), ((0, 0), (border, border), (border, border)))
    # Blur takes fine patterns away: what is compared is what it leaves.
    for axis in (1, 2):
        codes = codes + 0.5 * (np.roll(codes, 1, axis=axis) + np.roll(codes, -1, axis=axis))
    return _unit(level[:, inner, inner]) @ _unit(codes[:, inner, inner]).T


def _unit(patches: FloatArray) -> FloatArray:
    flat = patches.reshape(len(patches), -1)
    flat = flat - flat.mean(axis=1, keepdims=True)
    return np.asarray(flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9))
