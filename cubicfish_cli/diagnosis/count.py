"""How many corners boards have, as photos show it."""

from __future__ import annotations

from dataclasses import dataclass

from cubicfish_cli.boards.board import Board
from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.target import Target

FEWEST_PHOTOS = 2
"""So many photos must show it: in one, anything may cover a line of corners."""
# A grid fills its box when it has so much of it.
_FILLED = 0.9


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


def boards_with_squares(target: Target) -> list[int]:
    """Indices of the boards whose corners are where squares meet."""
    return [index for index, board in enumerate(target.boards) if board.has_squares]


def grid_boards(target: Target) -> list[Board]:
    """The boards that show as a grid of squares."""
    return [target.boards[index] for index in boards_with_squares(target)]
