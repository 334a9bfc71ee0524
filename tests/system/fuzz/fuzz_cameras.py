"""Camera files that are read before they are damaged."""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

from cubicfish import Calibration, CubicCamera, Target, load_corners
from cubicfish.fit import calibrate_points
from cubicfish.fit.calibrate import calibrate
from cubicfish.io.camera_yaml import camera_text

SAMPLE = Path(__file__).parents[3] / "sample_data"


@cache
def _calibration() -> Calibration:
    return calibrate(_pairs(), hold_out=False)


@cache
def _pairs():
    target = Target.load(SAMPLE / "target.yaml")
    return load_corners(SAMPLE / "true_corners.csv", target)


def camera() -> CubicCamera:
    return _calibration().camera


@cache
def camera_files() -> Sequence[bytes]:
    made_by = {"version": "0", "inputs": []}
    points = calibrate_points(_pairs(), hold_out=False)
    files = []
    with tempfile.TemporaryDirectory() as folder:
        for number, made in enumerate((_calibration(), points)):
            path = Path(folder) / f"{number}.yaml"
            fit = replace(made.fit, per_image=made.fit.per_image[:2])
            path.write_text(camera_text(made.camera, fit=fit, made_by=made_by))
            files.append(path.read_bytes())
    return files
