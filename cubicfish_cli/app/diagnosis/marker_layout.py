"""Boards whose markers lie otherwise than the target says: of other counts, or the other colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from cubicfish_cli.app.diagnosis.evidence import MarkerEvidence
from cubicfish_cli.app.diagnosis.mirrored import hardly_named, richest, unseen_boards
from cubicfish_cli.core.boards.board import Board, FirstSquare
from cubicfish_cli.core.boards.markers import MARKER_DICTIONARIES
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.types import IntArray

# Photos that are looked at, and how many columns a board may have.
_PHOTOS, _MOST_COLUMNS = 3, 40
# Side by side in a row two or three markers agree however long rows are: all of the board must do
# so in a photo, and so many times more than for any other length.
_LEAST_MARKERS, _CLEARLY = 4, 2
_COLOURS: tuple[FirstSquare, ...] = ("dark", "light")


def otherwise_laid_out(evidence: MarkerEvidence) -> list[Finding]:
    """Boards of which hardly a corner has a name, though markers are read: rows are of others.

    Ids run row by row, so the markers that follow each other across rows tell how long rows are.
    """
    from cubicfish_cli.corners.detection.markers import find_marked_corners  # for photos alone
    from cubicfish_cli.corners.detection.markers_measure import agreeing_markers

    target, findings = evidence.target, []
    none = hardly_named(evidence)
    for index in range(len(target.boards)) if none else unseen_boards(evidence):
        board = target.boards[index]
        if board.mirrored or board.markers is None or board.markers.inverted:
            continue
        boards = _try_layouts(board)
        drawings = [target.with_boards({index: other}) for other in boards]
        photos = list(islice(richest(evidence), _PHOTOS))
        counts: IntArray = np.zeros(len(boards), np.intp)
        for picture, grids in photos:
            counts = np.maximum(counts, agreeing_markers(picture, drawings, index, grids))
        best = int(counts.argmax())
        if _lies_alike(boards[best], board):
            continue
        longer = np.array([other.columns != boards[best].columns for other in boards])
        if counts[best] < max(_LEAST_MARKERS, _CLEARLY * int(counts[longer].max(initial=0))):
            continue
        seen = [find_marked_corners(picture, drawings[best], grids) for picture, grids in photos]
        rows = np.concatenate([one.row[one.board == index] for one in seen])
        if len(rows):
            some = len(evidence.corners.pixel) > 0 and not none
            severity = Severity.CARE if some else Severity.BAD
            findings.append(_describe_rows(board, boards[best], rows, int(counts[best]), severity))
    return findings


def _try_layouts(board: Board) -> list[Board]:
    """The board with rows of any length, and as many rows as there are markers for."""
    squares: Sequence[FirstSquare] = _COLOURS if board.has_squares else (board.first_square,)
    lengths = range(1, _MOST_COLUMNS + 1)
    drawings = [_lay_out_rows(board, length, first) for length in lengths for first in squares]
    usable = [one for one in drawings if one is not None]
    # The first is to have all markers.
    return sorted(usable, key=lambda one: -(one.markers.count if one.markers else 0))


def _lay_out_rows(board: Board, length: int, first: FirstSquare) -> Board | None:
    """The board with so many columns of squares' corners, or tags; None where that is none.

    It has as many rows as there are markers for.
    """
    markers = board.markers
    if markers is None:
        return None
    available = MARKER_DICTIONARIES[markers.dictionary] - markers.first
    if board.per_cell == 2:
        high = available // length
        columns, rows, count = 2 * length, 2 * high, length * high
    else:
        carrying = first == "light"
        high = (2 * available - carrying) // (length + 1)
        columns, rows, count = length, high - 1, (high * (length + 1) + carrying) // 2
    if min(columns, rows) < 2 or count < _LEAST_MARKERS:
        return None
    return replace(
        board,
        columns=columns,
        rows=rows,
        first_square=first,
        markers=replace(markers, count=count),
        shape=None,
    )


def _lies_alike(one: Board, other: Board) -> bool:
    return one.columns == other.columns and one.first_square == other.first_square


def _describe_rows(
    board: Board, other: Board, rows: IntArray, markers: int, severity: Severity
) -> Finding:
    # Tags are counted from the bottom.
    last = other.rows - int(rows.min()) if board.per_cell == 2 else int(rows.max()) + 1
    return Finding(
        code=Code.CORNER_COUNT,
        case="tags" if board.per_cell == 2 else "markers",
        severity=severity,
        boards=(board.name,),
        figures={
            "board": board.name,
            "markers": markers,
            "columns": other.columns // board.per_cell,
            "rows": last // board.per_cell,
            "drawn_columns": board.columns // board.per_cell,
            "drawn_rows": board.rows // board.per_cell,
            "first_square": other.first_square,
        },
    )
