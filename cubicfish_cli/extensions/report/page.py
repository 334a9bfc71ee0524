"""The page itself: figures, pictures and tables put into the template."""

from __future__ import annotations

import hashlib
import math
from base64 import b64encode
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cubicfish import CubicCamera, Verdict
from cubicfish.judge import Severity
from cubicfish_cli.extensions.report.acting import enough, live_view, next_photos, others_px
from cubicfish_cli.extensions.report.figures import all_figures, arrow_zoom
from cubicfish_cli.extensions.report.pictures import MOST_CARDS, all_pictures
from cubicfish_cli.extensions.report.scene import scene_figures
from cubicfish_cli.inputs.calibration_facts import Facts, facts_of_fit, matched
from cubicfish_cli.render.pages.template import template
from cubicfish_cli.words import camera as in_words
from cubicfish_cli.words.phrases import shell_line
from cubicfish_cli.words.sentences import render

if TYPE_CHECKING:
    from cubicfish import Calibration, Observations
    from cubicfish.fit import PointCalibration

_MOST_DROPPED = 200
_MOST_ROWS = 5000
_BELOW_90 = 89
_POINT_ABSENT = (
    "A point-lift camera has no rays: errors by angle, the lens's profile, uncertainty, coverage "
    "and an undistorted example do not exist for it."
)


def page_of_fit(
    fitted: Calibration | PointCalibration, pairs: Observations, photos: Sequence[Path]
) -> str:
    """Make the page about a fresh fit; see :func:`facts_of_fit`."""
    return report_html(facts_of_fit(fitted, pairs, photos))


def report_html(facts: Facts) -> str:
    """Make one self-contained HTML page about a calibration.

    The same facts give the same page, to the byte.
    """
    next_ones, (in_space, scene) = next_photos(facts), scene_figures(facts)
    figures = {**all_figures(facts), **in_space, **next_ones}
    zoom = arrow_zoom(facts, facts.errors) if facts.errors else 1.0
    pictures = all_pictures(facts, zoom)
    absent = [*facts.absent, *pictures.problems]
    is_ray = isinstance(facts.camera, CubicCamera)
    if not is_ray:
        absent.append(_POINT_ABSENT)
    names = [photo.image for photo in facts.photos]
    origin, shown = facts.known.origin, pictures.example
    script = Path(__file__).with_name("report.js").read_text(encoding="utf-8")
    return template(Path(__file__).with_name("report.html")).render(
        script=script,
        digest=b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        acts={
            "command": f"{origin.command or 'cubicfish calibrate'} --overwrite",
            "scene": scene,
            "view": live_view(facts, shown.name) if shown else None,
        },
        next_ones=list(next_ones),
        others_px=others_px(facts.photos),
        enough=enough(facts),
        tells_moves=any(photo.moves_px is not None for photo in facts.photos),
        quoted=shell_line,
        facts=facts,
        known=facts.known,
        lens=[(name.capitalize(), words) for name, words in in_words.lens_rows(facts.known)],
        fit=facts.fit,
        in_words=in_words,
        verdict=facts.known.verdict,
        words=Verdict.WORDS,
        render=render,
        is_ray=is_ray,
        figures=figures,
        tiles=_make_tiles(facts),
        pictures=pictures,
        number_of={name: index for index, name in enumerate(names, start=1)},
        boards_of=_list_boards(facts),
        cards=[name for name, copies in pictures.photos.items() if copies.card is not None],
        most_cards=MOST_CARDS,
        most_rows=_MOST_ROWS,
        # OpenCV's fisheye ends before 90 degrees.
        below_90=f" --max-angle {_BELOW_90}" if _reach_deg(facts) >= _BELOW_90 else "",
        rim_deg=math.floor(0.9 * min(_reach_deg(facts), _BELOW_90)),
        zoom=zoom,
        empty=_list_without_corners(facts),
        # They do not speak against the camera.
        notes=[render(one).line for one in facts.fit.findings if one.severity is Severity.NOTE],
        dropped=sorted(facts.fit.dropped_corners, key=lambda one: -np.nan_to_num(one.error_px))[
            :_MOST_DROPPED
        ],
        made=origin,
        day=origin.day,
        absent=absent,
    )


def _make_tiles(facts: Facts) -> list[tuple[str, str, str]]:
    """Return the figures at the top: name, value, meaning."""
    fit = facts.fit
    tiles = [
        (name, f"{value:.3f} px", meaning)
        for name, value, meaning in (
            ("RMS error", fit.rms_px, "on the photos of the fit"),
            ("Held-out RMS", fit.held_out_rms_px, "on photos not used in the fit"),
            ("Radial reference, held out", fit.radial_held_out_rms_px, "a Kannala–Brandt lens"),
        )
        if math.isfinite(value)
    ]
    for name, value, unit, meaning in in_words.scope(facts.known):
        tiles.append((name.capitalize(), f"{value} {unit}".replace(" °", "°"), meaning))
    if fit.rank and not isinstance(facts.camera, CubicCamera):
        tiles.append(("Rank", f"{fit.rank} of 20", "what the corners determine of P"))
    return tiles


def _reach_deg(facts: Facts) -> float:
    """Return the angle from the axis that the camera reaches, degrees; 0 for one without rays."""
    return facts.camera.max_angle_deg if isinstance(facts.camera, CubicCamera) else 0.0


def _list_boards(facts: Facts) -> dict[str, str]:
    """Return the boards that each photo shows, with their corners, if the corners are known."""
    if facts.errors is None or not facts.errors.pairs.boards:
        return {}
    pairs = facts.errors.pairs
    by_photo: dict[str, list[str]] = {}
    for (image, board), number in sorted(
        Counter(zip(pairs.image.tolist(), pairs.board.tolist(), strict=True)).items()
    ):
        by_photo.setdefault(pairs.images[image], []).append(f"{pairs.boards[board]} {number}")
    return {name: ", ".join(boards) for name, boards in by_photo.items()}


def _list_without_corners(facts: Facts) -> list[str]:
    """Return photos of which no corner was used, beside those left out by name."""
    known = {photo.image for photo in facts.photos} | facts.fit.unfit_images.keys()
    files = [one.file for one in facts.known.origin.inputs]
    paths = [Path(file) for file in files if not file.lower().endswith(".csv")]
    taken = set(matched(sorted(known), paths).values())
    return [path.name for path in paths if path not in taken]
