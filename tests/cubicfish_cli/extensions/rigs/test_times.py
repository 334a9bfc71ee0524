"""Rigs whose photos are not of one moment."""

from pathlib import Path

import pytest
from hand_held import hand_held

from cubicfish import save_corners, save_target
from cubicfish_cli.extensions.rigs.calibrate import RigOptions, calibrate_rig_files
from cubicfish_cli.extensions.rigs.evaluate import RigEvaluateOptions, evaluate_rig_files


@pytest.mark.slow
def test_a_rig_is_evaluated_with_the_times_that_it_was_fitted_with(tmp_path: Path) -> None:
    made, cameras = hand_held(2, moments=20, scatter=0.02), "abc"
    save_target(tmp_path / "target.yaml", made.target)
    files = [tmp_path / f"{name}.csv" for name in cameras]
    rows = ["camera,image,seconds"]
    for name, path, own, times in zip(cameras, files, made.corners, made.times, strict=True):
        save_corners(path, own)
        rows += [f"{name},{photo},{time}" for photo, time in times.items()]
    (tmp_path / "times.csv").write_text("\n".join(rows) + "\n")
    reported = {"target": tmp_path / "target.yaml", "times": tmp_path / "times.csv"}
    options = RigOptions(cameras=files, folder=tmp_path / "rig", refine_target="off", **reported)
    rig = calibrate_rig_files(options).rig
    found = evaluate_rig_files(RigEvaluateOptions(rig=tmp_path / "rig", cameras=files, **reported))
    assert found.rms_px == pytest.approx(rig.fit.rms_px, rel=0.1)
