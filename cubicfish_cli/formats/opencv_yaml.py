"""OpenCV's FileStorage YAML with a camera matrix and distortion coefficients.

There are no standard names: ``camera_matrix``, ``K``, ``cameraMatrix``, ``intrinsics`` and
``distortion_coefficients``, ``D``, ``distCoeffs``, ``dist_coeffs`` are read. Four coefficients may
be those of the fisheye module or of the pinhole lens: ``model`` or ``distortion_model`` must say
which (fisheye or equidistant, else pinhole or plumb_bob). What is written says ``model: fisheye``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.formats.bounded import read_bounded
from cubicfish_cli.formats.fields import focal, mapping, numbers, size
from cubicfish_cli.model.lens_record import LensRecord
from cubicfish_cli.plain_yaml import parse_plain_yaml

MAX_BYTES = 4_000_000
_MATRIX = ("camera_matrix", "K", "cameraMatrix", "intrinsics", "Camera_Matrix")
_COEFFICIENTS = (
    "distortion_coefficients", "D", "distCoeffs", "dist_coeffs", "Distortion_Coefficients",
)  # fmt: skip
_PINHOLE = ("pinhole", "plumb_bob", "radtan", "perspective")
_FISHEYE = ("fisheye", "equidistant", "kannala_brandt", "kannala-brandt")


def opencv_text(record: LensRecord, note: Sequence[str]) -> str:
    """A record ``kannala_brandt`` as FileStorage YAML, for cv2.fisheye."""
    values = record.values
    fx, fy, cx, cy = (float(values[key]) for key in ("fx", "fy", "cx", "cy"))
    width, height = record.image_size
    return "\n".join(
        [
            "%YAML:1.0",
            "---",
            *(f"# {line}" for line in note),
            "model: fisheye",
            f"image_width: {width}",
            f"image_height: {height}",
            *_matrix("camera_matrix", 3, 3, [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
            *_matrix("distortion_coefficients", 4, 1, np.asarray(values["k"], float).tolist()),
            "",
        ]
    )


def _matrix(name: str, rows: int, columns: int, data: Sequence[float]) -> list[str]:
    text = ", ".join(repr(float(value)) for value in data)
    return [
        f"{name}: !!opencv-matrix",
        f"   rows: {rows}",
        f"   cols: {columns}",
        "   dt: d",
        f"   data: [ {text} ]",
    ]


def read_opencv(path: Path) -> LensRecord:
    """Read a FileStorage YAML file of one camera.

    Raises:
        CameraFileError: the file is not one, or holds no camera; one line.

    """
    text = read_bounded(path, max_bytes=MAX_BYTES)
    text = re.sub(r"\A%YAML[: ]1\.[0-9]\s*\n", "", text)
    text = re.sub(r"!!opencv-matrix\b", "", text)
    record = mapping(path, parse_plain_yaml(path, text, error=CameraFileError), "the file")
    matrix = _of(path, record, _MATRIX, "camera matrix", (9,))
    d = _of(path, record, _COEFFICIENTS, "distortion coefficients", (0, 4, 5, 8, 12, 14))
    if "image_width" in record or "image_height" in record:
        image_size = size(
            path, record.get("image_width"), record.get("image_height"), "image_width and _height"
        )
    else:
        given = record.get("image_size") or record.get("imageSize") or record.get("img_shape")
        if not isinstance(given, list) or len(given) != 2:
            raise CameraFileError(
                f"{path} does not say how large the photos are: add image_width and image_height"
            )
        image_size = size(path, given[0], given[1], "the image size")
    fx, skew, cx, _, fy, cy = matrix[:6].tolist()
    focal(path, np.array([fx, fy]), "the camera matrix")
    values: dict[str, Any] = {"fx": fx, "fy": fy, "cx": cx, "cy": cy}
    kind = str(record.get("model") or record.get("distortion_model") or "").lower()
    if kind in _FISHEYE:
        if len(d) != 4:
            raise CameraFileError(f"{path}: a fisheye lens has 4 distortion coefficients")
        values |= {"k": d, "alpha": skew / fx}
        return LensRecord(model="kannala_brandt", values=values, image_size=image_size)
    if len(d) == 4 and kind not in _PINHOLE:
        raise CameraFileError(
            f"{path}: four distortion coefficients are a fisheye's or a pinhole's: add a line "
            "'model: fisheye' or 'model: pinhole' to it"
        )
    return LensRecord(model="pinhole", values={**values, "d": d}, image_size=image_size)


def _of(
    path: Path, record: dict[str, Any], names: Sequence[str], what: str, counts: tuple[int, ...]
) -> np.ndarray[Any, Any]:
    for name in names:
        if name in record:
            value = record[name]
            if isinstance(value, dict):
                value = value.get("data")
            if isinstance(value, list) and value and isinstance(value[0], list):
                value = [one for row in value if isinstance(row, list) for one in row]
            return numbers(path, value, name, counts)
    raise CameraFileError(f"{path} has no {what} under any of the names {', '.join(names)}")
