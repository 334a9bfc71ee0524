"""Figures of pages: their style, and where cameras stand in space."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish import FloatArray
from cubicfish_cli.render.pages.plot import Plot, Space, document

BLUE, ORANGE, GREEN, PURPLE, RED = "#0072b2", "#d98200", "#00805d", "#b5609b", "#c84e00"
BOARD_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, RED)
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


def finished(*plots: Plot, **more: Any) -> Drawn:
    """Finish a figure of some plots; ``more`` are further fields of :class:`Drawn`."""
    return Drawn(image=document(plots), **more)


def some(count: int, most: int) -> npt.NDArray[np.intp]:
    """At most ``most`` of so many indices, evenly from first to last."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, most).round().astype(np.intp))


def thinned(count: int, most: int, what: str) -> str:
    """Return the caption's remark where not everything is drawn."""
    return f" {most:,} of {count:,} {what} are drawn." if count > most else ""


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
    space: Space, centre: FloatArray, rotation: FloatArray, size: float, colours: Sequence[str]
) -> None:
    """Draw small pyramids at (N, 3) that open the way cameras look, rotations (N, 3, 3)."""
    strokes = camera_strokes(centre, rotation, size)
    for colour in dict.fromkeys(colours):
        own = [stroke for stroke, its in zip(strokes, colours, strict=True) if its == colour]
        space.lines(own, colour, 0.8)


def camera_strokes(centre: FloatArray, rotation: FloatArray, size: float) -> FloatArray:
    """Return the lines (N, 12, 3) of small pyramids, as :func:`draw_cameras` draws them."""
    a, b = size * _HALF_FIELD, 0.75 * size * _HALF_FIELD
    base = np.array([[-a, -b, size], [a, -b, size], [a, b, size], [-a, b, size]])
    tip = np.zeros(3)
    path = np.array([tip, base[0], base[1], tip, base[1], base[2], tip, base[2], base[3], tip,
                     base[3], base[0]])  # fmt: skip
    return np.asarray(np.einsum("nji,kj->nki", rotation, path) + centre[:, None])
