"""Pages as one PDF file: a board at true scale, with a ruler, words and lines to cut along.

Nothing beside the board is a dark area with corners, so that no detector takes it for a pattern.
"""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.text import Text
from matplotlib.transforms import Affine2D

from cubicfish import FloatArray
from cubicfish.scene import board_face
from cubicfish.target import Board
from cubicfish_cli import __version__
from cubicfish_cli.extensions.printing.layout import STRIP, Cut, Page, Side
from cubicfish_cli.render.drawing import drawing

_INCH = 25.4
_POINT = _INCH / 72
_STYLE: dict[Any, Any] = {
    "font.family": ["DejaVu Sans"],
    "text.parse_math": False,
    # Text stays text, so that pages can be searched and print as sharp as the rest.
    "pdf.fonttype": 42,
    "pdf.compression": 6,
    "path.simplify": False,
}
# Along and across the strip, in millimetres: the sign of the axes, the ruler, lines of words.
_SIGN, _RULER_START, _RULER = 5.5, 12.0, 100
_RULER_LINE, _LINES = 4.4, (7.2, 9.6, 12.0)
_BESIDE_CUT = 1.6
# White that the other ruler needs beside the board, and length of its words.
_CROSS_ROOM, _LETTERS = 4.0, 10.0


def write_boards(path: Path, pages: Sequence[Page]) -> None:
    """Write pages as one PDF file; the same pages are the same bytes.

    Raises:
        OSError: the file cannot be written.

    """
    about = {
        "Title": ", ".join(page.board.name for page in pages),
        "Creator": f"cubicfish {__version__}",
        "CreationDate": None,
    }
    # In memory: the library cannot close a file that a full disk has cut short.
    memory = io.BytesIO()
    with drawing(_STYLE), PdfPages(memory, metadata=about) as document:
        for number, page in enumerate(pages, start=1):
            document.savefig(_draw(page, f"page {number} of {len(pages)}"))
    path.write_bytes(memory.getvalue())


def _draw(page: Page, number: str) -> Figure:
    """Draw a page; every place on its axes is (x, y) in millimetres from its top left corner."""
    figure = Figure(figsize=(page.width / _INCH, page.height / _INCH), dpi=72)
    axes = figure.add_axes((0, 0, 1, 1), xlim=(0, page.width), ylim=(page.height, 0))
    axes.set_axis_off()
    # One path: where black is next to black, no reader can leave a white hair between them.
    ink = Outline.make_compound_path_from_polys(ink_rectangles(page.board) + page.shift)
    axes.add_patch(PathPatch(ink, facecolor="black", linewidth=0))
    for side, cut in page.cuts.items():
        _draw_cut(axes, page, side, cut)
    _draw_strip(axes, page, number)
    _draw_cross_ruler(axes, page)
    return figure


def ink_rectangles(board: Board) -> FloatArray:
    """Return (N, 4, 2) rectangles of a board's ink, in its plane."""
    face = board_face(board, margin=0.0)
    row, column = np.nonzero(face.dark)
    cell = np.stack([column, row], axis=-1)[:, None] + Board.AROUND_SQUARE
    return np.stack([face.x[cell[..., 0]], face.y[cell[..., 1]]], axis=-1)


def _draw_cut(axes: Axes, page: Page, side: Side, cut: Cut) -> None:
    """Draw a line to cut along, and before it, on what is kept, the board that the edge meets."""
    words = f"cut here: this edge meets the {cut.side} edge of {cut.board}"
    within = cut.place + (_BESIDE_CUT + 2.2 if side in ("left", "top") else -_BESIDE_CUT)
    upright = side in ("left", "right")
    draw_line = axes.axvline if upright else axes.axhline
    draw_line(cut.place, color="grey", linewidth=0.15 / _POINT, linestyle=(0, (20, 10)))
    length = page.height if upright else page.width
    at = (within, length / 2) if upright else (length / 2, within)
    text = axes.text(*at, words, ha="center", rotation=90.0 * upright, rotation_mode="anchor")
    _fit(text, 2.6, 0.8 * length)


def _draw_strip(axes: Axes, page: Page, number: str) -> None:
    """Draw the ruler, the directions of x and y, and the board's description."""
    turn = Affine2D().rotate_deg(-90).translate(0, page.length) if page.turned else Affine2D()
    place = turn.translate(*page.strip) + axes.transData

    def write(along: float, across: float, words: str, room: float = np.inf) -> None:
        text = axes.text(along, across, words, transform=place, rotation_mode="anchor")
        text.set_rotation(90.0 * page.turned)
        _fit(text, 2.1, room)

    # Whichever way the strip's words run.
    axes.text(
        _SIGN,
        STRIP / 2,
        "x →\ny ↓",
        transform=place,
        fontsize=3.4 / _POINT,
        ha="center",
        va="center",
    )
    tick = np.arange(_RULER + 1)
    length = np.select([tick % 10 == 0, tick % 5 == 0], [3.4, 2.4], 1.5)
    axes.vlines(
        _RULER_START + tick,
        _RULER_LINE - length,
        _RULER_LINE,
        transform=place,
        color="black",
        linewidth=0.12 / _POINT,
    )
    for k in range(10, _RULER, 10):
        write(_RULER_START + k + 0.4, _RULER_LINE - 2.1, f"{k}")
    write(_RULER_START + _RULER + 0.5, _RULER_LINE - 1.2, "100 mm")
    for across, words in zip(_LINES, _write_words(page.board, number), strict=True):
        write(_RULER_START, across, words, page.length - _RULER_START)


def _draw_cross_ruler(axes: Axes, page: Page) -> None:
    """Draw a ruler at right angles to the strip's, in the white beside the board.

    A printer may stretch one way and not the other.
    """
    across = int(page.turned)
    sides: tuple[tuple[Side, Side], ...] = (("left", "right"), ("top", "bottom"))
    size, inset = (page.width, page.height), page.strip[across]
    face = board_face(page.board, margin=0.0)
    inks = [np.add(one, page.shift) for one in (face.lower, face.upper)]

    def limits(axis: int, low: float, high: float) -> tuple[float, float]:
        first, last = (page.cuts.get(side) for side in sides[axis])
        return first.place if first else low, last.place if last else high

    low, high = limits(across, inset, inset + page.length)
    start, stop = limits(1 - across, inset, size[1 - across] - inset)
    strip = page.strip[1 - across]
    start, stop = (start, strip) if strip > size[1 - across] / 2 else (strip + STRIP, stop)
    length = min(_RULER, 10 * int((stop - start - _LETTERS) / 10))
    bands = [
        # Beside a cut stand words.
        (room >= _CROSS_ROOM and side not in page.cuts, room, edge, inwards)
        for side, room, edge, inwards in zip(
            sides[across],
            (inks[0][across] - low, high - inks[1][across]),
            (low, high),
            (1.0, -1.0),
            strict=True,
        )
    ]
    _, room, edge, inwards = max(bands)
    if room < _CROSS_ROOM or length < 10:
        return
    tick = np.arange(length + 1)
    ends = edge + inwards * np.select([tick % 10 == 0, tick % 5 == 0], [2.4, 1.8], 1.2)
    draw = axes.hlines if across == 0 else axes.vlines
    low_ends, high_ends = np.minimum(edge, ends), np.maximum(edge, ends)
    draw(start + tick, low_ends, high_ends, color="black", linewidth=0.12 / _POINT)
    at = (edge + inwards * 1.2, start + length + 0.5 * _LETTERS)
    axes.text(
        *(at if across == 0 else at[::-1]),
        f"{length} mm",
        fontsize=1.8 / _POINT,
        ha="center",
        va="center",
        rotation=90.0 * (across == 0),
    )


def _fit(text: Text, size: float, room: float) -> None:
    """Make letters ``size`` millimetres high, or as small as makes them at most ``room`` long."""
    text.set_fontsize(size / _POINT)
    extent = text.get_window_extent()
    length = max(extent.width, extent.height) * _POINT
    text.set_fontsize(min(1.0, room / length) * size / _POINT)


def _write_words(board: Board, number: str) -> tuple[str, str, str]:
    """Return the three lines of text of the strip."""
    if board.kind == "aprilgrid":
        columns, rows, origin = board.columns // 2, board.rows // 2, "top-left corner of its tag"
        what = f"{columns} x {rows} tags of {board.square:g} mm, spacing {board.spacing:g}"
    else:
        origin = f"inner corner of the board; the square up-left of it is {board.first_square}"
        what = f"{board.columns} x {board.rows} inner corners, squares {board.square:g} mm"
    if board.markers is not None:
        first, last = board.markers.first, board.markers.first + board.markers.count - 1
        what += f", markers {board.markers.side:g} mm, {board.family}, ids {first} to {last}"
    return (
        f"{board.name}: {board.kind}, {what}",
        f"corner (0, 0) is the top-left {origin}",
        "print at 100 %, no scaling: the rulers along x and y must measure what they say; "
        f"cubicfish {__version__}, {number}",
    )
