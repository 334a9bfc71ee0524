"""Drawing on a page in millimetres from its top left corner, and pages as one PDF file.

The ink of a board as polygons: what the renderer calls dark, in one exact outline.

The ink's edges run along x and along y only, so its places are a grid of cells, each of one
colour, which the face itself tells. All cells that touch along a side become one polygon: black
next to black is one area, and no reader or printer can leave a white hair between them.
"""

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
from cubicfish_cli.boards.board import Face
from cubicfish_cli.printing.extra import drawing
from cubicfish_cli.types import BoolArray, FloatArray, IntArray

Along = Literal["left", "center", "right"]

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
                verticalalignment="baseline",
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


Corner = tuple[int, int]

# Edges nearer to each other than this share of the face are one edge, but for rounding.
_SAME = 1e-12
_RIGHT, _DOWN, _LEFT, _UP = range(4)
_STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))


def ink_outlines(
    face: Face, lower: tuple[float, float], upper: tuple[float, float]
) -> list[FloatArray]:
    """Closed outlines (K, 2) of the ink between two opposite corners, in the board's plane.

    Outlines have the ink on their right (y runs down), holes included, so that the rule of
    non-zero winding fills just the ink. Areas that only touch at a corner are apart.
    """
    x = _cuts(face.steps[0], lower[0], upper[0])
    y = _cuts(face.steps[1], lower[1], upper[1])
    middle = np.stack(np.meshgrid((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2), axis=-1)
    loops = _loops(face.is_dark(middle))
    return [np.stack([x[loop[:, 0]], y[loop[:, 1]]], axis=-1) for loop in loops]


def _cuts(steps: FloatArray, lower: float, upper: float) -> FloatArray:
    inside = np.unique(steps[(steps > lower) & (steps < upper)])
    cuts = np.concatenate([[lower], inside, [upper]])
    same = _SAME * max(abs(lower), abs(upper))
    return cuts[np.concatenate([[True], np.diff(cuts) > same])]


def _loops(dark: BoolArray) -> list[IntArray]:
    """(rows, columns) -> the corners (K, 2), as x and y, of each outline of the dark cells."""
    around = np.pad(dark, 1)
    inside = around[1:-1, 1:-1]
    ways: dict[Corner, list[int]] = {}
    # With the ink on the right: along a cell's top to the right, down its right side, and so on.
    for way, light, start in (
        (_RIGHT, ~around[:-2, 1:-1], (0, 0)),
        (_DOWN, ~around[1:-1, 2:], (1, 0)),
        (_LEFT, ~around[2:, 1:-1], (1, 1)),
        (_UP, ~around[1:-1, :-2], (0, 1)),
    ):
        row, column = np.nonzero(inside & light)
        for corner in zip((column + start[0]).tolist(), (row + start[1]).tolist(), strict=True):
            ways.setdefault(corner, []).append(way)
    return [np.array(loop, np.intp) for loop in _follow(ways)]


def _follow(ways: dict[Corner, list[int]]) -> list[list[Corner]]:
    """Corners of closed ways, of which each part leaves a corner in one of its ``ways``."""
    loops = []
    left = dict.fromkeys((corner, way) for corner, leaving in ways.items() for way in leaving)
    while left:
        first = corner, way = next(iter(left))
        loop: list[Corner] = []
        while True:
            del left[corner, way]
            before = way
            corner = (corner[0] + _STEPS[way][0], corner[1] + _STEPS[way][1])
            # Where two areas touch, a turn to the right stays with the same one.
            way = ways[corner][0] if len(ways[corner]) == 1 else (way + 1) % 4
            if way != before:
                loop.append(corner)
            if (corner, way) == first:
                break
        loops.append(loop)
    return loops
