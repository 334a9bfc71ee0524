"""Where a sheet's print lies on paper: on one page, or on several that are glued together."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from math import ceil, floor

from cubicfish_cli.boards.board import Board
from cubicfish_cli.errors import TargetError
from cubicfish_cli.printing.sheet import (
    LOW_STRIP,
    SHORTEST_STRIP,
    SIDES,
    STRIP,
    Margins,
    Paper,
    Point,
    Rect,
    Sheet,
    Side,
)
from cubicfish_cli.wording import quoted

BAND = 6.0
"""Beyond an edge that is cut, room for its words and marks, in millimetres."""
OVERLAP = 10.0
"""By how much pages of one board overlap."""
BLEED = 2.0
"""By how much the print goes on beyond an edge that is trimmed and glued over another page."""
SHORTEST_SHEET = SHORTEST_STRIP + 4.0
"""Width of a sheet that holds the strip, kept off its edges."""
MOST_PAGES = 200
# White around a print, in shares of what it should have, where the paper is small.
_SHARES = (1.0, 0.75, 0.5, 0.4)
_ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True)
class Strip:
    """Where the ruler and the words are on a page.

    Attributes:
        place: the strip, on the page.
        turned: whether its words run upwards, beside the print, instead of along x.

    """

    place: Rect
    turned: bool = False


@dataclass(frozen=True, kw_only=True)
class Tile:
    """Which of several pages of one board a page is.

    Attributes:
        row, column: its place among them, from 0.
        rows, columns: how many there are.
        part: what it shows once glued, in the board's plane; what it prints is larger.

    """

    row: int
    column: int
    rows: int
    columns: int
    part: Rect


@dataclass(frozen=True, kw_only=True, eq=False)
class Page:
    """One page of paper, in millimetres from its top left corner.

    Attributes:
        sheet: whose print it shows.
        width, height: of the paper.
        margin: at the paper's edges, where nothing is printed.
        shift: where the board's corner (0, 0) is on the page, also when that is beyond it.
        window: what is shown of the board's plane.
        strip: where ruler and words are.
        cuts: for each side that is cut, where, on the page; sides with a seam.
        quiet: white around the print that nothing else may enter.
        tile: which page of several it is, or None.

    """

    sheet: Sheet
    width: float
    height: float
    margin: float
    shift: Point
    window: Rect
    strip: Strip
    quiet: float
    cuts: dict[Side, float] = field(default_factory=dict)
    tile: Tile | None = None


def lay_out(sheet: Sheet, paper: Paper, *, margin: float) -> list[Page]:
    """The pages of a sheet: one where it fits, else as many as it takes.

    Args:
        sheet: the board and what is around it.
        paper: the paper; upright or across, whichever suits.
        margin: at the paper's edges, where nothing is printed, in millimetres.

    Raises:
        TargetError: the paper is too small for its margins, or the board takes too many pages.

    """
    if sheet.margins is not None and sheet.strip is not None:
        page = _cut_out(sheet, sheet.margins, sheet.strip, paper, margin)
    else:
        page = _alone(sheet, paper, margin) if not sheet.seams else None
    return [page] if page is not None else _tiles(sheet, paper, margin)


def orientations(sheet_is_wide: bool, paper: Paper) -> tuple[tuple[float, float], ...]:
    """Width and height of the paper: the orientation that suits first."""
    upright, across = (paper.short, paper.long), (paper.long, paper.short)
    return (across, upright) if sheet_is_wide else (upright, across)


def _cut_out(
    sheet: Sheet, margins: Margins, strip: Side, paper: Paper, margin: float
) -> Page | None:
    """A sheet of a given size, cut out of the paper at its seams."""
    printed = sheet.printed
    whole = printed.grown(margins)
    waste = {side: margin + (BAND if side in sheet.seams else 0.0) for side in SIDES}
    for width, height in orientations(whole.width > whole.height, paper):
        free_x = width - waste["left"] - waste["right"] - whole.width
        free_y = height - waste["top"] - waste["bottom"] - whole.height
        if min(free_x, free_y) < -_ROUNDING or whole.width < SHORTEST_SHEET - _ROUNDING:
            continue
        shift = (
            waste["left"] + free_x / 2 - whole.left,
            waste["top"] + free_y / 2 - whole.top,
        )
        on_page = whole.moved(shift)
        edge = on_page.top if strip == "top" else on_page.bottom - STRIP
        # Words keep off the edges that are cut.
        place = Rect(left=on_page.left + 2, right=on_page.right - 2, top=edge, bottom=edge + STRIP)
        return Page(
            sheet=sheet,
            width=width,
            height=height,
            margin=margin,
            shift=shift,
            window=printed,
            strip=Strip(place=place),
            quiet=sheet.quiet,
            cuts={side: getattr(on_page, side) for side in sheet.seams},
        )
    return None


def _alone(sheet: Sheet, paper: Paper, margin: float) -> Page | None:
    """A print in the middle of a page, with as much white around it as there is room for."""
    printed = sheet.printed
    wide = printed.width > printed.height
    for strip, share, turned, (width, height) in product(
        (STRIP, LOW_STRIP), _SHARES, (False, True), orientations(wide, paper)
    ):
        quiet = share * sheet.quiet
        free_x, free_y = width, height - margin - strip
        if turned:
            free_x, free_y = width - margin - strip, height
        # White paper beyond the printer's reach is white too; the strip ends it on its side.
        rim = max(quiet, margin)
        need_x = printed.width + rim + (quiet if turned else rim)
        need_y = printed.height + rim + (rim if turned else quiet)
        length = (height if turned else width) - 2 * margin
        if need_x > free_x + _ROUNDING or need_y > free_y + _ROUNDING or length < SHORTEST_STRIP:
            continue
        left = rim + (free_x - need_x) / 2
        top = rim + (free_y - need_y) / 2
        shift = (left - printed.left, top - printed.top)
        place = Rect(
            left=width - margin - strip if turned else margin,
            right=width - margin,
            top=margin if turned else height - margin - strip,
            bottom=height - margin,
        )
        return Page(
            sheet=sheet,
            width=width,
            height=height,
            margin=margin,
            shift=shift,
            window=printed,
            strip=Strip(place=place, turned=turned),
            quiet=quiet,
        )
    return None


def _tiles(sheet: Sheet, paper: Paper, margin: float) -> list[Page]:
    """A print on several pages: each is trimmed on the left and at the top and glued over."""
    printed = sheet.printed
    white = _white(sheet, margin)
    whole = printed.grown(white)
    best: tuple[list[float], list[float], float, float] | None = None
    for width, height in orientations(whole.width > whole.height, paper):
        room_x = width - 2 * (margin + BAND)
        room_y = height - 2 * (margin + BAND) - STRIP
        if min(room_x, room_y) < 3 * OVERLAP or width - 2 * margin < SHORTEST_STRIP:
            continue
        columns = _parts(whole.left, whole.right, room_x, sheet.board)
        rows = _parts(whole.top, whole.bottom, room_y, sheet.board)
        if best is None or len(columns) * len(rows) < len(best[0]) * len(best[1]):
            best = columns, rows, width, height
    name = quoted(sheet.board.name)
    if best is None:
        raise TargetError(
            f"board {name}: {paper.name} has no room between margins of {margin:g} mm: take "
            "larger paper or a smaller --margin"
        )
    columns, rows, width, height = best
    count = (len(columns) - 1) * (len(rows) - 1)
    if count > MOST_PAGES:
        raise TargetError(
            f"board {name}, {whole.width:.0f} x {whole.height:.0f} mm, would take {count} pages of "
            f"{paper.name}, more than {MOST_PAGES}: take larger paper or smaller squares"
        )
    pages = []
    for row, column in product(range(len(rows) - 1), range(len(columns) - 1)):
        first_x, last_x = column == 0, column == len(columns) - 2
        first_y, last_y = row == 0, row == len(rows) - 2
        part = Rect(
            left=columns[column], right=columns[column + 1], top=rows[row], bottom=rows[row + 1]
        )
        tab = part.grown(Margins(right=0 if last_x else OVERLAP, bottom=0 if last_y else OVERLAP))
        shift = (margin + BAND - part.left, margin + BAND - part.top)
        on_page = tab.moved(shift)
        edges: tuple[tuple[Side, bool], ...] = (
            ("left", first_x), ("top", first_y), ("right", last_x), ("bottom", last_y),
        )  # fmt: skip
        pages.append(
            Page(
                sheet=sheet,
                width=width,
                height=height,
                margin=margin,
                shift=shift,
                window=tab.grown(
                    Margins(left=0 if first_x else BLEED, top=0 if first_y else BLEED)
                ),
                strip=Strip(
                    place=Rect(
                        left=margin,
                        right=width - margin,
                        top=height - margin - STRIP,
                        bottom=height - margin,
                    )
                ),
                quiet=sheet.quiet,
                cuts={
                    side: getattr(on_page, side)
                    for side, outer in edges
                    if outer and side in sheet.seams
                },
                tile=Tile(
                    row=row,
                    column=column,
                    rows=len(rows) - 1,
                    columns=len(columns) - 1,
                    part=part,
                ),
            )
        )
    return pages


def _white(sheet: Sheet, margin: float) -> Margins:
    """White that parts must show around a print: up to cuts, else what pages do not have anyway."""
    given = sheet.margins or Margins.of(sheet.quiet)

    def at(side: Side) -> float:
        if side in sheet.seams:
            return float(getattr(given, side))
        # Below a print is the strip, else the paper's own margin.
        return max(sheet.quiet - BAND - (0.0 if side == "bottom" else margin), 0.0)

    return Margins(left=at("left"), top=at("top"), right=at("right"), bottom=at("bottom"))


def _parts(start: float, end: float, room: float, board: Board) -> list[float]:
    """Ends of the parts of a length, alike, of which each fits into ``room`` with its overlap.

    Where there is play, parts end in the middle of squares, since corners should be on one page.
    """
    count = max(1, ceil((end - start - OVERLAP) / (room - OVERLAP) - _ROUNDING))
    even = [start + (end - start) * k / count for k in range(1, count)]
    if count > MOST_PAGES:
        return [start, *even, end]
    pitch = board.square * (1 + board.spacing)  # spacing is 0 but on aprilgrids
    ends = [start]
    for k, wished in enumerate(even, start=1):
        # What is left must still fit the pages that are left, each but the last with its overlap.
        lowest = end - room - (count - 1 - k) * (room - OVERLAP)
        highest = ends[-1] + room - OVERLAP
        square = floor(wished / pitch)
        middles = [pitch * (square + step) + board.square / 2 for step in (-1, 0, 1)]
        allowed = [middle for middle in middles if lowest <= middle <= highest]
        wished = min(max(wished, lowest), highest)
        ends.append(min(allowed, key=lambda middle: abs(middle - wished), default=wished))
    return [*ends, end]
