"""Uncertainty over the field: two figures, and the same words wherever they are told."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from running import Run
from samples import SAMPLE

from cubicfish.io.camera_yaml import load_camera
from cubicfish.judge.fit_record import FitRecord
from cubicfish.judge.uncertainty import FieldUncertainty, summed
from cubicfish_cli.words.camera import COVERED, uncertainty_words


def test_the_two_figures() -> None:
    whole = summed(np.arange(101.0) ** 2)
    assert whole == FieldUncertainty(median_px=2500.0, p95_px=9025.0)
    assert (
        uncertainty_words(whole)
        == "2500.000 px (1σ, median over the field; 95 % of it within 9025.000 px)"
    )
    assert whole.as_record() == {"median_px": 2500.0, "p95_px": 9025.0}


def field_of(uncertainty: object) -> FieldUncertainty | None:
    return FitRecord.of({"uncertainty": uncertainty}).uncertainty.field


def test_what_records_say() -> None:
    known = {"median_px": 1, "p95_px": 2.5, "sigma_px": "?"}
    assert field_of(known) == FieldUncertainty(median_px=1.0, p95_px=2.5)
    for odd in (None, 3, {}, {"median_px": 1.0}, {"sigma_px": [[None, True, "x"], 3]},
                {"median_px": float("nan"), "p95_px": 1.0}):  # fmt: skip
        assert field_of(odd) is None
    assert FitRecord().uncertainty.field is None


@pytest.mark.slow
@pytest.mark.usefixtures("with_report", "quick_fit")
def test_one_statistic_in_the_same_words_everywhere(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "c"
    target = SAMPLE / "target.yaml"
    said = run("calibrate", SAMPLE / "true_corners.csv", "-t", target, "-o", folder).stdout
    known = load_camera(folder / "camera.yaml").fit.uncertainty.field
    assert known is not None
    meaning = f"1σ, median over the field; 95 % of it within {known.p95_px:.3f} px"
    headline = re.compile(rf"{known.median_px:.3f} px\s+{re.escape(meaning)}")
    assert headline.search(said)
    advice = run("advise", folder).stdout
    assert headline.search(advice)
    assert json.loads(run("advise", folder, "--json").stdout)["now"] == known.as_record()
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count(meaning) == 2  # the figure at the top, and the map's caption
    assert page.count(uncertainty_words(known)) == 1
    # Coverage is of the field everywhere, and the field is where the camera may be trusted.
    for text in (said, advice, page):
        assert text.count(COVERED) == 1
    assert set(re.findall(r"corners cover[^,.]*? % of (the \w+)", page)) <= {"the field"}
    assert re.search(r"calibrated to +[0-9.]+ ° +from the axis; corners reach ", said)
    assert "from the axis; corners reach " in page
