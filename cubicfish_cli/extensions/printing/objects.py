"""Targets made for a size of paper: which boards, how many squares, and where they are.

A corner and a box are made of rectangular sheets that are cut at the edges where they meet. The
world's frame follows from that alone: z is up, and the sheets' printed faces meet in those edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cubicfish import FloatArray, Target, TargetError
from cubicfish.target import Board
from cubicfish_cli.extensions.printing.designs import DESIGNS, Counts, Design
from cubicfish_cli.extensions.printing.layout import SHORTEST_STRIP, STRIP, Cut, Page, Side, lay_out
from cubicfish_cli.extensions.printing.paper import Paper
from cubicfish_cli.inputs.target_source import length_mm

if TYPE_CHECKING:
    from cubicfish_cli.extensions.printing.command import PrintOptions

Vector = tuple[float, float, float]
Meetings = dict[Side, tuple[str, Side]]
"""Of the sides of a sheet that are cut: the board and the side that each meets."""

BAND = 6.0
"""Beyond an edge that is cut, room for its words, in millimetres."""
_INSET = 2.0  # of the strip from edges that are cut
_SIDES: tuple[Side, ...] = ("top", "right", "bottom", "left")
# Of corners along a side that nobody asked for by their number: 2 mm on A3 have 200.
_MOST_ALONG = 250
# Sides of squares that are tried, in millimetres.
_SQUARES = (*range(5, 40), *range(40, 80, 2), *range(80, 301, 5))


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
        """Return the end points of each side, where a, b and c are 1."""
        corner, x, y = np.array([self.corner, self.x_axis, self.y_axis])
        around = [*map(tuple, (corner, corner + x, corner + x + y, corner + y))]
        ends = zip(around, around[1:] + around[:1], strict=True)
        return dict(zip(_SIDES, map(frozenset, ends), strict=True))

    def meets(self, sheets: Sequence[_Sheet]) -> Meetings:
        """Return the sheets and sides that its sides meet."""
        return {
            side: (other.name, far)
            for side, ends in self.edges().items()
            for other in sheets
            for far, its in other.edges().items()
            if its == ends and other is not self
        }


_LEFT, _DOWN = (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)
_RIGHT, _DEEP, _NEAR = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
_SHEETS: dict[str, tuple[_Sheet, ...]] = {
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


def design(options: PrintOptions, paper: Paper, *, margin: float) -> tuple[Target, list[Page]]:
    """Design a target that fits the paper, each board on one page.

    Args:
        options: the target's options.
        paper: the paper.
        margin: at the paper's edges, where nothing is printed, in millimetres.

    Raises:
        TargetError: no such target fits, or the family has too few markers.

    """
    kind, made = options.kind or "board", DESIGNS[options.board_type or "checkerboard"]
    sheets = _SHEETS[kind]
    if kind == "board":
        # White up to the paper's edge begins where the printer can print.
        sides, rim = np.array([paper.long, paper.short - margin, 0.0]), margin
    else:
        sides, rim = _find_largest(kind, paper, margin), 0.0
    rooms = [sides[[*one.size]] for one in sheets]
    square, counts = _fit_squares(options, made, rooms, paper, rim=rim)
    markers = list(map(made.marker_count, counts))
    family = made.family(options.dictionary, sum(markers))
    places = [
        _place(one.meets(sheets), room, made, own, square)
        for one, room, own in zip(sheets, rooms, counts, strict=True)
    ]
    boards: list[dict[str, Any]] = []
    for number, (one, place) in enumerate(zip(sheets, places, strict=True)):
        x_axis, y_axis = np.array(one.x_axis), np.array(one.y_axis)
        origin = np.array(one.corner) * sides + place[0] * x_axis + place[1] * y_axis
        board = made.record(counts[number], square, family, sum(markers[:number]))
        board |= {"name": one.name, "x_axis": [*one.x_axis], "y_axis": [*one.y_axis]}
        # The file is read by people: no digits beyond what rounding left.
        board["origin"] = [0.0] * 3 if kind == "board" else (np.round(origin, 6) + 0.0).tolist()
        boards.append(board)
    target = Target.from_data({"units": "mm", "boards": boards})
    if kind == "board":
        return target, [lay_out(target.boards[0], paper, margin=margin)]
    pages = [
        _cut_out(board, one.meets(sheets), room, place, paper)
        for board, one, room, place in zip(target.boards, sheets, rooms, places, strict=True)
    ]
    return target, pages


def _find_largest(kind: str, paper: Paper, margin: float) -> FloatArray:
    """Return the largest sheets that the paper holds, across: their sides a, b and c."""
    width, height = paper.long - 2 * margin, paper.short - 2 * margin
    sides = np.array([width, width, width])
    for one in _SHEETS[kind]:
        meets = one.meets(_SHEETS[kind])
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
    return step * np.floor(sides / step + 1e-9)


def _fit_squares(
    options: PrintOptions, made: Design, rooms: Sequence[FloatArray], paper: Paper, *, rim: float
) -> tuple[float, list[Counts]]:
    """Return the square's side and the counts that cover most of sheets (width, height).

    White at the sheets' edges is at least ``rim`` wide.
    """
    side = None if options.square is None else length_mm(options.square)
    if side is not None and options.counts is not None:
        return side, [options.counts]
    most = made.counts[1] if options.square is None and options.counts is None else 1000
    best: tuple[float, float, list[Counts]] = (0.0, 0.0, [])
    for square in _SQUARES if side is None else (side,):
        limits = [_count_room(made, room, square, most, rim) for room in rooms]
        if options.counts is None:
            counts = _choose_distinct_counts(made, limits)
        else:
            counts = [options.counts] if (np.array(limits) >= options.counts).all() else []
        lengths = [[made.length(n, square) for n in own] for own in counts]
        best = max(best, (sum(across * down for across, down in lengths), square, counts))
    if not best[2]:
        raise TargetError(
            f"a {options.kind} of {_describe_squares(options, made, side)} does not fit on "
            f"{paper.name}, one board per page: take larger paper, smaller squares or fewer corners"
        )
    return float(best[1]), best[2]


def _count_room(made: Design, room: FloatArray, square: float, most: int, rim: float) -> Counts:
    """Return how many corners of a square's size a sheet has room for, ``most`` at most."""
    width, height = room
    quiet = made.quiet * square
    white = max(quiet, rim)
    return (
        min(most, made.count(width - 2 * white, square)),
        min(most, made.count(height - STRIP - quiet - white, square)),
    )


def _describe_squares(options: PrintOptions, made: Design, side: float | None) -> str:
    if side is not None:
        return f"squares of {side:g} mm"
    if options.counts is not None:
        return "{}x{} corners".format(*options.counts)
    return f"{made.type}s"


def _choose_distinct_counts(made: Design, limits: Sequence[Counts]) -> list[Counts]:
    """Return the largest counts of corners within limits; none if there is too little room.

    Counts and the colours of squares tell plain boards apart: no two have the same counts, either
    way round, and none looks the same upside down, since the sum of its counts is odd.

    Raises:
        TargetError: there is room for more than anybody wants.

    """
    if np.max(limits) > _MOST_ALONG:
        raise TargetError(
            f"squares so small would make boards of more than {_MOST_ALONG} corners along a side: "
            "take larger squares, or say how many with '--object board --corners'"
        )
    fewest = made.counts[0]
    if made.marker:
        return list(limits) if np.min(limits) >= fewest else []
    chosen: dict[int, Counts] = {}
    # The smallest sheet has the least choice, and comes first.
    for index in sorted(range(len(limits)), key=lambda k: (limits[k][0] * limits[k][1], k)):
        columns, rows = limits[index]
        taken = {tuple(sorted(counts)) for counts in chosen.values()}
        free = [
            (c, r)
            for c in range(fewest, columns + 1)
            for r in range(fewest, rows + 1)
            if (c + r) % 2 == 1 and (min(c, r), max(c, r)) not in taken
        ]
        if not free:
            return []
        chosen[index] = max(free, key=lambda counts: ((counts[0] + 1) * (counts[1] + 1), counts))
    return [chosen[index] for index in range(len(limits))]


def _place(
    meets: Meetings, room: FloatArray, made: Design, counts: Counts, square: float
) -> FloatArray:
    """Return where on a sheet (width, height) its corner (0, 0) is (2,), from the top left.

    At a single cut edge there is as little white as is allowed, else the same on both sides. Words
    and ruler stay away from an edge that is cut.
    """
    place = []
    for k, (near, far) in enumerate((("left", "right"), ("top", "bottom"))):
        strip = STRIP * k
        free = float(room[k]) - made.length(counts[k], square) - strip
        quiet = made.quiet * square
        white = free / 2
        if (near in meets) != (far in meets):
            white = quiet if near in meets else free - quiet
        place.append(white + (near not in meets) * strip + made.before * square)
    return np.array(place)


def _cut_out(
    board: Board, meets: Meetings, room: FloatArray, place: FloatArray, paper: Paper
) -> Page:
    """Lay out a sheet (width, height) to be cut out of its page; ``place`` is of corner (0, 0)."""
    width, height = room.tolist()
    bands = {side: BAND * (side in meets) for side in _SIDES}
    x = (paper.long + bands["left"] - bands["right"] - width) / 2
    y = (paper.short + bands["top"] - bands["bottom"] - height) / 2
    ends = {"left": x, "top": y, "right": x + width, "bottom": y + height}
    return Page(
        board=board,
        width=paper.long,
        height=paper.short,
        shift=(x + float(place[0]), y + float(place[1])),
        strip=(x + _INSET, y + height - STRIP if "top" in meets else y),
        length=width - 2 * _INSET,
        cuts={
            side: Cut(place=ends[side], board=name, side=far) for side, (name, far) in meets.items()
        },
    )
