"""What markers say of how their boards are printed: rows, sides, distances, and their own kind."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.grids import FoundGrids
from cubicfish.find.detection.markers_detect import SeenMarkers, Sight, every_family
from cubicfish.find.detection.markers_read import (
    VOUCH_CELLS,
    all_read,
    group_agreeing,
    middles_and_axes,
    read_alone,
)
from cubicfish.find.detection.medians import median
from cubicfish.find.detection.pyramid import build_pyramid
from cubicfish.target.boards.board import Board
from cubicfish.target.target import Target
from cubicfish.types import FloatArray, IntArray

# A marker's side that is off by this share puts its outermost modules half a module off. Fewer
# pairs of markers do not say how wide they are; theirs must lie this straight, as a share.
_SIDE_OFF, _FEWEST_PAIRS, _STRAIGHT = 0.1, 4, 0.2


def with_sides_seen(target: Target, alone: SeenMarkers) -> Target | None:
    """The target with its markers as wide as they are seen; None where that is what it says.

    A marker that lies two cells from another of its board, or nearer, is as far away as both say
    in their own sides. Corners do not depend on how wide markers are: a wrong size in the target's
    file hides them only because markers are looked for in the wrong parts of squares.
    """
    changed = {}
    for index in np.unique(alone.board).tolist():
        board, own = target.boards[index], alone.of(index)
        if board.markers is None or board.per_cell == 2:
            continue
        apart = own.cell[None] - own.cell[:, None]
        one, other = np.nonzero((apart != 0).any(-1) & (np.abs(apart).max(-1) <= VOUCH_CELLS))
        middle, step = middles_and_axes(own.pixel)
        seen = middle[other] - middle[one]
        expected = (0.5 * (step[one] + step[other]) @ apart[one, other][..., None])[..., 0]
        times = (seen * expected).sum(axis=1) / np.square(expected).sum(axis=1)
        off = np.linalg.norm(seen - times[:, None] * expected, axis=1)
        straight = (times > 1) & (off < _STRAIGHT * np.linalg.norm(seen, axis=1))
        side = board.square / median(times[straight]) if straight.any() else 0.0
        enough = straight.sum() >= 2 * _FEWEST_PAIRS
        if enough and abs(np.log(side / board.markers.side)) > _SIDE_OFF:
            changed[index] = replace(board, markers=replace(board.markers, side=side))
    return target.with_boards(changed) if changed else None


def agreeing_markers(
    image: npt.NDArray[np.generic],
    layouts: Sequence[Target],
    index: int,
    grids: FoundGrids,
) -> IntArray:
    """Count the markers that agree on where a board is, for each of several layouts of it.

    Args:
        image: (H, W) grey photo.
        layouts: the target with that board laid out otherwise, not in a mirror and not inverted;
            the first has all markers that are looked for.
        index: the board.
        grids: what was found in the same photo.

    Returns:
        (N,) for each layout.

    """
    seen = _read_all(image, layouts[0], grids).of(index)
    ids = _list_ids_by_cell(layouts[0].boards[index])[tuple(seen.cell.T)]
    counts = []
    for one in layouts:
        table = one.boards[index].marker_cells()
        row = ids - table[0, 0]
        known = row < len(table)
        own = replace(seen.select(known), cell=table[row[known], 1:])
        label = group_agreeing(own, one.boards[index]) if len(own) else np.zeros(0, np.intp)
        agreeing = [len(np.unique(own.cell[label == place], axis=0)) for place in np.unique(label)]
        counts.append(max(agreeing, default=0))
    return np.array(counts, np.intp)


def markers_of(image: npt.NDArray[np.generic], target: Target) -> int:
    """How many of a target's markers are clearly read in a grey photo (H, W)."""
    sight = Sight.of(image, target)
    seen = read_alone(sight.pyramid, sight.families)
    return len(np.unique(np.column_stack([seen.board, seen.cell]), axis=0))


def markers_of_any_kind(image: npt.NDArray[np.generic]) -> dict[str, IntArray]:
    """Ids of all markers (N,) that are clearly read in a grey photo (H, W), by dictionary."""
    names, all_families = every_family()
    seen = read_alone(build_pyramid(image), all_families)
    return {name: np.unique(seen.of(index).cell[:, 0]) for index, name in enumerate(names)}


def tags_apart(
    image: npt.NDArray[np.generic], target: Target, index: int, grids: FoundGrids
) -> FloatArray:
    """How far apart tags are that follow each other in a row of a board.

    Args:
        image: (H, W) grey photo.
        target: the calibration target, not in a mirror.
        index: the board.
        grids: what was found in the same photo.

    Returns:
        (N,) distances of their middles, in their sides.

    """
    seen = _read_all(image, target, grids).of(index)
    cell, first = np.unique(seen.cell, axis=0, return_index=True)
    middle, step = middles_and_axes(seen.pixel[first])
    row, following = np.nonzero((cell[None] - cell[:, None] == (1, 0)).all(axis=-1))
    side = np.linalg.norm(step[..., 0], axis=1)
    distance = np.linalg.norm(middle[following] - middle[row], axis=1)
    return np.asarray(distance / (0.5 * (side[row] + side[following])), float)


def _read_all(image: npt.NDArray[np.generic], target: Target, grids: FoundGrids) -> SeenMarkers:
    """Markers that are read alone and in grids' squares."""
    sight = Sight.of(image, target)
    return all_read(sight, grids, read_alone(sight.pyramid, sight.families))


def _list_ids_by_cell(board: Board) -> IntArray:
    """(cell columns, cell rows) ids of the markers; -1 in cells without one."""
    ids, column, row = board.marker_cells().T
    table = np.full((column.max() + 1, row.max() + 1), -1, np.intp)
    table[column, row] = ids
    return table
