"""By how much a refined target differs from its drawing, and what no print or wall explains."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.boards.shape import BoardShape
from cubicfish_cli.target import Target
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# Beyond these a deformation is no property of paper, plate or wall but a mistake in the drawing
# or in the names of the corners. Shares are of the board's half diagonal.
_MOST_BEND_SHARE = 0.03
_MOST_STRETCH = 0.015
_MOST_SHIFT_SHARE = 0.03
_MOST_TURN_DEG = 2.0
_MOST_OFFSET_SHARE = 0.02


@dataclass(frozen=True, kw_only=True)
class Deformation:
    """One board's deformation from its drawing, in the target's units.

    Attributes:
        board: its name.
        bend, twist, stretch: as :class:`~cubicfish_cli.target.BoardShape` has them.
        shift: how far the board's middle moved.
        turn_deg: how far the board turned.
        offset_rms: root mean square length of its corners' own offsets.
        doubts: what of this is more than a target like this explains.

    """

    board: str
    bend: tuple[float, float]
    twist: float
    stretch: tuple[float, float]
    shift: float
    turn_deg: float
    offset_rms: float
    doubts: tuple[Finding, ...]

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON and YAML."""
        texts = [f"{doubt.what}: {doubt.do}" for doubt in self.doubts]
        told = {"doubted": [doubt.as_record() for doubt in self.doubts]} if self.doubts else {}
        plain = replace(self, doubts=())  # asdict would take findings apart
        lists = {"bend": list(self.bend), "stretch": list(self.stretch), "doubts": texts}
        return asdict(plain) | lists | told


def deformations(drawn: Target, refined: Target, *, doubted: bool = True) -> list[Deformation]:
    """Each board's deformation; boards that are as drawn are left out.

    Args:
        drawn: the drawing.
        refined: the target as fitted.
        doubted: whether to doubt large ones; not where their cause is known.

    """
    found = [
        _deformation(before, after, drawn.units)
        for before, after in zip(drawn.boards, refined.boards, strict=True)
        if after is not before
    ]
    return found if doubted else [replace(deformation, doubts=()) for deformation in found]


def _deformation(drawn: Board, refined: Board, units: str) -> Deformation:
    shape = refined.shape
    if shape is None:
        shape = BoardShape(
            bend=np.zeros(2),
            twist=0.0,
            stretch=np.zeros(2),
            offsets=np.zeros((refined.rows, refined.columns, 3)),
        )
    if drawn.points is not None and refined.points is not None:
        middle, moved = drawn.points.mean(axis=0), refined.points.mean(axis=0)
        size = float(np.linalg.norm(np.ptp(drawn.points, axis=0))) / 2
        turn = 0.0
    else:
        half = drawn.normalised(np.zeros(2))[1]
        size = float(np.hypot(*half))
        middle, moved = (board.origin + half @ board.axes[:2] for board in (drawn, refined))
        cosine = (np.trace(refined.axes @ drawn.axes.T) - 1) / 2
        turn = float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1))))
    shift = float(np.linalg.norm(moved - middle))
    length = np.linalg.norm(shape.offsets, axis=2)
    offset_rms = float(np.sqrt(np.mean(length[length > 0] ** 2))) if length.any() else 0.0
    bend = (float(shape.bend[0]), float(shape.bend[1]))
    stretch = (float(shape.stretch[0]), float(shape.stretch[1]))
    pitch = drawn.square or size
    deepest = max(abs(bend[0]), abs(bend[1]), abs(shape.twist))
    doubts: dict[Code, dict[str, float]] = {}
    if deepest > _MOST_BEND_SHARE * size:
        doubts[Code.BENT] = {"size": deepest}
    if max(map(abs, stretch)) > _MOST_STRETCH:
        doubts[Code.STRETCHED] = {"percent": 100 * max(stretch, key=abs)}
    if shift > _MOST_SHIFT_SHARE * size or turn > _MOST_TURN_DEG:
        doubts[Code.MOVED] = {"size": shift, "turn_deg": turn}
    if offset_rms > _MOST_OFFSET_SHARE * pitch:
        doubts[Code.CORNERS_OFF] = {"size": offset_rms}
    return Deformation(
        board=drawn.name,
        bend=bend,
        twist=float(shape.twist),
        stretch=stretch,
        shift=shift,
        turn_deg=turn,
        offset_rms=offset_rms,
        doubts=tuple(
            Finding(
                code=code,
                severity=Severity.CARE,
                boards=(drawn.name,),
                figures={**figures, "units": units},
            )
            for code, figures in doubts.items()
        ),
    )
