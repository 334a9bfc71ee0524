"""Boards that have another number of corners than the target says."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.diagnosis.count import Count, grid_boards
from cubicfish_cli.diagnosis.evidence import GridEvidence
from cubicfish_cli.fitting.evidence import FitEvidence
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# Counting squares shows in so many photos of the whole board.
_WHOLE_BOARDS = 3


def squares_of_corners(evidence: FitEvidence) -> list[Finding]:
    """Boards that are seen whole in photos, but for the last column and row that they are to have.

    Corners that come as a table may be counted rightly where the target's squares are counted.
    """
    pairs, boards = evidence.pairs, []
    for index, board in enumerate(evidence.target.boards if evidence.target else ()):
        own = pairs.board == index
        if board.points is not None or not own.any() or min(board.columns, board.rows) < 3:
            continue
        last = pairs.column[own].max() + 1, pairs.row[own].max() + 1
        if last != (board.columns - 1, board.rows - 1):
            continue
        seen = np.bincount(pairs.image[own], minlength=len(pairs.images))
        if (seen == last[0] * last[1]).sum() >= _WHOLE_BOARDS:
            boards.append(board)
    return [squares_counted(boards)] if boards else []


def squares_of_grids(evidence: GridEvidence) -> list[Finding]:
    """That photo after photo shows one board whole, one corner smaller both ways."""
    boards = grid_boards(evidence.target)
    if len(boards) != 1:
        return []
    columns, rows = sorted((boards[0].columns, boards[0].rows))
    largest = [max(own, key=len) for own in evidence.identified.found if own]
    sizes = [tuple(sorted((np.ptp(grid.cells, axis=0) + 1).tolist())) for grid in largest]
    counted = (columns - 1, rows - 1)
    whole = sum(
        size == counted and len(grid) == size[0] * size[1]
        for grid, size in zip(largest, sizes, strict=True)
    )
    larger = any(size[0] > counted[0] or size[1] > counted[1] for size in sizes)
    if whole and 2 * whole >= len(largest) and not larger:
        return [squares_counted(boards, whole)]
    return []


def miscounted(evidence: GridEvidence) -> list[Finding]:
    """Boards of which photos show another number of corners."""
    counts = evidence.counts
    if not counts:
        return []
    fewest, most = min(one.photos for one in counts), max(one.photos for one in counts)
    boards = [evidence.target.boards[count.board] for count in counts]
    told = Finding(
        code=Code.CORNER_COUNT,
        severity=Severity.CARE,
        boards=tuple(board.name for board in boards),
        figures={
            "counts": [_seen(*both) for both in zip(counts, boards, strict=True)],
            "alike": fewest == most,
            "fewest": fewest,
            "most": most,
            "photos": len(evidence.names),
        },
    )
    return [told]


def squares_counted(boards: Sequence[Board], photos: int | None = None) -> Finding:
    """That boards have one corner less each way than the target says.

    Args:
        boards: these boards, one at least.
        photos: how many photos show it, where nothing can be made of any; None where the
            corners of a table are counted rightly.

    """
    first = boards[0]
    return Finding(
        code=Code.CORNER_COUNT,
        case="squares" if photos is None else "all_squares",
        severity=Severity.NOTE if photos is None else Severity.BAD,
        boards=tuple(board.name for board in boards),
        figures={
            "columns": first.columns - 1,
            "rows": first.rows - 1,
            "drawn_columns": first.columns,
            "drawn_rows": first.rows,
            "photos": photos,
        },
    )


def _seen(count: Count, board: Board) -> dict[str, str | int]:
    columns, rows = count.size
    return {
        "form": "both" if all(count.sure) else "columns" if count.sure[0] else "rows",
        "board": board.name,
        "columns": columns,
        "rows": rows,
        "drawn_columns": board.columns,
        "drawn_rows": board.rows,
    }
