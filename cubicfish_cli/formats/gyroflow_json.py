"""Gyroflow's lens profile: OpenCV's fisheye lens as JSON; pixel centres are at whole numbers."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from cubicfish_cli.model.lens_record import LensRecord


def gyroflow_text(record: LensRecord, note: Sequence[str]) -> str:
    """A record ``kannala_brandt`` as a lens profile."""
    values = record.values
    fx, fy, cx, cy = (float(values[key]) for key in ("fx", "fy", "cx", "cy"))
    size = dict(zip("wh", record.image_size, strict=True))
    profile = {
        "name": "cubicfish",
        "note": "; ".join(note),
        "calibrated_by": "",
        "camera_brand": "",
        "camera_model": "",
        "lens_model": "",
        "camera_setting": "",
        "calibrator_version": "cubicfish",
        "calib_dimension": size,
        "orig_dimension": size,
        "input_horizontal_stretch": 1.0,
        "input_vertical_stretch": 1.0,
        "num_images": 0,
        "distortion_model": "opencv_fisheye",
        "use_opencv_fisheye": True,
        "fisheye_params": {
            "camera_matrix": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
            "distortion_coeffs": np.asarray(values["k"], float).tolist(),
        },
        "use_opencv_standard": False,
    }
    return json.dumps(profile, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
