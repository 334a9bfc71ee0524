"""What a fit is worth by its figures: good, usable with care or not to be trusted, and why.

It reads the plain record that camera.yaml keeps, so that a calibration of last year is judged as
one of today is. Limits are in pixels of a photo of up to 2000 pixels per side; larger photos, whose
pixels are smaller, may be off by proportionally more of them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

from cubicfish_cli.assess.field_uncertainty import CERTAIN_PX
from cubicfish_cli.assess.records import recorded_number
from cubicfish_cli.types import FloatArray
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding, Level, asks_for_photos, level_of, of_record

WORDS: Mapping[Level, str] = {
    "good": "good",
    "care": "usable with care",
    "bad": "not to be trusted",
}
_SIDE = 2000.0
# Corners of a sharp photo are found to a tenth of a pixel; a whole one is a fault somewhere.
_ERROR_PX = (1.0, 3.0)
# A camera that is right to this on photos it never saw is not blamed for being righter on others.
_RIGHT_PX = 0.25
# Held-out error over that of the fit, and the held-out error from which that matters.
_OVERFIT = ((1.5, _RIGHT_PX), (3.0, 0.5))
# Held-out error over the radial reference's, which has a seventh of the parameters.
_BESIDE_COMPANION = ((1.05, _RIGHT_PX), (2.0, 0.5))
# Error on other photos over that when the camera was calibrated.
_WORSE_THAN_BEFORE = ((2.0, 0.1), (5.0, 0.5))
_COVERAGE = (0.5, 0.2)
_SEEN_SHARE = 0.3
# How far pixels may be off by all that photos say, of which corners' noise is the least: where a
# camera counts as certain, and where it is as bad as corners that are off by so much.
_MEDIAN_UNCERTAINTY_PX = (CERTAIN_PX, _ERROR_PX[1])
_RIM_UNCERTAINTY_PX = 2 * CERTAIN_PX
_DROPPED_SHARE = (0.05, 0.2)
_UNFIT_SHARE = (1 / 3, 1 / 2)
_FEW_CORNERS = 200
_FULL_RANK = {"ray": 16, "point": 20}
_FEW_PHOTOS = 3
# Photos of one flat board from which on a lens is known somehow, and well.
_FEW_OF_A_PLANE = (8, 4)
# Error at the rim over that in the middle, and the error from which that matters.
_RIM_ERROR = ((2.5, _RIGHT_PX), (math.inf, math.inf))
# Less of the rim than this is told beside the coverage of the whole.
_WHOLE_RIM = 0.9
# A field that goes so many degrees beyond where corners are all around, and is uncertain there.
_EXTRAPOLATED_DEG = 15.0
# Findings that explain no errors.
_NO_ERRORS = (Code.REPEATS, Code.ONE_PLACE)
_WORSE_PHOTO = 3.0
_FEW_CORNERS_IN_PHOTO = 20


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What a fit is worth.

    Attributes:
        level: the worst of the reasons'; ``good`` without any.
        figures: the figures that it rests on, in words.
        reasons: what is against the camera: causes that are known, then the rest, the worst first.

    """

    level: Level
    figures: str
    reasons: tuple[Finding, ...]

    @property
    def words(self) -> str:
        """``good``, ``usable with care`` or ``not to be trusted``."""
        return WORDS[self.level]

    @property
    def asks_for_photos(self) -> bool:
        """Whether a reason says to take photos, more or others."""
        return asks_for_photos(self.reasons)

    @property
    def line(self) -> str:
        """All in one line: the word, and the figures or the first reason."""
        if not self.reasons:
            return f"{self.words}: {self.figures}"
        more = len(self.reasons) - 1
        others = f" (and {more} more reason{'s' * (more > 1)})" if more else ""
        first = self.reasons[0]
        return f"{self.words}: {first.why}{others}; {first.do}"

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "level": self.level,
            "words": self.words,
            "figures": self.figures,
            "reasons": [{**reason.as_record(), "why": reason.why} for reason in self.reasons],
        }


def verdict(
    fit: Mapping[str, Any], image_size: tuple[int, int], outline: FloatArray | None = None
) -> Verdict:
    """Judge a fit by its record.

    Args:
        fit: what ``as_record`` of a calibration gives and camera.yaml keeps; a figure that is
            missing or no finite number counts as not known.
        image_size: (width, height), pixels.
        outline: (K, 2) the field within the photo where the camera may be trusted, pixels;
            None where there is none.

    """
    scale = max(1.0, max(image_size) / _SIDE)
    causes, asides = _of_findings(fit)
    reasons = [
        *asides,
        *_of_errors(fit, scale),
        *_of_held_out(fit, scale),
        *_of_photos(fit),
        *_of_field(fit, image_size, outline),
        *_of_rim(fit, scale),
        *_of_uncertainty(fit, scale),
        *_of_what_was_left_out(fit),
        *_of_object(fit),
    ]
    reasons.sort(key=_is_mild)
    reasons = [*sorted(causes, key=_is_mild), *reasons]
    return Verdict(
        level=level_of(reasons),
        figures=_figures(fit),
        reasons=tuple(reasons),
    )


def evaluation_verdict(
    record: Mapping[str, Any], fit: Mapping[str, Any], image_size: tuple[int, int]
) -> Verdict:
    """Judge how a camera does on photos that it was not fitted to.

    Args:
        record: what ``as_record`` of an evaluation gives.
        fit: the record of the camera's own fit; empty where its file has none.
        image_size: (width, height), pixels.

    """
    scale = max(1.0, max(image_size) / _SIDE)
    rms, p95 = _number(record, "rms_px"), _number(record, "p95_px")
    before = _number(fit, "held_out_rms_px") or _number(fit, "rms_px")
    if rms is None:
        return Verdict(level="bad", figures="no figures are known", reasons=())
    beside = "" if before is None else f", against {before:.3f} px when it was calibrated"
    reasons = []
    level = _ratio_above(rms, before, _WORSE_THAN_BEFORE, scale)
    if level is not None and before:
        figures = {"rms_px": rms, "before_px": before, "times": rms / before}
        if p95 is not None and p95 <= 3 * before:
            figures["p95_px"] = p95
            reasons.append(
                Finding(code=Code.A_FEW_FAR_OFF, severity=Severity.CARE, figures=figures)
            )
        else:
            reasons.append(Finding(code=Code.WORSE_THAN_BEFORE, severity=level, figures=figures))
    else:
        reasons += _reason(
            _above(rms / scale, _ERROR_PX), Code.LARGE_ERRORS, "evaluation", error_px=rms
        )
    return Verdict(
        level=level_of(reasons),
        figures=f"off by {rms:.3f} px on these photos{beside}",
        reasons=tuple(reasons),
    )


def photo_verdicts(
    fit: Mapping[str, Any], image_size: tuple[int, int]
) -> list[tuple[Finding, ...]]:
    """What is told of each photo of ``per_image``: its errors, also beside those of the others."""
    most = _ERROR_PX[0] * max(1.0, max(image_size) / _SIDE)
    records = [record for record in _list(fit, "per_image") if isinstance(record, Mapping)]
    errors = [_number(record, "rms_px") for record in records]
    typical = median([error for error in errors if error is not None] or [0.0])
    lost = Counter(
        str(corner.get("image"))
        for corner in _list(fit, "dropped_corners")
        if isinstance(corner, Mapping)
    )
    told = []
    for record, error in zip(records, errors, strict=True):
        corners, dropped = _number(record, "corners") or 0, lost[str(record.get("image"))]
        own: list[Finding] = []
        if error is not None and len(errors) > 1 and error > _WORSE_PHOTO * typical > 0:
            own += _reason(Severity.BAD, Code.STANDS_OUT, times=error / typical)
        elif error is not None and error > most:
            own += _reason(Severity.BAD, Code.LARGE_ERRORS, "photo")
        if dropped:
            own += _reason(Severity.CARE, Code.OUTLIERS, dropped=dropped)
        if corners < _FEW_CORNERS_IN_PHOTO:
            own += _reason(Severity.CARE, Code.FEW_CORNERS, "photo")
        told.append(tuple(own))
    return told


def _is_mild(reason: Finding) -> bool:
    return reason.severity is not Severity.BAD


def _reason(level: Severity | None, code: Code, case: str = "", **figures: Any) -> list[Finding]:
    """That one thing, if there is a level of it."""
    return [] if level is None else [Finding(code=code, severity=level, case=case, figures=figures)]


def _of_findings(fit: Mapping[str, Any]) -> tuple[list[Finding], list[Finding]]:
    """What a diagnosis blames, but for what is no fault of the camera.

    Returns:
        What explains errors, and what does not.

    """
    told = [of_record(one) for one in _list(fit, "findings") if isinstance(one, Mapping)]
    against = [one for one in told if one is not None and one.severity is not Severity.NOTE]
    causes = [one for one in against if one.code not in _NO_ERRORS]
    return causes, [one for one in against if one.code in _NO_ERRORS]


def _of_errors(fit: Mapping[str, Any], scale: float) -> Iterator[Finding]:
    held_out, rms = _number(fit, "held_out_rms_px"), _number(fit, "rms_px")
    if held_out is None and rms is None:
        yield from _reason(Severity.BAD, Code.NO_FIGURES)
        return
    error = max(value for value in (held_out, rms) if value is not None)
    yield from _reason(_above(error / scale, _ERROR_PX), Code.LARGE_ERRORS, error_px=error)
    corners = _number(fit, "corners")
    if corners is not None and corners < _FEW_CORNERS:
        yield from _reason(Severity.CARE, Code.FEW_CORNERS, corners=corners)


def _of_held_out(fit: Mapping[str, Any], scale: float) -> Iterator[Finding]:
    held_out, rms = _number(fit, "held_out_rms_px"), _number(fit, "rms_px")
    if held_out is None:
        photos = _number(fit, "images")
        few = photos is not None and photos < _FEW_PHOTOS
        yield from _reason(
            Severity.CARE, Code.NOT_HELD_OUT, "few" if photos and few else "", photos=photos
        )
        return
    level = _ratio_above(held_out, rms, _OVERFIT, scale)
    if rms:
        yield from _reason(level, Code.OVERFITTED, held_out_px=held_out, times=held_out / rms)
    reference = _number(fit, "companion_held_out_rms_px")
    level = _ratio_above(held_out, reference, _BESIDE_COMPANION, scale)
    if reference:
        yield from _reason(level, Code.RADIAL_IS_NEARER, held_out_px=held_out, radial_px=reference)


def _of_photos(fit: Mapping[str, Any]) -> Iterator[Finding]:
    """One flat board leaves much of a lens open in each photo: the others must tell it."""
    photos = _number(fit, "images")
    if fit.get("flat") is not True or photos is None:
        return
    level = _above(1 - photos, (1 - _FEW_OF_A_PLANE[0], 1 - _FEW_OF_A_PLANE[1]))
    bad = level is Severity.BAD
    yield from _reason(level, Code.FEW_PHOTOS_OF_A_PLANE, photos=photos, bad=bad)


def _of_rim(fit: Mapping[str, Any], scale: float) -> Iterator[Finding]:
    """What is off at the rim, and what lies beyond the corners."""
    record = fit.get("reach")
    record = record if isinstance(record, Mapping) else {}
    rim, middle = _number(record, "rim_rms_px"), _number(record, "middle_rms_px")
    start = _number(record, "rim_from_deg")
    if rim is not None and middle is not None and start is not None:
        yield from _reason(
            _ratio_above(rim, middle, _RIM_ERROR, scale),
            Code.WORSE_AT_THE_RIM,
            middle_px=middle,
            rim_px=rim,
            from_deg=start,
        )
    covered, around = _number(fit, "covered_deg"), _number(record, "all_around_deg")
    edge = _number(record, "edge_uncertainty_px")
    if covered is None or around is None or edge is None:
        return
    if covered - around > _EXTRAPOLATED_DEG and edge / scale > CERTAIN_PX:
        yield from _reason(
            Severity.CARE, Code.EXTRAPOLATED, covered_deg=covered, around_deg=around, edge_px=edge
        )


def _of_field(
    fit: Mapping[str, Any], image_size: tuple[int, int], outline: FloatArray | None
) -> Iterator[Finding]:
    share = _number(fit, "coverage")
    if share is not None:
        level = _above(-share, (-_COVERAGE[0], -_COVERAGE[1]))
        yield from _reason(level, Code.LOW_COVERAGE, share=share)
    if outline is not None and len(outline) > 2:
        seen = _area(outline) / (image_size[0] * image_size[1])
        if seen < _SEEN_SHARE:
            yield from _reason(Severity.CARE, Code.SMALL_FIELD, share=seen)
    lift = "point" if fit.get("lift") == "point" else "ray"
    rank, full = _number(fit, "rank"), _FULL_RANK[lift]
    if rank is not None and rank < full:
        case = "point" if lift == "point" else ""
        yield from _reason(Severity.CARE, Code.LOW_RANK, case, rank=rank, full=full)


def _of_uncertainty(fit: Mapping[str, Any], scale: float) -> Iterator[Finding]:
    record = fit.get("uncertainty")
    record = record if isinstance(record, Mapping) else {}
    typical, most = _number(record, "median_px"), _number(record, "max_px")
    level = None if typical is None else _above(typical / scale, _MEDIAN_UNCERTAINTY_PX)
    if level is not None:
        yield from _reason(level, Code.UNCERTAIN, median_px=typical)
    elif most is not None and most / scale > _RIM_UNCERTAINTY_PX:
        yield from _reason(Severity.CARE, Code.UNCERTAIN, "somewhere", max_px=most)


def _of_what_was_left_out(fit: Mapping[str, Any]) -> Iterator[Finding]:
    dropped, corners = _number(fit, "dropped") or 0, _number(fit, "corners") or 0
    level = _above(dropped / max(dropped + corners, 1), _DROPPED_SHARE)
    yield from _reason(level, Code.MANY_OUTLIERS, dropped=dropped, corners=dropped + corners)
    unfit = fit.get("unfit_images")
    left_out = len(unfit) if isinstance(unfit, Mapping) else 0
    photos = left_out + (_number(fit, "images") or 0)
    level = _above(left_out / max(photos, 1), _UNFIT_SHARE)
    yield from _reason(level, Code.MANY_UNFIT, left_out=left_out, photos=photos)


def _of_object(fit: Mapping[str, Any]) -> Iterator[Finding]:
    for departure in _list(fit, "departures"):
        if not isinstance(departure, Mapping):
            continue
        known = [of_record(one) for one in _list(departure, "doubted") if isinstance(one, Mapping)]
        doubts = [one.what for one in known if one is not None]
        older = [str(doubt) for doubt in _list(departure, "doubts")]  # with no codes beside them
        if doubts or older:
            yield from _reason(
                Severity.CARE,
                Code.BOARD_DOUBTED,
                "" if doubts else "older",
                board=str(departure.get("board")),
                doubted=", and ".join(doubts or older),
            )


def _figures(fit: Mapping[str, Any]) -> str:
    held_out, rms = _number(fit, "held_out_rms_px"), _number(fit, "rms_px")
    reference, coverage = _number(fit, "companion_held_out_rms_px"), _number(fit, "coverage")
    covered = _number(fit, "covered_deg")
    parts = []
    if held_out is not None:
        beside = f" (a radial lens: {reference:.3f})" if reference is not None else ""
        parts.append(f"off by {held_out:.3f} px{beside} on photos left out of the fit")
    elif rms is not None:
        parts.append(f"off by {rms:.3f} px on the photos that it was fitted to")
    if coverage is not None and covered is not None:
        parts.append(
            f"corners cover {100 * coverage:.0f} % of the field{_of_its_rim(fit)}, out to "
            f"{covered:.0f}° from the axis"
        )
    unfit = fit.get("unfit_images")
    if isinstance(unfit, Mapping) and unfit:
        parts.append(f"{len(unfit)} photo{'s' * (len(unfit) != 1)} left out")
    return ", ".join(parts) or "no figures are known"


def _of_its_rim(fit: Mapping[str, Any]) -> str:
    record = fit.get("reach")
    share = _number(record, "rim_coverage") if isinstance(record, Mapping) else None
    poor = share is not None and share < _WHOLE_RIM
    return f" and {100 * (share or 0):.0f} % of its rim" if poor else ""


def _above(value: float, limits: Sequence[float]) -> Severity | None:
    if value > limits[1]:
        return Severity.BAD
    return Severity.CARE if value > limits[0] else None


def _ratio_above(
    value: float, other: float | None, limits: Sequence[tuple[float, float]], scale: float
) -> Severity | None:
    """The level at which a value is too many times another one, and large enough to matter."""
    if other is None:
        return None
    (care, least), (bad, much) = limits
    if value > bad * other and value > much * scale:
        return Severity.BAD
    return Severity.CARE if value > care * other and value > least * scale else None


def _area(outline: FloatArray) -> float:
    x, y = outline.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


def _number(record: Mapping[str, Any], key: str) -> float | None:
    return recorded_number(record.get(key))


def _list(record: Mapping[str, Any], key: str) -> list[Any]:
    value = record.get(key)
    return value if isinstance(value, list) else []
