"""What is on a board's sheet of paper: the print, the white around it, the edges that are cut.

Sizes of paper, and lengths as people write them, in millimetres.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from cubicfish_cli.boards.board import Board, Face
from cubicfish_cli.boards.markers import Markers
from cubicfish_cli.errors import TargetError
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray
from cubicfish_cli.units import MILLIMETRES
from cubicfish_cli.wording import did_you_mean, quoted

# Width and height in millimetres, upright: ISO 216 and ANSI/ASME Y14.1.
PAPERS: dict[str, tuple[float, float]] = {
    "A0": (841, 1189),
    "A1": (594, 841),
    "A2": (420, 594),
    "A3": (297, 420),
    "A4": (210, 297),
    "A5": (148, 210),
    "B0": (1000, 1414),
    "B1": (707, 1000),
    "B2": (500, 707),
    "B3": (353, 500),
    "B4": (250, 353),
    "Letter": (215.9, 279.4),
    "Legal": (215.9, 355.6),
    "Tabloid": (279.4, 431.8),
    "Ledger": (279.4, 431.8),
    "ANSI C": (431.8, 558.8),
    "ANSI D": (558.8, 863.6),
    "ANSI E": (863.6, 1117.6),
}
# The ruler of 100 mm must have its place; PDF readers take pages of up to 200 inches.
SMALLEST, LARGEST = (100.0, 140.0), 5080.0
_NUMBER = r"[0-9]+(?:\.[0-9]+)?|\.[0-9]+"
_UNITS = "|".join(sorted(MILLIMETRES, key=len, reverse=True))


@dataclass(frozen=True, kw_only=True)
class Paper:
    """A size of paper, upright.

    Attributes:
        name: as a user would know it.
        short, long: its sides in millimetres.

    """

    name: str
    short: float
    long: float


def paper(text: str) -> Paper:
    """``A4``, ``letter``, ``600x400mm`` or ``24x36in`` -> Paper.

    Raises:
        TargetError: the text is no size of paper, or too small or too large a one.

    """
    known = {name.lower().replace(" ", ""): name for name in PAPERS}
    name = known.get(re.sub(r"[\s_-]", "", text).lower())
    if name is not None:
        short, long = PAPERS[name]
        return Paper(name=name, short=short, long=long)
    side = rf"\s*({_NUMBER})\s*({_UNITS})?\s*"
    match = re.fullmatch(rf"{side}[x×]{side}", text, re.I)
    if match is None:
        raise TargetError(
            f"{quoted(text)} is no size of paper: write a name or WIDTHxHEIGHT such as 600x400mm; "
            f"{did_you_mean(text, PAPERS)}"
        )
    units = (match[2] or match[4] or "mm", match[4] or match[2] or "mm")
    short, long = sorted(
        float(number) * MILLIMETRES[unit.lower()]
        for number, unit in zip(match.group(1, 3), units, strict=True)
    )
    if short < SMALLEST[0] or long < SMALLEST[1] or long > LARGEST:
        raise TargetError(
            f"paper of {short:g} x {long:g} mm is of no use here: it must be at least "
            f"{SMALLEST[0]:g} x {SMALLEST[1]:g} mm and at most {LARGEST:g} mm long"
        )
    return Paper(name=f"{short:g} x {long:g} mm", short=short, long=long)


def length_mm(text: str) -> float:
    """``30mm``, ``3cm``, ``0.75in`` or ``30`` (millimetres) -> millimetres.

    Raises:
        TargetError: the text is no positive length.

    """
    match = re.fullmatch(rf"\s*({_NUMBER})\s*({_UNITS})?\s*", text, re.I)
    value = float(match[1]) * MILLIMETRES[(match[2] or "mm").lower()] if match else 0.0
    if not 0 < value < 1e6:
        raise TargetError(f"{quoted(text)} is no length: write it like 30mm, 3cm or 1.25in")
    # Inches are exact in binary as little as tenths are; files should still look as meant.
    return round(value, 9)


def millimetres_per(units: str) -> float:
    """How many millimetres a target's unit is.

    Raises:
        TargetError: the unit is not known.

    """
    factor = MILLIMETRES.get(units.strip().lower().rstrip("."))
    if factor is None:
        raise TargetError(
            f"units {quoted(units)} cannot be printed at true scale: write mm, cm, m or in"
        )
    return factor


Point = tuple[float, float]
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

    left: float = 0.0
    top: float = 0.0
    right: float = 0.0
    bottom: float = 0.0

    @classmethod
    def of(cls, width: float) -> Margins:
        """The same on all sides."""
        return cls(left=width, top=width, right=width, bottom=width)


@dataclass(frozen=True, kw_only=True)
class Rect:
    """A rectangle: left < right, top < bottom; y runs down."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        """From left to right."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """From top to bottom."""
        return self.bottom - self.top

    def moved(self, by: Point) -> Rect:
        """The same rectangle elsewhere."""
        return Rect(
            left=self.left + by[0],
            top=self.top + by[1],
            right=self.right + by[0],
            bottom=self.bottom + by[1],
        )

    def grown(self, by: Margins) -> Rect:
        """With each side moved outwards."""
        return Rect(
            left=self.left - by.left,
            top=self.top - by.top,
            right=self.right + by.right,
            bottom=self.bottom + by.bottom,
        )

    @property
    def corners(self) -> FloatArray:
        """(4, 2) in order from the top left."""
        across = [self.left, self.right, self.right, self.left]
        return np.stack([across, [self.top, self.top, self.bottom, self.bottom]], axis=-1)


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
    def printed(self) -> Rect:
        """Where that is in the board's plane."""
        (left, top), (right, bottom) = self.face.lower, self.face.upper
        return Rect(left=left, top=top, right=right, bottom=bottom)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the print."""
        return self.printed.width, self.printed.height

    @cached_property
    def outline(self) -> FloatArray:
        """(4, 2) the sheet's corners in the board's plane, in order from the top left."""
        return self.printed.grown(self.margins or Margins.of(self.quiet)).corners

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
