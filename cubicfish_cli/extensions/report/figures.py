"""The figures of a page: the corners' places and errors, and the lens."""

import numpy as np

from cubicfish import CubicCamera, FloatArray, aligned_difference
from cubicfish.models import angle_from_axis
from cubicfish.sufficiency import CoverageGaps
from cubicfish_cli.inputs.calibration_facts import ErrorFacts, Facts
from cubicfish_cli.render.difference_picture import round_up
from cubicfish_cli.render.pages import figures as page
from cubicfish_cli.render.pages.plot import (
    INK,
    Plot,
    colour_bar,
    colours,
    nice_step,
    picture_plot,
    wide_plot,
)
from cubicfish_cli.words.camera import uncertainty_words

_MOST_STROKES = 1500
_FINE_CELLS = 12
_STEP_DEG = 5.0
_HEIGHT = 200.0
# Cells across and down in which uncertainty is drawn; its range is that of some of them.
_CELLS, _EVERY, _BANDS = (388, 292), 4, 10
# 95 of 100 arrows are at most this share of the picture's longer side.
_ARROW_SHARE = 0.04


def all_figures(facts: Facts) -> dict[str, page.Drawn]:
    """Draw every figure that these facts allow, by its name."""
    drawn: list[page.Drawn | None] = []
    errors, camera = facts.errors, facts.camera
    if errors is not None:
        drawn += [coverage_figure(facts, errors), vectors_figure(facts, errors)]
        drawn += [places_figure(facts, errors), angle_figure(errors)]
    if isinstance(camera, CubicCamera):
        drawn += [profile_figure(camera), uncertainty_figure(facts, camera)]
    return {figure.name: figure for figure in drawn if figure is not None}


def coverage_figure(facts: Facts, errors: ErrorFacts) -> page.Drawn:
    """Draw the corners, and the cells of the field that hold none."""
    plot = picture_plot(facts.camera.image_size)
    pixel, pairs, cells = errors.pairs.pixel, errors.pairs, errors.gaps.cells
    keys = [page.Key(kind="line", colour=INK, text="where the camera may be trusted")]
    empty = int(cells.empty.sum())
    if empty:
        shade_empty(plot, errors.gaps)
        keys.append(page.Key(kind="area", colour=page.RED, text="no corner here"))
    shown = page.some(len(pixel), page.MOST_DOTS)
    boards = pairs.boards if 1 < len(pairs.boards) <= len(page.BOARD_COLOURS) else ("corner",)
    for index, (board, colour) in enumerate(zip(boards, page.BOARD_COLOURS, strict=False)):
        own = shown[pairs.board[shown] == index] if len(boards) > 1 else shown
        plot.dots(pixel[own], colour, 2.2)
        keys.append(page.Key(kind="dot", colour=colour, text=board))
    caption = "Nothing has been checked where there are no corners." if empty else ""
    draw_outline(plot, facts)
    return page.finished(
        plot,
        name="coverage",
        title="Where the corners are",
        label=f"{len(pixel)} corners over the photo, and {empty} parts of the field without any",
        caption=(caption + page.thinned(len(pixel), page.MOST_DOTS, "corners")).strip(),
        keys=tuple(keys),
    )


def arrow_zoom(facts: Facts, errors: ErrorFacts) -> float:
    """Return the magnification of the drawn errors, so that most can be seen."""
    typical = float(np.percentile(errors.length, 95))
    return 1 / round_up(typical / (_ARROW_SHARE * max(facts.camera.image_size)))


def vectors_figure(facts: Facts, errors: ErrorFacts) -> page.Drawn:
    """Draw residuals as arrows, magnified."""
    length = errors.length
    zoom = arrow_zoom(facts, errors)
    plot = picture_plot(facts.camera.image_size)
    shown = page.some(len(length), _MOST_STROKES)
    start = errors.pairs.pixel[shown]
    ends = np.stack([start, start + zoom * errors.residual[shown]], axis=1)
    plot.lines(ends, page.BLUE, 0.8)
    plot.dots(start, INK, 1.5)
    draw_outline(plot, facts)
    typical = float(np.percentile(length, 95))
    return page.finished(
        plot,
        name="vectors",
        title="Errors as arrows",
        label=f"Reprojection errors as arrows, {zoom:g} times as long as they are; the 95th "
        f"percentile is {typical:.3f} px",
        caption=f"From each detected corner towards where the camera puts it, {zoom:g} times as "
        "long. Noise points every way; neighbours that point one way are an error of the camera, "
        "of the target or of the corner finder."
        + page.thinned(len(length), _MOST_STROKES, "errors"),
        keys=(
            page.Key(kind="dot", colour=INK, text="detected corner"),
            page.Key(kind="line", colour=page.BLUE, text=f"its error, {zoom:g} ×"),
        ),
    )


def places_figure(facts: Facts, errors: ErrorFacts) -> page.Drawn:
    """Draw the RMS error in cells over the photo."""
    width, height = facts.camera.image_size
    cell = min(width, height) / _FINE_CELLS
    edges = [np.arange(-(-side // cell) + 1) * cell - 0.5 for side in (width, height)]
    at = np.clip(errors.pairs.pixel, -0.5, [edges[0][-1], edges[1][-1]])
    count = np.histogram2d(at[:, 0], at[:, 1], bins=edges)[0].T
    square = np.histogram2d(at[:, 0], at[:, 1], bins=edges, weights=errors.length**2)[0].T
    value = np.sqrt(square / np.where(count, count, np.nan))
    top = round_up(float(np.nanpercentile(value, 95)))
    plot = picture_plot(facts.camera.image_size)
    plot.image(colours(value / top), (-0.5, edges[1][-1]), (edges[0][-1], -0.5))
    draw_outline(plot, facts)
    return page.finished(
        plot,
        colour_bar(plot, (0, top), "px RMS", beyond=bool(np.nanmax(value) > top)),
        name="places",
        title="Errors over the picture",
        label=f"RMS error in {int((count > 0).sum())} cells of the photo, from "
        f"{np.nanmin(value):.3f} to {np.nanmax(value):.3f} px",
        caption="RMS of the corners in each cell. A rim much worse than the middle means blur, "
        "or the model does not fit the lens.",
    )


def angle_figure(errors: ErrorFacts) -> page.Drawn | None:
    """Draw the error by angle from the axis."""
    angle, length = errors.angle_deg, errors.length
    if angle is None:
        return None
    bins = np.floor(angle / _STEP_DEG).astype(int)
    used = np.unique(bins)
    rms = np.array([np.sqrt((length[bins == index] ** 2).mean()) for index in used])
    few = min(int((bins == index).sum()) for index in used)
    top = 1.15 * max(float(np.percentile(length, 99)), float(rms.max()), 1e-9)
    labels = ("angle from the axis, degrees", "error, px")
    plot = wide_plot((0, _STEP_DEG * float(used.max() + 1)), (0, top), _HEIGHT, labels)
    shown = page.some(len(length), page.MOST_DOTS // 2)
    plot.dots(np.stack([angle, length], axis=-1)[shown], page.BLUE, 1.8, 0.7)
    steps = [
        [(_STEP_DEG * at, y), (_STEP_DEG * (at + 1), y)] for at, y in zip(used, rms, strict=True)
    ]
    plot.lines(steps, page.ORANGE, 2.4)
    beyond = int((length > top).sum())
    return page.finished(
        plot,
        name="angle",
        title="Errors by angle from the axis",
        label=f"Errors by angle from the axis; RMS from {rms.min():.3f} to {rms.max():.3f} px in "
        f"steps of {_STEP_DEG:g} degrees",
        caption=f"Smallest bin: {few:,} corner{'s' * (few != 1)}"
        + (f"; {beyond:,} point{'s' * (beyond != 1)} off scale." if beyond else ".")
        + page.thinned(len(length), page.MOST_DOTS // 2, "corners"),
        keys=(
            page.Key(kind="dot", colour=page.BLUE, text="a corner"),
            page.Key(kind="line", colour=page.ORANGE, text=f"RMS of {_STEP_DEG:g}° each"),
        ),
    )


def _rays_at(angle: FloatArray, around: FloatArray) -> FloatArray:
    """Unit rays (..., 3) of angles (...) from the axis and about it, radians."""
    across = np.sin(angle)
    return np.stack([across * np.cos(around), across * np.sin(around), np.cos(angle)], axis=-1)


def profile_figure(camera: CubicCamera) -> page.Drawn:
    """Draw the radius by angle, beside the reference and ideal lenses."""
    theta = np.deg2rad(np.linspace(0, camera.max_angle_deg, 31))[1:]
    rays = _rays_at(*np.meshgrid(theta, np.linspace(0, 2 * np.pi, 48), indexing="ij"))
    radial = camera.radial
    own = np.linalg.norm(camera.project(rays) - camera.project([0.0, 0.0, 1.0]), axis=-1)
    outwards = radial.project(rays) - np.array([radial.cx, radial.cy])
    other = np.linalg.norm(outwards, axis=-1)
    # The poses make up for a rotation between the two, which is no difference of lenses.
    miss, _ = aligned_difference(camera, radial, rays.reshape(-1, 3))
    difference = (miss.reshape((*rays.shape[:-1], 2)) * outwards).sum(axis=-1) / other
    known = np.isfinite(difference).all(axis=1)
    degrees = np.rad2deg(theta)
    focal = (radial.fx + radial.fy) / 2
    ideals = (
        ("equidistant, f θ", page.GREEN, focal * theta),
        ("stereographic, 2 f tan(θ/2)", page.PURPLE, 2 * focal * np.tan(theta / 2)),
        ("equisolid, 2 f sin(θ/2)", page.RED, 2 * focal * np.sin(theta / 2)),
    )
    ends = (0.0, float(degrees[-1]))
    plot = wide_plot(ends, (0, 1.12 * float(own.mean(axis=1).max())), _HEIGHT, (None, "radius, px"))
    for _, colour, radius in ideals:
        plot.lines([_stack(degrees, radius)], colour, 0.9, dash="4 2")
    plot.lines([_stack(degrees, other.mean(axis=1))[known]], page.ORANGE, 3.2)
    plot.lines([_stack(degrees, own.mean(axis=1))], page.BLUE, 1.4)
    low, high = (
        _stack(degrees, at)[known] for at in (difference.min(axis=1), difference.max(axis=1))
    )
    least, most = (
        float(at(np.append(one[:, 1], 0))) for at, one in ((np.min, low), (np.max, high))
    )
    spare = 0.05 * (most - least)
    labels = ("angle from the axis θ, degrees", "difference, px")
    below = wide_plot(ends, (least - spare, most + spare), _HEIGHT / 2, labels, plot.bottom - 20)
    below.area(np.concatenate([low, high[::-1]]), page.BLUE, 0.25)
    below.lines([[(0, 0), (ends[1], 0)]], page.ORANGE, 1.2)
    below.lines([_stack(degrees, difference.mean(axis=1))[known]], page.BLUE, 1.4)
    largest = float(np.abs(difference[known]).max()) if known.any() else 0.0
    return page.finished(
        plot,
        below,
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
            page.Key(kind="line", colour=page.BLUE, text="this camera, mean over all directions"),
            page.Key(kind="line", colour=page.ORANGE, text="radial reference (Kannala–Brandt)"),
            *(page.Key(kind="dash", colour=colour, text=text) for text, colour, _ in ideals),
        ),
    )


def uncertainty_figure(facts: Facts, camera: CubicCamera) -> page.Drawn | None:
    """Draw the uncertainty of the camera's pixels over the photo."""
    # In the middles of equal cells of the photo.
    sides = zip(camera.image_size, _CELLS, strict=True)
    x, y = ((np.arange(cells) + 0.5) / cells * side - 0.5 for side, cells in sides)
    sigma = facts.fit.uncertainty.over_grid(x, y)
    if sigma is None:
        return None
    some = sigma[::_EVERY, ::_EVERY].ravel()
    where = np.stack(np.meshgrid(x[::_EVERY], y[::_EVERY]), axis=-1).reshape(-1, 2)
    angle, field = angle_from_axis(camera.unproject(where)), [facts.outline]
    blind = facts.errors.gaps.cells.blind if facts.errors else 0.0
    if blind:  # where the camera sees itself
        field.append(camera.project(_rays_at(np.full(180, blind), np.linspace(0, 2 * np.pi, 180))))
    shown = some[(angle >= blind) & np.isfinite(some) & (some > 0)]
    if not len(shown):
        return None
    step = nice_step(max(float(np.ptp(shown)), 1e-9 * float(shown.max())) / _BANDS)
    low, high = step * np.floor(shown.min() / step), step * np.ceil(shown.max() / step)
    bands = max(1, round((high - low) / step))
    band = np.clip(np.floor((sigma - low) / step), 0, bands - 1)
    plot = picture_plot(camera.image_size)
    width, height = camera.image_size
    corners = (-0.5, height - 0.5), (width - 0.5, -0.5)
    plot.image(colours((band + 0.5) / bands), *corners, clip=field)
    draw_outline(plot, facts)
    figures = facts.fit.uncertainty.field
    return page.finished(
        plot,
        colour_bar(plot, (low, low + bands * step), "px", steps=bands),
        name="uncertainty",
        title="How certain the camera is",
        label=f"Uncertainty of a distant point's pixel over the photo, from {shown.min():.3f} "
        f"to {shown.max():.3f} px",
        caption="How far the pixel of a distant point would be elsewhere, had you taken other "
        "photos"
        + (f": {uncertainty_words(figures)}" if figures else "")
        + ". Errors of the target or of the model are not in it.",
    )


def _stack(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.stack([x, y], axis=-1)


def shade_empty(plot: Plot, gaps: CoverageGaps) -> None:
    """Shade the cells of the field that hold no corner."""
    cells = gaps.cells
    height, width = cells.empty.shape
    shade = np.where(cells.empty[..., None], [0.78, 0.31, 0, 0.22], 0.0)
    end = np.array([width, height]) * cells.cell - 0.5
    plot.image(shade, (-0.5, end[1]), (end[0], -0.5))


def draw_outline(plot: Plot, facts: Facts) -> None:
    """Draw where the camera may be trusted."""
    if len(facts.outline) > 2:
        plot.lines([[*facts.outline, facts.outline[0]]], INK, 0.9)
