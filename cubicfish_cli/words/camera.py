"""A camera in words: its key figures in one line and in rows, and the verdict."""

import math
from collections.abc import Mapping, Sequence

from cubicfish import Finding, Verdict
from cubicfish.judge import CameraFacts, ErrorStatistics, FieldUncertainty, FitRecord
from cubicfish_cli.words.phrases import counted, length_words

LEVELS: Mapping[str, str] = {
    "good": "good",
    "care": "usable with care",
    "bad": "not to be trusted",
}
COVERED = "of the field covered by corners"
"""The whole of which a coverage is a share, wherever it is printed. The field is where the camera
may be trusted and does not see itself, in squares of an eighth of the photo's shorter side."""
_UNKNOWN = "no figures are known"
# The coverage of the rim is printed beside that of the whole if it is less than this.
_WHOLE_RIM = 0.9


def camera_line(known: CameraFacts) -> str:
    """Return the key figures in one line, without the name that the camera's owner gave it."""
    figures = camera_figures(known)
    return f"{known.title}: {figures}" if known.title else figures


def camera_figures(known: CameraFacts) -> str:
    """Return ``1280x960 px, sees 174° x 143° (...), focal length 384.2 px, ..., good``."""
    fit, seen = known.fit, known.field
    parts = ["{}x{} px".format(*known.camera.image_size)]
    if seen is not None:
        around = f"{seen.horizontal:.0f}° x {seen.vertical:.0f}°"
        parts.append(f"sees {around} ({seen.diagonal:.0f}° diagonal)")
        if known.max_angle_deg is not None and seen.beyond(known.max_angle_deg):
            parts.append(f"calibrated to {known.max_angle_deg:.0f}° from the axis")
    if known.axis is not None:
        focal, (x, y) = known.axis
        parts.append(f"focal length {sum(focal) / 2:.1f} px, principal point ({x:.1f}, {y:.1f})")
    if math.isfinite(fit.held_out_rms_px):
        parts.append(f"held-out error {fit.held_out_rms_px:.3f} px")
    elif known.is_measured:
        parts.append(f"error {fit.rms_px:.3f} px RMS")
    if known.is_measured:
        parts.append(known.verdict.words)
    return ", ".join(parts)


def lens_rows(known: CameraFacts) -> list[tuple[str, str]]:
    """Return the figures of the lens that are known, a name and a text each."""
    rows = []
    units = (("focal length", "px per radian"), ("principal point", "px"))
    for (name, unit), value, sigma in zip(units, known.axis or (), known.axis_sigma, strict=False):
        x, y = ("", "") if sigma is None else (f" ± {one:.2f}" for one in sigma)
        rows.append((name, f"x {value[0]:.2f}{x}, y {value[1]:.2f}{y} {unit}"))
    if known.field is not None:
        seen = known.field
        words = (
            f"{seen.horizontal:.1f}° horizontal, {seen.vertical:.1f}° vertical, "
            f"{seen.diagonal:.1f}° diagonal"
        )
        rows.append(("field of view", words))
    if known.fit.pupil is not None:
        pupil = known.fit.pupil
        meaning = pupil_meaning(pupil.rim_px, pupil.distance, pupil.units)
        rows.append(("entrance pupil", f"{abs(pupil.rim_px):.3f} px: {meaning}"))
    return rows


def scope(known: CameraFacts) -> list[tuple[str, str, str, str]]:
    """Return the figures on how far to trust a camera: name, value, unit and meaning."""
    rows, fit = [], known.fit
    if known.max_angle_deg is not None:
        meaning = "from the axis, where the camera may be trusted"
        if math.isfinite(fit.covered_deg):
            meaning += f"; corners reach {fit.covered_deg:.1f}°"
        rows.append(("field", f"{known.max_angle_deg:.1f}", "°", meaning))
    if math.isfinite(fit.coverage):
        rows.append(("coverage", f"{100 * fit.coverage:.0f}", "%", COVERED))
    certain = fit.uncertainty.field
    if certain is not None:
        rows.append(("uncertainty", f"{certain.median_px:.3f}", "px", uncertainty_meaning(certain)))
    return rows


def uncertainty_words(certain: FieldUncertainty) -> str:
    """Return ``0.009 px (1σ, median over the field; 95 % of it within 0.013 px)``."""
    return f"{certain.median_px:.3f} px ({uncertainty_meaning(certain)})"


def uncertainty_meaning(certain: FieldUncertainty) -> str:
    """Return the meaning of the median, which stands behind it, with the other figure."""
    return f"1σ, median over the field; 95 % of it within {certain.p95_px:.3f} px"


def pupil_meaning(rim_px: float, distance: float, units: str | None) -> str:
    """Return the meaning of the effect of the moving pupil, whose size stands before it.

    Args:
        rim_px: how much farther from the axis a point is seen, pixels.
        distance: of that point.
        units: of the distance; None where it is not known.

    """
    away = length_words(distance, units or "")
    way = "nearer to" if rim_px < 0 else "farther from"
    return f"how much {way} the axis things {away} away appear at the rim than distant ones"


def pictures_of(fit: FitRecord) -> str | None:
    """Return the names of the photos or frames of a fit; None where they are not known."""
    names = [photo.image for photo in fit.per_image]
    if fit.images <= 0:
        return None
    return counted(names if len(names) == fit.images else [""] * fit.images)


def fit_figures(fit: FitRecord) -> str:
    """Return the figures that a verdict on a fit rests on."""
    radial, rim, parts = fit.companion_held_out_rms_px, fit.reach.rim_coverage, []
    if math.isfinite(fit.held_out_rms_px):
        beside = f" (a radial lens: {radial:.3f})" if math.isfinite(radial) else ""
        parts.append(f"off by {fit.held_out_rms_px:.3f} px{beside} on photos left out of the fit")
    elif math.isfinite(fit.rms_px):
        parts.append(f"off by {fit.rms_px:.3f} px on the photos that it was fitted to")
    if math.isfinite(fit.coverage + fit.covered_deg):
        beside = f" and {100 * rim:.0f} % of its rim" if rim < _WHOLE_RIM else ""
        parts.append(
            f"corners cover {100 * fit.coverage:.0f} % of the field{beside}, out to "
            f"{fit.covered_deg:.0f}° from the axis"
        )
    if out := len(fit.unfit_images):
        parts.append(f"{out} photo{'s' * (out != 1)} left out")
    return ", ".join(parts) or _UNKNOWN


def evaluation_figures(errors: ErrorStatistics, before_px: float) -> str:
    """Return the figures that a verdict on other photos rests on."""
    if math.isnan(errors.rms_px):
        return _UNKNOWN
    known = math.isfinite(before_px)
    beside = f", against {before_px:.3f} px when it was calibrated" if known else ""
    return f"off by {errors.rms_px:.3f} px on these photos{beside}"


def verdict_line(judged: Verdict) -> str:
    """Return the verdict in one line: the word, and the figures or the first reason."""
    if not judged.reasons:
        return f"{judged.words}: {judged.figures}"
    more = len(judged.reasons) - 1
    others = f" (and {more} more reason{'s' * (more > 1)})" if more else ""
    first = judged.reasons[0]
    return f"{judged.words}: {first.why}{others}; {first.do}"


def photo_words(findings: Sequence[Finding]) -> str:
    """Return the findings about a photo in a few words; ``good`` where there are none."""
    return "; ".join(finding.line for finding in findings) or "good"
