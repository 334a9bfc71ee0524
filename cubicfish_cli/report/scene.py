"""The target and where the photos were taken from, in two parallel views."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cubicfish_cli.printing.extra import drawing
from cubicfish_cli.report.facts import Facts
from cubicfish_cli.report.figures import (
    BOARD_COLOURS,
    MOST_DOTS,
    Drawn,
    Key,
    finished,
    key,
    some,
)
from cubicfish_cli.report.svg import (
    BLUE,
    INK,
    STYLE,
    WIDTH,
    Box,
    add_axes,
    areas,
    dots,
    new_figure,
    strokes,
)
from cubicfish_cli.types import FloatArray
from cubicfish_cli.units import round_down

_HEIGHT = 280.0
_FOOT = 24.0
# Size of a drawn camera, as a share of all that is drawn.
_CAMERA = 0.06
_HALF_FIELD = 0.6


def scene_figures(facts: Facts) -> dict[str, Drawn]:
    """Both views, by name; none where no pose is known."""
    placed = [photo for photo in facts.photos if photo.rotation is not None]
    if not placed:
        return {}
    rotation = np.array([photo.rotation for photo in placed])
    translation = np.array([photo.translation for photo in placed])
    centre = -np.einsum("nij,ni->nj", rotation, translation)
    plates = [] if facts.target is None else [board.outline() for board in facts.target.boards]
    loose = np.zeros((0, 3))
    if not plates and facts.errors is not None:
        world = facts.errors.pairs.world
        loose = world[some(len(world), MOST_DOTS // 4)]
    solid = np.concatenate([*plates, loose, centre[:0]])
    middle = solid.mean(axis=0) if len(solid) else centre.mean(axis=0)
    away, up = _directions(centre - middle, -rotation[:, 1])
    right = np.cross(up, away)
    aside = 0.55 * away + 0.75 * right + 0.35 * up
    with drawing(STYLE):
        views = {
            "scene-side": ("Where the photos were taken from", aside, up, "from aside"),
            "scene-top": ("The same from above", up + 0.15 * away, -away, "from above"),
        }
        return {
            name: _view(facts, name, title, (to_viewer, upright), words,
                        (plates, loose, centre, rotation))
            for name, (title, to_viewer, upright, words) in views.items()
        }  # fmt: skip


def _directions(offsets: FloatArray, ups: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where the cameras are on the whole, and which way is up in most photos: unit vectors."""
    length = np.linalg.norm(offsets, axis=1, keepdims=True)
    away = (offsets / np.maximum(length, 1e-12)).mean(axis=0)
    if np.linalg.norm(away) < 0.05:
        away = np.array([1.0, 0.0, 0.0])
    away = away / np.linalg.norm(away)
    up = ups.mean(axis=0)
    for trial in (up, *np.eye(3)[::-1]):
        across = trial - away * (trial @ away)
        if np.linalg.norm(across) > 0.2:
            return away, across / np.linalg.norm(across)
    return away, np.roll(away, 1)


def _view(
    facts: Facts,
    name: str,
    title: str,
    directions: tuple[FloatArray, FloatArray],
    words: str,
    solids: tuple[Sequence[FloatArray], FloatArray, FloatArray, FloatArray],
) -> Drawn:
    plates, loose, centre, rotation = solids
    forward, upright = directions
    forward = forward / np.linalg.norm(forward)
    right = np.cross(upright, forward)
    right /= np.linalg.norm(right)
    flat = np.stack([right, np.cross(forward, right)]).T
    everything = np.concatenate([*plates, loose, centre]) @ flat
    size = _CAMERA * float(np.ptp(everything, axis=0).max() or 1.0)
    cameras = frusta(centre, rotation, size) @ flat
    everything = np.concatenate([everything, cameras.reshape(-1, 2)])
    figure = new_figure(_HEIGHT + _FOOT)
    axes = add_axes(figure, Box(left=4, top=4, width=WIDTH - 8, height=_HEIGHT))
    unit = at_one_scale(axes, everything)
    keys: list[Key] = []
    boards = facts.target.boards if facts.target else ()
    several = len(plates) <= len(BOARD_COLOURS)
    for index, (board, plate) in enumerate(zip(boards, plates, strict=True)):
        colour = BOARD_COLOURS[index] if several else BLUE
        if board.points is None:
            areas(axes, (plate @ flat)[None], colour, 0.25)
            strokes(axes, (plate @ flat)[None], colour, 1.0, closed=True)
        else:
            dots(axes, plate[some(len(plate), MOST_DOTS // 4)] @ flat, colour, 2.0)
        if several:
            keys.append(key("area", colour, board.name))
    dots(axes, loose @ flat, BLUE, 1.6)
    strokes(axes, cameras, INK, 0.7, 0.75)
    length = scale_bar(figure, unit, _HEIGHT)
    keys.append(key("line", INK, "a photo: the open side looks at the target"))
    units = f" {facts.units}" if facts.units else " in the units of the target"
    return finished(
        figure,
        name=name,
        title=title,
        label=f"{len(plates)} boards and {len(centre)} camera poses, seen {words}",
        caption=f"{len(centre):,} photo{'s' * (len(centre) != 1)}; the bar is {length:g}{units}.",
        keys=tuple(keys),
    )


def scale_bar(figure: Figure, unit: float, top: float) -> float:
    """Draw a bar of a round length below a view that ends at ``top``; returns that length.

    Args:
        figure: that the view is in.
        unit: the world's length of a unit of the figure.
        top: where the view ends, in the figure's units.

    """
    length = round_down(90 * unit)
    place = 8 / (figure.get_figheight() * 72)
    scale = add_axes(figure, Box(left=8, top=top + 8, width=length / unit, height=8))
    scale.set_axis_off()
    scale.set_xlim(0, 1)
    scale.set_ylim(0, 1)
    strokes(scale, np.array([[[0.0, 0.5], [1.0, 0.5]]]), INK, 1.6)
    figure.text((14 + length / unit) / WIDTH, place + 0.012, f"{length:g}", va="center")
    return length


def at_one_scale(axes: Axes, points: FloatArray, height: float = _HEIGHT) -> float:
    """Show all points at one scale, without axes; returns the world's length of a unit."""
    axes.set_axis_off()
    low, high = points.min(axis=0), points.max(axis=0)
    room = np.array([WIDTH - 24, height - 16])
    unit = float(np.max((high - low) / room)) or 1.0
    middle, half = (low + high) / 2, unit * np.array([WIDTH - 8, height]) / 2
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    return unit


def frusta(centre: FloatArray, rotation: FloatArray, size: float) -> FloatArray:
    """(N, K, 3) strokes of small pyramids that open the way the cameras look."""
    a, b = size * _HALF_FIELD, 0.75 * size * _HALF_FIELD
    base = np.array([[-a, -b, size], [a, -b, size], [a, b, size], [-a, b, size]])
    tip = np.zeros(3)
    path = np.array([tip, base[0], base[1], tip, base[1], base[2], tip, base[2], base[3], tip,
                     base[3], base[0]])  # fmt: skip
    return np.einsum("nji,kj->nki", rotation, path) + centre[:, None]
