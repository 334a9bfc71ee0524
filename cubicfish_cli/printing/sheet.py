"""What is on a board's sheet of paper: the print, the white around it, the edges that are cut."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from cubicfish_cli.boards.board import Board, Face
from cubicfish_cli.boards.markers import Markers
from cubicfish_cli.errors import TargetError
from cubicfish_cli.printing.paper import millimetres_per
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray
from cubicfish_cli.wording import quoted

Side = Literal["left", "top", "right", "bottom"]
SIDES: tuple[Side, ...] = ("left", "top", "right", "bottom")
STRIP = 18.0
"""Height of the strip with ruler and words, in millimetres."""
LOW_STRIP = 11.0
"""The same where there is little room: a ruler and one line."""
SHORTEST_STRIP = 124.0
"""Length that the strip needs for its ruler."""


@dataclass(frozen=True, kw_only=True)
class Seam:
    """An edge that two sheets share once they are joined.

    Attributes:
        letter: the edge's name, the same on both sheets.
        board: the other sheet's board.
        side: the other sheet's side.

    """

    letter: str
    board: str
    side: Side


@dataclass(frozen=True, kw_only=True)
class Margins:
    """White around a print, in millimetres."""

    left: float
    top: float
    right: float
    bottom: float

    @classmethod
    def of(cls, width: float) -> Margins:
        """The same on all sides."""
        return cls(left=width, top=width, right=width, bottom=width)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """A board on paper, in millimetres.

    Attributes:
        board: the board, with lengths in millimetres.
        margins: from the print to the sheet's edges; None where the sheet may be as the paper is.
        seams: the edges that meet other sheets, where it is cut.
        strip: the side whose margin holds the strip with ruler and words; None where the strip is
            wherever there is place.

    """

    board: Board
    margins: Margins | None = None
    seams: Mapping[Side, Seam] = field(default_factory=dict)
    strip: Side | None = None

    @cached_property
    def face(self) -> Face:
        """The print alone, without white around it."""
        return self.board.face(margin=0.0)

    @cached_property
    def size(self) -> tuple[float, float]:
        """Width and height of the print."""
        (left, top), (right, bottom) = self.face.lower, self.face.upper
        return right - left, bottom - top

    @cached_property
    def outline(self) -> FloatArray:
        """(4, 2) the sheet's corners in the board's plane, in order from the top left."""
        white = self.margins or Margins.of(self.quiet)
        (left, top), (right, bottom) = self.face.lower, self.face.upper
        left, top = left - white.left, top - white.top
        right, bottom = right + white.right, bottom + white.bottom
        return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])

    @cached_property
    def quiet(self) -> float:
        """White that the print should have around it: a square, or half a tag."""
        return self.board.square / self.board.per_cell


def in_millimetres(board: Board, units: str) -> Board:
    """The same board, as drawn, with every length in millimetres.

    Raises:
        TargetError: the board has no print, or the unit is not known.

    """
    if board.points is not None:
        raise TargetError(
            f"board {quoted(board.name)} is a list of points, which has no print: choose the "
            "others with --board"
        )
    factor = millimetres_per(units)
    markers = board.markers
    scaled: Markers | None = replace(markers, side=markers.side * factor) if markers else None
    return replace(
        board,
        square=board.square * factor,
        origin=board.origin * factor,
        markers=scaled,
        shape=None,
    )


def sheets_of(target: Target, names: tuple[str, ...] = ()) -> list[Sheet]:
    """The boards of an existing target (all, or those named) as sheets that stand alone.

    Raises:
        TargetError: a name is not a board's, or a board has no print.

    """
    for name in names:
        if name not in target.board_names:
            known = ", ".join(map(quoted, target.board_names))
            raise TargetError(f"there is no board {quoted(name)} in the target: it has {known}")
    return [
        Sheet(board=in_millimetres(board, target.units))
        for board in target.boards
        if not names or board.name in names
    ]
