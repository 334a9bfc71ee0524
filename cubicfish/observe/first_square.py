"""Boards of markers that begin with the other square than the target says.

Half of a ChArUco board's ids then lie one square to the right of where the target has them, and
half to the left: what the larger half names lacks an outer column or row in every photo.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from cubicfish.find.identification.identified import FEWEST_CORNERS
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.target.boards.board import Board, FirstSquare
from cubicfish.target.boards.markers import MARKER_DICTIONARIES
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import IntArray

_OTHER: dict[FirstSquare, FirstSquare] = {"dark": "light", "light": "dark"}


def boards_begun_otherwise(
    target: Target, corners: Observations | None, findings: Iterable[Finding]
) -> dict[int, Board]:
    """The boards that may begin with the other square, as they then are, by their index.

    Those of which every photo lacks the same outer column or row, where most photos have room for
    it; and those whose markers are said to lie so.

    Args:
        target: what photos show.
        corners: the corners that markers named; None where none could be.
        findings: what is said of them.

    """
    others = {index: _begun_otherwise(board) for index, board in enumerate(target.boards)}
    said = {name for one in findings if _says_so(one, target) for name in one.boards}
    return {
        index: other
        for index, other in others.items()
        if other is not None
        and (other.name in said or (corners is not None and _lacks_a_line(corners, index, other)))
    }


def _says_so(finding: Finding, target: Target) -> bool:
    """Whether a finding says that a board of the target begins with the other square."""
    if (finding.code, finding.case) != (Code.CORNER_COUNT, "markers"):
        return False
    board, says = target.board(finding.boards[0]), finding.figures
    return says["columns"] == board.columns and says["first_square"] != board.first_square


def _begun_otherwise(board: Board) -> Board | None:
    """The board with its markers in its other squares; None if there is none, or too few ids."""
    markers = board.markers
    if markers is None or not board.has_squares:
        return None
    count = (board.columns + 1) * (board.rows + 1) - markers.count
    if markers.first + count > MARKER_DICTIONARIES[markers.dictionary]:
        return None
    first = _OTHER[board.first_square]
    return replace(board, first_square=first, markers=replace(markers, count=count))


def _lacks_a_line(corners: Observations, index: int, board: Board) -> bool:
    """Whether no photo shows an outer line of a board, but the next one and room for it."""
    own = corners.select(corners.board == index)
    if len(own.pixel) < FEWEST_CORNERS:
        return False
    cell = np.stack([own.column, own.row], axis=-1)
    for axis, last in enumerate((board.columns - 1, board.rows - 1)):
        for next_line, inwards in ((1, 1), (last - 1, -1)):
            beyond = cell[:, axis] - next_line if inwards > 0 else next_line - cell[:, axis]
            if beyond.min() == 0 and _has_room(own, cell, axis, next_line, inwards):
                return True
    return False


def _has_room(own: Observations, cell: IntArray, axis: int, line: int, inwards: int) -> bool:
    """Whether most corners of a line would have another one beyond them in the photo."""
    step = np.zeros(3, np.intp)
    step[1 + axis] = inwards
    names = np.column_stack([own.image, cell])
    place = {tuple(name): number for number, name in enumerate(names.tolist())}
    outer = np.flatnonzero(cell[:, axis] == line)
    inner = np.array([place.get(tuple(name), -1) for name in (names[outer] + step).tolist()])
    known = inner >= 0
    beyond = 2 * own.pixel[outer[known]] - own.pixel[inner[known]]
    inside = ((beyond > 0) & (beyond < np.array(own.image_size) - 1)).all(axis=1)
    return bool(2 * inside.sum() > len(inside))


def begins_otherwise(board: Board, corners: int, named: int) -> Finding:
    """Say that a board begins with the other square.

    Args:
        board: as it is.
        corners: how many of its corners are named so.
        named: how many are named as the target says.

    """
    return Finding(
        code=Code.BOARD_ORDER,
        case="first_square",
        severity=Severity.NOTE,
        boards=(board.name,),
        figures={
            "board": board.name,
            "first_square": board.first_square,
            "corners": corners,
            "named": named,
        },
    )
