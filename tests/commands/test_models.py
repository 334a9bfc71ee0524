"""``cubicfish calibrate --compare``: other lens models in one table."""

import json
from pathlib import Path

import pytest
from running import SAMPLE, Run

CORNERS = SAMPLE / "true_corners.csv"
TARGET = SAMPLE / "target.yaml"


def calibrate(run: Run, folder: Path, *options: str) -> str:
    args = ["calibrate", CORNERS, "-t", TARGET, "-o", folder, "--no-hold-out", *options]
    said: str = run(*args).stdout
    return said


@pytest.mark.slow
def test_the_table_and_the_json_hold_the_same_models(
    run: Run, tmp_path: Path, quick_fit: None
) -> None:
    said = calibrate(run, tmp_path / "a", "--compare")
    record = json.loads(calibrate(run, tmp_path / "b", "--compare", "--json"))
    table = said.split("the same corners, loss and folds, the target as drawn\n")[1].splitlines()
    names = [row["model"] for row in record["models"]]
    assert names[:2] == ["cubic", "Kannala–Brandt"]
    assert len(names) == 7
    for row, line in zip(record["models"], table[1:], strict=False):
        assert line.startswith(row["model"])
        assert f"{row['rms_px']:.3f}" in line
        assert row["held_out_rms_px"] is None
    assert record["models"][0]["rms_px"] == pytest.approx(record["rms_px"], rel=0.05)
    assert record["models"][1]["rms_px"] == pytest.approx(record["companion_rms_px"], rel=0.01)


@pytest.mark.slow
def test_without_the_option_there_is_no_table(run: Run, tmp_path: Path, quick_fit: None) -> None:
    assert "the same corners" not in calibrate(run, tmp_path / "a")
    assert "models" not in json.loads(calibrate(run, tmp_path / "b", "--json"))
