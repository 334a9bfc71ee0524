"""What is said when no corner can be named, or hardly one: what was seen, and what to do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.fitting.diagnosis.squares_counted import squares_counted
from cubicfish_cli.identification.decide import Decided
from cubicfish_cli.identification.name_grids import FEWEST_CORNERS, GridReport, Identified
from cubicfish_cli.identification.remarks import CODES
from cubicfish_cli.identification.wrong_drawing.count import Count
from cubicfish_cli.target import Target
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# Photos of another object show the same grid again and again, and so much of its corners is
# larger than every board where it is a larger one.
_COMMON = 0.5
_FEWEST_PHOTOS = 2


def nothing_named(identified: Identified, target: Target) -> Finding:
    """Why none of the grids, of which there is at least one, could be named."""
    grids = [grid for own in identified.grids for grid in own]
    boards = grid_boards(target)
    if _is_another_object(identified, target):
        return another_object(identified, target)
    largest = max(grids, key=lambda grid: grid.corners)
    photos = sum(bool(own) for own in identified.grids)
    for board in boards:
        if sorted(largest.size) == sorted((board.columns - 1, board.rows - 1)):
            return squares_counted([board], 1)
    why = CODES[Counter(grid.verdict for grid in grids).most_common(1)[0][0]]
    return Finding(
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


def counted_squares(identified: Identified, target: Target) -> Finding | None:
    """What to say when photo after photo shows one board whole, one corner smaller both ways."""
    boards = grid_boards(target)
    if len(boards) != 1:
        return None
    columns, rows = sorted((boards[0].columns, boards[0].rows))
    largest = [max(own, key=len) for own in identified.found if own]
    sizes = [tuple(sorted((np.ptp(grid.cells, axis=0) + 1).tolist())) for grid in largest]
    counted = (columns - 1, rows - 1)
    whole = sum(
        size == counted and len(grid) == size[0] * size[1]
        for grid, size in zip(largest, sizes, strict=True)
    )
    larger = any(size[0] > counted[0] or size[1] > counted[1] for size in sizes)
    if whole and 2 * whole >= len(largest) and not larger:
        return squares_counted(boards, whole)
    return None


def wrong_object(identified: Identified, counts: Sequence[Count], target: Target) -> Finding | None:
    """What to say when corners have names, but those of another object's boards.

    Args:
        identified: the names.
        counts: what photos show of boards' sizes.
        target: the object.

    """
    boards = grid_boards(target)
    if len(boards) == 1:
        off = [
            np.abs(np.subtract(count.size, (boards[0].columns, boards[0].rows))) for count in counts
        ]
        return another_object(identified, target) if any(one.sum() > 1 for one in off) else None
    grids = [grid for own in identified.grids for grid in own if grid.corners >= FEWEST_CORNERS]
    corners = sum(grid.corners for grid in grids)
    beyond = sum(grid.corners for grid in grids if grid.verdict is Decided.TOO_LARGE)
    together = sum(sum(grid.named for grid in own) > 1 for own in identified.grids)
    seen = sum(bool(own) for own in identified.grids)
    if beyond > _COMMON * corners and together < _COMMON * seen:
        return another_object(identified, target)
    return None


def another_object(identified: Identified, target: Target) -> Finding:
    """That photos and target.yaml are of different objects: what both show."""
    largest = _largest(identified)
    size = max(largest, key=lambda grid: grid.corners).size
    boards = grid_boards(target)
    says = ", ".join(f"{board.name} {_times((board.columns, board.rows))}" for board in boards[:6])
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


def grid_boards(target: Target) -> list[Board]:
    """The boards that show as a grid of squares."""
    return [board for board in target.boards if board.has_squares]


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


def _largest(identified: Identified) -> list[GridReport]:
    """The largest grid of each photo that has one."""
    return [max(own, key=lambda grid: grid.corners) for own in identified.grids if own]


def _times(size: tuple[int, int]) -> str:
    """A size with the longer side first, as boards lie in photos any way round."""
    return f"{max(size)}x{min(size)}"
