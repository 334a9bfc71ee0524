"""What of a refined target no print or wall explains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cubicfish_cli.core.assess.fit_record import Departure
from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.target import Target

# Beyond these a deformation is no property of paper, plate or wall but a mistake in the drawing
# or in the names of the corners. Shares are of the board's half diagonal.
_MOST_BEND_SHARE = 0.03
_MOST_STRETCH = 0.015
_MOST_SHIFT_SHARE = 0.03
_MOST_TURN_DEG = 2.0
_MOST_OFFSET_SHARE = 0.02
# What is put down to one board, or to the lens, is not doubted of every board.
_INSTEAD = (
    Code.BOARD_PLACE,
    Code.BOARD_SQUARE,
    Code.TWO_LENSES,
    Code.ZOOM,
    Code.SCALED,
    Code.SHIFTED,
    Code.TURNED,
)


def with_doubts(
    departures: Sequence[Departure], drawn: Target, findings: Sequence[Finding]
) -> tuple[Departure, ...]:
    """Departures from a drawing with what is to be doubted of them.

    Args:
        departures: a board each.
        drawn: the drawing.
        findings: what is likely wrong; where that explains departures, none is doubted.

    """
    if any(finding.code in _INSTEAD for finding in findings):
        return tuple(departures)
    boards = {board.name: board for board in drawn.boards}
    return tuple(_with_doubts(one, boards[one.board], drawn.units) for one in departures)


def _with_doubts(of: Departure, board: Board, units: str) -> Departure:
    size = _half_diagonal(board)
    deepest = max(*map(abs, of.bend), abs(of.twist))
    doubts: dict[Code, dict[str, float]] = {}
    if deepest > _MOST_BEND_SHARE * size:
        doubts[Code.BENT] = {"size": deepest}
    if max(map(abs, of.stretch)) > _MOST_STRETCH:
        doubts[Code.STRETCHED] = {"percent": 100 * max(of.stretch, key=abs)}
    if of.shift > _MOST_SHIFT_SHARE * size or of.turn_deg > _MOST_TURN_DEG:
        doubts[Code.MOVED] = {"size": of.shift, "turn_deg": of.turn_deg}
    if of.offset_rms > _MOST_OFFSET_SHARE * (board.square or size):
        doubts[Code.CORNERS_OFF] = {"size": of.offset_rms}
    found = tuple(
        Finding(
            code=code,
            severity=Severity.CARE,
            boards=(of.board,),
            figures={**figures, "units": units},
        )
        for code, figures in doubts.items()
    )
    return replace(of, doubts=tuple(f"{one.what}: {one.do}" for one in found), doubted=found)


def _half_diagonal(board: Board) -> float:
    if board.points is not None:
        return float(np.linalg.norm(np.ptp(board.points, axis=0))) / 2
    return float(np.hypot(*board.normalised(np.zeros(2))[1]))
