"""What a page lets its reader do: leave photos out, look around in one, and take the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish import CubicCamera, CubicfishError, build_view
from cubicfish.judge import PhotoRecord
from cubicfish.sufficiency import Goal
from cubicfish.views import CentralView
from cubicfish_cli.extensions.advice.advise import Advice, advise
from cubicfish_cli.extensions.advice.limited_lens import limited_lens
from cubicfish_cli.extensions.advice.proposals import Proposal
from cubicfish_cli.extensions.native.source import source_text
from cubicfish_cli.extensions.report.figures import draw_outline, shade_empty
from cubicfish_cli.inputs.calibration_facts import Facts
from cubicfish_cli.render.board_shapes import dark_squares, paper
from cubicfish_cli.render.pages import figures as page
from cubicfish_cli.render.pages.plot import INK, picture_plot
from cubicfish_cli.words.phrases import shell_line

# Of more corners it would take longer than all else of the page.
_MOST_CORNERS = 4000
_PIECES = 6  # of a board's side, which a fisheye bends
_BEYOND_DEG = 8.0  # boards are drawn this far beyond the field
_ACROSS = 960  # pixels of a straightened photo, at most
_KINDS = ("perspective", "cylindrical", "equirectangular", "stereographic", "equidistant")
_VERTEX = """#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0, 1); }
"""
# Each ray is what `views/view.py` has for its kind of view.
_FRAGMENT = """
uniform sampler2D photo;
uniform float focal;
uniform mat3 turn;
uniform int kind;
out vec4 colour;
void main() {
  vec2 middle = shown_size / 2.0, pixel;
  vec2 f = vec2(gl_FragCoord.x - middle.x, middle.y - gl_FragCoord.y) / focal;
  float t = length(f), pi = 3.14159266;
  bool shown = kind == 0 || kind == 3 || (kind == 4 ? t : abs(f.x)) <= pi;
  shown = shown && (kind != 2 || abs(f.y) <= pi / 2.0);
  vec3 ray = kind == 0 ? vec3(f, 1)
    : kind == 1 ? vec3(sin(f.x), f.y, cos(f.x))
    : kind == 2 ? vec3(sin(f.x) * cos(f.y), sin(f.y), cos(f.x) * cos(f.y))
    : kind == 3 ? vec3(f, 1.0 - t * t / 4.0)
    : vec3(t > 0.0 ? f * (sin(t) / t) : f, cos(t));
  shown = camera_project_ray(turn * ray, pixel) && shown;
  vec2 at = (pixel + 0.5) / photo_size;
  colour = vec4(shown && at == clamp(at, 0.0, 1.0) ? texture(photo, at).rgb : vec3(0), 1);
}
"""


def enough(facts: Facts) -> bool:
    """Return whether no more photos are needed."""
    return not Goal.of(facts.fit, facts.camera.image_size).explain_unmet(facts.known.verdict)


def next_photos(facts: Facts) -> dict[str, page.Drawn]:
    """Draw the photos to take next, by their names; none where none is needed or known."""
    errors, camera, known = facts.errors, facts.camera, facts.known
    if errors is None or not isinstance(camera, CubicCamera):
        return {}
    if enough(facts) or len(errors.pairs.pixel) > _MOST_CORNERS or len(errors.pairs.images) < 2:
        return {}
    try:
        advice = advise(known, errors.pairs, facts.target, count=False)  # type: ignore[arg-type]
    except (CubicfishError, np.linalg.LinAlgError):  # of records that fit nothing
        return {}
    drawn = (_draw_next(facts, advice, *one) for one in enumerate(advice.proposals, start=1))
    return {one.name: one for one in drawn}


def others_px(photos: Sequence[PhotoRecord]) -> dict[str, float]:
    """RMS error of the others, by each photo's name, pixels; NaN where there are none."""
    corners = np.array([one.corners for one in photos], float)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # of records of no fit
        square = corners * np.nan_to_num([one.rms_px for one in photos]) ** 2
        others = np.sqrt(np.maximum(square.sum() - square, 0) / (corners.sum() - corners))
    return {one.image: float(px) for one, px in zip(photos, others, strict=True)}


def _draw_next(facts: Facts, advice: Advice, number: int, proposal: Proposal) -> page.Drawn:
    """Draw a photo to take: the boards as the camera would see them, over the corners so far."""
    plot, pixel, view = picture_plot(advice.camera.image_size), advice.pairs.pixel, proposal.view
    shade_empty(plot, advice.gaps)
    plot.dots(pixel[page.some(len(pixel), page.MOST_DOTS // 4)], INK, 1.2, 0.5)
    draw_outline(plot, facts)
    seen, lens = view.seen, limited_lens(advice.camera, _BEYOND_DEG)
    boards = advice.target.boards if advice.target else ()
    colours = page.BOARD_COLOURS if len(boards) <= len(page.BOARD_COLOURS) else [page.BLUE] * 999
    away = np.linalg.norm(seen.camera, axis=1)
    shown = np.unique(seen.board[seen.visible]).tolist()
    for index in sorted(shown, key=lambda one: -float(away[seen.board == one].mean())):
        board, colour = boards[index], colours[index % len(colours)]
        squares = board.origin + dark_squares(board) @ board.axes[:2]
        for shapes, opacity in ((paper(board, _PIECES), 0.2), (squares, 0.6)):
            plot.areas(lens.project(view.points(shapes)), colour, opacity)
    gain = (
        f"{proposal.before.median_px:.3f} px → {proposal.after.median_px:.3f} px, "
        f"{100 * proposal.gain:.0f} % less over the field"
    )
    return page.finished(
        plot,
        name=f"next-{number}",
        title=f"{number}. Put {proposal.words}",
        label=f"Where the target should be in photo {number} of those to take next",
        caption=f"Uncertainty: {gain}.",
        keys=(
            *(
                page.Key(kind="area", colour=colours[one % len(colours)], text=boards[one].name)
                for one in shown
            ),
            page.Key(kind="dot", colour=INK, text="corners so far"),
            page.Key(kind="area", colour=page.RED, text="no corner yet"),
        ),
    )


def live_view(facts: Facts, photo: str) -> dict[str, Any] | None:
    """What the page's script needs to straighten a photo; None where nothing can be shown.

    Keys:
        vertex, fragment: the shader's source
        kinds: of view, as the shader counts them
        fields: how wide inner and outer are in each, degrees
        size: (width, height) of the picture
        start: how wide a picture is first, degrees
        command: what straightens the photo, but for its view

    """
    camera, fields = facts.camera, {}
    if not isinstance(camera, CubicCamera):
        return None
    rays = camera.unproject(facts.outline)
    rays = rays[np.isfinite(rays[:, 0])]
    if not len(rays):
        return None
    for kind in _KINDS:
        plain = CentralView(kind=kind, size=camera.image_size, focal=1.0)
        away = np.abs(plain.pixels(rays) - plain.middle) / (np.array(plain.size) / 2)
        shares = np.nan_to_num(away.max(axis=1), nan=np.inf)  # behind a flat picture
        ends = (max(1 / one, plain.least_focal) for one in (shares.min(), shares.max()))
        fields[kind] = [round(replace(plain, focal=end).hfov_deg, 1) for end in ends]
    glsl = source_text(facts.known, "glsl", "camera")  # type: ignore[arg-type]
    (width, height), across = camera.image_size, min(camera.image_size[0], _ACROSS)
    size = across, round(across * height / width)
    sizes = f"const vec2 photo_size = vec2({width}, {height}), shown_size = vec2{size};"
    return {
        "vertex": _VERTEX,
        "fragment": f"#version 300 es\nprecision highp float;\n{glsl}{sizes}{_FRAGMENT}",
        "kinds": _KINDS,
        "fields": fields,
        "size": size,
        "start": build_view(camera).hfov_deg,
        "command": shell_line(
            "cubicfish", "undistort", Path(photo), "flat.jpg", "--model", "camera.yaml"
        ),
    }
