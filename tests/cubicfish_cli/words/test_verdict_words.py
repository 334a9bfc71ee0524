"""What a verdict says of a fit."""

from typing import Any

import pytest

from cubicfish.judge.fit_record import ErrorStatistics, FitRecord
from cubicfish.judge.verdict import evaluation_verdict
from cubicfish_cli.words.camera import photo_words, verdict_line, verdict_record
from cubicfish_cli.words.sentences import render, render_short, with_text
from tests.cubicfish.judge.test_verdict import (
    FAULTS,
    GOOD,
    SIZE,
    STRETCHED,
    judged,
    reported_of_photos,
)

SAID = [
    ("off by 1.30 px", "target.yaml"),
    ("off by 4.10 px", "target.yaml"),
    ("90 corners are too few", "more photos"),
    ("no error was measured", "--hold-out"),
    ("1 photo is too few", "three or more"),
    ("2.7 times as much", "more photos"),
    ("4.5 times", "photos"),
    ("a plain radial lens does better", "the rim"),
    ("a plain radial lens does better", "the rim"),
    ("7 photos of one flat board are too few", "ten"),
    ("too few to separate the lens", "tilted"),
    ("0.06 px in the middle and by 0.3 px beyond 85°", "out there"),
    ("covered all round only to 60° (to 88° on the best side)", "other sides"),
    ("cover 40 % of the field; the rest", "empty parts"),
    ("cover 10 % of the field; the rest", "empty parts"),
    ("determine 13 of 16", "other parts of the picture"),
    ("19 of 20", "--lift ray"),
    ("uncertainty is 0.60 px", "sharper"),
    ("uncertainty is 1.10 px", "sharper"),
    ("0.31 px over 95 % of the field, where 0.2 px is good", "corners out to the rim"),
    ("200 of 2200 corners", "which boards"),
    ("900 of 2900 corners", "which boards"),
    ("2 of 3 photos", "again"),
    ("board left seems stretched by 4.0 %, more than is normal", "measure ten"),
]


def test_a_good_fit_is_said_with_its_figures() -> None:
    assert verdict_line(judged(GOOD, SIZE)) == (
        "good: off by 0.120 px (a radial lens: 0.200) on photos left out of the fit, corners cover "
        "90 % of the field, out to 88° from the axis, 1 photo left out"
    )


@pytest.mark.parametrize(
    ("change", "level", "why", "do"),
    [(change, level, *said) for (change, level, _), said in zip(FAULTS, SAID, strict=True)],
)
def test_a_reason_says_why_and_what_to_do(
    change: dict[str, Any], level: str, why: str, do: str
) -> None:
    if "findings" in change:  # a record keeps the words that were said
        change = {"findings": [with_text(STRETCHED).as_record()]}
    said = judged({**GOOD, **change}, SIZE)
    (reason,) = said.reasons
    assert why in render(reason).why
    assert do in render(reason).do
    assert render(reason).why in verdict_line(said)
    assert "\n" not in verdict_line(said)
    (record,) = verdict_record(said)["reasons"]
    own = {"level": level, "why": render(reason).why, "do": render(reason).do}
    assert own.items() <= record.items()


def test_other_reasons_are_counted() -> None:
    said = judged({**GOOD, "corners": 90, "coverage": 0.1, "rank": 5}, SIZE)
    assert verdict_line(said).startswith("not to be trusted: corners cover 10 %")
    assert "(and 2 more reasons)" in verdict_line(said)


def test_photos_are_said_in_a_few_words() -> None:
    records = [{"image": f"{i}.png", "rms_px": 0.1, "corners": 100} for i in range(5)]
    records += [
        {"image": "bad.png", "rms_px": 0.5, "corners": 100},
        {"image": "few.png", "rms_px": 0.1, "corners": 9},
    ]
    fit = {"per_image": records, "dropped_corners": [{"image": "few.png"}] * 2}
    reported = reported_of_photos(fit)
    assert [render_short(one) for one in reported[5]] == ["5× the others"]
    assert [photo_words(own) for own in reported] == [
        *["good"] * 5, "5 times the others' error; look at it, or --exclude it",
        "2 dropped; few corners",
    ]  # fmt: skip


def test_a_record_without_figures_is_said_so() -> None:
    assert "does not say how well" in render(judged({"images": 9}, SIZE).reasons[0]).why
    assert "cubicfish evaluate" in render(judged({}, SIZE).reasons[0]).do


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
def test_other_photos_are_said_beside_the_fit(
    rms: float, p95: float, before: float | None, level: str, words: str
) -> None:
    fit = {} if before is None else {"held_out_rms_px": before, "rms_px": 0.9 * before}
    judged = evaluation_verdict(
        ErrorStatistics(rms_px=rms, p95_px=p95), None, FitRecord.of(fit), (960, 720)
    )
    assert judged.level == level
    assert words in verdict_line(judged)
