"""Targets made for a size of paper: which boards, how many squares, and where they are.

Every target is made of rectangular sheets that are cut at the edges where they meet. The world's
frame follows from that alone: z is up, and the sheets' printed faces meet in those edges.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import floor
from typing import Literal

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.boards.types import BOARD_TYPES
from cubicfish_cli.errors import TargetError
from cubicfish_cli.printing.layout import BAND, SHORTEST_SHEET, lay_out
from cubicfish_cli.printing.sheet import (
    STRIP,
    Margins,
    Paper,
    Seam,
    Sheet,
    Side,
)
from cubicfish_cli.target import Target

Kind = Literal["corner", "box", "block", "board"]
Counts = tuple[int, int]
Vector = tuple[float, float, float]

KINDS: dict[Kind, str] = {
    "corner": "three boards that meet like the floor and two walls of a room, seen from inside",
    "box": "the bottom and the four walls of an open box, seen from inside",
    "block": "the top and the four sides of a block, seen from outside",
    "board": "one flat board",
}
# Placement of squares that are tried, in millimetres.
_NICE = (*range(5, 40), *range(40, 80, 2), *range(80, 301, 5))


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What a target is to be like; None where that is for the paper to decide.

    Attributes:
        kind: which target.
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
class _Face:
    """One sheet of a target whose sheets have sides a, b or c.

    Attributes:
        name: the board's.
        size: which lengths its width and its height are.
        corner: the world point of its top left corner, as multiples of a, b and c for x, y, z.
        x_axis, y_axis: of the board.
        strip: the side with the ruler and the words.
        meets: for each side that is cut, the board and side that it meets.

    """

    name: str
    size: tuple[int, int]
    corner: Vector
    x_axis: Vector
    y_axis: Vector
    strip: Side
    meets: Mapping[Side, tuple[str, Side]] = field(default_factory=dict)

    def edges(self) -> dict[Side, frozenset[tuple[float, ...]]]:
        """The end points of each side, where a, b and c are 1."""
        corner, x, y = (np.array(part, float) for part in (self.corner, self.x_axis, self.y_axis))
        a, b, c, d = map(tuple, np.stack([corner, corner + x, corner + x + y, corner + y]).tolist())
        return {
            "left": frozenset((a, d)),
            "top": frozenset((a, b)),
            "right": frozenset((b, c)),
            "bottom": frozenset((c, d)),
        }


def _joined(*faces: _Face) -> tuple[_Face, ...]:
    """The sheets of a target, each with what its sides meet."""
    sides = [(one.name, side, ends) for one in faces for side, ends in one.edges().items()]
    return tuple(
        replace(
            one,
            meets={
                side: (board, other)
                for side, ends in one.edges().items()
                for board, other, far in sides
                if far == ends and board != one.name
            },
        )
        for one in faces
    )


_LEFT, _DOWN = (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)
_RIGHT, _DEEP, _NEAR = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
# Width and height of a sheet are sides 0, 1, 2 of the target: along x, along y and along z.
_FACES: dict[Kind, tuple[_Face, ...]] = {
    "corner": _joined(
        _Face("left", (0, 2), (1, 0, 1), _LEFT, _DOWN, "top"),
        _Face("right", (0, 2), (0, 0, 1), _DEEP, _DOWN, "top"),
        _Face("floor", (0, 2), (1, 0, 0), _LEFT, _DEEP, "bottom"),
    ),
    "box": _joined(
        _Face("bottom", (0, 1), (0, 1, 0), _RIGHT, _NEAR, "bottom"),
        _Face("back", (0, 2), (0, 1, 1), _RIGHT, _DOWN, "top"),
        _Face("front", (0, 2), (1, 0, 1), _LEFT, _DOWN, "top"),
        _Face("left", (1, 2), (0, 0, 1), _DEEP, _DOWN, "top"),
        _Face("right", (1, 2), (1, 1, 1), _NEAR, _DOWN, "top"),
    ),
    "block": _joined(
        _Face("top", (0, 1), (0, 1, 1), _RIGHT, _NEAR, "bottom"),
        _Face("front", (0, 2), (0, 0, 1), _RIGHT, _DOWN, "bottom"),
        _Face("back", (0, 2), (1, 1, 1), _LEFT, _DOWN, "bottom"),
        _Face("left", (1, 2), (0, 1, 1), _NEAR, _DOWN, "bottom"),
        _Face("right", (1, 2), (1, 0, 1), _DEEP, _DOWN, "bottom"),
    ),
    "board": _joined(_Face("board", (0, 2), (0, 0, 0), _RIGHT, _DEEP, "bottom")),
}


def design(wanted: Wanted, paper: Paper, *, margin: float) -> tuple[Target, list[Sheet]]:
    """A target whose sheets fit the paper, each on one page unless that cannot be.

    Args:
        wanted: what it is to be like. With ``square`` and ``counts`` its sheets are as large as
            that takes; otherwise as large as the paper allows.
        paper: the paper.
        margin: at the paper's edges, where nothing is printed, in millimetres.

    Raises:
        TargetError: nothing like that fits, or the markers' family has not enough of them.

    """
    faces = _FACES[wanted.kind]
    if wanted.square is not None and wanted.counts is not None:
        counts = _chosen(wanted, _alike(faces, wanted.counts))
        if counts is None:
            raise TargetError(_too_few(wanted))
        boards = _boards(wanted, faces, wanted.square, counts)
        for strip in (STRIP, 0.0):
            sides = _around(faces, boards, strip)
            sheets = _sheets(wanted, faces, boards, sides, strip)
            if all(len(lay_out(sheet, paper, margin=margin)) == 1 for sheet in sheets):
                break
    else:
        sides = _largest(wanted.kind, faces, paper, margin)
        square, counts = _fitting(wanted, faces, sides, paper, margin)
        sheets = _sheets(wanted, faces, _boards(wanted, faces, square, counts), sides, STRIP)
    return Target(units="mm", boards=tuple(sheet.board for sheet in sheets)), sheets


def _largest(
    kind: Kind, faces: Sequence[_Face], paper: Paper, margin: float
) -> tuple[float, float, float]:
    """The largest sheets that the paper holds, across: lengths along x, y and z."""
    width, height = paper.long - 2 * margin, paper.short - 2 * margin
    if kind == "board":  # its white may go on to the paper's edges, but for the strip's
        return paper.long, paper.long, paper.short - margin
    sides = [width, width, width]
    for one in faces:
        across, down = one.size
        bands_x = BAND * sum(side in one.meets for side in ("left", "right"))
        bands_y = BAND * sum(side in one.meets for side in ("top", "bottom"))
        sides[across] = min(sides[across], width - bands_x)
        sides[down] = min(sides[down], height - bands_y)
    if min(sides) < SHORTEST_SHEET:
        raise TargetError(
            f"{paper.name} is too small for a {kind} with its rulers: take larger paper, or "
            "'--object board'"
        )
    # Joined all around, sheets are cut to size: whole half centimetres are easily measured.
    step = 1.0 if kind == "corner" else 5.0
    x, y, z = (step * floor(side / step + 1e-9) for side in sides)
    return x, y, z


def _around(
    faces: Sequence[_Face], boards: Sequence[Board], strip: float
) -> tuple[float, float, float]:
    """Sheets that are as large as their prints need."""
    sides = [0.0, 0.0, 0.0]
    for one, board in zip(faces, boards, strict=True):
        sheet = Sheet(board=board)
        need = (sheet.size[0] + 2 * sheet.quiet, sheet.size[1] + 2 * sheet.quiet + strip)
        for index, length in zip(one.size, need, strict=True):
            sides[index] = max(sides[index], length, SHORTEST_SHEET)
    return sides[0], sides[1], sides[2]


def _fitting(
    wanted: Wanted,
    faces: Sequence[_Face],
    sides: tuple[float, float, float],
    paper: Paper,
    margin: float,
) -> tuple[float, list[Counts]]:
    """The squares and their numbers that cover most of the sheets."""
    # White up to the paper's edge begins where the printer can print.
    rim = margin if wanted.kind == "board" else 0.0
    board = BOARD_TYPES[wanted.type]
    best: tuple[float, float, list[Counts]] | None = None
    for square in (wanted.square,) if wanted.square is not None else _NICE:
        quiet = square / board.per_cell
        limits = []
        for one in faces:
            across, down = (sides[k] for k in one.size)
            free = (across - 2 * max(quiet, rim), down - STRIP - quiet - max(quiet, rim))
            columns, rows = (board.designed_count(length, square) for length in free)
            limits.append((columns, rows))
        if wanted.counts is not None:
            needed = _chosen(wanted, _alike(faces, wanted.counts))
            counts = needed if needed and all(map(_within, needed, limits)) else None
        else:
            _, most = board.designed_counts
            if wanted.square is None:
                limits = [(min(columns, most), min(rows, most)) for columns, rows in limits]
            counts = _chosen(wanted, limits)
        if counts is None:
            continue
        sizes = [[board.designed_length(n, square) for n in one] for one in counts]
        score = sum(width * height for width, height in sizes)
        if best is None or score >= best[0]:
            best = score, square, counts
    if best is None:
        what = [f"squares of {wanted.square:g} mm"] if wanted.square is not None else []
        what += ["{}x{}".format(*wanted.counts)] if wanted.counts is not None else []
        raise TargetError(
            f"{', '.join(what) or f'a {wanted.kind} of {wanted.type}s'} does not fit on "
            f"{paper.name}: take larger paper or "
            f"{'smaller squares' if wanted.square is not None else 'fewer corners'}, or give both "
            "--square and --corners to have it on several pages"
        )
    return float(best[1]), best[2]


def _within(counts: Counts, limit: Counts) -> bool:
    return counts[0] <= limit[0] and counts[1] <= limit[1]


def _alike(faces: Sequence[_Face], counts: Counts) -> list[Counts]:
    """What each sheet has room for where the first has room for ``counts``."""
    columns, rows = counts
    along = (columns, rows, rows)
    return [(along[one.size[0]], along[one.size[1]]) for one in faces]


def _chosen(wanted: Wanted, limits: Sequence[Counts]) -> list[Counts] | None:
    """The largest numbers of corners within limits; None where there are too few.

    Plain boards are told apart by their numbers and by the colours of their squares, so no two
    have the same numbers, either way round, and none looks the same upside down: the sum of its
    numbers is odd.
    """
    given = wanted.counts
    board = BOARD_TYPES[wanted.type]
    fewest, _ = board.designed_counts
    fewest = fewest if given is None else min(fewest, 3)
    if board.marker_borders:
        if given is None and any(min(limit) < fewest for limit in limits):
            return None
        return list(limits)
    chosen: dict[int, Counts] = {}
    if given is not None:
        chosen[0] = given
    taken = {tuple(sorted(counts)) for counts in chosen.values()}
    # Where there is the least room there is the least choice.
    for index in sorted(range(len(limits)), key=lambda k: (limits[k][0] * limits[k][1], k)):
        if index in chosen:
            continue
        columns, rows = limits[index]
        free = [
            (c, r)
            for c in range(fewest, columns + 1)
            for r in range(fewest, rows + 1)
            if (c + r) % 2 == 1 and (min(c, r), max(c, r)) not in taken
        ]
        if not free:
            return None
        best = max(free, key=lambda counts: ((counts[0] + 1) * (counts[1] + 1), counts))
        chosen[index] = best
        taken.add((min(best), max(best)))
    return [chosen[index] for index in range(len(limits))]


def _too_few(wanted: Wanted) -> str:
    columns, rows = wanted.counts or (0, 0)
    return (
        f"{columns}x{rows} corners leave no different numbers for the other boards of a "
        f"{wanted.kind}, which must be told apart: take more corners, or '--type charuco'"
    )


def _boards(
    wanted: Wanted, faces: Sequence[_Face], square: float, counts: Sequence[Counts]
) -> list[Board]:
    """The boards, not yet in their places."""
    kind = BOARD_TYPES[wanted.type]
    markers = list(map(kind.designed_marker_count, counts))
    family = kind.designed_family(wanted.dictionary, sum(markers))
    boards, first = [], 0
    for one, own, carried in zip(faces, counts, markers, strict=True):
        boards.append(kind.designed(one.name, own, square, family, first))
        first += carried
    return boards


def _sheets(
    wanted: Wanted,
    faces: Sequence[_Face],
    boards: Sequence[Board],
    sides: tuple[float, float, float],
    strip: float,
) -> list[Sheet]:
    if wanted.kind == "board":
        return [Sheet(board=boards[0])]
    seams = _seams(faces)
    sheets = []
    for one, board in zip(faces, boards, strict=True):
        sheet = Sheet(board=board)
        margins = _margins(one, sheet, (sides[one.size[0]], sides[one.size[1]]), strip)
        sheets.append(
            Sheet(
                board=_placed(sheet, one, margins, sides),
                margins=margins,
                seams=seams[one.name],
                strip=one.strip if strip else None,
            )
        )
    return sheets


def _margins(one: _Face, sheet: Sheet, size: tuple[float, float], strip: float) -> Margins:
    """White around a print: as little as allowed at a single cut edge, else alike."""

    def share(free: float, start: Side, end: Side) -> tuple[float, float]:
        if (start in one.meets) == (end in one.meets):
            return free / 2, free / 2
        near = sheet.quiet
        return (near, free - near) if start in one.meets else (free - near, near)

    width, height = sheet.size
    left, right = share(size[0] - width, "left", "right")
    top, bottom = share(size[1] - height - strip, "top", "bottom")
    if one.strip == "top":
        top += strip
    else:
        bottom += strip
    return Margins(left=left, top=top, right=right, bottom=bottom)


def _placed(sheet: Sheet, one: _Face, margins: Margins, sides: tuple[float, float, float]) -> Board:
    """The board where its sheet belongs in the world."""
    x_axis, y_axis = np.array(one.x_axis), np.array(one.y_axis)
    right, down = margins.left - sheet.printed.left, margins.top - sheet.printed.top
    origin = np.array(one.corner) * sides + right * x_axis + down * y_axis
    # The file is read by people: no digits beyond what rounding left.
    return replace(
        sheet.board, origin=np.round(origin, 6) + 0.0, x_axis=x_axis + 0.0, y_axis=y_axis + 0.0
    )


def _seams(faces: Sequence[_Face]) -> dict[str, dict[Side, Seam]]:
    """For each board its cut sides; the two sides of an edge carry the same letter."""
    letters: dict[frozenset[tuple[str, Side]], str] = {}
    seams: dict[str, dict[Side, Seam]] = {}
    for one in faces:
        seams[one.name] = {}
        for side, (board, other) in one.meets.items():
            edge = frozenset([(one.name, side), (board, other)])
            letter = letters.setdefault(edge, chr(ord("A") + len(letters)))
            seams[one.name][side] = Seam(letter=letter, board=board, side=other)
    return seams
