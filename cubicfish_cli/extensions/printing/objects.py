"""Targets made for a size of paper: which boards, how many squares, and where they are.

A corner and a box are made of rectangular sheets that are cut at the edges where they meet. The
world's frame follows from that alone: z is up, and the sheets' printed faces meet in those edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import floor
from typing import Literal

import numpy as np

from cubicfish_cli.app.board_faces import board_face
from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.boards.types import BOARD_TYPES
from cubicfish_cli.core.errors import TargetError
from cubicfish_cli.core.target import Target
from cubicfish_cli.extensions.printing.designs import DESIGNS
from cubicfish_cli.extensions.printing.layout import (
    SHORTEST_STRIP,
    STRIP,
    Cut,
    Page,
    Side,
    lay_out,
    quiet_zone,
)
from cubicfish_cli.extensions.printing.paper import Paper

Kind = Literal["corner", "box", "board"]
Counts = tuple[int, int]
Vector = tuple[float, float, float]

BAND = 6.0
"""Beyond an edge that is cut, room for its words, in millimetres."""
_INSET = 2.0  # of the strip from edges that are cut
_SIDES: tuple[Side, ...] = ("top", "right", "bottom", "left")
# Sides of squares that are tried, in millimetres.
_SQUARES = (*range(5, 40), *range(40, 80, 2), *range(80, 301, 5))


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What a target is to be like; None where that is for the paper to decide.

    Attributes:
        kind: which target: three boards that meet like the floor and two walls of a room, the
            bottom and the four walls of an open box (both seen from inside), or one flat board.
        type: of its boards.
        square: side of a square, or of a tag, in millimetres.
        counts: inner corners (of an aprilgrid: tags) along x and y of the largest board.
        dictionary: the markers' family.

    """

    kind: Kind
    type: str = "checkerboard"
    square: float | None = None
    counts: Counts | None = None
    dictionary: str | None = None


@dataclass(frozen=True)
class _Sheet:
    """One sheet of a target whose sheets have sides a, b and c.

    Attributes:
        name: the board's.
        size: which of the sides its width and its height are.
        corner: the world point of its top left corner, as multiples of a, b and c for x, y, z.
        x_axis, y_axis: of the board.

    """

    name: str
    size: tuple[int, int]
    corner: Vector
    x_axis: Vector
    y_axis: Vector

    def edges(self) -> dict[Side, frozenset[tuple[float, ...]]]:
        """The end points of each side, where a, b and c are 1."""
        corner, x, y = np.array([self.corner, self.x_axis, self.y_axis])
        around = [*map(tuple, (corner, corner + x, corner + x + y, corner + y))]
        ends = zip(around, around[1:] + around[:1], strict=True)
        return dict(zip(_SIDES, map(frozenset, ends), strict=True))


_LEFT, _DOWN = (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)
_RIGHT, _DEEP, _NEAR = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
_SHEETS: dict[Kind, tuple[_Sheet, ...]] = {
    "corner": (
        _Sheet("left", (0, 2), (1, 0, 1), _LEFT, _DOWN),
        _Sheet("right", (0, 2), (0, 0, 1), _DEEP, _DOWN),
        _Sheet("floor", (0, 2), (1, 0, 0), _LEFT, _DEEP),
    ),
    "box": (
        _Sheet("bottom", (0, 1), (0, 1, 0), _RIGHT, _NEAR),
        _Sheet("back", (0, 2), (0, 1, 1), _RIGHT, _DOWN),
        _Sheet("front", (0, 2), (1, 0, 1), _LEFT, _DOWN),
        _Sheet("left", (1, 2), (0, 0, 1), _DEEP, _DOWN),
        _Sheet("right", (1, 2), (1, 1, 1), _NEAR, _DOWN),
    ),
    "board": (_Sheet("board", (0, 1), (0, 0, 0), _RIGHT, _DEEP),),
}


def design(wanted: Wanted, paper: Paper, *, margin: float) -> tuple[Target, list[Page]]:
    """A target that fits the paper, each board on one page.

    Args:
        wanted: what it is to be like.
        paper: the paper.
        margin: at the paper's edges, where nothing is printed, in millimetres.

    Raises:
        TargetError: nothing like that fits, or the markers' family has not enough of them.

    """
    sheets = _SHEETS[wanted.kind]
    if wanted.kind == "board":
        if wanted.square is not None and wanted.counts is not None:
            square, counts = wanted.square, [wanted.counts]
        else:
            # White up to the paper's edge begins where the printer can print.
            rooms = [(paper.long, paper.short - margin)]
            square, counts = _fitting(wanted, rooms, paper, rim=margin)
        pages = [lay_out(board, paper, margin=margin) for board in _boards(wanted, square, counts)]
    else:
        sides = _largest(wanted.kind, paper, margin)
        rooms = [(sides[one.size[0]], sides[one.size[1]]) for one in sheets]
        square, counts = _fitting(wanted, rooms, paper, rim=0.0)
        boards = _boards(wanted, square, counts)
        pages = [
            _cut_out(one, board, _meetings(one, sheets), sides, paper, margin)
            for one, board in zip(sheets, boards, strict=True)
        ]
    return Target(units="mm", boards=tuple(page.board for page in pages)), pages


def _meetings(one: _Sheet, sheets: Sequence[_Sheet]) -> dict[Side, tuple[str, Side]]:
    """For each side of a sheet that is cut, the board and side that it meets."""
    return {
        side: (other.name, far)
        for side, ends in one.edges().items()
        for other in sheets
        for far, its in other.edges().items()
        if its == ends and other is not one
    }


def _largest(kind: Kind, paper: Paper, margin: float) -> tuple[float, float, float]:
    """The largest sheets that the paper holds, across: their sides a, b and c."""
    width, height = paper.long - 2 * margin, paper.short - 2 * margin
    sides = [width, width, width]
    for one in _SHEETS[kind]:
        meets = _meetings(one, _SHEETS[kind])
        across, down = one.size
        sides[across] = min(sides[across], width - BAND * len({"left", "right"} & meets.keys()))
        sides[down] = min(sides[down], height - BAND * len({"top", "bottom"} & meets.keys()))
    if min(sides[one.size[0]] for one in _SHEETS[kind]) < SHORTEST_STRIP + 2 * _INSET:
        raise TargetError(
            f"{paper.name} is too small for a {kind} with its rulers: take larger paper, or "
            "'--object board'"
        )
    # Joined all around, sheets are cut to size: whole half centimetres are easily measured.
    step = 1.0 if kind == "corner" else 5.0
    a, b, c = (step * floor(side / step + 1e-9) for side in sides)
    return a, b, c


def _fitting(
    wanted: Wanted, rooms: Sequence[tuple[float, float]], paper: Paper, *, rim: float
) -> tuple[float, list[Counts]]:
    """The squares and their numbers that cover most of sheets of these widths and heights.

    White at the sheets' edges is at least ``rim`` wide.
    """
    made, per_cell = DESIGNS[wanted.type], BOARD_TYPES[wanted.type].per_cell
    given = None if wanted.counts is None else _given_counts(wanted, wanted.counts)
    best: tuple[float, float, list[Counts]] = (0.0, 0.0, [])
    for square in _SQUARES if wanted.square is None else (wanted.square,):
        quiet = square / per_cell
        white = max(quiet, rim)
        limits = [
            (
                made.count(width - 2 * white, square),
                made.count(height - STRIP - quiet - white, square),
            )
            for width, height in rooms
        ]
        counts = given
        if given is None:
            fewest, most = made.counts
            if wanted.square is None:
                limits = [(min(columns, most), min(rows, most)) for columns, rows in limits]
            counts = _told_apart(wanted, limits, fewest)
        if counts is None or (np.array(counts) > limits).any():
            continue
        lengths = [[made.length(n, square) for n in own] for own in counts]
        best = max(best, (sum(across * down for across, down in lengths), square, counts))
    if not best[2]:
        what = [f"squares of {wanted.square:g} mm"] if wanted.square is not None else []
        what += ["{}x{} corners".format(*wanted.counts)] if wanted.counts is not None else []
        raise TargetError(
            f"a {wanted.kind} of {' and '.join(what) or wanted.type + 's'} does not fit on "
            f"{paper.name}, a board a page: take larger paper, smaller squares or fewer corners"
        )
    return float(best[1]), best[2]


def _given_counts(wanted: Wanted, counts: Counts) -> list[Counts]:
    """Numbers of corners of all boards, where those of the largest are given.

    Raises:
        TargetError: they leave the others none by which boards are told apart.

    """
    along = (counts[0], counts[1], counts[1])
    sheets = _SHEETS[wanted.kind]
    chosen = _told_apart(wanted, [(along[one.size[0]], along[one.size[1]]) for one in sheets], 3)
    if chosen is None:
        raise TargetError(
            "{}x{} corners leave no different numbers for the other boards of a {}, which must "
            "be told apart: take more corners, or '--type charuco'".format(*counts, wanted.kind)
        )
    return chosen


def _told_apart(wanted: Wanted, limits: Sequence[Counts], fewest: int) -> list[Counts] | None:
    """The largest numbers of corners within limits; None where there are too few.

    Plain boards are told apart by their numbers and by the colours of their squares, so no two
    have the same numbers, either way round, and none looks the same upside down: the sum of its
    numbers is odd. The first may be given, and is as it is.
    """
    if DESIGNS[wanted.type].marker:
        few = wanted.counts is None and min(map(min, limits)) < fewest
        return None if few else list(limits)
    chosen: dict[int, Counts] = {} if wanted.counts is None else {0: wanted.counts}
    # Where there is the least room there is the least choice.
    for index in sorted(range(len(limits)), key=lambda k: (limits[k][0] * limits[k][1], k)):
        if index in chosen:
            continue
        columns, rows = limits[index]
        taken = {tuple(sorted(counts)) for counts in chosen.values()}
        free = [
            (c, r)
            for c in range(fewest, columns + 1)
            for r in range(fewest, rows + 1)
            if (c + r) % 2 == 1 and (min(c, r), max(c, r)) not in taken
        ]
        if not free:
            return None
        chosen[index] = max(free, key=lambda counts: ((counts[0] + 1) * (counts[1] + 1), counts))
    return [chosen[index] for index in range(len(limits))]


def _boards(wanted: Wanted, square: float, counts: Sequence[Counts]) -> list[Board]:
    """The boards, not yet in their places."""
    made = DESIGNS[wanted.type]
    markers = list(map(made.marker_count, counts))
    family = made.family(wanted.dictionary, sum(markers))
    boards, first = [], 0
    for one, own, carried in zip(_SHEETS[wanted.kind], counts, markers, strict=True):
        boards.append(made.board(one.name, own, square, family, first))
        first += carried
    return boards


def _cut_out(
    one: _Sheet,
    board: Board,
    meets: dict[Side, tuple[str, Side]],
    sides: tuple[float, float, float],
    paper: Paper,
    margin: float,
) -> Page:
    """A sheet that is cut out of its page, with its board where it belongs in the world."""
    width, height = (sides[k] for k in one.size)
    face, quiet = board_face(board, margin=0.0), quiet_zone(board)
    (left, top), (right, bottom) = face.lower, face.upper
    # Words and ruler keep off an edge that is cut.
    above = "top" not in meets
    across = _white(width - (right - left), quiet, meets, "left", "right")
    down = _white(height - (bottom - top) - STRIP, quiet, meets, "top", "bottom") + STRIP * above
    x_axis, y_axis = np.array(one.x_axis), np.array(one.y_axis)
    origin = np.array(one.corner) * sides + (across - left) * x_axis + (down - top) * y_axis
    bands = {side: BAND * (side in meets) for side in _SIDES}
    x = margin + bands["left"]
    x += (paper.long - margin - bands["right"] - width - x) / 2
    y = margin + bands["top"]
    y += (paper.short - margin - bands["bottom"] - height - y) / 2
    ends = {"left": x, "top": y, "right": x + width, "bottom": y + height}
    return Page(
        # The file is read by people: no digits beyond what rounding left.
        board=replace(
            board, origin=np.round(origin, 6) + 0.0, x_axis=x_axis + 0.0, y_axis=y_axis + 0.0
        ),
        width=paper.long,
        height=paper.short,
        shift=(x + across - left, y + down - top),
        strip=(x + _INSET, y if above else y + height - STRIP),
        length=width - 2 * _INSET,
        cuts={
            side: Cut(place=ends[side], board=name, side=far) for side, (name, far) in meets.items()
        },
    )


def _white(
    free: float, quiet: float, meets: dict[Side, tuple[str, Side]], near: Side, far: Side
) -> float:
    """White before a print: as little as allowed at a single cut edge, else as much as after it."""
    if (near in meets) == (far in meets):
        return free / 2
    return quiet if near in meets else free - quiet
