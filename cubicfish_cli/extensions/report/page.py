"""The page itself: figures, pictures and tables put into the template."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cubicfish import CubicCamera, Verdict
from cubicfish.judge import Severity
from cubicfish_cli.extensions.report.figures import all_figures, arrow_zoom
from cubicfish_cli.extensions.report.pictures import MOST_CARDS, all_pictures
from cubicfish_cli.extensions.report.scene import scene_figures
from cubicfish_cli.inputs.calibration_facts import Facts, facts_of_fit, matched
from cubicfish_cli.render.pages.template import template
from cubicfish_cli.words import camera as in_words
from cubicfish_cli.words.sentences import render

if TYPE_CHECKING:
    from cubicfish import Calibration, Observations
    from cubicfish.fit import PointCalibration

_MOST_DROPPED = 200
_MOST_ROWS = 5000
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
    figures = {**all_figures(facts), **scene_figures(facts)}
    zoom = arrow_zoom(facts, facts.errors) if facts.errors else 1.0
    pictures = all_pictures(facts, zoom)
    absent = [*facts.absent, *pictures.problems]
    if not isinstance(facts.camera, CubicCamera):
        absent.append(_POINT_ABSENT)
    names = [photo.image for photo in facts.photos]
    origin = facts.known.origin
    return template(Path(__file__).with_name("report.html")).render(
        facts=facts,
        known=facts.known,
        lens=[(name.capitalize(), words) for name, words in in_words.lens_rows(facts.known)],
        fit=facts.fit,
        in_words=in_words,
        verdict=facts.known.verdict,
        words=Verdict.WORDS,
        render=render,
        is_ray=isinstance(facts.camera, CubicCamera),
        figures=figures,
        tiles=_make_tiles(facts),
        pictures=pictures,
        number_of={name: index for index, name in enumerate(names, start=1)},
        boards_of=_list_boards(facts),
        cards=[name for name, copies in pictures.photos.items() if copies.card is not None],
        most_cards=MOST_CARDS,
        most_rows=_MOST_ROWS,
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
