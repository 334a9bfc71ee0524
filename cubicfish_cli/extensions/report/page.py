"""The page itself: figures, pictures and tables put into the template."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from cubicfish_cli.app.calibration_facts import Facts, matched
from cubicfish_cli.core.assess.fit_record import DroppedCorner, FitRecord, origin_of
from cubicfish_cli.core.assess.verdict import WORDS
from cubicfish_cli.core.codes import Severity
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.extensions.report.figures import all_figures, arrow_zoom
from cubicfish_cli.extensions.report.pictures import MOST_CARDS, all_pictures
from cubicfish_cli.extensions.report.scene import scene_figures

_MOST_DROPPED = 200
_MOST_ROWS = 5000
_LONGEST_TEXT = 1000
_IMAGES = ("data:image/jpeg;base64,", "data:image/svg+xml;base64,")
_POINT_ABSENT = (
    "A point-lift camera has no rays: errors by angle, the lens's profile, uncertainty, coverage "
    "and an undistorted example do not exist for it."
)


def report_html(facts: Facts) -> str:
    """One self-contained HTML page about a calibration.

    The same facts give the same page, to the byte.
    """
    figures = {**all_figures(facts), **scene_figures(facts)}
    zoom = arrow_zoom(facts, facts.errors) if facts.errors else 1.0
    pictures = all_pictures(facts, zoom)
    absent = [*facts.absent, *pictures.problems]
    if not isinstance(facts.camera, CubicCamera):
        absent.append(_POINT_ABSENT)
    names = [photo.image for photo in facts.photos]
    return template(_TEMPLATES / "report.html").render(
        facts=facts,
        known=facts.known.facts,
        lens=[(name.capitalize(), words) for name, words in facts.known.facts.lens],
        fit=facts.fit,
        verdict=facts.known.verdict,
        words=WORDS,
        camera=facts.camera,
        is_ray=isinstance(facts.camera, CubicCamera),
        figures=figures,
        tiles=_tiles(facts),
        pictures=pictures,
        number_of={name: index for index, name in enumerate(names, start=1)},
        boards_of=_boards(facts),
        cards=[name for name, copies in pictures.photos.items() if copies.card is not None],
        most_cards=MOST_CARDS,
        most_rows=_MOST_ROWS,
        zoom=zoom,
        deformations=_deformations(facts.fit),
        empty=_without_corners(facts),
        notes=_notes(facts.fit),
        dropped=sorted(facts.fit.dropped_corners, key=_least_off)[:_MOST_DROPPED],
        made=made_of(facts.known.made_by),
        day=day_of(facts.known.made_by),
        absent=absent,
    )


def day_of(made_by: Mapping[str, Any]) -> str | None:
    """When it was made, for people."""
    date = origin_of(made_by).date
    return date.replace("T", " ").replace("+00:00", " UTC") if date else None


_TEMPLATES = Path(__file__).with_name("templates")


@cache
def template(page: Path) -> Any:
    """One of the package's pages, which have style and figures in common."""
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_printable,
    )
    environment.filters["px"] = _px
    environment.filters["count"] = _count
    environment.globals["style"] = (_TEMPLATES / "report.css").read_text(encoding="utf-8")
    texts = [one.read_text(encoding="utf-8") for one in (_TEMPLATES / "parts.html", page)]
    return environment.from_string("".join(texts))


def _printable(value: Any) -> Any:
    """Text from outside on one line, letters only: what nobody vouches for is in every name."""
    if not isinstance(value, str) or hasattr(value, "__html__"):  # the package's own markup
        return value
    if value.startswith(_IMAGES):
        return value
    if len(value) > _LONGEST_TEXT:
        value = value[: _LONGEST_TEXT - 1] + "…"
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in value)


def _px(value: float | None, places: int = 3) -> str:
    return "–" if value is None or math.isnan(value) else f"{value:.{places}f}"


def _count(value: float) -> str:
    return f"{value:,.0f}"


def _tiles(facts: Facts) -> list[tuple[str, str, str]]:
    """The figures at the top: name, value, meaning."""
    fit = facts.fit
    tiles = [
        (name, f"{value:.3f} px", meaning)
        for name, value, meaning in (
            ("RMS error", fit.rms_px, "on the photos of the fit"),
            ("Held-out RMS", fit.held_out_rms_px, "on photos that a fit never saw"),
            ("Radial reference, held out", fit.companion_held_out_rms_px, "a Kannala–Brandt lens"),
        )
        if math.isfinite(value)
    ]
    for name, value, unit, meaning in facts.known.facts.scope:
        tiles.append((name.capitalize(), f"{value} {unit}".replace(" °", "°"), meaning))
    if fit.rank and not isinstance(facts.camera, CubicCamera):
        tiles.append(("Rank", f"{fit.rank} of 20", "what the corners determine of P"))
    return tiles


def _boards(facts: Facts) -> dict[str, str]:
    """Which boards each photo shows, with their corners, where the corners are at hand."""
    if facts.errors is None or not facts.errors.pairs.boards:
        return {}
    pairs = facts.errors.pairs
    told: dict[str, list[str]] = {}
    for (image, board), number in sorted(
        Counter(zip(pairs.image.tolist(), pairs.board.tolist(), strict=True)).items()
    ):
        told.setdefault(pairs.images[image], []).append(f"{pairs.boards[board]} {number}")
    return {name: ", ".join(boards) for name, boards in told.items()}


def _deformations(fit: FitRecord) -> list[dict[str, Any]]:
    """How the target as fitted differs from its drawing, a row per board."""
    return [
        {
            "board": one.board,
            "bend": _joined(one.bend, ".2g"),
            "stretch": _joined([100 * share for share in one.stretch], ".2f"),
            "twist": _joined([one.twist], ".2g"),
            "shift": _joined([one.shift], ".2g"),
            "turn": _joined([one.turn_deg], ".2f"),
            "offset": _joined([one.offset_rms], ".2g"),
            "doubts": one.doubts,
        }
        for one in fit.departures
    ]


def _joined(values: Sequence[float], form: str) -> str:
    return ", ".join(format(value, form) for value in np.nan_to_num(values).tolist())


def _notes(fit: FitRecord) -> list[str]:
    """What speaks not against the camera and should be known all the same."""
    notes = [one for one in fit.findings if one.severity is Severity.NOTE]
    return [*(f"{one.what} ({one.evidence}); {one.do}" for one in notes), *fit.notes]


def _least_off(corner: DroppedCorner) -> float:
    return -float(np.nan_to_num(corner.error_px))


def made_of(made_by: Mapping[str, Any]) -> dict[str, Any]:
    """How the calibration was made, as text."""
    origin = origin_of(made_by)
    return {
        "version": origin.version,
        "date": origin.date,
        "command": origin.command,
        "options": [
            (name, "yes" if value is True else "no" if value is False else str(value))
            for name, value in origin.options.items()
        ],
        "target": origin.target and (origin.target.file, origin.target.sha256),
        "inputs": [(one.file, one.sha256) for one in origin.inputs],
    }


def _without_corners(facts: Facts) -> list[str]:
    """Photos that went in and of which no corner took part, besides those left out by name."""
    known = {photo.image for photo in facts.photos} | facts.fit.unfit_images.keys()
    files = [one.file for one in origin_of(facts.known.made_by).inputs]
    paths = [Path(file) for file in files if not file.lower().endswith(".csv")]
    taken = set(matched(sorted(known), paths).values())
    return [path.name for path in paths if path not in taken]
