"""matplotlib figures as SVG in a page's own colours and fonts.

Figures are drawn in stand-in colours that become CSS variables, so that one drawing suits light
pages, dark pages and paper. What is drawn many times (dots, strokes, cells) is one path each.
Names that a user chose never enter a figure: legends and captions are the page's.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from cubicfish_cli.types import FloatArray

# Stand-ins for the page's colours, which no figure uses for anything else.
INK, MUTED, GRID, PAPER = "#0a0b01", "#0a0b02", "#0a0b03", "#0a0b04"
BLUE, ORANGE, GREEN, PURPLE, RED, SKY = (
    "#0a0b11", "#0a0b12", "#0a0b13", "#0a0b14", "#0a0b15", "#0a0b16",
)  # fmt: skip
VARIABLES = {
    INK: "--ink",
    MUTED: "--muted",
    GRID: "--grid",
    PAPER: "--card",
    BLUE: "--blue",
    ORANGE: "--orange",
    GREEN: "--green",
    PURPLE: "--purple",
    RED: "--red",
    SKY: "--sky",
}
# Width of every figure in its own units: 10 units of text are read on a phone and on a desk.
WIDTH = 360.0
_TEXT = 10.0

STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.family": ["DejaVu Sans"],
    "font.size": _TEXT,
    "axes.edgecolor": MUTED,
    "axes.facecolor": "none",
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.facecolor": "none",
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "text.color": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "path.simplify": False,
}


@dataclass(frozen=True, kw_only=True)
class Box:
    """A place in a figure, in its units from the top left."""

    left: float
    top: float
    width: float
    height: float


def new_figure(height: float) -> Figure:
    """An empty figure of the common width."""
    figure = Figure(figsize=(WIDTH / 72, height / 72), dpi=72)
    FigureCanvasSVG(figure)
    return figure


def add_axes(figure: Figure, box: Box) -> Axes:
    """Axes that fill a box."""
    height = figure.get_figheight() * 72
    bottom = height - box.top - box.height
    return figure.add_axes(
        (box.left / WIDTH, bottom / height, box.width / WIDTH, box.height / height)
    )


def svg_text(figure: Figure, name: str, label: str) -> str:
    """A figure as an ``svg`` element for a page.

    Args:
        figure: drawn within :func:`cubicfish_cli.printing.extra.drawing` in :data:`STYLE`.
        name: letters that no other figure of the page has; they start every id.
        label: what it shows, for those who cannot see it; plain text.

    """
    buffer = io.StringIO()
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(buffer, format="svg", metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    # It would hold for the whole page.
    text = re.sub(r"<style type=\"text/css\">[^<]*</style>", "", text)
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = _page_colours(_own_ids(text, name))
    text = re.sub(r"<(?!/)[^>]+>", _short_tag, text)
    text = re.sub(r">\s+<", "><", text)
    size = re.search(r'viewBox="[^"]*"', text)
    inner = text[text.index(">") + 1 :].strip()
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size[0] if size else ""} role="img" '
        f'aria-label="{escape(label)}">{inner}'
    )


def _own_ids(text: str, name: str) -> str:
    """The same with ids that start with a name, and none that nothing refers to."""
    named = dict.fromkeys(re.findall(r'(?:url\(|href=")#([^)"]+)', text))
    # matplotlib's ids are hashes with salt, of numbers in full: they differ from run to run.
    names = {old: f"{name}-{number}" for number, old in enumerate(named, start=1)}

    def own_id(found: re.Match[str]) -> str:
        return f' id="{names[found[1]]}"' if found[1] in names else ""

    text = re.sub(r'\sid="([^"]*)"', own_id, text)
    text = re.sub(r"url\(#([^)]+)\)", lambda found: f"url(#{names[found[1]]})", text)
    text = re.sub(r'(?:xlink:)?href="#([^"]+)"', lambda found: f'href="#{names[found[1]]}"', text)
    return text.replace(' xmlns:xlink="http://www.w3.org/1999/xlink"', "")


def _page_colours(text: str) -> str:
    """The same in the page's colours and letters."""
    text = re.sub(r"font-family: [^;\"]*;? ?", "", text)
    text = re.sub(r"font: ([0-9.]+px) [^;\"]*", r"font-size: \1", text)
    for colour, variable in VARIABLES.items():
        text = text.replace(colour, f"var({variable})")
    return text


def _short_tag(tag: re.Match[str]) -> str:
    """A tag with short numbers and spaces."""
    text = re.sub(r"-?[0-9]+\.[0-9]{3,}", lambda number: f"{float(number[0]):.2f}", tag[0])
    return re.sub(r"\s+", " ", text)


def dots(axes: Axes, at: FloatArray, colour: str, size: float, alpha: float = 1.0) -> None:
    """Discs at (N, 2), all in one path: strokes of no length with round ends."""
    strokes(axes, np.stack([at, at], axis=1), colour, size, alpha)


def strokes(
    axes: Axes,
    ends: FloatArray,
    colour: str,
    width: float = 0.8,
    alpha: float = 1.0,
    closed: bool = False,
) -> None:
    """Lines (N, K, 2) in data coordinates, all in one path."""
    style = {"capstyle": "round", "joinstyle": "round", "alpha": alpha}
    _path(axes, ends, closed, fill=False, edgecolor=colour, linewidth=width, **style)


def areas(axes: Axes, polygons: FloatArray, colour: str, alpha: float = 1.0) -> None:
    """Filled polygons (N, K, 2) in data coordinates, all in one path."""
    _path(axes, polygons, True, facecolor=colour, edgecolor="none", alpha=alpha)


def _path(axes: Axes, lines: FloatArray, closed: bool, **style: Any) -> None:
    if not len(lines):
        return
    codes = np.full(lines.shape[:2], Outline.LINETO, np.uint8)
    codes[:, 0] = Outline.MOVETO
    if closed:
        lines = np.concatenate([lines, lines[:, :1]], axis=1)
        codes = np.concatenate([codes, np.full((len(lines), 1), Outline.CLOSEPOLY, np.uint8)], 1)
    # Not add_patch: it looks at every segment, to scale axes that have their scale.
    axes.add_artist(PathPatch(Outline(lines.reshape(-1, 2), codes.ravel()), **style))


def rectangles(left: FloatArray, top: FloatArray, width: float, height: float) -> FloatArray:
    """Corners (N, 4, 2) of rectangles of one size by their (N,) left and top edges."""
    x, y = np.stack([left, left + width]), np.stack([top, top + height])
    return np.stack(
        [np.stack([x[i], y[j]], axis=-1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))], axis=1
    )
