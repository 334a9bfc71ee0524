"""How many corners boards have, as photos show it, and what is to be said of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.fitting.diagnosis.finding import Finding, listed
from cubicfish_cli.target import Board, Target

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


def miscounted(counts: Sequence[Count], target: Target, photos: int) -> Finding | None:
    """What is to be said of boards of which photos show another number of corners.

    Args:
        counts: of :func:`~cubicfish_cli.naming.wrong_drawing.miscounted.counted`.
        target: the object.
        photos: how many photos there are.

    """
    if not counts:
        return None
    names = tuple(target.boards[count.board].name for count in counts)
    parts = [_words(count, target.boards[count.board]) for count in counts]
    several = len(counts) > 1
    fewest, most = min(one.photos for one in counts), max(one.photos for one in counts)
    which = f"{most}" if fewest == most else f"{fewest} to {most}"
    return Finding(
        cause="corner_count",
        level="care",
        what=f"photos show {listed(parts, 'boards')}",
        evidence=f"{which} of {photos} photos show where {'they end' if several else 'it ends'}, "
        "none shows otherwise",
        do="correct corners in target.yaml (and origin, if it was of a corner that is not there) "
        "and run it again",
        boards=names,
    )


def _words(count: Count, board: Board) -> str:
    drawn = board.columns, board.rows
    if all(count.sure):
        what, says = f"{_times(*count.size)} inner corners", _times(*drawn)
    else:
        axis = 0 if count.sure[0] else 1
        what = f"{count.size[axis]} {('columns', 'rows')[axis]} of inner corners"
        says = f"{drawn[axis]}"
    return f"{what} of board {board.name} (target.yaml says {says})"


def _times(columns: int, rows: int) -> str:
    return f"{columns}x{rows}"
