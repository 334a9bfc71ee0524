"""A fit's figures in words: good, usable with care or not to be trusted; why; and what to do.

It reads the plain record that camera.yaml keeps, so that a calibration of last year is judged as
one of today is. Limits are in pixels of a photo of up to 2000 pixels a side; larger photos, whose
pixels are smaller, may be off by proportionally more of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from cubicfish_cli.fitting.reach import CERTAIN_PX

FloatArray = npt.NDArray[np.float64]
Level = Literal["good", "care", "bad"]

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
# Held-out error over the radial companion's, which has a seventh of the parameters.
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
_NO_ERRORS = ("repeats", "one_place")
_WORSE_PHOTO = 3.0
_FEW_CORNERS_IN_PHOTO = 20


@dataclass(frozen=True, kw_only=True)
class Reason:
    """Something against a camera.

    Attributes:
        level: ``care`` or ``bad``.
        why: what the figures say.
        do: what to do about it.

    """

    level: Level
    why: str
    do: str


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
    reasons: tuple[Reason, ...]

    @property
    def words(self) -> str:
        """``good``, ``usable with care`` or ``not to be trusted``."""
        return WORDS[self.level]

    @property
    def asks_for_photos(self) -> bool:
        """Whether a reason says to take photos, more or others."""
        return any(reason.do.startswith("take ") for reason in self.reasons)

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
            "reasons": [
                {"level": reason.level, "why": reason.why, "do": reason.do}
                for reason in self.reasons
            ],
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
        level=min(reasons, key=_is_mild).level if reasons else "good",
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
    if level is not None and before and p95 is not None and p95 <= 3 * before:
        reasons.append(
            Reason(
                level="care",
                why=f"most corners are within {p95:.3f} px, and a few are far off (RMS "
                f"{rms:.3f} px{beside})",
                do="look at the photos with the largest errors",
            )
        )
    elif level is not None and before:
        reasons.append(
            Reason(
                level=level,
                why=f"it is off by {rms:.3f} px, {rms / before:.1f} times as much as when it was "
                f"calibrated ({before:.3f} px)",
                do="if lens, focus and zoom are as they were and this is the same object, "
                "calibrate again and see what has moved ('cubicfish compare')",
            )
        )
    elif _above(rms / scale, _ERROR_PX) is not None:
        reasons.append(
            Reason(
                level=_above(rms / scale, _ERROR_PX) or "care",
                why=f"it is off by {rms:.2f} px, and good photos of a well-measured object give a "
                "tenth of a pixel or two",
                do="check that camera, object and photos belong together",
            )
        )
    return Verdict(
        level=reasons[0].level if reasons else "good",
        figures=f"off by {rms:.3f} px on these photos{beside}",
        reasons=tuple(reasons),
    )


def photo_verdicts(fit: Mapping[str, Any], image_size: tuple[int, int]) -> list[str]:
    """A word on each photo of ``per_image``: its errors, also beside those of the others."""
    most = _ERROR_PX[0] * max(1.0, max(image_size) / _SIDE)
    records = [record for record in _list(fit, "per_image") if isinstance(record, Mapping)]
    errors = [_number(record, "rms_px") for record in records]
    typical = median([error for error in errors if error is not None] or [0.0])
    lost: dict[str, int] = {}
    for corner in _list(fit, "dropped_corners"):
        if isinstance(corner, Mapping):
            lost[str(corner.get("image"))] = lost.get(str(corner.get("image")), 0) + 1
    words = []
    for record, error in zip(records, errors, strict=True):
        corners, dropped = _number(record, "corners") or 0, lost.get(str(record.get("image")), 0)
        said = []
        if error is not None and len(errors) > 1 and error > _WORSE_PHOTO * typical > 0:
            said.append(f"{error / typical:.0f} times the others' error: look at it")
        elif error is not None and error > most:
            said.append("large errors")
        if dropped:
            said.append(f"{dropped} dropped")
        if corners < _FEW_CORNERS_IN_PHOTO:
            said.append("few corners")
        words.append("; ".join(said) or "good")
    return words


def _is_mild(reason: Reason) -> bool:
    return reason.level != "bad"


def _of_findings(fit: Mapping[str, Any]) -> tuple[list[Reason], list[Reason]]:
    """What a diagnosis blames (fitting/diagnosis), but for what is no fault of the camera.

    Returns:
        What explains errors, and what does not.

    """
    causes: list[Reason] = []
    asides: list[Reason] = []
    for finding in _list(fit, "findings"):
        if not isinstance(finding, Mapping):
            continue
        level = finding.get("level")
        if level == "bad" or level == "care":
            reason = Reason(
                level="bad" if level == "bad" else "care",
                why=f"{finding.get('what')} ({finding.get('evidence')})",
                do=str(finding.get("do")),
            )
            (asides if finding.get("cause") in _NO_ERRORS else causes).append(reason)
    return causes, asides


def _of_errors(fit: Mapping[str, Any], scale: float) -> Iterator[Reason]:
    held_out, rms = _number(fit, "held_out_rms_px"), _number(fit, "rms_px")
    if held_out is None and rms is None:
        yield Reason(
            level="bad",
            why="the file does not say how well the camera fits",
            do="calibrate again",
        )
        return
    error = max(value for value in (held_out, rms) if value is not None)
    level = _above(error / scale, _ERROR_PX)
    if level is not None:
        yield Reason(
            level=level,
            why=f"corners are off by {error:.2f} px, and good photos of a well-measured object "
            "give a tenth of a pixel or two",
            do="compare target.yaml with the object (inner corners, square, places: 'cubicfish "
            "target check --draw'), and look at the photos with the largest errors",
        )
    corners = _number(fit, "corners")
    if corners is not None and corners < _FEW_CORNERS:
        yield Reason(
            level="care",
            why=f"{corners:.0f} corners are few: some hundreds make a good camera",
            do="take more photos, or use boards with more squares",
        )


def _of_held_out(fit: Mapping[str, Any], scale: float) -> Iterator[Reason]:
    held_out, rms = _number(fit, "held_out_rms_px"), _number(fit, "rms_px")
    if held_out is None:
        photos = _number(fit, "images")
        few = photos is not None and photos < _FEW_PHOTOS
        yield Reason(
            level="care",
            why=(f"from {photos:.0f} photo{'s' * (photos != 1)} " if photos and few else "")
            + "it is not known how right the camera is on photos that it has not seen",
            do="take three or more photos"
            if few
            else "calibrate with --hold-out, or take more photos if that was on",
        )
        return
    level = _ratio_above(held_out, rms, _OVERFIT, scale)
    if level is not None and rms:
        yield Reason(
            level=level,
            why=f"on photos left out of the fit it is off by {held_out:.3f} px, "
            f"{held_out / rms:.1f} times as much as on those that it was fitted to",
            do="take more photos, and more than one with corners in each part of the picture",
        )
    companion = _number(fit, "companion_held_out_rms_px")
    level = _ratio_above(held_out, companion, _BESIDE_COMPANION, scale)
    if level is not None and companion:
        yield Reason(
            level=level,
            why=f"on photos left out of the fit a plain radial lens is nearer ({companion:.3f} px "
            f"against {held_out:.3f} px): the corners do not carry so rich a camera",
            do="take more photos, with corners out to the rim",
        )


def _of_photos(fit: Mapping[str, Any]) -> Iterator[Reason]:
    """One flat board leaves much of a lens open in each photo: the others must tell it."""
    photos = _number(fit, "images")
    if fit.get("flat") is not True or photos is None:
        return
    level = _above(1 - photos, (1 - _FEW_OF_A_PLANE[0], 1 - _FEW_OF_A_PLANE[1]))
    if level is not None:
        yield Reason(
            level=level,
            why=f"{photos:.0f} photo{'s' * (photos != 1)} of one flat board "
            + ("do not tell a lens from the board's poses" if level == "bad" else "are few"),
            do="take ten or more, tilted, near and far, out to the rim",
        )


def _of_rim(fit: Mapping[str, Any], scale: float) -> Iterator[Reason]:
    """What is off at the rim, and what lies beyond the corners."""
    record = fit.get("reach")
    record = record if isinstance(record, Mapping) else {}
    rim, middle = _number(record, "rim_rms_px"), _number(record, "middle_rms_px")
    start = _number(record, "rim_from_deg")
    level = None if rim is None else _ratio_above(rim, middle, _RIM_ERROR, scale)
    if level is not None and rim is not None and middle is not None and start is not None:
        yield Reason(
            level=level,
            why=f"it is off by {middle:.2g} px in the middle and by {rim:.2g} px beyond "
            f"{start:.0f}° from the axis",
            do="take more photos with corners out there, or trust it less there",
        )
    covered, around = _number(fit, "covered_deg"), _number(record, "all_around_deg")
    edge = _number(record, "edge_uncertainty_px")
    if covered is None or around is None or edge is None:
        return
    if covered - around > _EXTRAPOLATED_DEG and edge / scale > CERTAIN_PX:
        yield Reason(
            level="care",
            why=f"corners reach {covered:.0f}° from the axis on some sides and {around:.0f}° all "
            f"around: beyond that it is extrapolated, uncertain by {edge:.2g} px at the field's "
            "edge",
            do="take photos with the object at the rim on the other sides",
        )


def _of_field(
    fit: Mapping[str, Any], image_size: tuple[int, int], outline: FloatArray | None
) -> Iterator[Reason]:
    share = _number(fit, "coverage")
    level = None if share is None else _above(-share, (-_COVERAGE[0], -_COVERAGE[1]))
    if level is not None and share is not None:
        yield Reason(
            level=level,
            why=f"corners cover only {100 * share:.0f} % of the field, and the figures say "
            "nothing of the rest",
            do="take photos with the object in the empty parts",
        )
    if outline is not None and len(outline) > 2:
        seen = _area(outline) / (image_size[0] * image_size[1])
        if seen < _SEEN_SHARE:
            yield Reason(
                level="care",
                why=f"it may be trusted over {100 * seen:.0f} % of the photo only, as far as the "
                "corners reach",
                do="if the lens shows more than that, take photos with the object near the rim",
            )
    lift = "point" if fit.get("lift") == "point" else "ray"
    rank = _number(fit, "rank")
    if rank is not None and rank < _FULL_RANK[lift]:
        where = "on the boards only" if lift == "point" else "where the corners lie only"
        yield Reason(
            level="care",
            why=f"the corners determine {rank:.0f} of {_FULL_RANK[lift]} cubics: the camera means "
            f"something {where}",
            do="add boards in other planes, or calibrate with --lift ray"
            if lift == "point"
            else "take photos with the object in other parts of the picture",
        )


def _of_uncertainty(fit: Mapping[str, Any], scale: float) -> Iterator[Reason]:
    record = fit.get("uncertainty")
    record = record if isinstance(record, Mapping) else {}
    typical, most = _number(record, "median_px"), _number(record, "max_px")
    level = None if typical is None else _above(typical / scale, _MEDIAN_UNCERTAINTY_PX)
    if level is not None:
        yield Reason(
            level=level,
            why=f"its pixels are uncertain by {typical:.2f} px (one standard deviation, median "
            "over the field)",
            do="take more photos, sharper ones, or boards with more squares",
        )
    elif most is not None and most / scale > _RIM_UNCERTAINTY_PX:
        yield Reason(
            level="care",
            why=f"its pixels are uncertain by up to {most:.2f} px at the worst place of the field",
            do="take photos with corners there (the map of uncertainty shows where), or leave it "
            "out with --mask-limit",
        )


def _of_what_was_left_out(fit: Mapping[str, Any]) -> Iterator[Reason]:
    dropped, corners = _number(fit, "dropped") or 0, _number(fit, "corners") or 0
    level = _above(dropped / max(dropped + corners, 1), _DROPPED_SHARE)
    if level is not None:
        yield Reason(
            level=level,
            why=f"{dropped:.0f} of {dropped + corners:.0f} corners were grossly wrong and are left "
            "out",
            do="see which boards or photos they are of: a board that moved, a wrong count of "
            "inner corners or a wrong name in corners.csv",
        )
    unfit = fit.get("unfit_images")
    left_out = len(unfit) if isinstance(unfit, Mapping) else 0
    photos = left_out + (_number(fit, "images") or 0)
    level = _above(left_out / max(photos, 1), _UNFIT_SHARE)
    if level is not None:
        yield Reason(
            level=level,
            why=f"{left_out} of {photos:.0f} photos do not fit and are left out",
            do="take them again: sharp, of an object that does not move, as the sensor made them",
        )


def _of_object(fit: Mapping[str, Any]) -> Iterator[Reason]:
    for departure in _list(fit, "departures"):
        doubts = departure.get("doubts") if isinstance(departure, Mapping) else None
        if isinstance(departure, Mapping) and isinstance(doubts, list) and doubts:
            yield Reason(
                level="care",
                why=f"board {departure.get('board')} seems "
                + ", and ".join(str(doubt).partition(":")[0] for doubt in doubts)
                + ", more than paper or plate explains",
                do="measure the object again, correct target.yaml and calibrate again",
            )


def _figures(fit: Mapping[str, Any]) -> str:
    held_out, rms = _number(fit, "held_out_rms_px"), _number(fit, "rms_px")
    companion, coverage = _number(fit, "companion_held_out_rms_px"), _number(fit, "coverage")
    covered = _number(fit, "covered_deg")
    parts = []
    if held_out is not None:
        beside = f" (a radial lens: {companion:.3f})" if companion is not None else ""
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


def _above(value: float, limits: Sequence[float]) -> Level | None:
    return "bad" if value > limits[1] else "care" if value > limits[0] else None


def _ratio_above(
    value: float, other: float | None, limits: Sequence[tuple[float, float]], scale: float
) -> Level | None:
    """The level at which a value is too many times another one, and large enough to matter."""
    if other is None:
        return None
    (care, least), (bad, much) = limits
    if value > bad * other and value > much * scale:
        return "bad"
    return "care" if value > care * other and value > least * scale else None


def _area(outline: FloatArray) -> float:
    x, y = outline.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


def _number(record: Mapping[str, Any], key: str) -> float | None:
    """A finite number of a record that nobody vouches for."""
    value = record.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def _list(record: Mapping[str, Any], key: str) -> list[Any]:
    value = record.get(key)
    return value if isinstance(value, list) else []
