"""Figures of pages: their style, and where cameras stand in space."""

import io
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from cubicfish_cli.app.drawing import lay_out
from cubicfish_cli.core.types import FloatArray, IntArray

INK, MUTED = "#1d2329", "#57606a"
BLUE, ORANGE, GREEN, PURPLE, RED = "#0072b2", "#d98200", "#00805d", "#b5609b", "#c84e00"
BOARD_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, RED)
STYLE: dict[Any, Any] = {
    # The same drawing has the same ids in every run.
    "svg.hashsalt": "cubicfish",
    "svg.fonttype": "none",
    "font.size": 10,
    "savefig.dpi": 150,
    "axes.edgecolor": MUTED,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#dfe3e8",
    "axes.axisbelow": True,
}
WIDTH = 5.0
"""Of every figure, inches."""
MOST_DOTS = 4000
# Half of what a drawn camera sees, as a share of its length.
_HALF_FIELD = 0.6


@dataclass(frozen=True, kw_only=True)
class Key:
    """An entry of a legend: a mark of a kind (``dot``, ``line``, ``dash``, ``area``), its words.

    Legends are the page's: names that a user chose never enter a drawing.
    """

    kind: str
    colour: str
    text: str


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A figure for the page.

    Attributes:
        name: short, for ids.
        title: what it is.
        label: what it shows, for those who cannot see it.
        image: the drawing, as a data URI.
        caption: the text below it.
        keys: its legend.

    """

    name: str
    title: str
    label: str
    image: str
    caption: str
    keys: tuple[Key, ...] = ()


def new_figure(height: float = 3.3) -> Figure:
    """Return an empty figure of the common width; heights are in inches."""
    return Figure(figsize=(WIDTH, height), layout="constrained")


def finished(figure: Figure, **more: Any) -> Drawn:
    """Finish a figure; ``more`` are further fields of :class:`Drawn`."""
    lay_out(figure)
    data = io.BytesIO()
    undated = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(data, format="svg", metadata=undated)
    image = "data:image/svg+xml;base64," + b64encode(data.getvalue()).decode()
    return Drawn(image=image, **more)


def some(count: int, most: int) -> IntArray:
    """At most ``most`` of so many indices, evenly from first to last."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, most).round().astype(np.intp))


def thinned(count: int, most: int, what: str) -> str:
    """Return the caption's remark where not everything is drawn."""
    return f" {most:,} of {count:,} {what} are drawn." if count > most else ""


def dots(axes: Axes, at: FloatArray, colour: str, size: float, alpha: float = 1.0) -> None:
    """Discs at (N, 2), as one picture: thousands of them would make a large file."""
    axes.scatter(
        at[:, 0], at[:, 1], s=size**2, color=colour, alpha=alpha, linewidths=0, rasterized=True
    )


def upright(ahead: FloatArray, up: FloatArray) -> FloatArray:
    """Return (3, 3): rows right, ahead and up of who looks ahead, as upright as possible."""
    trials = [(a, b) for b in (up, *np.eye(3)[::-1]) for a in (ahead, *np.eye(3))]
    for one, other in trials:
        across = np.cross(one, other)
        lengths = float(np.linalg.norm(one) * np.linalg.norm(other))
        if np.linalg.norm(across) > max(0.1 * lengths, 1e-9):
            break
    top, right = other / np.linalg.norm(other), across / np.linalg.norm(across)
    return np.stack([right, np.cross(top, right), top])


def draw_cameras(
    axes: Axes3D, centre: FloatArray, rotation: FloatArray, size: float, colours: Sequence[str]
) -> None:
    """Draw small pyramids at (N, 3) that open the way cameras look, rotations (N, 3, 3)."""
    a, b = size * _HALF_FIELD, 0.75 * size * _HALF_FIELD
    base = np.array([[-a, -b, size], [a, -b, size], [a, b, size], [-a, b, size]])
    tip = np.zeros(3)
    path = np.array([tip, base[0], base[1], tip, base[1], base[2], tip, base[2], base[3], tip,
                     base[3], base[0]])  # fmt: skip
    strokes = np.einsum("nji,kj->nki", rotation, path) + centre[:, None]
    axes.add_collection3d(Line3DCollection(list(strokes), colors=list(colours), linewidths=0.8))


def show_evenly(axes: Axes3D, points: FloatArray, elevation: float, azimuth: float) -> None:
    """Show all points (N, 3), at one scale along all axes, seen from somewhere."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    half = 0.55 * float(np.ptp(points, axis=0).max() or 1.0)
    axes.set(
        **{f"{name}lim": (at - half, at + half) for name, at in zip("xyz", middle, strict=True)}
    )
    axes.set_box_aspect((1, 1, 1), zoom=1.1)
    axes.set_proj_type("ortho")
    axes.view_init(elev=elevation, azim=azimuth)
    axes.tick_params(labelsize=7)
    if elevation > 80:
        axes.set_zticks([])
