"""Drawing on a page in millimetres from its top left corner, and pages as one PDF file."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_pdf import FigureCanvasPdf, PdfPages
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.text import Text
from matplotlib.textpath import TextToPath
from matplotlib.transforms import Affine2D

from cubicfish_cli import __version__
from cubicfish_cli.printing.extra import drawing
from cubicfish_cli.types import FloatArray

Along = Literal["left", "center", "right"]
Upright = Literal["top", "center", "baseline", "bottom"]

INK, GREY, PALE = "#000000", "#808080", "#c8c8c8"
_INCH = 25.4
_POINT = _INCH / 72
_SMALLEST_TEXT = 1.4
STYLE: dict[Any, Any] = {
    "font.family": ["DejaVu Sans"],
    # Letters stay letters, so that pages can be searched and print as sharp as the rest.
    "pdf.fonttype": 42,
    "pdf.compression": 6,
    "path.simplify": False,
}


class Canvas:
    """A page of paper; every place is (x, y) in millimetres from its top left corner, y down."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        self.figure = Figure(figsize=(width / _INCH, height / _INCH), dpi=72)
        FigureCanvasPdf(self.figure)
        self.figure.patch.set_visible(False)
        self._drawn = 0
        self._page = (
            Affine2D().scale(1 / _INCH, -1 / _INCH).translate(0, height / _INCH)
            + self.figure.dpi_scale_trans
        )

    def fill(self, outlines: Sequence[FloatArray], colour: str = INK) -> None:
        """Fill closed outlines (K, 2) at once, by the rule of non-zero winding."""
        if outlines:
            self._path(outlines, closed=True, facecolor=colour, edgecolor="none", linewidth=0)

    def lines(
        self,
        lines: Iterable[Sequence[tuple[float, float]] | FloatArray],
        *,
        width: float = 0.2,
        colour: str = INK,
        dashes: tuple[float, float] | None = None,
        closed: bool = False,
    ) -> None:
        """Draw lines through points, ``width`` wide; ``dashes`` are line and gap."""
        style = (0.0, tuple(length / width for length in dashes)) if dashes else "-"
        self._path(
            [np.asarray(line, float) for line in lines],
            closed=closed,
            facecolor="none",
            edgecolor=colour,
            linewidth=width / _POINT,
            linestyle=style,
            capstyle="butt",
            joinstyle="miter",
        )

    def text(
        self,
        at: tuple[float, float],
        words: str,
        size: float,
        *,
        along: Along = "left",
        upright: Upright = "baseline",
        turn: float = 0.0,
        bold: bool = False,
        colour: str = INK,
        room: float | None = None,
    ) -> None:
        """Write words, ``size`` high (the em), turned by so many degrees to the left.

        Words longer than ``room`` are made smaller, and if that is not enough, cut short.
        """
        if room is not None:
            words, size = fitted(words, size, room, bold=bold)
        self._add(
            Text(
                *at,
                text=words,
                fontsize=size / _POINT,
                fontweight="bold" if bold else "normal",
                color=colour,
                horizontalalignment=along,
                verticalalignment=upright,
                rotation=turn,
                rotation_mode="anchor",
                parse_math=False,
                transform=self._page,
            )
        )

    def _path(self, lines: Sequence[FloatArray], *, closed: bool, **style: Any) -> None:
        if not lines:
            return
        points, codes = [], []
        for line in lines:
            end = [line[:1]] if closed else []
            points += [line, *end]
            codes += [Outline.MOVETO, *[Outline.LINETO] * (len(line) - 1)]
            codes += [Outline.CLOSEPOLY] * len(end)
        patch = PathPatch(
            Outline(np.concatenate(points), np.array(codes, np.uint8)),
            transform=self._page,
            clip_on=False,
            **style,
        )
        self._add(patch)

    def _add(self, artist: Artist) -> None:
        """What comes later covers what came before, words and areas alike."""
        self._drawn += 1
        artist.set_zorder(self._drawn)
        self.figure.add_artist(artist)


def fitted(words: str, size: float, room: float, *, bold: bool = False) -> tuple[str, float]:
    """Words and their size so that they are at most ``room`` millimetres long."""
    length = length_of(words, size, bold=bold)
    if length <= room:
        return words, size
    size = max(size * room / length, min(_SMALLEST_TEXT, size))
    while len(words) > 1 and length_of(words, size, bold=bold) > room:
        words = words[:-2].rstrip() + "…"
    return words, size


def length_of(words: str, size: float, *, bold: bool = False) -> float:
    """How long words are, in millimetres."""
    return _length(words, bold) * size


@cache
def _length(words: str, bold: bool) -> float:
    """How long words are, in their own size."""
    with drawing(STYLE):
        font = FontProperties(family=["DejaVu Sans"], weight="bold" if bold else "normal", size=100)
        width, _, _ = TextToPath().get_text_width_height_descent(words, font, ismath=False)
    return float(width) / 100


def write_pdf(path: Path, title: str, pages: Iterable[Canvas], *, date: datetime | None) -> None:
    """Write pages as one PDF file; without a ``date`` the same pages are the same bytes.

    Raises:
        OSError: the file cannot be written.

    """
    about = {
        "Title": title,
        "Creator": f"cubicfish {__version__}",
        "Producer": f"matplotlib {mpl.__version__}",
        "CreationDate": date,
    }
    # In memory: the library cannot close a file that a full disk has cut short.
    memory = io.BytesIO()
    with PdfPages(memory, metadata=about) as document:
        for page in pages:
            document.savefig(page.figure)
    path.write_bytes(memory.getvalue())
