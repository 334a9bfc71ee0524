"""One page: a board's ink at true scale, and around it what helps to print, cut and glue it.

Nothing in the strip beside it is a dark area with corners, so that no detector takes it for a
pattern.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cubicfish_cli import __version__
from cubicfish_cli.boards.aprilgrid import AprilGrid
from cubicfish_cli.boards.board import Board
from cubicfish_cli.printing.canvas import GREY, PALE, Canvas, fitted, ink_outlines, length_of
from cubicfish_cli.printing.layout import BAND, OVERLAP, Page, Strip, Tile
from cubicfish_cli.printing.sheet import STRIP, Point, Rect, Side

_POINTER = 2.2
# A pointer to corner (0, 0) needs that much white beyond the quiet zone.
_POINTER_ROOM = 7.0


def draw_pages(pages: Sequence[Page]) -> Iterator[Canvas]:
    """Draw pages, numbered through, one at a time."""
    for number, page in enumerate(pages, start=1):
        yield draw_page(page, number, len(pages))


def draw_page(page: Page, number: int, count: int) -> Canvas:
    """Draw a page, the ``number``-th of ``count``."""
    canvas = Canvas(page.width, page.height)
    window = page.window
    outlines = ink_outlines(
        page.sheet.face, (window.left, window.top), (window.right, window.bottom)
    )
    canvas.fill([outline + np.array(page.shift) for outline in outlines])
    extent = _extent(page)
    for side, place in page.cuts.items():
        _cut(canvas, page, side, place, extent)
    if page.tile is not None:
        _trims(canvas, page, page.tile, extent)
    else:
        _pointers(canvas, page)
    draw_strip(canvas, page, number, count)
    return canvas


def _extent(page: Page) -> Rect:
    """What of the page belongs to the joined target: up to its cuts or the printer's reach."""
    return Rect(
        left=page.cuts.get("left", page.margin),
        top=page.cuts.get("top", page.margin),
        right=page.cuts.get("right", page.width - page.margin),
        bottom=page.cuts.get("bottom", page.height - page.margin),
    )


def _cut(canvas: Canvas, page: Page, side: Side, place: float, extent: Rect) -> None:
    """A line to cut along, and beyond it which edge it is and what it meets."""
    seam = page.sheet.seams[side]
    words = f"edge {seam.letter}: cut here; it meets edge {seam.letter} of {seam.board}"
    room = BAND - 1.0
    if side in ("left", "right"):
        line = [(place, extent.top), (place, extent.bottom)]
        x = place - 1.6 if side == "left" else place + 1.6 + 2.2
        middle = (extent.top + extent.bottom) / 2
        canvas.text((x, middle), words, 2.6, along="center", turn=90,
                    room=extent.height - 2 * room)  # fmt: skip
    else:
        line = [(extent.left, place), (extent.right, place)]
        y = place - 1.6 if side == "top" else place + 1.6 + 2.2
        middle = (extent.left + extent.right) / 2
        canvas.text((middle, y), words, 2.6, along="center", room=extent.width - 2 * room)
    canvas.lines([line], width=0.15, colour=GREY, dashes=(3.0, 1.5))


def _pointers(canvas: Canvas, page: Page) -> None:
    """Small arrow heads in the margins at the column and the row of corner (0, 0)."""
    x, y = page.shift
    printed = page.window.moved(page.shift)
    in_strip = page.strip.place
    top, left = printed.top - page.quiet, printed.left - page.quiet
    size = _POINTER
    free_top = top - page.margin
    if "top" not in page.cuts and free_top >= _POINTER_ROOM and in_strip.top > top:
        canvas.lines(
            [[(x - size / 2, top - size), (x, top), (x + size / 2, top - size)]], width=0.25
        )
        canvas.text((x + size, top - 0.4), "column 0", 2.2)
    free_left = left - page.margin
    if "left" not in page.cuts and free_left >= _POINTER_ROOM:
        canvas.lines(
            [[(left - size, y - size / 2), (left, y), (left - size, y + size / 2)]], width=0.25
        )
        canvas.text((left - size - 0.6, y + 0.8), "row 0", 2.2, along="right")


def _trims(canvas: Canvas, page: Page, tile: Tile, extent: Rect) -> None:
    """Marks where a page is trimmed, and where its neighbours come to lie."""
    part = tile.part.moved(page.shift)
    window = page.window.moved(page.shift)
    marks: list[tuple[Point, Point]] = []
    near, far = 1.0, BAND - 0.5  # from the print to a mark and its end

    def across(x: float) -> None:
        marks.append(((x, window.top - near), (x, window.top - far)))
        marks.append(((x, window.bottom + near), (x, window.bottom + far)))

    def along(y: float) -> None:
        marks.append(((window.left - near, y), (window.left - far, y)))
        marks.append(((window.right + near, y), (window.right + far, y)))

    middle_x, middle_y = (part.left + part.right) / 2, (part.top + part.bottom) / 2
    if tile.column > 0:
        across(part.left)
        canvas.text((window.left - 1.2, middle_y), "trim at the marks and glue over the page on "
                    "the left", 2.2, along="center", turn=90, room=part.height)  # fmt: skip
    if tile.row > 0:
        along(part.top)
        canvas.text((middle_x, window.top - 1.2), "trim at the marks and glue over the page above",
                    2.2, along="center", room=part.width)  # fmt: skip
    if tile.column < tile.columns - 1:
        across(part.right)
        canvas.text((window.right + 2.8, middle_y), f"glue tab: the next page covers the last "
                    f"{OVERLAP:g} mm", 2.2, along="center", turn=90,
                    room=part.height)  # fmt: skip
    if tile.row < tile.rows - 1:
        along(part.bottom)
        canvas.text((middle_x, window.bottom + 2.8), f"glue tab: the page below covers the last "
                    f"{OVERLAP:g} mm", 2.2, along="center", room=part.width)  # fmt: skip
    canvas.lines(marks, width=0.15)


_COMPASS, _LOW_COMPASS = 15.0, 11.0
_RULER = 100.0
_AFTER_RULER = 13.0
# Words are beside the ruler where there is that much room, else above it.
_ENOUGH = 75.0
_INCHES = 4


@dataclass(frozen=True)
class _Local:
    """Places along and across a strip -> places on the page."""

    strip: Strip

    @property
    def length(self) -> float:
        """Along its words."""
        place = self.strip.place
        return place.height if self.strip.turned else place.width

    @property
    def low(self) -> bool:
        """Whether there is room for the ruler and one line only."""
        place = self.strip.place
        return (place.width if self.strip.turned else place.height) < STRIP - 1e-6

    @property
    def compass(self) -> float:
        """Side of the place of the arrows."""
        return _LOW_COMPASS if self.low else _COMPASS

    @property
    def turn(self) -> float:
        """Of its words, in degrees to the left."""
        return 90.0 if self.strip.turned else 0.0

    def at(self, along: float, across: float) -> Point:
        place = self.strip.place
        if self.strip.turned:
            return place.left + across, place.bottom - along
        return place.left + along, place.top + across


def describe(board: Board) -> str:
    """What a board in millimetres is, in one line."""
    if isinstance(board, AprilGrid):
        what = (
            f"aprilgrid, {board.columns // 2} x {board.rows // 2} tags of {board.square:g} mm, "
            f"spacing {board.spacing:g}"
        )
    else:
        what = (
            f"{board.kind}, {board.columns} x {board.rows} inner corners, squares "
            f"{board.square:g} mm"
        )
    if board.markers is not None:
        first, last = board.markers.first, board.markers.first + board.markers.count - 1
        family = board.markers.dictionary
        if isinstance(board, AprilGrid):
            family = board.family
        else:
            what += f", markers {board.markers.side:g} mm"
        what += f", {family}, ids {first} to {last}"
    if board.first_square == "light":
        what += ", first square light"
    return what


def draw_strip(canvas: Canvas, page: Page, number: int, count: int) -> None:
    """Draw the strip of a page, the ``number``-th of ``count``."""
    local = _Local(page.strip)
    board = page.sheet.board
    dark = "dark" if board.first_square == "dark" else "light"
    if isinstance(board, AprilGrid):
        origin = "corner (0, 0) is the top left corner of the tag at the top left"
    else:
        origin = (
            f"corner (0, 0) is the inner corner at the top left; the square up-left of it is {dark}"
        )
    where = f"page {number} of {count}"
    if page.tile is not None:
        tile = page.tile
        where += f", row {tile.row + 1} of {tile.rows}, column {tile.column + 1} of {tile.columns}"
    words = [
        describe(board),
        "print at 100 %, no scaling: the ruler must measure 100 mm",
        f"x right, y down; {origin}",
        f"cubicfish {__version__}, {where}",
    ]
    _compass(canvas, local)
    start = local.compass + 3.0
    room = local.length - start - _RULER - _AFTER_RULER
    overview = _overview_width(page.tile) + 3.0 if page.tile is not None else 0.0
    if page.tile is not None:
        _overview(canvas, local, page.tile, local.length - overview + 3.0)
    if local.low:
        _rulers(canvas, local, start, 7.0)
        line = ", ".join([board.name, *words])
        canvas.text(local.at(start, 2.2), line, 2.2, room=local.length - start, turn=local.turn)
    elif room - overview >= _ENOUGH:
        _rulers(canvas, local, start, 4.4)
        _words(
            canvas, local, (start + _RULER + _AFTER_RULER, 3.6), board.name, words, room - overview
        )
    else:
        _rulers(canvas, local, start, 12.8)
        _words_above(
            canvas, local, start, board.name, words, room + _RULER + _AFTER_RULER - overview
        )


def _words(
    canvas: Canvas, local: _Local, at: Point, name: str, words: Sequence[str], room: float
) -> None:
    along, across = at
    canvas.text(local.at(along, across), name, 4.2, bold=True, room=room, turn=local.turn)
    size = min(fitted(line, 2.4, room)[1] for line in words)
    for row, line in enumerate(words, start=1):
        place = local.at(along, across + 0.8 + 3.1 * row)
        canvas.text(place, line, size, room=room, turn=local.turn)


def _words_above(
    canvas: Canvas, local: _Local, along: float, name: str, words: Sequence[str], room: float
) -> None:
    what, scale, axes, made = words
    name, size = fitted(name, 3.4, 0.35 * room, bold=True)
    canvas.text(local.at(along, 2.6), name, size, bold=True, turn=local.turn)
    start = along + length_of(name, size, bold=True) + 2.0
    canvas.text(local.at(start, 2.6), what, 2.3, room=room - (start - along), turn=local.turn)
    lines = (f"{scale}; {made}", axes)
    size = min(fitted(line, 2.3, room)[1] for line in lines)
    for row, line in enumerate(lines):
        canvas.text(local.at(along, 5.4 + 2.6 * row), line, size, room=room, turn=local.turn)


def _rulers(canvas: Canvas, local: _Local, along: float, across: float) -> None:
    """100 mm above a line and inches below it."""
    ticks = [
        (local.at(along + k, across), local.at(along + k, across - _tick(k)))
        for k in range(round(_RULER) + 1)
    ]
    canvas.lines(ticks, width=0.12)
    canvas.lines([(local.at(along, across), local.at(along + 25.4 * _INCHES, across))], width=0.12)
    for k in range(10, round(_RULER), 10):
        _label(canvas, local, (along + k + 0.4, across - 2.1), f"{k}")
    _label(canvas, local, (along + _RULER + 0.5, across - 1.2), "100 mm")
    inches = [
        (local.at(along + 3.175 * k, across), local.at(along + 3.175 * k, across + _eighth(k)))
        for k in range(8 * _INCHES + 1)
    ]
    canvas.lines(inches, width=0.12)
    for k in range(1, _INCHES):
        _label(canvas, local, (along + 25.4 * k + 0.5, across + 3.4), f"{k}")
    _label(canvas, local, (along + 25.4 * _INCHES + 0.5, across + 2.9), "4 in")


def _label(canvas: Canvas, local: _Local, at: Point, words: str) -> None:
    canvas.text(local.at(*at), words, 2.1, turn=local.turn)


def _tick(k: int) -> float:
    return 3.4 if k % 10 == 0 else 2.4 if k % 5 == 0 else 1.5


def _eighth(k: int) -> float:
    return 3.4 if k % 8 == 0 else 2.4 if k % 4 == 0 else 1.5


def _compass(canvas: Canvas, local: _Local) -> None:
    """Which way x and y run on this page, whichever way the strip's words do."""
    left, top = local.at(0, 0)
    if local.strip.turned:
        top -= local.compass
    x, y = left + 2.0, top + (1.2 if local.low else 2.4)
    arrow = local.compass - 6.0
    canvas.lines(
        [
            [(x, y), (x + arrow, y)],
            [(x + arrow - 1.8, y - 1.0), (x + arrow, y), (x + arrow - 1.8, y + 1.0)],
            [(x, y), (x, y + arrow)],
            [(x - 1.0, y + arrow - 1.8), (x, y + arrow), (x + 1.0, y + arrow - 1.8)],
        ],
        width=0.35,
    )
    canvas.text((x + arrow + 1.0, y + 0.9), "x", 3.0)
    canvas.text((x - 0.8, y + arrow + 3.2), "y", 3.0)
    canvas.text((x + 1.2, y + 3.2), "(0, 0)", 2.2)


def _overview_width(tile: Tile) -> float:
    return min(26.0, 14.0 * max(1.0, tile.columns / tile.rows))


def _overview(canvas: Canvas, local: _Local, tile: Tile, along: float) -> None:
    """All pages of the board in small, with this one marked."""
    cell = min(_overview_width(tile) / tile.columns, 14.0 / tile.rows)
    boxes = [
        _box(local, along + cell * column, 1.5 + cell * row, cell)
        for row in range(tile.rows)
        for column in range(tile.columns)
    ]
    here = boxes[tile.row * tile.columns + tile.column]
    canvas.lines(boxes, width=0.15, colour=GREY, closed=True)
    # Pale, and never dark, since dark cells in a grid are what detectors look for.
    canvas.lines([here], width=0.7, colour=GREY, closed=True)
    (x0, y0), (x1, y1) = here[0], here[2]
    canvas.lines([[(x0, y0), (x1, y1)], [(x0, y1), (x1, y0)]], width=0.2, colour=PALE)


def _box(local: _Local, along: float, across: float, size: float) -> list[Point]:
    steps = ((0.0, 0.0), (size, 0.0), (size, size), (0.0, size))
    return [local.at(along + a, across + b) for a, b in steps]
