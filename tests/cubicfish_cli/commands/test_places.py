"""Boards whose place nobody knows, in the target that a calibration writes."""

from running import run_cli

from cubicfish import Target
from tests.cubicfish.observe.test_places import TABLE, UNKNOWN, off_mm


def test_what_was_measured_goes_into_the_refined_target(tmp_path):
    file = tmp_path / "target.yaml"
    file.write_text(UNKNOWN.text())
    line = ("calibrate", TABLE, "-t", file, "--no-hold-out", "--no-report", "-o", tmp_path / "c")
    assert "left and right were measured" in run_cli(*line, "--refine-target", "off").stderr
    assert off_mm(Target.load(tmp_path / "c" / "target.refined.yaml")) < 0.2
    line = ("simulate", "-t", file, "-m", tmp_path / "c", "-n", 1, "-o", tmp_path / "s")
    assert "place: unknown" in run_cli(*line, code=1).stderr
