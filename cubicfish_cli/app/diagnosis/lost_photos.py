"""Photos that show boards and give no corners: where they are many, the set-up is to blame."""

from __future__ import annotations

from collections import Counter, defaultdict

from cubicfish_cli.app.diagnosis.evidence import GridEvidence, PhotoEvidence, grid_boards
from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.corners.identification.identified import GridReport

# Fewer may be of another board, or taken by mistake.
_MANY = 1 / 3
# One photo may show two things as one grid.
_FEWEST_PHOTOS = 2


def many_lost(evidence: PhotoEvidence) -> list[Finding]:
    """That more than a third of the photos in which boards were found are lost for one reason."""
    lost = defaultdict[Code, list[Finding]](list)
    for one in evidence.lost:
        lost[one.code].append(one)
    own = max(lost.values(), key=len, default=[])
    if len(own) < _FEWEST_PHOTOS or len(own) <= _MANY * evidence.with_boards:
        return []
    finding = Finding(
        code=own[0].code,
        case="many",
        severity=Severity.CARE,
        images=tuple(name for one in own for name in one.images),
        figures={**own[0].figures, "left_out": len(own), "photos": evidence.with_boards},
    )
    boards = grid_boards(evidence.target)
    if finding.code is Code.TOO_LARGE and isinstance(evidence, GridEvidence) and len(boards) == 1:
        return [_count_lone_board(finding, boards[0], evidence)]
    return [finding]


def _count_lone_board(finding: Finding, board: Board, evidence: GridEvidence) -> Finding:
    """The same of a lone board, with the numbers of corners that photos show."""
    largest = [max(own, key=_corners) for own in evidence.identified.grids if own]
    sides = [Counter(pick(one.size) for one in largest) for pick in (max, min)]
    long, short = (
        max((side for side in own if own[side] >= _FEWEST_PHOTOS), default=max(own))
        for own in sides
    )
    upright = board.columns < board.rows
    counted = {
        "columns": short if upright else long,
        "rows": long if upright else short,
        "drawn_columns": board.columns,
        "drawn_rows": board.rows,
    }
    return Finding(
        code=Code.CORNER_COUNT,
        case="many",
        severity=finding.severity,
        images=finding.images,
        boards=(board.name,),
        figures={**finding.figures, **counted},
    )


def _corners(grid: GridReport) -> int:
    return grid.corners
