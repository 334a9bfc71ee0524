"""One page: a board's ink at true scale, and around it what helps to print, cut and glue it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from cubicfish_cli.printing.canvas import GREY, Canvas
from cubicfish_cli.printing.layout import BAND, OVERLAP, Page, Point, Rect, Tile
from cubicfish_cli.printing.outline import ink_outlines
from cubicfish_cli.printing.sheet import Side
from cubicfish_cli.printing.strip import draw_strip

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
    """What of the page belongs to the joined object: up to its cuts or the printer's reach."""
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
