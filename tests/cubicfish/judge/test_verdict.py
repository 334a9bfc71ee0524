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
from cubicfish.judge.fit_record import ErrorStatistics, FitRecord
from cubicfish.judge.uncertainty import FieldUncertainty
from cubicfish.judge.verdict import Verdict, evaluation_verdict, photo_verdicts, verdict
from cubicfish.types import FloatArray
from cubicfish_cli.words.camera import photo_words, verdict_line, verdict_record
from cubicfish_cli.words.sentences import render, render_short, with_text

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


def test_a_good_fit_is_good() -> None:
    said = judged(GOOD, SIZE)
    assert (said.level, said.reasons) == ("good", ())
    assert verdict_line(said) == (
        "good: off by 0.120 px (a radial lens: 0.200) on photos left out of the fit, corners cover "
        "90 % of the field, out to 88° from the axis, 1 photo left out"
    )


@pytest.mark.parametrize(
    ("change", "level", "why", "do"),
    [
        ({"rms_px": 1.2, "held_out_rms_px": 1.3, **FAR}, "bad", "off by 1.30 px", "target.yaml"),
        ({"rms_px": 4.0, "held_out_rms_px": 4.1, **FAR}, "bad", "off by 4.10 px", "target.yaml"),
        ({"corners": 90}, "care", "90 corners are too few", "more photos"),
        ({"held_out_rms_px": None}, "care", "no error was measured", "--hold-out"),
        (
            {"held_out_rms_px": None, "images": 1, "unfit_images": {}},
            "care",
            "1 photo is too few",
            "three or more",
        ),
        (
            {"held_out_rms_px": 0.3, "companion_held_out_rms_px": 0.4},
            "care",
            "2.7 times as much",
            "more photos",
        ),
        ({"held_out_rms_px": 0.5, "companion_held_out_rms_px": 0.6}, "care", "4.5 times", "photos"),
        (
            {"rms_px": 0.25, "held_out_rms_px": 0.3, "companion_held_out_rms_px": 0.25},
            "care",
            "a plain radial lens is nearer",
            "the rim",
        ),
        (
            {"rms_px": 0.05, "held_out_rms_px": 0.052, "companion_held_out_rms_px": 0.05},
            "care",
            "a plain radial lens is nearer",
            "the rim",
        ),
        ({"flat": True, "images": 7}, "care", "7 photos of one flat board are too few", "ten"),
        ({"flat": True, "images": 3}, "bad", "too few to separate the lens", "tilted"),
        (
            {"reach": {"rim_rms_px": 0.3, "middle_rms_px": 0.06, "rim_from_deg": 85.0}},
            "care",
            "0.06 px in the middle and by 0.3 px beyond 85°",
            "out there",
        ),
        (
            {"reach": {"all_around_deg": 60.0, "edge_uncertainty_px": 0.7}},
            "care",
            "covered all round only to 60° (to 88° on the best side)",
            "other sides",
        ),
        (
            {"coverage": 0.4},
            "care",
            "cover 40 % of the field; the rest",
            "empty parts",
        ),
        ({"coverage": 0.1}, "bad", "cover 10 % of the field; the rest", "empty parts"),
        ({"rank": 13}, "care", "determine 13 of 16", "other parts of the picture"),
        ({"lift": "point", "rank": 19}, "care", "19 of 20", "--lift ray"),
        ({"uncertainty": {"median_px": 0.6}}, "care", "uncertainty is 0.60 px", "sharper"),
        ({"uncertainty": {"median_px": 1.1}}, "bad", "uncertainty is 1.10 px", "sharper"),
        (
            {"uncertainty": {"median_px": 0.1, "p95_px": 0.31}},
            "care",
            "0.31 px over 95 % of the field, where 0.2 px is good",
            "corners out to the rim",
        ),
        ({"dropped": 200}, "care", "200 of 2200 corners", "which boards"),
        ({"dropped": 900}, "bad", "900 of 2900 corners", "which boards"),
        ({"images": 1, "unfit_images": {"a": "", "b": ""}}, "bad", "2 of 3 photos", "again"),
        (
            {"findings": [with_text(STRETCHED).as_record()]},
            "care",
            "board left seems stretched by 4.0 %, more than paper",
            "measure ten",
        ),
    ],
)
def test_each_fault_is_one_reason(change: dict[str, Any], level: str, why: str, do: str) -> None:
    said = judged({**GOOD, **change}, SIZE)
    assert said.level == level
    (reason,) = said.reasons
    assert reason.severity == level
    assert why in render(reason).why
    assert do in render(reason).do
    assert render(reason).why in verdict_line(said)
    assert "\n" not in verdict_line(said)
    (record,) = verdict_record(said)["reasons"]
    assert {
        "level": level,
        "why": render(reason).why,
        "do": render(reason).do,
    }.items() <= record.items()


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
    assert verdict_line(said).startswith("not to be trusted: corners cover 10 %")
    assert "(and 2 more reasons)" in verdict_line(said)


@pytest.mark.parametrize(
    ("cause", "first"),
    [("board_order", "columns run backwards"), ("repeats", "corners cover 10 %")],
)
def test_a_known_cause_comes_before_what_it_leads_to(cause: str, first: str) -> None:
    finding = {"cause": cause, "level": "care", "what": "columns run backwards", "do": "turn them"}
    said = judged({**GOOD, "coverage": 0.1, "findings": [finding]}, SIZE)
    assert said.level == "bad"
    assert verdict_line(said).startswith(f"not to be trusted: {first}")


def test_larger_photos_may_be_off_by_more_of_their_pixels() -> None:
    fit = {**GOOD, "rms_px": 1.5, "held_out_rms_px": 1.6, "companion_held_out_rms_px": 3}
    assert judged(fit, (8000, 6000)).level == "good"
    assert judged(fit, SIZE).level == "bad"


def test_a_field_that_is_a_small_part_of_the_photo_is_reported() -> None:
    middle = np.array([[500.0, 300], [700, 300], [700, 500], [500, 500]])
    said = judged(GOOD, SIZE, middle)
    assert said.level == "care"
    assert "over only 4 % of the photo" in render(said.reasons[0]).why
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
    assert [render_short(one) for one in reported[5]] == ["5× the others"]
    assert [photo_words(own) for own in reported] == [
        *["good"] * 5, "5 times the others' error; look at it, or --exclude it",
        "2 dropped; few corners",
    ]  # fmt: skip
    far = {"per_image": [{"image": "a", "rms_px": 5.0, "corners": 50}] * 3}
    assert [photo_words(own) for own in reported_of_photos(far)] == ["large errors"] * 3


def test_a_record_without_figures_is_not_trusted() -> None:
    said = judged({"images": 9}, SIZE)
    assert said.level == "bad"
    assert "does not say how well" in render(said.reasons[0]).why


def test_a_camera_from_elsewhere_is_neither_trusted_nor_accused() -> None:
    said = judged({}, SIZE)
    (reason,) = said.reasons
    assert (said.level, reason.code) == ("care", Code.NO_FIGURES)
    assert "cubicfish evaluate" in render(reason).do


@pytest.mark.slow
@given(st.dictionaries(st.sampled_from([*GOOD, "per_image", "dropped_corners", "lift"]), PLAIN))
def test_no_record_breaks_it(record: dict[str, Any]) -> None:
    judged({**GOOD, **record}, SIZE)
    reported_of_photos(record)


@pytest.mark.parametrize(
    ("rms", "p95", "before", "level", "words"),
    [
        (0.15, 0.3, 0.12, "good", "off by 0.150 px on these photos, against 0.120 px"),
        (0.50, 1.0, 0.12, "care", "4.2 times as much"),
        (0.90, 1.8, 0.12, "bad", "cubicfish compare"),
        (0.90, 0.2, 0.12, "care", "a few are far off"),
        (0.04, 0.1, 0.01, "good", "off by 0.040 px"),
        (1.50, 3.0, None, "bad", "check that camera, target and photos belong together"),
        (5.00, 9.0, 4.0, "bad", "off by 5.00 px"),
    ],
)
def test_other_photos_are_judged_beside_the_fit(
    rms: float, p95: float, before: float | None, level: str, words: str
) -> None:
    fit = {} if before is None else {"held_out_rms_px": before, "rms_px": 0.9 * before}
    judged = evaluation_verdict(
        ErrorStatistics(rms_px=rms, p95_px=p95), None, FitRecord.of(fit), (960, 720)
    )
    assert judged.level == level
    assert words in verdict_line(judged)


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
