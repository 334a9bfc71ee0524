"""What is written for a target: its boards' pages, and one that says how sheets are joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import combinations
from pathlib import Path

import numpy as np

from cubicfish_cli import __version__
from cubicfish_cli.printing.canvas import GREY, STYLE, Canvas, ink_outlines, length_of, write_pdf
from cubicfish_cli.printing.extra import drawing
from cubicfish_cli.printing.layout import Page
from cubicfish_cli.printing.page import draw_pages
from cubicfish_cli.printing.sheet import SIDES, Sheet, Side
from cubicfish_cli.rendering.object_drawing import Picture, picture_of
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray
from cubicfish_cli.words.catalogue import catalogue

SIZES = {"A4": (210.0, 297.0), "Letter": (215.9, 279.4)}
_MARGIN = 14.0
_TEXT, _LINE = 3.1, 4.3
_DRAWING = 96.0
_NET = 30.0
_PAPER, _SHADE, _PRINT = "#ffffff", "#e9e6df", "#3c424d"
_ORIGIN, _X, _Y = "#d6336c", "#e8590c", "#1c7ed6"
# Pairs of boards whose distances are listed where no edges are shared.
_MOST_PAIRS = 10
# Which two corners of a sheet's outline a side joins.
_ENDS: dict[Side, tuple[int, int]] = {
    "left": (3, 0), "top": (0, 1), "right": (1, 2), "bottom": (2, 3),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Words:
    """What the page says, besides the drawings.

    Attributes:
        title: the target.
        steps: what to do, one after the other.

    """

    title: str
    steps: tuple[str, ...]


def assembly_page(sheets: Sequence[Sheet], words: Words, *, letter: bool) -> Canvas:
    """Draw the page.

    Args:
        sheets: the target's sheets, with boards in their places, in millimetres.
        words: what it says.
        letter: on US letter paper instead of A4.

    """
    width, height = SIZES["Letter" if letter else "A4"]
    canvas = Canvas(width, height)
    y = _MARGIN + 4.0
    canvas.text((_MARGIN, y), words.title, 5.2, bold=True, room=width - 2 * _MARGIN)
    y += 3.0
    y += _draw_object(canvas, sheets, y, width)
    if any(sheet.seams for sheet in sheets):
        y = _draw_sheets(canvas, sheets, y + 5.0, width) + 5.0
    y += 5.0
    for number, step in enumerate(words.steps, start=1):
        canvas.text((_MARGIN, y), f"{number}.", _TEXT, bold=True)
        y = _paragraph(canvas, (_MARGIN + 6.0, y), step, width - 2 * _MARGIN - 6.0) + 1.2
    y += 2.0
    _draw_table(canvas, y, height - _MARGIN - 6.0, lengths(sheets), width)
    canvas.text(
        (_MARGIN, height - _MARGIN + 2.0),
        f"cubicfish {__version__}; this page is not to scale, the boards' pages are",
        2.4,
        colour=GREY,
    )
    return canvas


def lengths(sheets: Sequence[Sheet]) -> list[tuple[str, str, tuple[float, ...]]]:
    """What can be measured with a ruler: (where, from what to what, millimetres)."""
    rows: list[tuple[str, str, tuple[float, ...]]] = []
    for sheet in sheets:
        board = sheet.board
        c, r = board.columns - 1, board.rows - 1
        right, down = board.plane_points(c, r).tolist()
        rows.append((board.name, f"(0, 0) to ({c}, 0) / to (0, {r})", (right, down)))
    by_name = {sheet.board.name: sheet for sheet in sheets}
    pairs = []
    for sheet in sheets:
        for side, seam in sheet.seams.items():
            other = by_name.get(seam.board)
            if other is None or sheet.board.name > seam.board:
                continue
            pairs.append((sheet, other))
            near = (_to_edge(sheet, side), _to_edge(other, seam.side))
            what = f"to corners of {sheet.board.name} / of {seam.board}"
            rows.append((f"edge {seam.letter}", what, near))
    for one, other in (pairs or list(combinations(sheets, 2)))[:_MOST_PAIRS]:
        if _see_each_other(one, other):
            rows.append(_across(one, other))
    return rows


def _to_edge(sheet: Sheet, side: Side) -> float:
    """From a side of the sheet to the nearest column or row of corners."""
    board = sheet.board
    axis = 0 if side in ("left", "right") else 1
    edge = sheet.outline[_ENDS[side][0], axis]
    last = board.plane_points(board.columns - 1, board.rows - 1)[axis]
    return float(-edge if side in ("left", "top") else edge - last)


def _see_each_other(one: Sheet, other: Sheet) -> bool:
    """Whether a straight line goes from face to face through the open."""
    way = _outermost(other)[0].mean(axis=0) - _outermost(one)[0].mean(axis=0)
    return bool(way @ one.board.axes[2] < 0 < way @ other.board.axes[2])


def _outermost(sheet: Sheet) -> tuple[FloatArray, list[tuple[int, int]]]:
    """The four outermost corners: world points (4, 3), and which they are."""
    c, r = sheet.board.columns - 1, sheet.board.rows - 1
    names = [(0, 0), (c, 0), (c, r), (0, r)]
    column, row = np.array(names).T
    return sheet.board.world_points(column, row), names


def _across(one: Sheet, other: Sheet) -> tuple[str, str, tuple[float, ...]]:
    """The largest distance between outermost corners, which tells most about the angle."""
    (a, names_a), (b, names_b) = _outermost(one), _outermost(other)
    distance = np.linalg.norm(a[:, None] - b, axis=-1)
    i, j = np.unravel_index(int(distance.argmax()), distance.shape)
    return (
        f"{one.board.name} – {other.board.name}",
        f"{names_a[i]} to {names_b[j]}",
        (float(distance[i, j]),),
    )


def _world(sheet: Sheet, plane: FloatArray) -> FloatArray:
    return np.asarray(sheet.board.origin + plane @ sheet.board.axes[:2])


def _draw_object(canvas: Canvas, sheets: Sequence[Sheet], top: float, width: float) -> float:
    """The target as someone in front of it sees it; returns how much height it took."""
    target = Target(units="mm", boards=tuple(sheet.board for sheet in sheets))
    plates = [_world(sheet, sheet.outline) for sheet in sheets]
    picture, height = picture_of(
        target,
        np.concatenate(plates),
        size=(width - 2 * _MARGIN, _DRAWING),
        margin=4.0,
        lowest=30.0,
    )
    shift = np.array([_MARGIN, top])
    order = sorted(range(len(sheets)), key=lambda k: plates[k].mean(0) @ picture.to_viewer)
    for index in order:
        _draw_plate(canvas, sheets[index], picture, shift)
    seen = {sheet.board.name for sheet in sheets if picture.faces(sheet.board)}
    for sheet in sheets:
        for side, seam in sheet.seams.items():
            # Each edge once, and none that is behind it all or before it all.
            if sheet.board.name < seam.board and seen & {sheet.board.name, seam.board}:
                ends = _world(sheet, sheet.outline[list(_ENDS[side])])
                _badge(canvas, picture.at(ends.mean(axis=0)) + shift, seam.letter)
    canvas.text(
        (width / 2, top + height + 1.0),
        "dot: corner (0, 0)   orange: x, columns   blue: y, rows",
        2.4,
        along="center",
        colour=GREY,
    )
    return height + 1.0


def _draw_plate(canvas: Canvas, sheet: Sheet, picture: Picture, shift: FloatArray) -> None:
    outline = picture.at(_world(sheet, sheet.outline)) + shift
    board = sheet.board
    if not picture.faces(board):
        canvas.lines([outline], width=0.25, colour=GREY, dashes=(1.5, 1.0), closed=True)
        x, y = outline.mean(axis=0)
        canvas.text((x, y + 1.0), f"{board.name} (its back)", 2.6, along="center", colour=GREY)
        return
    canvas.fill([outline], _PAPER)
    canvas.lines([outline], width=0.25, colour=GREY, closed=True)
    loops = ink_outlines(sheet.face, sheet.face.lower, sheet.face.upper)
    canvas.fill([picture.at(_world(sheet, loop)) + shift for loop in loops], _PRINT)
    start = picture.at(board.origin) + shift
    for axis, colour in ((board.x_axis, _X), (board.y_axis, _Y)):
        end = picture.at(board.origin + 2 * board.square * axis) + shift
        canvas.lines([[tuple(start), tuple(end)]], width=0.7, colour=colour)
    canvas.fill([start + 1.1 * _circle()], _ORIGIN)
    _name(canvas, outline.mean(axis=0), board.name)


def _draw_sheets(canvas: Canvas, sheets: Sequence[Sheet], top: float, width: float) -> float:
    """The sheets in a row, each with the letters of its edges; returns where they end."""
    extent = [np.ptp(sheet.outline, axis=0) for sheet in sheets]
    gap = 9.0
    room = width - 2 * _MARGIN - gap * (len(sheets) - 1)
    scale = min(room / sum(size[0] for size in extent), _NET / max(size[1] for size in extent))
    left = _MARGIN
    for sheet, size in zip(sheets, extent, strict=True):
        place = np.array([left, top]) - scale * sheet.outline[0]
        outline = scale * sheet.outline + place
        inner = sheet.printed.corners
        canvas.fill([scale * inner + place], _SHADE)
        canvas.lines([outline], width=0.2, colour=GREY, closed=True)
        for side in SIDES:
            seam = sheet.seams.get(side)
            if seam is not None:
                ends = outline[list(_ENDS[side])]
                canvas.lines([ends], width=0.6)
                _badge(canvas, ends.mean(axis=0), seam.letter)
        middle = scale * inner.mean(axis=0) + place
        canvas.text((middle[0], middle[1] + 1.0), sheet.board.name, 3.2, bold=True, along="center",
                    room=0.8 * scale * size[0])  # fmt: skip
        left += scale * size[0] + gap
    return float(top + scale * max(size[1] for size in extent))


def _badge(canvas: Canvas, at: FloatArray, letter: str) -> None:
    canvas.fill([at + 2.1 * _circle()], _PAPER)
    canvas.lines([at + 2.1 * _circle()], width=0.3, closed=True)
    canvas.text((at[0], at[1] + 1.05), letter, 3.0, bold=True, along="center")


def _name(canvas: Canvas, at: FloatArray, words: str) -> None:
    half = length_of(words, 3.6, bold=True) / 2 + 1.2
    box = at + np.array([[-half, -2.4], [half, -2.4], [half, 2.4], [-half, 2.4]])
    canvas.fill([box], _PAPER)
    canvas.text((at[0], at[1] + 1.3), words, 3.6, bold=True, along="center")


def _circle() -> FloatArray:
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _paragraph(canvas: Canvas, at: tuple[float, float], words: str, room: float) -> float:
    """Write words in lines; returns where the next line would be."""
    x, y = at
    line = ""
    for word in [*words.split(" "), ""]:
        longer = f"{line} {word}".strip()
        if word and length_of(longer, _TEXT) <= room:
            line = longer
            continue
        canvas.text((x, y), line, _TEXT)
        line, y = word, y + _LINE
    return y


def _draw_table(
    canvas: Canvas,
    top: float,
    bottom: float,
    rows: Sequence[tuple[str, str, tuple[float, ...]]],
    width: float,
) -> None:
    """Lengths in two columns, as many as there is room for."""
    canvas.text(
        (_MARGIN, top), "Between corners, in millimetres: measure, and compare", 3.2, bold=True
    )
    step = 3.9
    fits = max(1, int((bottom - top) / step) - 1)
    half = (width - 2 * _MARGIN + 8.0) / 2
    per_column = min(fits, -(-len(rows) // 2))
    for index, (where, what, values) in enumerate(rows[: 2 * per_column]):
        column, row = divmod(index, per_column)
        x, y = _MARGIN + column * half, top + step * (row + 1.3)
        canvas.text((x, y), where, 2.7, bold=True, room=24.0)
        canvas.text((x + 25.0, y), what, 2.7, room=half - 8.0 - 25.0 - 24.0)
        shown = " / ".join(f"{value:.1f}" for value in values)
        canvas.text((x + half - 8.0, y), shown, 2.7, along="right")


_US_PAPER = ("Letter", "Legal", "Tabloid", "Ledger", "ANSI")


def write_boards(path: Path, pages: Sequence[Page], *, date: datetime | None) -> None:
    """Write the boards' pages as one PDF file; the same pages are the same bytes.

    Raises:
        OSError: the file cannot be written.

    """
    names = dict.fromkeys(page.sheet.board.name for page in pages)
    with drawing(STYLE):
        write_pdf(path, ", ".join(names), draw_pages(pages), date=date)


def write_assembly(
    path: Path, sheets: Sequence[Sheet], words: Words, paper: str, *, date: datetime | None
) -> None:
    """Write the page that says how sheets are joined, as a PDF file.

    Raises:
        OSError: the file cannot be written.

    """
    with drawing(STYLE):
        page = assembly_page(sheets, words, letter=paper.startswith(_US_PAPER))
        write_pdf(path, words.title, [page], date=date)


def words_for(kind: str | None, paper: str) -> Words:
    """What the page says about a target of a kind that is made here, or (None) any other."""
    said = catalogue().assembly
    names = ["print", "place", "measure", "then"]
    if kind is not None:
        spare = ["spare"] * (kind != "corner")
        names = ["print", "glue", "outside" if kind == "block" else "inside", *spare, *names[2:]]
    steps = tuple(said[name].format(paper=paper) for name in names)
    return Words(title=said[f"{kind or 'any'}_title"], steps=steps)
