"""A camera in words: its key figures in one line and in rows, and the verdict."""

import math
from collections.abc import Sequence
from typing import Any

from cubicfish import Finding, Verdict
from cubicfish.judge import CameraFacts, FieldUncertainty, FitRecord
from cubicfish_cli.words.phrases import counted, length_words, two_digits, whole
from cubicfish_cli.words.sentences import record_of, render

COVERED = "of the field covered by corners"
"""The whole of which a coverage is a share, wherever it is printed. The field is where the camera
may be trusted and does not see itself, in squares of an eighth of the photo's shorter side."""

GOAL = "of uncertainty, over 95 % of the field (--goal)"
"""What the goal of somebody's own is of, wherever it is printed."""

# A smaller effect of the moving entrance pupil is not worth a line.
_PUPIL_MATTERS_PX = 0.5


def headline(known: CameraFacts) -> str:
    """Return ``0.08 px where corners were, ±0.7 px over the field, 43 % of the photo calibrated``.

    The error on photos not used in the fit, the uncertainty over the calibrated field, and its
    share of the photo; what is not known is left out.
    """
    fit, certain = known.fit, known.fit.uncertainty.field
    error = fit.held_out_rms_px if math.isfinite(fit.held_out_rms_px) else fit.rms_px
    parts = [f"{_short(error)} px where {_things(fit)} were"] if math.isfinite(error) else []
    if certain is not None:
        parts.append(f"±{_short(certain.median_px)} px over the field")
    return ", ".join([*parts, f"{whole(known.calibrated_share)} of the photo calibrated"])


def _things(fit: FitRecord) -> str:
    """What a camera was fitted to: corners of boards, or points that somebody marked."""
    return "corners" if fit.marked is None else "points"


def _short(px: float) -> str:
    return f"{px:.2f}" if 0.01 <= px < 10 else two_digits(px)


def lens_rows(known: CameraFacts) -> list[tuple[str, str]]:
    """Return the figures of the lens that are known, a name and a text each."""
    rows = []
    units = (("focal length", "px per radian"), ("principal point", "px"))
    for (name, unit), value, sigma in zip(units, known.axis or (), known.axis_sigma, strict=False):
        x, y = ("", "") if sigma is None else (f" ± {one:.2f}" for one in sigma)
        rows.append((name, f"x {value[0]:.2f}{x}, y {value[1]:.2f}{y} {unit}"))
    if known.field is not None:
        rows.append(("field of view", str(known.field)))
    pupil = known.fit.pupil
    if pupil is not None and abs(pupil.rim_px) >= _PUPIL_MATTERS_PX:
        rows.append(("entrance pupil", pupil_words(pupil.rim_px, pupil.distance, pupil.units)))
    return rows


def scope(known: CameraFacts) -> list[tuple[str, str, str, str]]:
    """Return the figures on how far to trust a camera: name, value, unit and meaning."""
    rows, fit = [], known.fit
    if known.max_angle_deg is not None:
        rows.append(("calibrated to", f"{known.max_angle_deg:.1f}", "°", reach_words(known)))
    if math.isfinite(fit.coverage):
        covered = COVERED.replace("corners", _things(fit))
        rows.append(("coverage", f"{100 * fit.coverage:.0f}", "%", covered))
    certain = fit.uncertainty.field
    if certain is not None:
        rows.append(("uncertainty", f"{certain.median_px:.3f}", "px", uncertainty_meaning(certain)))
    if fit.goal_px:
        rows.append(("goal", f"{fit.goal_px:g}", "px", GOAL))
    return rows


def reach_words(known: CameraFacts) -> str:
    """Return ``from the axis; corners reach 94.5°``, the meaning of the field's end."""
    covered = known.fit.covered_deg
    reached = f"; {_things(known.fit)} reach {covered:.1f}°" if math.isfinite(covered) else ""
    return f"from the axis{reached}"


def uncertainty_words(certain: FieldUncertainty) -> str:
    """Return ``0.009 px (1σ, median over the field; 95 % of it within 0.013 px)``."""
    return f"{certain.median_px:.3f} px ({uncertainty_meaning(certain)})"


def uncertainty_meaning(certain: FieldUncertainty) -> str:
    """Return the meaning of the median, which stands behind it, with the other figure."""
    return f"1σ, median over the field; 95 % of it within {certain.p95_px:.3f} px"


def pupil_words(rim_px: float, distance: float, units: str | None) -> str:
    """Return ``close objects (33 cm) shift outward by 2.6 px at the rim``."""
    away, way = length_words(distance, units or ""), "inward" if rim_px < 0 else "outward"
    return f"close objects ({away}) shift {way} by {abs(rim_px):.1f} px at the rim"


def pictures_of(fit: FitRecord) -> str | None:
    """Return the names of the photos or frames of a fit; None where they are not known."""
    names = [photo.image for photo in fit.per_image]
    if fit.images <= 0:
        return None
    return counted(names if len(names) == fit.images else [""] * fit.images)


def verdict_line(judged: Verdict) -> str:
    """Return the verdict in one line: the word, and the figures or the first reason."""
    if not judged.reasons:
        return str(judged)
    more = len(judged.reasons) - 1
    others = f" (and {more} more reason{'s' * (more > 1)})" if more else ""
    first = render(judged.reasons[0])
    return f"{judged.words}: {first.why}{others}; {first.do}"


def verdict_record(judged: Verdict) -> dict[str, Any]:
    """Return plain data for JSON."""
    return {
        "level": judged.level,
        "words": judged.words,
        "figures": judged.figures,
        "reasons": [{**record_of(one), "why": render(one).why} for one in judged.reasons],
    }


def photo_words(findings: Sequence[Finding]) -> str:
    """Return the findings about a photo in a few words; ``good`` where there are none."""
    return "; ".join(render(finding).line for finding in findings) or "good"
