"""Gyroflow's lens profile: OpenCV's fisheye lens as JSON; pixel centres are at whole numbers."""

from pathlib import Path

from cubicfish import CameraFileError
from cubicfish.models import Lens, RadialCamera
from cubicfish_cli.extensions.formats.lenses import matrix_rows, named_in_matrix, named_lens
from cubicfish_cli.foreign.file_contents import PlacedLens, json_text, load_plain_json, numbers

MAX_BYTES = 4_000_000


def gyroflow_text(one: PlacedLens) -> str:
    """Write a radial lens as a lens profile."""
    size = dict(zip("wh", one.lens.image_size, strict=True))
    profile = {
        "name": "cubicfish",
        "note": "; ".join(one.note),
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
            "camera_matrix": matrix_rows(one.lens),
            "distortion_coeffs": one.lens.k.tolist(),
        },
        "use_opencv_standard": False,
    }
    return json_text(profile)


def read_gyroflow(path: Path) -> Lens:
    """Read a lens profile.

    Raises:
        CameraFileError: the file is not one, or its lens is not OpenCV's fisheye; one line.

    """
    profile = load_plain_json(path, max_bytes=MAX_BYTES)
    if profile.values.get("distortion_model", "opencv_fisheye") != "opencv_fisheye":
        raise CameraFileError(f"{path}: distortion_model must be opencv_fisheye: no other is read")
    parameters = profile.part("fisheye_params")
    rows = parameters.values.get("camera_matrix")
    rows = rows if isinstance(rows, list) and all(isinstance(row, list) for row in rows) else []
    flat = [value for row in rows for value in row]
    matrix = numbers(path, flat, "fisheye_params.camera_matrix", (9,))
    k = parameters.numbers("distortion_coeffs", 4).tolist()
    named = named_in_matrix(matrix) | dict(zip(("k1", "k2", "k3", "k4"), k, strict=True))
    image_size = profile.part("calib_dimension").size("w", "h")
    return named_lens(path, RadialCamera, image_size, named)
