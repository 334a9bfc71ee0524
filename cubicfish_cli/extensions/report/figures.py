"""The figures of a page: the corners' places and errors, and the lens."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from cubicfish_cli.app.calibration_facts import ErrorFacts, Facts
from cubicfish_cli.app.comparison import aligned_difference
from cubicfish_cli.app.difference_picture import round_up
from cubicfish_cli.app.drawing import drawing
from cubicfish_cli.app.pages import figures as page
from cubicfish_cli.app.words.camera import uncertainty_words
from cubicfish_cli.core.fit.statistics import rms_px
from cubicfish_cli.core.geometry import inside_polygon
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.lenses.sphere import ray_at

_MOST_STROKES = 1500
_FINE_CELLS = 12
_STEP_DEG = 5.0
# 95 of 100 arrows are at most this share of the picture's longer side.
_ARROW_SHARE = 0.04


def all_figures(facts: Facts) -> dict[str, page.Drawn]:
    """Draw every figure that these facts allow, by its name."""
    drawn: list[page.Drawn | None] = []
    errors, camera = facts.errors, facts.camera
    with drawing(page.STYLE):
        if errors is not None:
            drawn += [coverage_figure(facts, errors), vectors_figure(facts, errors)]
            drawn += [places_figure(facts, errors), angle_figure(errors)]
        if isinstance(camera, CubicCamera):
            drawn += [profile_figure(camera), uncertainty_figure(facts, camera)]
    return {figure.name: figure for figure in drawn if figure is not None}


def coverage_figure(facts: Facts, errors: ErrorFacts) -> page.Drawn:
    """Draw the corners, and the cells of the field that hold none."""
    figure, axes = _make_photo_axes(facts)
    pixel, pairs, cells = errors.pairs.pixel, errors.pairs, errors.cells
    keys = [page.Key(kind="line", colour=page.INK, text="where the camera may be trusted")]
    empty = int(cells.empty.sum())
    if empty:
        height, width = cells.empty.shape
        extent = (-0.5, width * cells.cell - 0.5, height * cells.cell - 0.5, -0.5)
        shade = np.where(cells.empty[..., None], [0.78, 0.31, 0, 0.22], 0.0)
        axes.imshow(shade, extent=extent, interpolation="nearest", zorder=0.5)
        keys.append(page.Key(kind="area", colour=page.RED, text="no corner here"))
    shown = page.some(len(pixel), page.MOST_DOTS)
    boards = pairs.boards if 1 < len(pairs.boards) <= len(page.BOARD_COLOURS) else ("corner",)
    for index, (board, colour) in enumerate(zip(boards, page.BOARD_COLOURS, strict=False)):
        own = shown[pairs.board[shown] == index] if len(boards) > 1 else shown
        page.dots(axes, pixel[own], colour, 2.5)
        keys.append(page.Key(kind="dot", colour=colour, text=board))
    share = facts.fit.coverage
    caption = f"Corners cover {100 * share:.0f} % of the field." if math.isfinite(share) else ""
    if empty:
        caption += " What a camera says of places without corners nobody has checked."
    return page.finished(
        figure,
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
    figure, axes = _make_photo_axes(facts)
    shown = page.some(len(length), _MOST_STROKES)
    start = errors.pairs.pixel[shown]
    ends = np.stack([start, start + zoom * errors.residual[shown]], axis=1)
    axes.add_collection(
        LineCollection(list(ends), colors=page.BLUE, linewidths=0.8, rasterized=True)
    )
    page.dots(axes, start, page.INK, 1.5)
    typical = float(np.percentile(length, 95))
    return page.finished(
        figure,
        name="vectors",
        title="Errors as arrows",
        label=f"Reprojection errors as arrows, {zoom:g} times as long as they are; the 95th "
        f"percentile is {typical:.3f} px",
        caption=f"From each detected corner towards where the camera puts it, {zoom:g} times as "
        "long. Noise points every way; neighbours that point one way are an error of the camera, "
        "of the target or of the corner finder."
        + page.thinned(len(length), _MOST_STROKES, "errors"),
        keys=(
            page.Key(kind="dot", colour=page.INK, text="detected corner"),
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
    figure, axes = _make_photo_axes(facts)
    cells = axes.pcolormesh(*edges, value, cmap="cividis", vmin=0, vmax=top, rasterized=True)
    beyond = "max" if np.nanmax(value) > top else "neither"
    figure.colorbar(cells, location="bottom", label="px RMS", aspect=40, extend=beyond)
    return page.finished(
        figure,
        name="places",
        title="Errors over the picture",
        label=f"RMS error in {int((count > 0).sum())} cells of the photo, from "
        f"{np.nanmin(value):.3f} to {np.nanmax(value):.3f} px",
        caption="RMS of the corners in each cell. A rim much worse than the middle means blur "
        "there, or a lens that the model does not follow.",
    )


def angle_figure(errors: ErrorFacts) -> page.Drawn | None:
    """Draw the error by angle from the axis."""
    angle, length = errors.angle_deg, errors.length
    if angle is None:
        return None
    bins = np.floor(angle / _STEP_DEG).astype(int)
    used = np.unique(bins)
    rms = np.array([rms_px(errors.residual[bins == index]) for index in used])
    few = min(int((bins == index).sum()) for index in used)
    top = 1.15 * max(float(np.percentile(length, 99)), float(rms.max()), 1e-9)
    figure = page.new_figure()
    axes = figure.add_subplot()
    axes.grid(True)
    shown = page.some(len(length), page.MOST_DOTS // 2)
    page.dots(axes, np.stack([angle, length], axis=-1)[shown], page.BLUE, 2.0, 0.6)
    axes.hlines(rms, used * _STEP_DEG, (used + 1) * _STEP_DEG, colors=page.ORANGE, linewidth=2.4)
    axes.set(xlim=(0, _STEP_DEG * (used.max() + 1)), ylim=(0, top))
    axes.set(xlabel="angle from the axis, degrees", ylabel="error, px")
    beyond = int((length > top).sum())
    return page.finished(
        figure,
        name="angle",
        title="Errors by angle from the axis",
        label=f"Errors by angle from the axis; RMS from {rms.min():.3f} to {rms.max():.3f} px in "
        f"steps of {_STEP_DEG:g} degrees",
        caption=f"The least filled step holds {few:,} corner{'s' * (few != 1)}."
        + (f" Larger errors, above the figure: {beyond:,}." if beyond else "")
        + page.thinned(len(length), page.MOST_DOTS // 2, "corners"),
        keys=(
            page.Key(kind="dot", colour=page.BLUE, text="a corner"),
            page.Key(kind="line", colour=page.ORANGE, text=f"RMS of {_STEP_DEG:g}° each"),
        ),
    )


def profile_figure(camera: CubicCamera) -> page.Drawn:
    """Draw the radius by angle, beside the reference and ideal lenses."""
    theta = np.deg2rad(np.linspace(0, camera.max_angle_deg, 61))[1:]
    rays = ray_at(*np.meshgrid(theta, np.linspace(0, 2 * np.pi, 48), indexing="ij"))
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
    figure = page.new_figure(4.6)
    axes, below = figure.subplots(2, sharex=True, height_ratios=(2, 1))
    for part in (axes, below):
        part.grid(True)
        part.set_xlim(0, float(degrees[-1]))
    for _, colour, radius in ideals:
        axes.plot(degrees, radius, color=colour, linewidth=0.9, linestyle="--")
    axes.plot(degrees[known], other.mean(axis=1)[known], color=page.ORANGE, linewidth=3.2)
    axes.plot(degrees, own.mean(axis=1), color=page.BLUE, linewidth=1.4)
    axes.set(ylim=(0, 1.12 * float(own.mean(axis=1).max())), ylabel="radius, px")
    low, high = difference[known].min(axis=1), difference[known].max(axis=1)
    below.fill_between(degrees[known], low, high, color=page.BLUE, alpha=0.25, linewidth=0)
    below.plot(degrees[known], difference[known].mean(axis=1), color=page.BLUE, linewidth=1.4)
    below.axhline(0, color=page.ORANGE, linewidth=1.2)
    below.set(ylabel="difference, px", xlabel="angle from the axis θ, degrees")
    largest = float(np.abs(difference[known]).max()) if known.any() else 0.0
    return page.finished(
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
            page.Key(kind="line", colour=page.BLUE, text="this camera, mean over all directions"),
            page.Key(kind="line", colour=page.ORANGE, text="radial reference (Kannala–Brandt)"),
            *(page.Key(kind="dash", colour=colour, text=text) for text, colour, _ in ideals),
        ),
    )


def uncertainty_figure(facts: Facts, camera: CubicCamera) -> page.Drawn | None:
    """Draw the uncertainty of the camera's pixels over the photo."""
    width, height = camera.image_size
    x, y = np.linspace(0, width - 1, 97), np.linspace(0, height - 1, 73)
    pixel = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    sigma = facts.fit.uncertainty.at(pixel)
    if sigma is None:
        return None
    inside = inside_polygon(pixel, facts.outline)
    if facts.errors and facts.errors.cells.blind:  # where the camera sees itself
        around = np.linspace(0, 2 * np.pi, 180)
        hole = camera.project(ray_at(np.full(180, facts.errors.cells.blind), around))
        inside &= ~inside_polygon(pixel, hole)
    shown = np.ma.masked_where(~(inside & np.isfinite(sigma) & (sigma > 0)), sigma)
    if not shown.count():
        return None
    figure, axes = _make_photo_axes(facts)
    bands = axes.contourf(x, y, shown.reshape(len(y), len(x)), 7, cmap="cividis")
    figure.colorbar(bands, location="bottom", label="px", aspect=40)
    figures = facts.fit.uncertainty.field
    return page.finished(
        figure,
        name="uncertainty",
        title="How certain the camera is",
        label=f"Uncertainty of a distant point's pixel over the photo, from {shown.min():.3f} "
        f"to {shown.max():.3f} px",
        caption="How far the pixel of a distant point would be elsewhere, had you taken other "
        "photos"
        + (f": {uncertainty_words(figures)}" if figures else "")
        + ". Errors of the target or of the model are not in it.",
    )


def _make_photo_axes(facts: Facts) -> tuple[Figure, Axes]:
    """Make axes of a photo's shape, y down, with the trusted field's outline."""
    figure = page.new_figure(3.9)
    axes = figure.add_subplot()
    width, height = facts.camera.image_size
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal")
    axes.spines[:].set_visible(True)
    axes.locator_params(nbins=5)
    if len(facts.outline) > 2:
        axes.fill(*facts.outline.T, facecolor="none", edgecolor=page.INK, linewidth=0.9, zorder=3)
    return figure, axes
