"""Pages as one PDF file: a board's ink at true scale, and beside it what helps to print and cut it.

Nothing beside the board is a dark area with corners, so that no detector takes it for a pattern.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import FigureCanvasPdf, PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.transforms import Affine2D

from cubicfish_cli import __version__
from cubicfish_cli.app.board_faces import Face, board_face
from cubicfish_cli.app.drawing import drawing
from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.boards.types import AprilGrid
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.extensions.printing.layout import STRIP, Cut, Page, Point, Side

_INCH = 25.4
_POINT = _INCH / 72
_STYLE: dict[Any, Any] = {
    "font.family": ["DejaVu Sans"],
    "text.parse_math": False,
    # Letters stay letters, so that pages can be searched and print as sharp as the rest.
    "pdf.fonttype": 42,
    "pdf.compression": 6,
    "path.simplify": False,
}
# Along and across the strip, in millimetres: the sign of the axes, the ruler, lines of words.
_SIGN, _RULER_START, _RULER = 5.5, 12.0, 100
_RULER_LINE, _LINES = 4.4, (7.2, 9.6, 12.0)
_BESIDE_CUT = 1.6


def write_boards(path: Path, pages: Sequence[Page], *, date: datetime | None) -> None:
    """Write pages as one PDF file; without a ``date`` the same pages are the same bytes.

    Raises:
        OSError: the file cannot be written.

    """
    about = {
        "Title": ", ".join(page.board.name for page in pages),
        "Creator": f"cubicfish {__version__}",
        "Producer": f"matplotlib {mpl.__version__}",
        "CreationDate": date,
    }
    # In memory: the library cannot close a file that a full disk has cut short.
    memory = io.BytesIO()
    with drawing(_STYLE), PdfPages(memory, metadata=about) as document:
        for number, page in enumerate(pages, start=1):
            document.savefig(_drawn(page, f"page {number} of {len(pages)}"))
    path.write_bytes(memory.getvalue())


def _drawn(page: Page, number: str) -> Figure:
    """The page; every place on its axes is (x, y) in millimetres from its top left corner."""
    figure = Figure(figsize=(page.width / _INCH, page.height / _INCH), dpi=72)
    FigureCanvasPdf(figure)
    figure.patch.set_visible(False)
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, page.width), ylim=(page.height, 0))
    axes.set_axis_off()
    ink = ink_rectangles(board_face(page.board, margin=0.0)) + page.shift
    # One path: where black is next to black, no reader can leave a white hair between them.
    codes = [Outline.MOVETO, *[Outline.LINETO] * 3, Outline.CLOSEPOLY] * len(ink)
    closed = np.concatenate([ink, ink[:, :1]], axis=1).reshape(-1, 2)
    axes.add_patch(PathPatch(Outline(closed, codes), facecolor="black", linewidth=0))
    for side, cut in page.cuts.items():
        _draw_cut(axes, page, side, cut)
    _draw_strip(axes, page, number)
    return figure


def ink_rectangles(face: Face) -> FloatArray:
    """(N, 4, 2) rectangles that are the ink of a face, in the board's plane.

    Dark cells of a row that touch are one rectangle.
    """
    x, y = face.x, face.y
    change = np.diff(np.pad(face.dark, ((0, 0), (1, 1))).astype(int), axis=1)
    row, start = np.nonzero(change == 1)
    _, end = np.nonzero(change == -1)
    left, right, top, bottom = x[start], x[end], y[row], y[row + 1]
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    return np.stack([np.stack(corner, axis=-1) for corner in corners], axis=1)


def _draw_cut(axes: Axes, page: Page, side: Side, cut: Cut) -> None:
    """A line to cut along, and beyond it what the edge meets."""
    words = f"cut here: this edge meets the {cut.side} edge of {cut.board}"
    style: dict[str, Any] = {
        "color": "grey",
        "linewidth": 0.15 / _POINT,
        "linestyle": (0, (20, 10)),
    }
    upright = side in ("left", "right")
    beyond = cut.place + (-_BESIDE_CUT if side in ("left", "top") else _BESIDE_CUT + 2.2)
    middle = (page.height if upright else page.width) / 2
    if upright:
        axes.axvline(cut.place, **style)
    else:
        axes.axhline(cut.place, **style)
    at = (beyond, middle) if upright else (middle, beyond)
    _write(
        axes, at, words, 2.6, 0.8 * 2 * middle, turn=90.0 * upright, horizontalalignment="center"
    )


def _draw_strip(axes: Axes, page: Page, number: str) -> None:
    """The ruler, which way x and y run, and what the board is."""
    board = page.board
    left, top = page.strip
    place = Affine2D().translate(left, top)
    if page.turned:
        place = Affine2D().rotate_deg(-90).translate(left, top + page.length)
    turn = 90.0 * page.turned

    def at(along: float, across: float) -> Point:
        x, y = place.transform((along, across))
        return float(x), float(y)

    # Whichever way the strip's words run.
    axes.text(*at(_SIGN, STRIP / 2), "x →\ny ↓", fontsize=3.4 / _POINT, ha="center", va="center")
    millimetres = np.arange(_RULER + 1)
    length = np.select([millimetres % 10 == 0, millimetres % 5 == 0], [3.4, 2.4], 1.5)
    for k in millimetres.tolist():
        start, end = (
            at(_RULER_START + k, _RULER_LINE),
            at(_RULER_START + k, _RULER_LINE - length[k]),
        )
        axes.plot(*zip(start, end, strict=True), color="black", linewidth=0.12 / _POINT)
        if k % 10 == 0 and 0 < k < _RULER:
            _write(axes, at(_RULER_START + k + 0.4, _RULER_LINE - 2.1), f"{k}", 2.1, turn=turn)
    _write(axes, at(_RULER_START + _RULER + 0.5, _RULER_LINE - 1.2), "100 mm", 2.1, turn=turn)
    room = page.length - _RULER_START
    for across, words in zip(_LINES, _words(board, number), strict=True):
        _write(axes, at(_RULER_START, across), words, 2.1, room, turn=turn)


def _write(
    axes: Axes, at: Point, words: str, size: float, room: float = np.inf, *, turn: float, **how: Any
) -> None:
    """Write words, ``size`` millimetres high, or as small as makes them at most ``room`` long."""
    text = axes.text(
        *at, words, fontsize=size / _POINT, rotation=turn, rotation_mode="anchor", **how
    )
    extent = text.get_window_extent()
    length = (extent.height if turn else extent.width) * _POINT
    text.set_fontsize(min(1.0, room / length) * size / _POINT)


def _words(board: Board, number: str) -> tuple[str, str, str]:
    """What the strip says, in three lines."""
    if isinstance(board, AprilGrid):
        columns, rows, origin = board.columns // 2, board.rows // 2, "top left corner of its tag"
        what = f"{columns} x {rows} tags of {board.square:g} mm, spacing {board.spacing:g}"
    else:
        origin = f"inner corner; the square up-left of it is {board.first_square}"
        what = f"{board.columns} x {board.rows} inner corners, squares {board.square:g} mm"
    if board.markers is not None:
        first, last = board.markers.first, board.markers.first + board.markers.count - 1
        family = board.family if isinstance(board, AprilGrid) else board.markers.dictionary
        what += f", markers {board.markers.side:g} mm, {family}, ids {first} to {last}"
    return (
        f"{board.name}: {board.kind}, {what}",
        f"corner (0, 0), at the top left, is the {origin}",
        f"print at 100 %, no scaling: the ruler must measure 100 mm; cubicfish {__version__}, "
        f"{number}",
    )
