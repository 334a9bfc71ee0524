"""Verdict on a calibration: good, usable with care or not to be trusted, and why.

It reads the plain record that camera.yaml keeps, so that an old calibration is judged as a new one
is. Limits are in pixels of a photo of up to 2000 pixels per side; larger photos have
smaller pixels, and limits grow in proportion.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any, ClassVar

import numpy as np

from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding, VerdictLevel, level_of
from cubicfish.judge.fit_record import ErrorStatistics, FitRecord, PhotoRecord
from cubicfish.judge.uncertainty import CERTAIN_PX, TRUSTED_PX, FieldUncertainty, of_size
from cubicfish.types import FloatArray

# The limits of what is good are those that docs/expectations.md states.
#
# Corners of a sharp photo are found to a tenth of a pixel. An error of a whole pixel means that
# something is wrong, and no camera that comes of it is worth using.
_ERROR_PX = (0.5, 1.0)
# A camera with an error below this on photos that it never saw is not blamed for smaller ones
# elsewhere.
_RIGHT_PX = 0.25
# Ratio of the held-out error to that of the fit, and the held-out error from which it matters.
_OVERFIT = ((1.5, _RIGHT_PX), (3.0, 0.5))
# Ratio of the held-out error to that of the radial reference, which has a seventh of the
# parameters. It matters however small both are: a user of a radial lens would have the better
# camera.
_BESIDE_COMPANION = ((1.02, 0.0), (2.0, 0.5))
# Ratio of the error on other photos to that of the calibration, and the error from which it
# matters.
_WORSE_THAN_BEFORE = ((2.0, 0.1), (5.0, 0.5))
# Where much of the field has no corner, the figures of the rest say nothing about it.
COVERAGE = (0.9, 0.2)
_SEEN_SHARE = 0.3
# Uncertainty of the pixels: the median over the field up to which a camera counts as certain, and
# from which it is as bad as corners with such errors; and what 95 % of the field should be within.
_MEDIAN_UNCERTAINTY_PX = (CERTAIN_PX, TRUSTED_PX)
GOAL_PX = 0.2
_DROPPED_SHARE = (0.05, 0.2)
_REJECTED_SHARE = (1 / 3, 1 / 2)
_FEW_CORNERS = 200
FEWEST_OF_A_CUBIC = 30
"""Fewer corners say nothing of a lens's asymmetry: they are fitted by a radial lens alone."""
FEW_PHOTOS = 3
# Fewest photos of one flat board that determine a lens well, and fewest that determine it at all.
FEW_OF_A_PLANE = (8, 4)
# Ratio of the error at the rim to that in the middle, and the error from which it matters.
_RIM_ERROR = ((2.5, _RIGHT_PX), (math.inf, math.inf))
# The field may go so many degrees beyond where corners are all around, if it is uncertain there.
_EXTRAPOLATED_DEG = 15.0
# Findings that do not explain errors.
_NO_ERRORS = (Code.REPEATS, Code.ONE_PLACE)
# What is said in other words of points that people marked.
_OF_POINTS = (
    Code.LARGE_ERRORS,
    Code.FEW_CORNERS,
    Code.NOT_HELD_OUT,
    Code.OVERFITTED,
    Code.UNCERTAIN,
    Code.SMALL_FIELD,
    Code.LOW_COVERAGE,
    Code.EXTRAPOLATED,
    Code.MANY_OUTLIERS,
)
# Points may be off by so many times what they are said to be.
_BEYOND_MARKED = 2.0
# The coverage of the rim is stated beside that of the whole if it is less than this.
_WHOLE_RIM = 0.9
_UNKNOWN = "no figures are known"
_WORSE_PHOTO = 3.0
_FEW_CORNERS_IN_PHOTO = 20


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The verdict on a fit.

    Attributes:
        level: the level of the worst reason; ``good`` without any.
        figures: the figures that the verdict rests on, in one line.
        reasons: the findings against the camera: known causes first, then the rest, the worst
            first.

    """

    WORDS: ClassVar[Mapping[VerdictLevel, str]] = {
        "good": "good",
        "care": "usable with care",
        "bad": "not to be trusted",
    }
    """What is said of each level."""

    level: VerdictLevel
    figures: str = ""
    reasons: tuple[Finding, ...]

    @property
    def words(self) -> str:
        """``good``, ``usable with care`` or ``not to be trusted``."""
        return self.WORDS[self.level]

    def __str__(self) -> str:
        """The verdict in one line: the word, and the figures or the reasons."""
        reasons = "; ".join(map(str, self.reasons))
        return f"{self.words}: {reasons or self.figures}"


def verdict(
    fit: FitRecord, image_size: tuple[int, int], outline: FloatArray | None = None
) -> Verdict:
    """Judge a fit by its record.

    Args:
        fit: the record.
        image_size: (width, height), pixels.
        outline: (K, 2) the field within the photo where the camera may be trusted, pixels;
            None where there is none.

    """
    scale = of_size(image_size)
    blamed = [one for one in fit.findings if one.severity is not Severity.NOTE]
    causes = [one for one in blamed if one.code not in _NO_ERRORS]
    others = [one for one in blamed if one.code in _NO_ERRORS]
    others += _apply_rules(fit, image_size, outline, scale)
    if fit.marked is not None:  # who marked points has no boards, and no file that says where
        others = [replace(one, case="points") if one.code in _OF_POINTS else one for one in others]
    reasons = (*sorted(causes, key=_is_mild), *sorted(others, key=_is_mild))
    return Verdict(level=level_of(reasons), figures=_state_fit(fit), reasons=reasons)


def evaluation_verdict(
    errors: ErrorStatistics,
    uncertainty: FieldUncertainty | None,
    fit: FitRecord,
    image_size: tuple[int, int],
    photos: Sequence[PhotoRecord] = (),
) -> Verdict:
    """Judge how a camera does on photos that it was not fitted to.

    Args:
        errors: reprojection errors on these photos.
        uncertainty: uncertainty of the camera at their corners; None where it is not known.
        fit: the record of the camera's own fit.
        image_size: (width, height), pixels.
        photos: the errors in each of these photos.

    """
    scale = of_size(image_size)
    rms, before = errors.rms_px, fit.held_out_rms_px
    before = before if before > 0 else fit.rms_px
    if math.isnan(rms):
        return Verdict(level="bad", figures=_UNKNOWN, reasons=())
    beside = f", against {before:.3f} px when it was calibrated" if math.isfinite(before) else ""
    stated = f"off by {rms:.3f} px on these photos{beside}"
    level = ratio_above(rms, before, _WORSE_THAN_BEFORE, scale)
    if level is None:
        level = _rate(rms / scale, _ERROR_PX)
        reasons = _report(level, Code.LARGE_ERRORS, "evaluation", error_px=rms)
    else:
        figures: dict[str, Any] = {"rms_px": rms, "before_px": before, "times": rms / before}
        if apart := _find_photos_apart(photos, before, scale):
            reasons = apart
        elif errors.p95_px <= 3 * before:
            p95 = errors.p95_px
            reasons = _report(Severity.CARE, Code.A_FEW_FAR_OFF, **figures, p95_px=p95)
        else:
            reasons = _report(level, Code.WORSE_THAN_BEFORE, **figures)
    # The poses of these photos absorb much of a camera's error: small errors alone clear no camera.
    median_px = math.nan if uncertainty is None else uncertainty.median_px
    level = _rate(median_px, _limits_of_median(fit, scale))
    reasons += _report(level, Code.UNCERTAIN, "evaluation", median_px=median_px)
    reasons.sort(key=_is_mild)
    return Verdict(level=level_of(reasons), figures=stated, reasons=tuple(reasons))


def _find_photos_apart(photos: Sequence[PhotoRecord], before: float, scale: float) -> list[Finding]:
    """Find that all photos but a few have errors as before: it is these that are not as they were.

    Args:
        photos: the errors in each photo.
        before: RMS when the camera was calibrated, pixels.
        scale: of the photos, see :func:`of_size`.

    """
    typical = median([photo.rms_px for photo in photos] or [0.0])
    apart = [photo for photo in photos if photo.rms_px > _WORSE_PHOTO * typical]
    others = [photo for photo in photos if photo.rms_px <= _WORSE_PHOTO * typical]
    if not 0 < len(apart) < len(others):
        return []
    rest = _joint_rms(others)
    if ratio_above(rest, before, _WORSE_THAN_BEFORE, scale) is not None:
        return []
    found = Finding(
        code=Code.A_FEW_FAR_OFF,
        case="photos",
        severity=Severity.CARE,
        images=tuple(photo.image for photo in apart),
        figures={"rms_px": _joint_rms(apart), "rest_px": rest, "others": len(others)},
    )
    level = _rate(rest / scale, _ERROR_PX)
    return [found, *_report(level, Code.LARGE_ERRORS, "evaluation", error_px=rest)]


def _joint_rms(photos: Sequence[PhotoRecord]) -> float:
    """RMS over the corners of several photos, pixels."""
    square = sum(photo.corners * photo.rms_px**2 for photo in photos)
    return math.sqrt(square / sum(photo.corners for photo in photos))


def photo_verdicts(fit: FitRecord, image_size: tuple[int, int]) -> list[Verdict]:
    """The verdict on each photo: its errors, by themselves and beside those of the others."""
    photos = fit.per_image
    most = _most_px(fit, of_size(image_size))
    errors = [photo.rms_px for photo in photos]
    typical = median([error for error in errors if math.isfinite(error)] or [0.0])
    beside = typical if len(errors) > 1 else 0.0
    lost = Counter(corner.image for corner in fit.dropped_corners)
    enough = enough_corners([photo.corners for photo in photos])
    verdicts = []
    for photo in photos:
        own, out = _judge_error(photo.rms_px, beside, most), lost[photo.image]
        unknown = math.isnan(photo.rms_px) and photo.corners > 0
        own += _report(Severity.NOTE if unknown else None, Code.NO_ERROR)
        own += _report(Severity.CARE if out else None, Code.OUTLIERS, dropped=out)
        few = photo.corners < enough and fit.marked is None
        own += _report(Severity.CARE if few else None, Code.FEW_CORNERS, "photo")
        verdicts.append(Verdict(level=level_of(own), reasons=tuple(own)))
    return verdicts


def enough_corners(counts: Sequence[int]) -> float:
    """Return how many corners are not few for one of these photos, by how many each shows.

    Where most show as few, it is the board that has no more.
    """
    return min(_FEW_CORNERS_IN_PHOTO, median(counts or [0]))


def _judge_error(error: float, typical: float, most: float) -> list[Finding]:
    """Judge a photo's error beside those of the others, where there are any, and by itself."""
    if error > _WORSE_PHOTO * typical > 0:
        return _report(Severity.BAD, Code.STANDS_OUT, times=error / typical)
    return _report(Severity.BAD if error > most else None, Code.LARGE_ERRORS, "photo")


def _state_fit(fit: FitRecord) -> str:
    radial, rim, parts = fit.radial_held_out_rms_px, fit.reach.rim_coverage, []
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
        parts.append(f"{out:,} photo{'s' * (out != 1)} left out")
    return ", ".join(parts) or _UNKNOWN


def _is_mild(reason: Finding) -> bool:
    return reason.severity is not Severity.BAD


def _report(level: Severity | None, code: Code, case: str = "", **figures: Any) -> list[Finding]:
    """List this one finding; none where it has no level."""
    return [] if level is None else [Finding(code=code, severity=level, case=case, figures=figures)]


def _apply_rules(
    of: FitRecord, image_size: tuple[int, int], outline: FloatArray | None, scale: float
) -> Iterator[Finding]:
    """Apply one rule after the other, in the order of their weight; an unknown figure breaks none.

    The first rules say how wrong the camera is and why it cannot be right, the later ones where it
    is less so.
    """
    yield from _judge_errors(of, scale)
    yield from _judge_what_is_left_out(of)
    yield from _judge_field(of, image_size, outline, scale)


def _judge_errors(of: FitRecord, scale: float) -> Iterator[Finding]:
    held_out, rms, photos = of.held_out_rms_px, of.rms_px, of.images
    radial = of.radial_held_out_rms_px
    error = float(np.fmax(held_out, rms))
    if of.says_nothing:  # not a calibration of ours, such as an import
        yield from _report(Severity.CARE, Code.NO_FIGURES, "elsewhere")
    elif math.isnan(error):
        yield from _report(Severity.BAD, Code.NO_FIGURES)
    else:
        most = _most_px(of, scale)
        level = _rate(error, (_ERROR_PX[0] * scale if of.marked is None else most, most))
        yield from _report(level, Code.LARGE_ERRORS, error_px=error)
    case = "few" if 0 < photos < FEW_PHOTOS else ""
    level = _care_if(math.isnan(held_out) and not of.says_nothing)
    yield from _report(level, Code.NOT_HELD_OUT, case, photos=photos or None)
    # What is another in every photo is fitted to each, and more photos do not help.
    anew = any(one.case == "anew" for one in of.findings)
    level = None if anew else ratio_above(held_out, rms, _OVERFIT, scale)
    yield from _report(level, Code.OVERFITTED, held_out_px=held_out, times=held_out / (rms or 1))
    level = ratio_above(held_out, radial, _BESIDE_COMPANION, scale)
    yield from _report(level, Code.RADIAL_IS_NEARER, held_out_px=held_out, radial_px=radial)
    if of.flat and photos:  # each photo leaves much of a lens open: the others must determine it
        level = _rate(1 - photos, (1 - FEW_OF_A_PLANE[0], 1 - FEW_OF_A_PLANE[1]))
        bad = level is Severity.BAD
        yield from _report(level, Code.FEW_PHOTOS_OF_A_PLANE, photos=photos, bad=bad)


def _judge_what_is_left_out(of: FitRecord) -> Iterator[Finding]:
    """Rules on the photos and corners that were left out, and on what they leave open."""
    dropped, used = of.dropped, of.corners
    level = _rate(dropped / max(dropped + used, 1), _DROPPED_SHARE)
    yield from _report(level, Code.MANY_OUTLIERS, dropped=dropped, corners=dropped + used)
    left_out = len(of.unfit_images)
    every = left_out + of.images
    level = _rate(left_out / max(every, 1), _REJECTED_SHARE)
    yield from _report(level, Code.MANY_UNFIT, left_out=left_out, photos=every)
    lift, full = ("point", 20) if of.lift == "point" else ("", 16)
    yield from _report(_care_if(0 < of.rank < full), Code.LOW_RANK, lift, rank=of.rank, full=full)


def _judge_field(
    of: FitRecord, image_size: tuple[int, int], outline: FloatArray | None, scale: float
) -> Iterator[Finding]:
    """Rules on the field: at the rim, and beyond the corners."""
    extent, used = of.reach, of.corners
    rim, middle, start = extent.rim_rms_px, extent.middle_rms_px, extent.rim_from_deg
    level = None if math.isnan(start) else ratio_above(rim, middle, _RIM_ERROR, scale)
    yield from _report(level, Code.WORSE_AT_THE_RIM, middle_px=middle, rim_px=rim, from_deg=start)
    seen = math.nan
    if outline is not None and len(outline) > 2:
        seen = share_within(outline, image_size)
    yield from _report(_care_if(seen < _SEEN_SHARE), Code.SMALL_FIELD, share=seen)
    enough = _FEW_CORNERS if of.marked is None else FEWEST_OF_A_CUBIC
    yield from _report(_care_if(0 < used < enough), Code.FEW_CORNERS, corners=used)
    # What follows from the above, and what half of all cameras have.
    level = _rate(-of.coverage, (-COVERAGE[0], -COVERAGE[1]))
    yield from _report(level, Code.LOW_COVERAGE, share=of.coverage)
    covered, around, edge = of.covered_deg, extent.all_around_deg, extent.edge_uncertainty_px
    certain = max(CERTAIN_PX * scale, of.goal_px or 0.0)
    level = _care_if(covered - around > _EXTRAPOLATED_DEG and edge > certain)
    yield from _judge_certainty(of, scale, is_rim_blamed=level is not None)
    yield from _report(
        level, Code.EXTRAPOLATED, covered_deg=covered, around_deg=around, edge_px=edge
    )


def _judge_certainty(of: FitRecord, scale: float, *, is_rim_blamed: bool) -> Iterator[Finding]:
    """Rules on the uncertainty over the field: by the goal that somebody asked for, if any.

    Where the rim is blamed with its reason, that it is uncertain is not said again.
    """
    known, goal = of.uncertainty, of.goal_px
    median_px, p95_px = known.median_px, known.p95_px
    level = _rate(median_px, _limits_of_median(of, scale))
    if goal:
        level = level or _care_if(p95_px > goal)
        figures = {"median_px": median_px, "p95_px": p95_px, "goal_px": goal}
        yield from _report(level, Code.UNCERTAIN, "goal", **figures)
        return
    yield from _report(level, Code.UNCERTAIN, median_px=median_px)
    level = _care_if(level is None and not is_rim_blamed and p95_px > GOAL_PX * scale)
    figures = {"p95_px": p95_px, "goal_px": GOAL_PX * scale}
    yield from _report(level, Code.UNCERTAIN, "rim", **figures)


def _limits_of_median(of: FitRecord, scale: float) -> tuple[float, float]:
    """The median uncertainty that asks for care, and that which is not to be trusted.

    Who asked for a goal has no use for a camera that misses it over half of the field.
    """
    if of.goal_px:
        return of.goal_px, of.goal_px
    care, bad = _MEDIAN_UNCERTAINTY_PX
    return care * scale, bad * scale


def _most_px(of: FitRecord, scale: float) -> float:
    """The error from which on something is wrong: of marked points, as exact as they are."""
    usual = 0.0 if of.marked is None else of.marked.usual_px
    return max(_ERROR_PX[1] * scale, _BEYOND_MARKED * usual)


def _care_if(odd: bool) -> Severity | None:
    return Severity.CARE if odd else None


def _rate(value: float, limits: Sequence[float]) -> Severity | None:
    if value > limits[1]:
        return Severity.BAD
    return Severity.CARE if value > limits[0] else None


def ratio_above(
    value: float, other: float, limits: Sequence[tuple[float, float]], scale: float
) -> Severity | None:
    """The level at which a value is too many times another one, and large enough to matter."""
    if not other > 0:
        return None
    (care, least), (bad, much) = limits
    if value > bad * other and value > much * scale:
        return Severity.BAD
    return Severity.CARE if value > care * other and value > least * scale else None


def share_within(outline: FloatArray, image_size: tuple[int, int]) -> float:
    """The share of a photo (width, height), pixels, that lies within an outline (K, 2)."""
    x, y = outline.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2 / math.prod(image_size))
