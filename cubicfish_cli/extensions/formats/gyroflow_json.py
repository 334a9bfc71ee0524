"""Gyroflow's lens profile: OpenCV's fisheye lens as JSON; pixel centres are at whole numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cubicfish_cli.app.lenses.camera_format import (
    CameraFormat,
    focal,
    json_text,
    numbers,
    parse_plain_json,
    read_bounded,
    size,
)
from cubicfish_cli.core.errors import CameraFileError
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.plain_yaml import mapping

MAX_BYTES = 4_000_000


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


def read_gyroflow(path: Path) -> RadialCamera:
    """Read a lens profile.

    Raises:
        CameraFileError: the file is not one, or its lens is not OpenCV's fisheye; one line.

    """
    text = read_bounded(path, max_bytes=MAX_BYTES)
    profile = mapping(path, parse_plain_json(path, text), "the file")
    if profile.get("distortion_model", "opencv_fisheye") != "opencv_fisheye":
        raise CameraFileError(f"{path}: distortion_model must be opencv_fisheye: no other is read")
    held = mapping(path, profile.get("fisheye_params"), "fisheye_params")
    rows = held.get("camera_matrix")
    rows = rows if isinstance(rows, list) and all(isinstance(row, list) for row in rows) else []
    flat = [one for row in rows for one in row]
    values = numbers(path, flat, "fisheye_params.camera_matrix", (9,))
    fx, _, cx, _, fy, cy = values[:6].tolist()
    focal(path, values[[0, 4]], "fisheye_params.camera_matrix")
    k = numbers(path, held.get("distortion_coeffs"), "fisheye_params.distortion_coeffs", (4,))
    photo = mapping(path, profile.get("calib_dimension"), "calib_dimension")
    image_size = size(path, photo.get("w"), photo.get("h"), "calib_dimension")
    return RadialCamera(image_size=image_size, fx=fx, fy=fy, cx=cx, cy=cy, k=k)


FORMAT = CameraFormat(
    lenses={"gyroflow": RadialCamera},
    file_name="lens_profile.json",
    write=lambda lens, note, poses: gyroflow_text(lens, note),
    read=read_gyroflow,
    marks=(("fisheye_params", "calib_dimension"),),
)
