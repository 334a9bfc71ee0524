"""By how much a refined target departs from its drawing, and what of that nothing explains."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cubicfish_cli.core.assess.fit_record import Departure
from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.boards.shape import BoardShape
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


def departures(
    drawn: Target, refined: Target, findings: Sequence[Finding]
) -> tuple[Departure, ...]:
    """By how much each board departs from its drawing, with what is to be doubted of it.

    Args:
        drawn: the drawing.
        refined: the target as fitted; boards that are as drawn are left out.
        findings: what is likely wrong; where that explains departures, none is doubted.

    """
    explained = any(finding.code in _INSTEAD for finding in findings)
    found = []
    for before, after in zip(drawn.boards, refined.boards, strict=True):
        if after is not before:
            own = _departure(before, after)
            found.append(own if explained else _with_doubts(own, before, drawn.units))
    return tuple(found)


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


def _departure(drawn: Board, refined: Board) -> Departure:
    shape = refined.shape or BoardShape.none(refined.columns, refined.rows)
    turn = 0.0
    if drawn.points is not None and refined.points is not None:
        middle, moved = drawn.points.mean(axis=0), refined.points.mean(axis=0)
    else:
        half = drawn.normalised(np.zeros(2))[1]
        middle, moved = (board.origin + half @ board.axes[:2] for board in (drawn, refined))
        cosine = (np.trace(refined.axes @ drawn.axes.T) - 1) / 2
        turn = float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1))))
    length = np.linalg.norm(shape.offsets, axis=2)
    return Departure(
        board=drawn.name,
        bend=(float(shape.bend[0]), float(shape.bend[1])),
        twist=float(shape.twist),
        stretch=(float(shape.stretch[0]), float(shape.stretch[1])),
        shift=float(np.linalg.norm(moved - middle)),
        turn_deg=turn,
        offset_rms=float(np.sqrt(np.mean(length[length > 0] ** 2))) if length.any() else 0.0,
    )
