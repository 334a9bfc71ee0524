"""Boards whose markers lie otherwise than the target says: of other counts, or the other colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from cubicfish_cli.boards.board import Board, FirstSquare
from cubicfish_cli.boards.markers import MARKER_DICTIONARIES, alike
from cubicfish_cli.diagnosis.evidence import MarkerEvidence
from cubicfish_cli.diagnosis.mirrored import hardly_named, richest, unseen_boards
from cubicfish_cli.target import Target
from cubicfish_cli.types import IntArray
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

if TYPE_CHECKING:
    from cubicfish_cli.detection.markers import MarkedCorners

# Photos that are looked at, and how many columns a board may have.
_PHOTOS, _MOST_COLUMNS = 3, 40
# Side by side in a row two or three markers agree however long rows are: all of the board must do
# so in a photo, and so many times more than for any other length.
_LEAST_MARKERS, _CLEARLY = 4, 2
_COLOURS: tuple[FirstSquare, ...] = ("dark", "light")
# A row is there where so many of its corners are seen, in so many photos.
_OF_ROW, _BEYOND_IN = 2, 2


def otherwise_laid_out(evidence: MarkerEvidence) -> list[Finding]:
    """Boards of which hardly a corner has a name, though markers are read: rows are of others.

    Ids run row by row, so the markers that follow each other across rows tell how long rows are.
    """
    from cubicfish_cli.detection.markers import find_marked_corners  # for photos alone
    from cubicfish_cli.detection.markers_measure import agreeing_markers

    target, findings = evidence.target, []
    none = hardly_named(evidence)
    for index in range(len(target.boards)) if none else unseen_boards(evidence):
        board = target.boards[index]
        if board.mirrored or board.markers is None or board.markers.inverted:
            continue
        boards = _otherwise(board)
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
            findings.append(_laid_out(board, boards[best], rows, int(counts[best]), severity))
    return findings


def _otherwise(board: Board) -> list[Board]:
    """The board with rows of any length, and as many rows as there are markers for."""
    squares: Sequence[FirstSquare] = _COLOURS if board.has_squares else (board.first_square,)
    lengths = range(1, _MOST_COLUMNS + 1)
    drawings = [_with_rows_of(board, length, first) for length in lengths for first in squares]
    usable = [one for one in drawings if one is not None]
    # The first is to have all markers.
    return sorted(usable, key=lambda one: -(one.markers.count if one.markers else 0))


def _with_rows_of(
    board: Board, length: int, first: FirstSquare, last: int | None = None
) -> Board | None:
    """The board with so many columns of squares' corners, or tags; None where that is none.

    It has as many rows as there are markers for, in all or before the id ``last``.
    """
    markers = board.markers
    if markers is None:
        return None
    available = (last or MARKER_DICTIONARIES[markers.dictionary]) - markers.first
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


def _laid_out(
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


def more_rows(evidence: MarkerEvidence) -> list[Finding]:
    """Boards whose markers go on beyond the last row that the target says.

    Ids run row by row: a row too few hides corners, and changes the name of none.
    """
    from cubicfish_cli.detection.markers import (  # for photos alone
        find_marked_corners,
        outlined_corners,
    )

    target, findings = evidence.target, []
    photos = list(islice(richest(evidence), _PHOTOS))
    for index in np.unique(evidence.corners.board).tolist():
        board = target.boards[index]
        longer = _with_all_rows(board, target)
        if longer is None:
            continue
        drawing = target.with_boards({index: longer})
        beyond = [
            (picture, grids)
            for picture, grids in photos
            if _last_row(outlined_corners(picture, drawing), index, longer) > board.rows
        ]
        # What outlines alone say is rough.
        seen = (find_marked_corners(picture, drawing, grids) for picture, grids in beyond)
        rows = [row for one in seen if (row := _last_row(one, index, longer)) > board.rows]
        if len(rows) >= _BEYOND_IN:
            findings.append(_goes_on(board, max(rows), len(rows)))
    return findings


def _last_row(found: MarkedCorners, index: int, board: Board) -> int:
    """The last row of a board that shows some corners, counted from 1; 0 where none does."""
    own = found.row[found.board == index]
    # Tags are counted from the bottom.
    row = board.rows - 1 - own if board.per_cell == 2 else own
    shown = np.flatnonzero(np.bincount(row) >= _OF_ROW)
    return int(shown.max(initial=-1)) + 1


def _with_all_rows(board: Board, target: Target) -> Board | None:
    """The board with as many rows as there are markers for that no other board has."""
    if board.markers is None:
        return None
    own, dictionaries = board.markers, alike(board.markers.dictionary)
    others = [
        other.markers.first
        for other in target.boards
        if other.markers and other.markers.dictionary in dictionaries
    ]
    last = min((first for first in others if first > own.first), default=None)
    longer = _with_rows_of(board, board.columns // board.per_cell, board.first_square, last)
    return longer if longer is not None and longer.rows > board.rows else None


def _goes_on(board: Board, rows: int, photos: int) -> Finding:
    return Finding(
        code=Code.CORNER_COUNT,
        case="more_rows",
        severity=Severity.NOTE,
        boards=(board.name,),
        figures={
            "board": board.name,
            "key": "tags" if board.per_cell == 2 else "corners",
            "columns": board.columns // board.per_cell,
            "rows": rows // board.per_cell,
            "drawn_rows": board.rows // board.per_cell,
            "photos": photos,
        },
    )
