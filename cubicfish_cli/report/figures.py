"""The figures of a page: where the corners are, how far off they are, and what the lens is like."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import Transform, blended_transform_factory
from scipy.special import xlogy

from cubicfish_cli.assess.uncertainty import recorded_grid, recorded_uncertainty, sigma_at
from cubicfish_cli.fitting.alignment import aligned_difference
from cubicfish_cli.fitting.findings import FieldCells
from cubicfish_cli.fitting.statistics import rms_px
from cubicfish_cli.geometry import inside_polygon
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.sphere import ray_at
from cubicfish_cli.printing.extra import drawing
from cubicfish_cli.rendering.difference_picture import COLOURS
from cubicfish_cli.report.facts import ErrorFacts, Facts
from cubicfish_cli.report.svg import (
    BLUE,
    GREEN,
    GRID,
    INK,
    ORANGE,
    PAPER,
    PURPLE,
    RED,
    STYLE,
    VARIABLES,
    WIDTH,
    Box,
    add_axes,
    areas,
    dots,
    new_figure,
    rectangles,
    strokes,
    svg_text,
)
from cubicfish_cli.types import FloatArray, IntArray
from cubicfish_cli.units import round_down, round_up

MOST_DOTS = 4000
_MOST_STROKES = 1500
_CELLS = 8  # along the shorter side, as coverage counts them
_FINE_CELLS = 12
BOARD_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, RED)
_STEP_DEG = 5.0
# 95 of 100 arrows are at most this share of the picture's longer side.
_ARROW_SHARE = 0.04
# Share of errors beyond four σ that noise alone does not explain.
_HEAVY_TAIL = 0.001
# Steps of angle whose RMS is this many times the typical one are called a worse rim.
_WORSE_RIM = 3.0
_BANDS = 5
# Room for the labels of a y axis, also where small pages have larger letters.
_LEFT = 60.0
# Width of a letter there.
_LETTER = 8.0
_MOST_BANDS = 7
# Points of a grid through which a smooth surface is laid.
_FEWEST_POINTS, _MOST_POINTS = 6, 1000


@dataclass(frozen=True, kw_only=True)
class Key:
    """An entry of a legend: a mark of a kind (``dot``, ``line``, ``dash``, ``area``), its words."""

    kind: str
    colour: str
    text: str


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A figure for the page.

    Attributes:
        name: short, for ids.
        title: what it is.
        svg: the drawing.
        caption: what it tells.
        keys: its legend.
        axes: what the page's script needs to tell values under the pointer; empty for none.

    """

    name: str
    title: str
    svg: str
    caption: str
    keys: tuple[Key, ...] = ()
    axes: str = ""


def finished(figure: Figure, *, name: str, label: str, **more: Any) -> Drawn:
    """A figure that is finished; ``label`` is for those who cannot see it, ``more`` as above."""
    return Drawn(name=name, svg=svg_text(figure, name, label), **more)


def key(kind: str, colour: str, text: str) -> Key:
    """An entry of a legend, by a stand-in colour or by one that stays as it is."""
    variable = VARIABLES.get(colour)
    return Key(kind=kind, colour=f"var({variable})" if variable else colour, text=text)


def readout(axes: Axes, x: str, y: str, digits: tuple[int, int] = (0, 0)) -> str:
    """Where axes are in their drawing, and what they count: units behind x and y, and digits."""
    figure = axes.figure
    assert isinstance(figure, Figure)
    at, height = axes.get_position(), figure.get_figheight() * 72
    box = (WIDTH * at.x0, height * (1 - at.y1), WIDTH * at.width, height * at.height)
    numbers = (*box, *axes.get_xlim(), *axes.get_ylim(), *digits)
    return "|".join((" ".join(f"{float(number):.6g}" for number in numbers), x, y))


def all_figures(facts: Facts) -> dict[str, Drawn]:
    """Every figure that these facts allow, by its name."""
    makers: list[Callable[[], Drawn | None]] = []
    errors = facts.errors
    if errors is not None:
        makers += [
            lambda: coverage_figure(facts, errors),
            lambda: vectors_figure(facts, errors),
            lambda: places_figure(facts, errors),
            lambda: angle_figure(errors),
            lambda: histogram_figure(errors),
        ]
    camera = facts.camera
    if isinstance(camera, CubicCamera):
        makers += [lambda: profile_figure(facts, camera), lambda: uncertainty_figure(facts, camera)]
    with drawing(STYLE):
        drawn = [make() for make in makers]
    return {figure.name: figure for figure in drawn if figure is not None}


def some(count: int, most: int) -> IntArray:
    """At most ``most`` of so many indices, evenly from first to last."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, most).round().astype(np.intp))


def thinned(count: int, most: int, what: str) -> str:
    """What a caption says where not everything is drawn."""
    return f" {most:,} of {count:,} {what} are drawn." if count > most else ""


def coverage_figure(facts: Facts, errors: ErrorFacts) -> Drawn:
    """Where the corners are, and the cells of the field that hold none."""
    figure, axes = _photo_axes(facts.camera.image_size)
    pixel, pairs = errors.pairs.pixel, errors.pairs
    outline = facts.outline
    empty = _empty_cells(errors.cells)
    areas(axes, empty, RED, 0.22)
    shown = some(len(pixel), MOST_DOTS)
    boards = pairs.boards if 1 < len(pairs.boards) <= len(BOARD_COLOURS) else ()
    keys = []
    if boards:
        for index, board in enumerate(boards):
            own = shown[pairs.board[shown] == index]
            dots(axes, pixel[own], BOARD_COLOURS[index], 2.0)
            keys.append(key("dot", BOARD_COLOURS[index], board))
    else:
        dots(axes, pixel[shown], BLUE, 2.0)
        keys.append(key("dot", BLUE, "corner"))
    if len(outline) > 2:
        strokes(axes, outline[None], INK, 0.9, closed=True)
        keys.append(key("line", INK, "where the camera may be trusted"))
    if len(empty):
        keys.append(key("area", RED, "no corner here"))
    share = facts.number("coverage")
    caption = "" if share is None else f"Corners cover {100 * share:.0f} % of the field."
    if len(empty):
        caption += " What a camera says of places without corners nobody has checked."
    return finished(
        figure,
        name="coverage",
        axes=readout(axes, " px", " px"),
        title="Where the corners are",
        label=f"{len(pixel)} corners over the photo, and {len(empty)} parts of the field without "
        "any",
        caption=(caption + thinned(len(pixel), MOST_DOTS, "corners")).strip(),
        keys=tuple(keys),
    )


def arrow_zoom(facts: Facts, errors: ErrorFacts) -> float:
    """How many times as long as they are errors are drawn, so that most can be seen."""
    typical = float(np.percentile(errors.length, 95))
    return round_down(_ARROW_SHARE * max(facts.camera.image_size) / max(typical, 1e-9))


def vectors_figure(facts: Facts, errors: ErrorFacts) -> Drawn:
    """Residuals as arrows, magnified."""
    width, height = facts.camera.image_size
    length = errors.length
    typical = float(np.percentile(length, 95))
    zoom = arrow_zoom(facts, errors)
    figure, axes = _photo_axes(facts.camera.image_size, foot=22)
    shown = some(len(length), _MOST_STROKES)
    start = errors.pairs.pixel[shown]
    ends = np.stack([start, start + zoom * errors.residual[shown]], axis=1)
    strokes(axes, ends, BLUE, 0.7, 0.85)
    dots(axes, start, INK, 1.3)
    sample = round_down(0.16 * max(width, height) / zoom)
    drawn = zoom * sample / width * axes.get_position().width
    left = float(axes.get_position().x0)
    y = 7 / (figure.get_figheight() * 72)
    figure.add_artist(_line([left, left + drawn], [y, y]))
    figure.text(left + drawn + 6 / WIDTH, y, f"{sample:g} px", va="center", color=INK)
    return finished(
        figure,
        name="vectors",
        axes=readout(axes, " px", " px"),
        title="Errors as arrows",
        label=f"Reprojection errors as arrows, {zoom:g} times as long as they are; the 95th "
        f"percentile is {typical:.3f} px",
        caption=f"From each detected corner towards where the camera puts it, {zoom:g} times as "
        "long. Noise points every way; neighbours that point one way are an error of the camera, "
        "of the target or of the corner finder." + thinned(len(length), _MOST_STROKES, "errors"),
        keys=(key("dot", INK, "detected corner"), key("line", BLUE, f"its error, {zoom:g} ×")),
    )


def places_figure(facts: Facts, errors: ErrorFacts) -> Drawn:
    """RMS error in cells over the photo."""
    width, height = facts.camera.image_size
    cell = min(width, height) / _FINE_CELLS
    columns, rows = -(-width // cell), -(-height // cell)
    column, row = np.floor((errors.pairs.pixel + 0.5) / cell).astype(int).T
    column, row = np.clip(column, 0, int(columns) - 1), np.clip(row, 0, int(rows) - 1)
    place = row * int(columns) + column
    count = np.bincount(place, minlength=int(columns * rows))
    square = np.bincount(place, errors.length**2, minlength=int(columns * rows))
    hit = np.flatnonzero(count)
    value = np.sqrt(square[hit] / count[hit])
    top = round_up(float(np.percentile(value, 95)))
    colours = _band_colours(_BANDS)
    band = np.clip((value / top * _BANDS).astype(int), 0, _BANDS - 1)
    figure, axes = _photo_axes(facts.camera.image_size, foot=34)
    y, x = np.divmod(hit, int(columns))
    for index, colour in enumerate(colours):
        own = band == index
        areas(axes, rectangles(x[own] * cell - 0.5, y[own] * cell - 0.5, cell, cell), colour)
    if len(facts.outline) > 2:
        strokes(axes, facts.outline[None], INK, 0.9, closed=True)
    edges = [f"{top * i / _BANDS:.3g}" for i in range(_BANDS + 1)]
    edges[-1] += "+" * bool(value.max() > top)
    _scale_bar(figure, colours, edges, "px RMS")
    return finished(
        figure,
        name="places",
        axes=readout(axes, " px", " px"),
        title="Errors over the picture",
        label=f"RMS error in {len(hit)} cells of the photo, from {value.min():.3f} to "
        f"{value.max():.3f} px",
        caption="RMS of the corners in each cell. A rim much worse than the middle means blur "
        "there, or a lens that the model does not follow.",
    )


def angle_figure(errors: ErrorFacts) -> Drawn | None:
    """Error by angle from the axis."""
    angle, length = errors.angle_deg, errors.length
    if angle is None:
        return None
    bins = np.floor(angle / _STEP_DEG).astype(int)
    used = np.unique(bins)
    rms = np.array([rms_px(errors.residual[bins == index]) for index in used])
    number = np.array([int((bins == index).sum()) for index in used])
    top = 1.15 * max(float(np.percentile(length, 99)), float(rms.max()), 1e-9)
    figure = new_figure(240)
    axes = add_axes(figure, Box(left=_LEFT, top=8, width=WIDTH - _LEFT - 10, height=194))
    axes.grid(True)
    shown = some(len(length), MOST_DOTS // 2)
    inside = shown[length[shown] <= top]
    dots(axes, np.stack([angle[inside], length[inside]], axis=-1), BLUE, 1.6, 0.6)
    steps = np.stack([used, used + 1], axis=-1) * _STEP_DEG
    strokes(axes, np.stack([steps, np.stack([rms, rms], axis=-1)], axis=-1), ORANGE, 2.4)
    axes.set_xlim(0, float(_STEP_DEG * (used.max() + 1)))
    axes.set_ylim(0, top)
    axes.set_xlabel("angle from the axis, degrees")
    axes.set_ylabel("error, px")
    _beside_ticks(axes)
    beyond = int((length > top).sum())
    few = int(number.min())
    return finished(
        figure,
        name="angle",
        axes=readout(axes, "°", " px", (1, 3)),
        title="Errors by angle from the axis",
        label=f"Errors by angle from the axis; RMS from {rms.min():.3f} to {rms.max():.3f} px in "
        f"steps of {_STEP_DEG:g} degrees",
        caption=_worse_rim(used, rms)
        + f"The least filled step holds {few:,} corner{'s' * (few != 1)}."
        + (f" Larger errors, above the figure: {beyond:,}." if beyond else "")
        + thinned(len(length), MOST_DOTS // 2, "corners"),
        keys=(
            key("dot", BLUE, "a corner"),
            key("line", ORANGE, f"RMS of {_STEP_DEG:g}° each"),
        ),
    )


def _worse_rim(steps: IntArray, rms: FloatArray) -> str:
    """Where errors grow towards the rim, in words; empty where they do not."""
    worse = rms > _WORSE_RIM * np.median(rms)
    outer = len(rms) - int(np.argmin(worse[::-1])) if not worse.all() else len(rms)
    if outer == len(rms):
        return ""
    times = float(rms[outer:].max() / np.median(rms))
    return (
        f"Beyond {_STEP_DEG * steps[outer]:.0f}° errors are up to {times:.0f} times the usual: "
        "trust the camera less there. "
    )


def histogram_figure(errors: ErrorFacts) -> Drawn:
    """Residuals along x and y against the normal distribution of the same spread."""
    values = errors.residual.ravel()
    sigma = max(1.4826 * float(np.median(np.abs(values - np.median(values)))), 1e-9)
    reach = 4.0 * sigma
    number, edges = np.histogram(values, bins=40, range=(-reach, reach))
    counts = 100 * number / len(values)
    step = float(edges[1] - edges[0])
    x = np.linspace(-reach, reach, 121)
    normal = 100 * step * np.exp(-0.5 * (x / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
    figure = new_figure(240)
    axes = add_axes(figure, Box(left=_LEFT, top=8, width=WIDTH - _LEFT - 10, height=194))
    axes.grid(True, axis="y")
    bars = np.concatenate([rectangles(edges[i : i + 1], np.zeros(1), 0.9 * step, float(share))
                           for i, share in enumerate(counts)])  # fmt: skip
    areas(axes, bars, BLUE, 0.8)
    strokes(axes, np.stack([x, normal], axis=-1)[None], ORANGE, 2)
    axes.set_xlim(-reach, reach)
    axes.set_ylim(0, 1.08 * float(max(counts.max(), normal.max())))
    axes.set_xlabel("error along x or y, px")
    axes.set_ylabel("share, %")
    _beside_ticks(axes)
    beyond = float(np.mean(np.abs(values) > reach))
    heavy = beyond > _HEAVY_TAIL
    return finished(
        figure,
        name="histogram",
        axes=readout(axes, " px", " %", (3, 1)),
        title="How errors are spread",
        label="Histogram of errors along x and y with the normal distribution of sigma "
        f"{sigma:.4f} px",
        caption=f"{100 * beyond:.2g} % lie beyond four σ, where a normal distribution has 0.006 %"
        + (": corners that were found worse than most, which weigh little in the fit." * heavy)
        + "." * (not heavy),
        keys=(
            key("area", BLUE, "errors along x and along y"),
            key("line", ORANGE, f"normal, σ = {sigma:.3f} px (from the median)"),
        ),
    )


def profile_figure(facts: Facts, camera: CubicCamera) -> Drawn:
    """Radius by angle, beside the reference and ideal lenses."""
    theta = np.deg2rad(np.linspace(0, camera.max_angle_deg, 61))[1:]
    azimuth = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    sine = np.sin(theta)[:, None]
    rays = np.stack(
        [sine * np.cos(azimuth), sine * np.sin(azimuth),
         np.broadcast_to(np.cos(theta)[:, None], (len(theta), len(azimuth)))],
        axis=-1,
    )  # fmt: skip
    radial = camera.radial
    middle = np.array([radial.cx, radial.cy])
    own = np.linalg.norm(camera.project(rays) - camera.project([0.0, 0.0, 1.0]), axis=-1)
    outwards = radial.project(rays) - middle
    other = np.linalg.norm(outwards, axis=-1)
    # The poses make up for a rotation between the two, which is no difference of lenses.
    miss, _ = aligned_difference(camera, radial, rays.reshape(-1, 3))
    difference = (miss.reshape((*rays.shape[:-1], 2)) * outwards).sum(axis=-1) / other
    known = np.isfinite(difference).all(axis=1)
    degrees = np.rad2deg(theta)
    focal = (radial.fx + radial.fy) / 2
    ideals = (
        ("equidistant, f θ", GREEN, focal * theta),
        ("stereographic, 2 f tan(θ/2)", PURPLE, 2 * focal * np.tan(theta / 2)),
        ("equisolid, 2 f sin(θ/2)", RED, 2 * focal * np.sin(theta / 2)),
    )
    figure = new_figure(330)
    axes = add_axes(figure, Box(left=_LEFT, top=8, width=WIDTH - _LEFT - 10, height=170))
    below = add_axes(figure, Box(left=_LEFT, top=200, width=WIDTH - _LEFT - 10, height=88))
    for part in (axes, below):
        part.grid(True)
        part.set_xlim(0, float(degrees[-1]))
        _beside_ticks(part)
    for _, colour, radius in ideals:
        axes.plot(degrees, radius, color=colour, linewidth=0.9, linestyle=(0, (4, 2)))
    axes.plot(degrees[known], other.mean(axis=1)[known], color=ORANGE, linewidth=3.2)
    axes.plot(degrees, own.mean(axis=1), color=BLUE, linewidth=1.4)
    axes.set_ylim(0, 1.12 * float(own.mean(axis=1).max()))
    axes.set_ylabel("radius, px")
    axes.tick_params(labelbottom=False)
    low, high = difference[known].min(axis=1), difference[known].max(axis=1)
    below.fill_between(degrees[known], low, high, color=BLUE, alpha=0.25, linewidth=0)
    below.plot(degrees[known], difference[known].mean(axis=1), color=BLUE, linewidth=1.4)
    below.axhline(0, color=ORANGE, linewidth=1.2)
    below.set_ylabel("difference, px")
    below.set_xlabel("angle from the axis θ, degrees")
    largest = float(np.abs(difference[known]).max()) if known.any() else 0.0
    return finished(
        figure,
        name="profile",
        title="The lens: radius by angle",
        label=f"Radius by angle from the axis to {camera.max_angle_deg:.0f} degrees, beside the "
        "radial reference, which differs by up to "
        f"{largest:.1f} px, and three ideal lenses of focal length {focal:.0f} px",
        caption="Below, how much farther out the camera sees than the radial reference, a rotation "
        "between them taken out: the line is the mean over all directions, the band goes from the "
        "least to the most, and no radial lens follows it. Ideal lenses with the reference's focal "
        f"length, f = {focal:.0f} px.",
        keys=(
            key("line", BLUE, "this camera, mean over all directions"),
            key("line", ORANGE, "radial reference (Kannala–Brandt)"),
            *(key("dash", colour, text) for text, colour, _ in ideals),
        ),
    )


def uncertainty_figure(facts: Facts, camera: CubicCamera) -> Drawn | None:
    """How far the camera's own pixels may be off, over the photo."""
    record = recorded_grid(facts.fit)
    if record is None:
        return None
    width, height = camera.image_size
    x, y = np.linspace(0, width - 1, 97), np.linspace(0, height - 1, 73)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    sigma = _smooth_sigma(record, grid.reshape(-1, 2)).reshape(grid.shape[:2])
    inside = inside_polygon(grid.reshape(-1, 2), facts.outline)
    hole = np.zeros((0, 2))
    if facts.errors and facts.errors.cells.blind:  # where the camera sees itself
        around = np.linspace(0, 2 * np.pi, 180)
        hole = camera.project(ray_at(np.full(180, facts.errors.cells.blind), around))
        inside &= ~inside_polygon(grid.reshape(-1, 2), hole)
    shown = sigma[inside.reshape(sigma.shape) & np.isfinite(sigma)]
    if not len(shown):
        return None
    levels = _levels(float(shown.min()), float(shown.max()))
    colours = _band_colours(len(levels) - 1)
    figure, axes = _photo_axes(camera.image_size, foot=34)
    known = np.ma.masked_invalid(np.clip(sigma, levels[0], levels[-1]))
    bands = axes.contourf(x, y, known, levels=levels, colors=colours)
    edge = axes.fill(*facts.outline.T, facecolor="none", edgecolor=INK, linewidth=0.9)[0]
    bands.set_clip_path(edge)
    axes.fill(*hole.T, facecolor=PAPER, linewidth=0)
    _scale_bar(figure, colours, [f"{level:g}" for level in levels], "px")
    figures = recorded_uncertainty(facts.fit)
    return finished(
        figure,
        name="uncertainty",
        axes=readout(axes, " px", " px"),
        title="How certain the camera is",
        label=f"Uncertainty of a distant point's pixel over the photo, from {shown.min():.3f} "
        f"to {shown.max():.3f} px",
        caption="How far the pixel of a distant point would be elsewhere, had you taken other "
        "photos"
        + (f": {figures.words}" if figures else "")
        + ". Errors of the target or of the model are not in it.",
    )


def _smooth_sigma(record: Mapping[str, Any], pixel: FloatArray) -> FloatArray:
    """Uncertainty at pixels (N, 2): a smooth surface through the grid's points, and beyond."""
    x, y = np.meshgrid(record["x"], record["y"])
    sigma = np.array(record["sigma_px"], float)
    known = sigma > 0
    if not _FEWEST_POINTS <= known.sum() <= _MOST_POINTS:
        return sigma_at(record, pixel)
    points, logs = np.column_stack([x[known], y[known]]), np.log(sigma[known])
    try:
        smooth = _least_bent(points / x.max(), logs, pixel / x.max())
    except np.linalg.LinAlgError:  # all on one line
        return sigma_at(record, pixel)
    return np.exp(np.clip(smooth, logs.min(), logs.max()))


def _least_bent(points: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """The thin plate through values (N,) at points (N, 2), at others (M, 2) -> (M,).

    Duchon (1977). SciPy's takes a fifth of a second to load, for this alone.

    Raises:
        numpy.linalg.LinAlgError: all points are on one line.

    """

    def terms(of: FloatArray) -> FloatArray:
        square = np.sum(np.square(of[:, None] - points), axis=2)
        return np.column_stack([xlogy(square, square), np.ones(len(of)), of])

    own = terms(points)
    whole = np.concatenate([own, np.pad(own[:, -3:].T, ((0, 0), (0, 3)))])
    weights = np.linalg.solve(whole, np.pad(values, (0, 3)))
    return np.asarray(terms(at) @ weights)


def _photo_axes(size: tuple[int, int], foot: float = 0.0) -> tuple[Figure, Axes]:
    """Axes of a photo's shape, y down, with ``foot`` units of room below for a scale."""
    width, height = size
    most = (WIDTH - 46.0, 300.0)
    scale = min(most[0] / width, most[1] / height)
    box = Box(left=36, top=8, width=scale * width, height=scale * height)
    figure = new_figure(box.height + 28 + foot)
    axes = add_axes(figure, box)
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    for side in axes.spines.values():
        side.set_visible(True)
        side.set_color(GRID)
    axes.locator_params(nbins=5)
    return figure, axes


def _beside_ticks(axes: Axes) -> None:
    """The label of the y axis at the figure's edge, clear of the ticks' labels."""
    axes.yaxis.set_label_coords(16 / WIDTH, 0.5, transform=_across(axes))


def _across(axes: Axes) -> Transform:
    """X as a share of the figure, y as a share of the axes."""
    return blended_transform_factory(axes.figure.transFigure, axes.transAxes)


def _scale_bar(figure: Figure, colours: Sequence[str], edges: Sequence[str], unit: str) -> None:
    """Bands of colour with their edges' values at the foot of a figure."""
    height = figure.get_figheight() * 72
    width = WIDTH - 100
    axes = add_axes(figure, Box(left=36, top=height - 30, width=width, height=9))
    axes.set_axis_off()
    axes.set_xlim(0, len(colours))
    axes.set_ylim(0, 1)
    for index, colour in enumerate(colours):
        areas(axes, rectangles(np.array([float(index)]), np.zeros(1), 1, 1), colour)
    # Not every edge is named where names would touch, with the larger letters of a small page too.
    room = _LETTER * max(map(len, edges)) + 6
    every = max(1, int(np.ceil(room * len(colours) / width)))
    for index, text in enumerate(edges):
        if index % every == 0:
            axes.text(index, -0.6, text, ha="center", va="top", fontsize=9.5)
    axes.text(len(colours) + 0.03 * len(colours), 0.5, unit, ha="left", va="center", fontsize=9.5)


def _band_colours(count: int) -> list[str]:
    place = np.linspace(0, len(COLOURS) - 1, max(count, 1)).round().astype(int)
    return ["#{:02x}{:02x}{:02x}".format(*COLOURS[index].tolist()) for index in place]


def _levels(low: float, high: float) -> list[float]:
    """Round numbers around all from the lowest to the highest; over a wide span they grow."""
    low = max(low, high / 1e4, 1e-9)
    high = max(high, 1.05 * low)
    if high < 3 * low:
        step = round_up((high - low) / _MOST_BANDS)
        series = step * np.arange(np.floor(low / step), np.ceil(high / step) + 2)
    else:
        powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.floor(np.log10(high)) + 2)
        series = (powers[:, None] * [1, 1.5, 2, 3, 5, 7]).ravel()
    begin = int(np.searchsorted(series, low * 1.000001)) - 1
    end = max(int(np.searchsorted(series, high * 0.999999)), begin + 1)
    every = -(-(end - begin) // _MOST_BANDS)
    return [float(f"{level:.4g}") for level in series[max(begin, 0) : end + every : every]]


def _empty_cells(cells: FieldCells) -> FloatArray:
    """(N, 4, 2) the squares of the field that hold no corner."""
    row, column = np.nonzero(cells.empty)
    left, top = column.astype(float) * cells.cell, row.astype(float) * cells.cell
    return rectangles(left - 0.5, top - 0.5, cells.cell, cells.cell)


def _line(x: Sequence[float], y: Sequence[float]) -> Line2D:
    return Line2D(x, y, color=BLUE, linewidth=2, solid_capstyle="butt")
