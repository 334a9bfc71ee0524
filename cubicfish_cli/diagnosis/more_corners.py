"""How many corners boards have, as photos show it: more than drawn, by grids larger than they."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.diagnosis.evidence import boards_with_squares
from cubicfish_cli.identification.identified import FEWEST_CORNERS, GridReport, Identified
from cubicfish_cli.identification.name_grids import name_again
from cubicfish_cli.placement import TURNS
from cubicfish_cli.target import Target

FEWEST_PHOTOS = 2
"""So many photos must show it: in one, anything may cover a line of corners."""
# A grid fills its box when it has so much of it.
_FILLED = 0.9
# Grids that are larger than drawn must have a place on the enlarged board, so many of them.
_PLACED = 0.9
_TRIAL_PHOTOS = 6


@dataclass(frozen=True, kw_only=True)
class Count:
    """How many corners a board has, as photos show it.

    Attributes:
        board: index into the target's boards.
        size: columns and rows that are seen.
        photos: in how many photos.
        sure: whether the columns are surely so many, and the rows; else they are as drawn, and
            photos do not tell.

    """

    board: int
    size: tuple[int, int]
    photos: int
    sure: tuple[bool, bool] = (True, True)


def is_full(grid: Grid) -> bool:
    """Whether a grid has nearly all corners of its box."""
    return bool(len(grid) >= _FILLED * (grid.cells.max(axis=0) + 1).prod())


def more_corners(identified: Identified, target: Target) -> list[Count]:
    """Boards of which photos show more corners than are drawn.

    Args:
        identified: what became of the photos' grids.
        target: the drawing.

    """
    lost = [
        (photo, number, report)
        for photo, own in enumerate(identified.grids)
        for number, report in enumerate(own)
        if not report.named and report.corners >= FEWEST_CORNERS
    ]
    boards = boards_with_squares(target)
    found: list[Count] = []
    for index, axis in product(boards, (0, 1)):
        if any(count.board == index for count in found):
            continue
        board = target.boards[index]
        size = (board.columns + (axis == 0), board.rows + (axis == 1))
        # Of boards of a target a grid may show a part.
        whole = [(photo, n) for photo, n, one in lost if sorted(one.size) == sorted(size)]
        if len(boards) == 1:
            full = [(photo, n) for photo, n in whole if is_full(identified.found[photo][n])]
            photos = _outnumbering(full, identified, board)
        else:
            length, most = size[axis], size[1 - axis]
            larger = [
                (photo, n)
                for photo, n, one in lost
                if any(a == length and b <= most for a, b in (one.size, one.size[::-1]))
            ]
            photos = _with_place(larger, identified, target, index, axis)
        if photos:
            exceeds = any(np.greater(sorted(one.size), sorted(size)).any() for *_, one in lost)
            other = bool(whole) and not exceeds
            sure = (True, other) if axis == 0 else (other, True)
            found.append(Count(board=index, size=size, photos=photos, sure=sure))
    return found


def _outnumbering(larger: Sequence[tuple[int, int]], identified: Identified, board: Board) -> int:
    """In how many photos larger grids are, if in more than show the board as it is drawn."""
    photos = {photo for photo, _ in larger}
    drawn = sorted((board.columns, board.rows))
    as_drawn = {
        photo
        for photo, own in enumerate(identified.grids)
        if any(report.named and sorted(report.size) == drawn for report in own)
    }
    enough = len(photos) >= max(FEWEST_PHOTOS, len(as_drawn) + 1) and not photos & as_drawn
    return len(photos) if enough else 0


def _with_place(
    larger: Sequence[tuple[int, int]],
    identified: Identified,
    target: Target,
    index: int,
    axis: int,
) -> int:
    """In how many photos larger grids lie where the board is, beside others, if it is so large."""
    photos = sorted({photo for photo, _ in larger})
    if len(photos) < FEWEST_PHOTOS:
        return 0
    fullest = sorted(photos, key=lambda photo: -sum(len(grid) for grid in identified.found[photo]))
    chosen = sorted(fullest[:_TRIAL_PHOTOS])
    for at_start in (False, True):
        board = _longer(target.boards[index], axis, at_start=at_start)
        again = name_again(identified, chosen, target.with_boards({index: board})).grids
        placed = {
            photo
            for photo, number in larger
            if photo in chosen
            and _fills(again[chosen.index(photo)][number], index, board, axis)
            and sum(report.named for report in again[chosen.index(photo)]) > 1
        }
        if len(placed) >= max(FEWEST_PHOTOS, _PLACED * len(chosen)):
            return len(photos)
    return 0


def _fills(report: GridReport, index: int, board: Board, axis: int) -> bool:
    """Whether a grid lies on a board, and from end to end along one of its axes."""
    if report.place is None or report.place.board != index:
        return False
    length = (np.abs(TURNS[report.place.turn]) @ report.size)[axis]
    return bool(length == (board.columns, board.rows)[axis])


def _longer(board: Board, axis: int, *, at_start: bool) -> Board:
    """The board with one more line of corners, at its end or at its start."""
    origin, first_square = board.origin, board.first_square
    if at_start:
        origin = origin - board.square * board.axes[axis]
        first_square = "dark" if first_square == "light" else "light"
    return replace(
        board,
        columns=board.columns + (axis == 0),
        rows=board.rows + (axis == 1),
        origin=origin,
        first_square=first_square,
        shape=None,
    )
