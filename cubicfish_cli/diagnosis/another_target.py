"""That photos and target are of different objects, or no corner of any can be named."""

from __future__ import annotations

from collections import Counter

import numpy as np

from cubicfish_cli.diagnosis.corner_count import squares_counted
from cubicfish_cli.diagnosis.count import grid_boards
from cubicfish_cli.diagnosis.evidence import GridEvidence
from cubicfish_cli.identification.decide import Decided
from cubicfish_cli.identification.identified import CODES, FEWEST_CORNERS, GridReport, Identified
from cubicfish_cli.target import Target
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# Photos of another object show the same grid again and again, and so much of its corners is
# larger than every board where it is a larger one.
_COMMON = 0.5
_FEWEST_PHOTOS = 2


def nothing_named(evidence: GridEvidence) -> list[Finding]:
    """Why none of the grids could be named, where there is any."""
    identified, target = evidence.identified, evidence.target
    if not any(identified.grids):
        return []
    grids = [grid for own in identified.grids for grid in own]
    boards = grid_boards(target)
    if _is_another_object(identified, target):
        return [_another_object(identified, target)]
    largest = max(grids, key=lambda grid: grid.corners)
    photos = sum(bool(own) for own in identified.grids)
    for board in boards:
        if sorted(largest.size) == sorted((board.columns - 1, board.rows - 1)):
            return [squares_counted([board], 1)]
    why = CODES[Counter(grid.verdict for grid in grids).most_common(1)[0][0]]
    told = Finding(
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
    return [told]


def another_target(evidence: GridEvidence) -> list[Finding]:
    """That corners have names, but those of another object's boards."""
    identified, target = evidence.identified, evidence.target
    boards = grid_boards(target)
    if len(boards) == 1:
        off = [
            np.abs(np.subtract(count.size, (boards[0].columns, boards[0].rows)))
            for count in evidence.counts
        ]
        other = any(one.sum() > 1 for one in off)
        return [_another_object(identified, target)] if other else []
    grids = [grid for own in identified.grids for grid in own if grid.corners >= FEWEST_CORNERS]
    corners = sum(grid.corners for grid in grids)
    beyond = sum(grid.corners for grid in grids if grid.verdict is Decided.TOO_LARGE)
    together = sum(sum(grid.named for grid in own) > 1 for own in identified.grids)
    seen = sum(bool(own) for own in identified.grids)
    if beyond > _COMMON * corners and together < _COMMON * seen:
        return [_another_object(identified, target)]
    return []


def _another_object(identified: Identified, target: Target) -> Finding:
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
