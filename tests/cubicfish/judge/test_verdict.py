"""The verdict on a fit: good where all is well, and one reason for each thing that is not."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_data import PLAIN

import cubicfish.judge.verdict as judging
from cubicfish.fit.calibration import Calibration
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.judge.fit_record import ErrorStatistics, FitRecord, PhotoRecord
from cubicfish.judge.uncertainty import FieldUncertainty
from cubicfish.judge.verdict import Verdict, evaluation_verdict, photo_verdicts, verdict
from cubicfish.types import FloatArray

SIZE = (1280, 800)
GOOD: dict[str, Any] = {
    "rms_px": 0.11,
    "held_out_rms_px": 0.12,
    "companion_held_out_rms_px": 0.2,
    "corners": 2000,
    "images": 12,
    "coverage": 0.9,
    "covered_deg": 88.0,
    "rank": 16,
    "dropped": 3,
    "unfit_images": {"blurred.png": "noisy"},
    "uncertainty": {"median_px": 0.02, "max_px": 0.2},
    "departures": [{"board": "floor", "doubts": []}],
}
STRETCHED = Finding(
    code=Code.STRETCHED, severity=Severity.CARE, boards=("left",), figures={"percent": 4.0}
)
FAR = {"companion_held_out_rms_px": 5.0}


def judged(
    record: dict[str, Any], size: tuple[int, int], outline: FloatArray | None = None
) -> Verdict:
    return verdict(FitRecord.of(record), size, outline)


def reported_of_photos(record: dict[str, Any]) -> list[tuple[Finding, ...]]:
    return [judged.reasons for judged in photo_verdicts(FitRecord.of(record), SIZE)]


def test_a_photo_of_a_small_board_is_not_short_of_corners() -> None:
    """All of a board's twelve corners are what a photo can show: others beside it show fewer."""
    records = [{"image": f"{i}.png", "rms_px": 0.1, "corners": 12} for i in range(5)]
    few = {"image": "few.png", "rms_px": 0.1, "corners": 9}
    reasons = reported_of_photos({"per_image": [*records, few]})
    assert [[one.code for one in own] for own in reasons] == [*[[]] * 5, [Code.FEW_CORNERS]]


def test_a_good_fit_is_good() -> None:
    said = judged(GOOD, SIZE)
    assert (said.level, said.reasons) == ("good", ())


FAULTS: list[tuple[dict[str, Any], str, Code]] = [
    ({"rms_px": 1.2, "held_out_rms_px": 1.3, **FAR}, "bad", Code.LARGE_ERRORS),
    ({"rms_px": 4.0, "held_out_rms_px": 4.1, **FAR}, "bad", Code.LARGE_ERRORS),
    ({"corners": 90}, "care", Code.FEW_CORNERS),
    ({"held_out_rms_px": None}, "care", Code.NOT_HELD_OUT),
    ({"held_out_rms_px": None, "images": 1, "unfit_images": {}}, "care", Code.NOT_HELD_OUT),
    ({"held_out_rms_px": 0.3, "companion_held_out_rms_px": 0.4}, "care", Code.OVERFITTED),
    ({"held_out_rms_px": 0.5, "companion_held_out_rms_px": 0.6}, "care", Code.OVERFITTED),
    (
        {"rms_px": 0.25, "held_out_rms_px": 0.3, "companion_held_out_rms_px": 0.25},
        "care",
        Code.RADIAL_IS_NEARER,
    ),
    (
        {"rms_px": 0.05, "held_out_rms_px": 0.052, "companion_held_out_rms_px": 0.05},
        "care",
        Code.RADIAL_IS_NEARER,
    ),
    ({"flat": True, "images": 7}, "care", Code.FEW_PHOTOS_OF_A_PLANE),
    ({"flat": True, "images": 3}, "bad", Code.FEW_PHOTOS_OF_A_PLANE),
    (
        {"reach": {"rim_rms_px": 0.3, "middle_rms_px": 0.06, "rim_from_deg": 85.0}},
        "care",
        Code.WORSE_AT_THE_RIM,
    ),
    ({"reach": {"all_around_deg": 60.0, "edge_uncertainty_px": 0.7}}, "care", Code.EXTRAPOLATED),
    ({"coverage": 0.4}, "care", Code.LOW_COVERAGE),
    ({"coverage": 0.1}, "bad", Code.LOW_COVERAGE),
    ({"rank": 13}, "care", Code.LOW_RANK),
    ({"lift": "point", "rank": 19}, "care", Code.LOW_RANK),
    ({"uncertainty": {"median_px": 0.6}}, "care", Code.UNCERTAIN),
    ({"uncertainty": {"median_px": 1.1}}, "bad", Code.UNCERTAIN),
    ({"uncertainty": {"median_px": 0.1, "p95_px": 0.31}}, "care", Code.UNCERTAIN),
    ({"dropped": 200}, "care", Code.MANY_OUTLIERS),
    ({"dropped": 900}, "bad", Code.MANY_OUTLIERS),
    ({"images": 1, "unfit_images": {"a": "", "b": ""}}, "bad", Code.MANY_UNFIT),
    ({"findings": [STRETCHED.as_record()]}, "care", Code.STRETCHED),
]


@pytest.mark.parametrize(("change", "level", "code"), FAULTS)
def test_each_fault_is_one_reason(change: dict[str, Any], level: str, code: Code) -> None:
    said = judged({**GOOD, **change}, SIZE)
    (reason,) = said.reasons
    assert (said.level, reason.severity, reason.code) == (level, level, code)


@pytest.mark.parametrize(
    "change",
    [
        {"rms_px": 0.07, "held_out_rms_px": 0.122, "companion_held_out_rms_px": 0.12},
        {"rms_px": 0.15, "held_out_rms_px": 0.198},
        {"flat": True, "images": 8},
        {"flat": False, "images": 3},
        {"reach": {"rim_rms_px": 0.2, "middle_rms_px": 0.03, "rim_from_deg": 85.0}},
        {"reach": {"rim_rms_px": 0.4, "middle_rms_px": 0.3, "rim_from_deg": 85.0}},
        {"reach": {"all_around_deg": 60.0, "edge_uncertainty_px": 0.4}},
        {"uncertainty": {"median_px": 0.15, "p95_px": 0.2}},
        {"reach": {"all_around_deg": 80.0, "edge_uncertainty_px": 0.7}},
    ],
)
def test_what_nobody_would_notice_is_no_reason(change: dict[str, Any]) -> None:
    assert judged({**GOOD, **change}, SIZE).level == "good"


def test_the_rim_is_among_the_figures() -> None:
    line = str(judged({**GOOD, "reach": {"rim_coverage": 0.42}}, SIZE))
    assert "corners cover 90 % of the field and 42 % of its rim, out to 88° from the axis" in line
    whole = str(judged({**GOOD, "reach": {"rim_coverage": 0.95}}, SIZE))
    assert whole == str(judged(GOOD, SIZE))


def test_the_worst_reason_comes_first_and_the_others_are_counted() -> None:
    said = judged({**GOOD, "corners": 90, "coverage": 0.1, "rank": 5}, SIZE)
    assert [reason.severity for reason in said.reasons] == ["bad", "care", "care"]
    assert said.reasons[0].code == Code.LOW_COVERAGE


@pytest.mark.parametrize(
    ("cause", "first"),
    [("board_order", Code.BOARD_ORDER), ("repeats", Code.LOW_COVERAGE)],
)
def test_a_known_cause_comes_before_what_it_leads_to(cause: str, first: Code) -> None:
    finding = {"cause": cause, "level": "care", "what": "columns run backwards", "do": "turn them"}
    said = judged({**GOOD, "coverage": 0.1, "findings": [finding]}, SIZE)
    assert (said.level, said.reasons[0].code) == ("bad", first)


def test_larger_photos_may_be_off_by_more_of_their_pixels() -> None:
    fit = {**GOOD, "rms_px": 1.5, "held_out_rms_px": 1.6, "companion_held_out_rms_px": 3}
    assert judged(fit, (8000, 6000)).level == "good"
    assert judged(fit, SIZE).level == "bad"


def test_a_field_that_is_a_small_part_of_the_photo_is_reported() -> None:
    middle = np.array([[500.0, 300], [700, 300], [700, 500], [500, 500]])
    said = judged(GOOD, SIZE, middle)
    assert said.level == "care"
    assert said.reasons[0].code == Code.SMALL_FIELD
    whole = np.array([[0.0, 0], [1279, 0], [1279, 799], [0, 799]])
    assert judged(GOOD, SIZE, whole).level == "good"


@pytest.mark.slow
def test_a_real_fit_is_judged_by_its_record(fitted: Calibration) -> None:
    said = verdict(fitted.fit, fitted.camera.image_size, fitted.camera.outline())
    assert [reason.code for reason in said.reasons] == [Code.NOT_HELD_OUT]
    assert [judged.level for judged in fitted.photo_verdicts] == ["good"] * 10


def test_photos_beside_each_other() -> None:
    records = [{"image": f"{i}.png", "rms_px": 0.1, "corners": 100} for i in range(5)]
    records += [
        {"image": "bad.png", "rms_px": 0.5, "corners": 100},
        {"image": "few.png", "rms_px": 0.1, "corners": 9},
    ]
    fit = {"per_image": records, "dropped_corners": [{"image": "few.png"}] * 2}
    reported = reported_of_photos(fit)
    assert [[one.code for one in own] for own in reported[5:]] == [
        [Code.STANDS_OUT], [Code.OUTLIERS, Code.FEW_CORNERS]
    ]  # fmt: skip
    assert not any(reported[:5])
    far = {"per_image": [{"image": "a", "rms_px": 5.0, "corners": 50}] * 3}
    assert [[one.code for one in own] for own in reported_of_photos(far)] == [
        [Code.LARGE_ERRORS]
    ] * 3


def test_a_record_without_figures_is_not_trusted() -> None:
    said = judged({"images": 9}, SIZE)
    assert said.level == "bad"
    assert said.reasons[0].code == Code.NO_FIGURES


def test_a_camera_from_elsewhere_is_neither_trusted_nor_accused() -> None:
    said = judged({}, SIZE)
    (reason,) = said.reasons
    assert (said.level, reason.code) == ("care", Code.NO_FIGURES)


@pytest.mark.slow
@given(st.dictionaries(st.sampled_from([*GOOD, "per_image", "dropped_corners", "lift"]), PLAIN))
def test_no_record_breaks_it(record: dict[str, Any]) -> None:
    judged({**GOOD, **record}, SIZE)
    reported_of_photos(record)


@pytest.mark.parametrize(
    ("rms", "p95", "before", "level"),
    [
        (0.15, 0.3, 0.12, "good"),
        (0.50, 1.0, 0.12, "care"),
        (0.90, 1.8, 0.12, "bad"),
        (0.90, 0.2, 0.12, "care"),
        (0.04, 0.1, 0.01, "good"),
        (1.50, 3.0, None, "bad"),
        (5.00, 9.0, 4.0, "bad"),
    ],
)
def test_other_photos_are_judged_beside_the_fit(
    rms: float, p95: float, before: float | None, level: str
) -> None:
    fit = {} if before is None else {"held_out_rms_px": before, "rms_px": 0.9 * before}
    judged = evaluation_verdict(
        ErrorStatistics(rms_px=rms, p95_px=p95), None, FitRecord.of(fit), (960, 720)
    )
    assert judged.level == level


def judged_on(*rms: float) -> Verdict:
    """What is said of photos of 54 corners with such errors, beside 0.04 px before."""
    photos = [PhotoRecord(image=f"{at}.png", rms_px=one, corners=54) for at, one in enumerate(rms)]
    errors = ErrorStatistics(rms_px=float(np.sqrt(np.mean(np.square(rms)))), p95_px=max(rms))
    return evaluation_verdict(errors, None, FitRecord(held_out_rms_px=0.04), (960, 720), photos)


@pytest.mark.parametrize("apart", [1, 2, 5])
def test_photos_that_are_apart_are_named_and_not_the_camera(apart: int) -> None:
    (reason,) = judged_on(*[0.9] * apart, *[0.04] * 10).reasons
    assert (reason.code, reason.case) == (Code.A_FEW_FAR_OFF, "photos")
    assert reason.severity is Severity.CARE
    assert reason.images == tuple(f"{at}.png" for at in range(apart))
    expected = {"rms_px": 0.9, "rest_px": 0.04, "others": 10}
    assert reason.figures == pytest.approx(expected)


@pytest.mark.parametrize(
    "rms", [(0.9, 0.9, 0.04, 0.04), (0.9, *[0.25] * 10), tuple(0.3 + 0.1 * at for at in range(9))]
)
def test_a_camera_that_is_off_in_many_photos_is_worse_than_before(rms: tuple[float, ...]) -> None:
    (reason,) = judged_on(*rms).reasons
    assert reason.code == Code.WORSE_THAN_BEFORE


@pytest.mark.parametrize(("sigma", "level"), [(0.4, "good"), (0.6, "care"), (9.6, "bad")])
def test_small_errors_do_not_clear_an_uncertain_camera(sigma: float, level: str) -> None:
    """The poses of a few photos take up what a lens of three photos is off by."""
    errors = ErrorStatistics(rms_px=0.12, p95_px=0.2)
    uncertainty = FieldUncertainty(median_px=sigma, p95_px=sigma)
    judged = evaluation_verdict(errors, uncertainty, FitRecord(held_out_rms_px=0.127), (800, 800))
    assert judged.level == level
    assert [reason.code for reason in judged.reasons] == [Code.UNCERTAIN] * (level != "good")
    larger = evaluation_verdict(errors, uncertainty, FitRecord(), (8000, 6000))
    assert larger.level == ("good" if sigma < 2 else "bad")


@pytest.mark.parametrize(
    ("median_px", "p95_px", "goal_px", "level"),
    [
        (0.02, 0.05, 0.1, "good"),
        (0.02, 0.15, 0.1, "care"),
        (0.12, 0.15, 0.1, "bad"),
        (1.5, 2.5, 3.0, "good"),
        (1.5, 3.5, 3.0, "care"),
        (3.1, 3.5, 3.0, "bad"),
    ],
)
@pytest.mark.parametrize("size", [SIZE, (8000, 6000)])
def test_a_goal_of_ones_own_decides(
    median_px: float, p95_px: float, goal_px: float, level: str, size: tuple[int, int]
) -> None:
    certain = {"median_px": median_px, "p95_px": p95_px}
    record = FitRecord.of({**GOOD, "uncertainty": certain, "goal_px": goal_px})
    assert FitRecord.of(record.as_record()).goal_px == goal_px
    said = verdict(record, size)
    expected = [] if level == "good" else [(Code.UNCERTAIN, "goal")]
    assert (said.level, [(one.code, one.case) for one in said.reasons]) == (level, expected)
    at_corners = FieldUncertainty(**certain)
    elsewhere = evaluation_verdict(ErrorStatistics(rms_px=0.12), at_corners, record, size)
    assert (elsewhere.level == "bad") == (level == "bad")


def test_a_rim_within_the_goal_is_not_extrapolated_too_far() -> None:
    far = {"all_around_deg": 60.0, "edge_uncertainty_px": 0.7}
    certain = {"median_px": 0.1, "p95_px": 0.2}
    judge = {**GOOD, "reach": far, "uncertainty": certain}
    assert [one.code for one in judged(judge, SIZE).reasons] == [Code.EXTRAPOLATED]
    assert judged({**judge, "goal_px": 0.8}, SIZE).level == "good"


def test_an_uncertain_rim_is_said_once_by_what_explains_it() -> None:
    rim = {"uncertainty": {"median_px": 0.1, "p95_px": 0.6}}
    far = {"reach": {"all_around_deg": 60.0, "edge_uncertainty_px": 0.7}}
    assert [one.case for one in judged({**GOOD, **rim}, SIZE).reasons] == ["rim"]
    assert [one.code for one in judged({**GOOD, **rim, **far}, SIZE).reasons] == [Code.EXTRAPOLATED]


def test_the_page_of_figures_states_the_limits_of_the_verdict() -> None:
    page = Path(__file__).parents[3] / "docs" / "expectations.md"
    rows = [line.split(" | ") for line in page.read_text(encoding="utf-8").splitlines()]
    stated = {
        row[0].strip("| "): [float(re.findall(r"[0-9.]+", cell)[0]) for cell in row[1:]
                             if re.search(r"[0-9]", cell)]
        for row in rows
        if len(row) == 4
    }  # fmt: skip
    assert stated["held-out RMS"] == [*judging._ERROR_PX]
    assert stated["coverage"] == [100 * limit for limit in judging.COVERAGE]
    assert stated["uncertainty, median over the field"] == [*judging._MEDIAN_UNCERTAINTY_PX]
    assert stated["uncertainty, 95 % of the field"] == [judging.GOAL_PX]
    assert stated["outliers"] == [100 * limit for limit in judging._DROPPED_SHARE]
