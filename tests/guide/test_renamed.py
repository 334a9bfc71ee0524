"""Files of a calibration whose photos were named the other way round."""

from pathlib import Path

import pytest
from symmetric_board import drawn, misnamed, photos

from cubicfish import Calibration
from cubicfish_cli import (
    CalibrateOptions,
    EvaluateOptions,
    calibrate_files,
    evaluate_files,
    load_corners,
    save_corners,
)
from cubicfish_cli.inputs.calibration_facts import facts_of_files


@pytest.mark.slow
@pytest.mark.parametrize("kept", ["the table", "its folder"])
def test_what_is_written_goes_together(tmp_path: Path, kept: str) -> None:
    """Whether the table of corners is the user's own, as it was, or one with the names found."""
    target = drawn(6, 4)
    given, _ = misnamed(photos(6, 4, 0.1), target)
    folder = tmp_path / "calibration"
    folder.mkdir()
    table = (folder if kept == "the table" else tmp_path) / "corners.csv"
    save_corners(table, given)
    before = table.read_bytes()
    drawing = tmp_path / "target.yaml"
    drawing.write_text(target.text(), encoding="utf-8")
    found = calibrate_files(
        CalibrateOptions(
            inputs=table, target=drawing, folder=folder, refine_target="points", report=False
        )
    )
    assert isinstance(found.fitted, Calibration)
    assert found.fitted.renamed
    assert table.read_bytes() == before
    refined = folder / "target.refined.yaml"
    measured = evaluate_files(
        EvaluateOptions(camera=folder, inputs=folder / "corners.csv", target=refined)
    ).evaluation
    assert measured.errors.rms_px == pytest.approx(found.fitted.errors.rms_px, rel=0.05)
    facts = facts_of_files(folder / "camera.yaml", target=None, photos=())
    assert facts.lack is None
    assert facts.errors is not None
    if kept == "its folder":
        named = load_corners(folder / "corners.csv", target)
        assert (named.column == found.fitted.named(given).column).all()
