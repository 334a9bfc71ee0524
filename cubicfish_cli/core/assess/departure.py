"""How far a fitted target departs from the nominal one."""

import numpy as np

from cubicfish_cli.core.assess.fit_record import Departure
from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.boards.shape import BoardShape
from cubicfish_cli.core.target import Target


def departures(nominal: Target | None, refined: Target | None) -> tuple[Departure, ...]:
    """How far each board departs from the nominal one; boards that do not are left out."""
    if nominal is None or refined is None:
        return ()
    both = zip(nominal.boards, refined.boards, strict=True)
    return tuple(_measure_departure(before, after) for before, after in both if after is not before)


def _measure_departure(nominal: Board, refined: Board) -> Departure:
    shape = refined.shape or BoardShape.none(refined.columns, refined.rows)
    turn = 0.0
    if nominal.points is not None and refined.points is not None:
        middle, moved = nominal.points.mean(axis=0), refined.points.mean(axis=0)
    else:
        half = nominal.normalised(np.zeros(2))[1]
        middle, moved = (board.origin + half @ board.axes[:2] for board in (nominal, refined))
        cosine = (np.trace(refined.axes @ nominal.axes.T) - 1) / 2
        turn = float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1))))
    length = np.linalg.norm(shape.offsets, axis=2)
    return Departure(
        board=nominal.name,
        bend=(float(shape.bend[0]), float(shape.bend[1])),
        twist=float(shape.twist),
        stretch=(float(shape.stretch[0]), float(shape.stretch[1])),
        shift=float(np.linalg.norm(moved - middle)),
        turn_deg=turn,
        offset_rms=float(np.sqrt(np.mean(length[length > 0] ** 2))) if length.any() else 0.0,
    )
