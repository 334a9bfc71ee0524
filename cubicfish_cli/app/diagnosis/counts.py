"""How many corners boards have, where photos show other numbers than the target says.

A board has more corners where photos show it as a larger grid, and never as it is drawn. It has
fewer where whole grids of one size end in view of the lens, and no photo shows more.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from cubicfish_cli.app.diagnosis.evidence import boards_with_squares
from cubicfish_cli.core.placement import TURNS
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import BoolArray
from cubicfish_cli.corners.detection.grids import Grid
from cubicfish_cli.corners.identification.ends import Ends
from cubicfish_cli.corners.identification.identified import FEWEST_CORNERS, Identified

# So many photos must show it: in one, anything may cover a line of corners.
_FEWEST_PHOTOS = 2
# A grid fills its box when it has so much of it.
_FILLED = 0.9
# So many of the grids that end in view must have as many lines.
_AGREE_SHARE = 0.8
# A line of corners should be in view where so many of them would be visible.
_LINE_CORNERS = 3

Size = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class Count:
    """How many corners a board has, as photos show it.

    Attributes:
        board: index into the target's boards.
        size: columns and rows that are seen.
        photos: in how many photos.

    """

    board: int
    size: Size
    photos: int


def count_corners(identified: Identified, target: Target) -> list[Count]:
    """Count the corners of boards, where photos show others than the drawing.

    Args:
        identified: what became of the photos' grids.
        target: the drawing.

    Returns:
        One for each board that has more or fewer, in the order of the boards.

    """
    boards = boards_with_squares(target)
    counts = _find_more(identified, target, boards)
    counts |= _find_fewer(identified, target, [one for one in boards if one not in counts])
    return [counts[index] for index in sorted(counts)]


def _find_more(identified: Identified, target: Target, boards: list[int]) -> dict[int, Count]:
    """Boards that are a line longer: grids that fit nowhere, in photos without the board."""
    as_drawn, shown = defaultdict[int, set[int]](set), defaultdict[int, set[int]](set)
    larger = defaultdict[tuple[int, ...], set[int]](set)
    for photo, own in enumerate(identified.grids):
        for number, report in enumerate(own):
            size = tuple(sorted(report.size))
            if report.place is not None:
                board = target.boards[report.place.board]
                shown[report.place.board].add(photo)
                if size == tuple(sorted((board.columns, board.rows))):
                    as_drawn[report.place.board].add(photo)
            elif report.corners >= FEWEST_CORNERS and _is_full(identified.found[photo][number]):
                larger[size].add(photo)
    counts = {}
    for index in boards:
        board = target.boards[index]
        other = as_drawn[index] if len(boards) == 1 else shown[index]
        for size in ((board.columns + 1, board.rows), (board.columns, board.rows + 1)):
            photos = larger[tuple(sorted(size))] - other
            if len(photos) >= max(_FEWEST_PHOTOS, len(as_drawn[index]) + 1):
                counts[index] = Count(board=index, size=size, photos=len(photos))
    return counts


def _find_fewer(identified: Identified, target: Target, boards: list[int]) -> dict[int, Count]:
    """Boards of which photo after photo shows as many corners, and both ends; none shows more."""
    doubtful = [index for index in boards if not _is_shown_whole(identified, target, index)]
    scene = identified.scene
    if scene is None or scene.camera is None or not doubtful:
        return {}
    scene.place_grids()
    alone = len(boards_with_squares(target)) == 1
    seen = defaultdict[int, list[Size]](list)
    whole = defaultdict[int, list[tuple[Size, BoolArray]]](list)
    for own, reports in zip(scene.photos, identified.grids, strict=True):
        for index, report in zip(sorted(own), reports, strict=True):
            place, grid = report.place, scene.grids[index]
            if place is None or place.board not in doubtful or report.corners < FEWEST_CORNERS:
                continue
            board = target.boards[place.board]
            size = np.array([board.columns, board.rows])
            turn, extent = TURNS[place.turn], grid.cells.max(axis=0) + 1
            axes = np.abs(turn).argmax(axis=1)
            if alone and (extent[axes[0]] < extent[axes[1]]) == (size[0] >= size[1]):
                axes = axes[::-1]  # its place may be any: it lies as its longer side does
            columns, rows = extent[axes].tolist()
            seen[place.board].append((columns, rows))
            ends = scene.ends(own, index) if scene.poses[index] is not None else None
            if ends is None or not _is_full(grid):
                continue
            ended = _ends_in_view(ends)[axes]
            if not alone:
                cells = grid.cells @ turn.T + [place.column, place.row]
                ended = np.where(turn.sum(axis=1)[:, None] < 0, ended[:, ::-1], ended)
                ended |= np.stack([cells.min(axis=0) == 0, cells.max(axis=0) == size - 1], axis=1)
            whole[place.board].append(((columns, rows), ended.all(axis=1)))
    counts = {}
    for index, grids in whole.items():
        board, most = target.boards[index], np.max(seen[index], axis=0)
        short = most < [board.columns, board.rows]
        alike = [(size == most)[short].all() for size, ended in grids if ended[short].all()]
        if sum(alike) >= max(_FEWEST_PHOTOS, _AGREE_SHARE * len(alike)):
            columns, rows = most.tolist()
            counts[index] = Count(board=index, size=(columns, rows), photos=int(sum(alike)))
    return counts


def _is_shown_whole(identified: Identified, target: Target, index: int) -> bool:
    """Whether photos show the first and last columns and rows of a board that are drawn.

    Where one board is the whole target, a photo must show as many corners.
    """
    board = target.boards[index]
    drawn = np.array([board.columns, board.rows])
    if len(boards_with_squares(target)) == 1:
        reports = [one for own in identified.grids for one in own if one.named]
        sizes = [sorted(one.size) for one in reports if one.corners >= FEWEST_CORNERS]
        return not sizes or bool((np.max(sizes, axis=0) >= sorted(drawn)).all())
    corners = identified.corners
    own = np.stack([corners.column, corners.row], axis=1)[corners.board == index]
    return not len(own) or not (own.min(axis=0).any() or (own.max(axis=0) < drawn - 1).any())


def _is_full(grid: Grid) -> bool:
    """Whether a grid has nearly all corners of its box."""
    return bool(len(grid) >= _FILLED * (grid.cells.max(axis=0) + 1).prod())


def _ends_in_view(ends: Ends) -> BoolArray:
    """(2, 2) before and after the grid along i and j: a next line should be in view, but is not."""
    missing = np.array([ends.table[tuple(room)] for room in np.eye(4, dtype=np.intp)])
    return np.asarray(missing.reshape(2, 2) >= _LINE_CORNERS)
