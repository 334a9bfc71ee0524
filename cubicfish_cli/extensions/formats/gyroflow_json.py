"""Gyroflow's lens profile: OpenCV's fisheye lens as JSON; pixel centres are at whole numbers."""

from __future__ import annotations

from collections.abc import Sequence

from cubicfish_cli.app.lenses.camera_format import CameraFormat, json_text
from cubicfish_cli.core.lenses.radial import RadialCamera


def gyroflow_text(lens: RadialCamera, note: Sequence[str]) -> str:
    """A lens as a lens profile."""
    fx, fy, cx, cy = lens.fx, lens.fy, lens.cx, lens.cy
    size = dict(zip("wh", lens.image_size, strict=True))
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
            "distortion_coeffs": lens.k.tolist(),
        },
        "use_opencv_standard": False,
    }
    return json_text(profile)


FORMAT = CameraFormat(
    lenses={"gyroflow": RadialCamera},
    file_name="lens_profile.json",
    write=lambda lens, note, poses: gyroflow_text(lens, note),
)
