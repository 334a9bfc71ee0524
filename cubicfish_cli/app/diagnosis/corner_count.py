"""Grids in photos that are not the target's: boards of more or fewer corners, another target."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from cubicfish_cli.app.diagnosis.evidence import GridEvidence, grid_boards
from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.evidence import FitEvidence
from cubicfish_cli.core.target import Target
from cubicfish_cli.corners.identification.identified import (
    CODES,
    FEWEST_CORNERS,
    Decided,
    Identified,
)

# Counting squares shows in so many photos of the whole board.
_WHOLE_BOARDS = 3
# Photos of another target show the same grid again and again, and so much of its corners is
# larger than every board where it is a larger one.
_COMMON = 0.5
_FEWEST_PHOTOS = 2


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
    boards = [evidence.target.boards[one.board] for one in counts]
    seen = [
        {
            "form": "one",
            "board": board.name,
            "columns": count.size[0],
            "rows": count.size[1],
            "drawn_columns": board.columns,
            "drawn_rows": board.rows,
        }
        for count, board in zip(counts, boards, strict=True)
    ]
    fewest, most = min(one.photos for one in counts), max(one.photos for one in counts)
    finding = Finding(
        code=Code.CORNER_COUNT,
        severity=Severity.CARE,
        boards=tuple(board.name for board in boards),
        figures={
            "counts": seen,
            "alike": fewest == most,
            "fewest": fewest,
            "most": most,
            "photos": len(evidence.names),
        },
    )
    return [finding]


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


def nothing_named(evidence: GridEvidence) -> list[Finding]:
    """Why none of the grids could be named, where there is any."""
    identified, target = evidence.identified, evidence.target
    if not any(identified.grids):
        return []
    grids = [grid for own in identified.grids for grid in own]
    boards = grid_boards(target)
    if _is_another_object(identified, target):
        return [_describe_another_target(identified, target)]
    largest = max(grids, key=lambda grid: grid.corners)
    photos = sum(bool(own) for own in identified.grids)
    for board in boards:
        if sorted(largest.size) == sorted((board.columns - 1, board.rows - 1)):
            return [squares_counted([board], 1)]
    why = CODES[Counter(grid.verdict for grid in grids).most_common(1)[0][0]]
    finding = Finding(
        code=Code.NOTHING_NAMED,
        severity=Severity.BAD,
        figures={
            "grids": len(grids),
            "columns": max(largest.size),
            "rows": min(largest.size),
            "photos": photos,
            "says": ", ".join(f"{board.columns}x{board.rows}" for board in boards[:6]),
            "why": why.value,
            "help": why.value,
        },
    )
    return [finding]


def another_target(evidence: GridEvidence) -> list[Finding]:
    """That corners have names, but those of another target's boards."""
    identified, target = evidence.identified, evidence.target
    boards = grid_boards(target)
    if len(boards) == 1:
        off = [
            np.abs(np.subtract(count.size, (boards[0].columns, boards[0].rows)))
            for count in evidence.counts
        ]
        other = any(one.sum() > 1 for one in off)
        return [_describe_another_target(identified, target)] if other else []
    grids = [grid for own in identified.grids for grid in own if grid.corners >= FEWEST_CORNERS]
    corners = sum(grid.corners for grid in grids)
    beyond = sum(grid.corners for grid in grids if grid.verdict is Decided.TOO_LARGE)
    together = sum(sum(grid.named for grid in own) > 1 for own in identified.grids)
    seen = sum(bool(own) for own in identified.grids)
    if beyond > _COMMON * corners and together < _COMMON * seen:
        return [_describe_another_target(identified, target)]
    return []


def _describe_another_target(identified: Identified, target: Target) -> Finding:
    """That photos and target.yaml are of different targets: what both show."""
    largest = [max(own, key=lambda grid: grid.corners) for own in identified.grids if own]
    size = max(largest, key=lambda grid: grid.corners).size
    boards = grid_boards(target)
    # With the longer side first, as boards lie in photos any way round.
    sizes = [(max(board.columns, board.rows), min(board.columns, board.rows)) for board in boards]
    named = list(zip(boards, sizes, strict=True))[:6]
    says = ", ".join(f"{board.name} {long}x{short}" for board, (long, short) in named)
    more = f" and {len(boards) - 6} more boards" if len(boards) > 6 else ""
    return Finding(
        code=Code.ANOTHER_TARGET,
        severity=Severity.BAD,
        boards=tuple(board.name for board in boards),
        figures={
            "photos": len(largest),
            "columns": max(size),
            "rows": min(size),
            "says": says + more,
        },
    )


def _is_another_object(identified: Identified, target: Target) -> bool:
    """Whether photo after photo shows one grid whole that is none of the boards."""
    grids = [grid for own in identified.grids for grid in own]
    if all(grid.verdict is Decided.TOO_LARGE for grid in grids):
        return True
    full = Counter(
        size
        for own in identified.grids
        for size in {
            (max(grid.size), min(grid.size))
            for grid in own
            if grid.corners == grid.size[0] * grid.size[1] >= FEWEST_CORNERS
        }
    )
    drawn = {tuple(sorted((b.columns, b.rows), reverse=True)) for b in grid_boards(target)}
    seen = sum(bool(own) for own in identified.grids)
    least = max(_FEWEST_PHOTOS, _COMMON * seen)
    return any(photos >= least for size, photos in full.items() if size not in drawn)
