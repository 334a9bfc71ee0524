"""py-OCamCalib's JSON: the lens of :mod:`cubicfish_cli.formats.ocamcalib` with other axes.

x is along the columns, y down the rows and z forward: ``taylor_coefficient`` with a0 > 0,
``distortion_center`` (x, y), ``stretch_matrix`` [[c, d], [e, 1]], and ``inverse_poly``, the radius
over the angle from the axis, HIGHEST order first. It does not say how large the photos are.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.formats.camera_format import CameraFormat, parse_plain_json, read_bounded
from cubicfish_cli.formats.ocamcalib import MAX_COEFFICIENTS, ocam_lens, scaled
from cubicfish_cli.lenses.scaramuzza import ScaramuzzaLens
from cubicfish_cli.types import FloatArray

# A calibration's JSON also holds a pose and an error for every photo.
MAX_BYTES = 16_000_000


def pyocamcalib_text(lens: ScaramuzzaLens) -> str:
    """A lens as the text of py-OCamCalib's JSON, numbers at full precision."""
    lens = scaled(lens, float(lens.stretch[1, 1]))
    inverse = _shifted(lens.inverse, -math.pi / 2)
    data = {
        "camera_name": "camera",
        "taylor_coefficient": lens.a.tolist(),
        "distortion_center": [lens.cx, lens.cy],
        "stretch_matrix": lens.stretch.tolist(),
        "inverse_poly": inverse[::-1].tolist(),
    }
    return json.dumps(data, indent=4, allow_nan=False) + "\n"


def read_pyocamcalib(path: Path, *, image_size: tuple[int, int] | None) -> ScaramuzzaLens:
    """Read py-OCamCalib's JSON.

    Args:
        path: the file.
        image_size: (width, height) of the photos, which the file does not state.

    Raises:
        CameraFileError: the file is not one, or the size is not given; one line that names the
            file and the key.

    """
    text = read_bounded(path, max_bytes=MAX_BYTES)
    data = parse_plain_json(path, text)
    if not isinstance(data, dict) or "taylor_coefficient" not in data:
        raise CameraFileError(f"{path}: it has no key taylor_coefficient: is it py-OCamCalib's?")
    if image_size is None:
        raise CameraFileError(
            f"{path}: py-OCamCalib's file does not say how large the photos are: add --size WxH"
        )
    polynomial = _vector(path, data, "taylor_coefficient")
    inverse = _vector(path, data, "inverse_poly") if "inverse_poly" in data else np.zeros(0)
    centre = _vector(path, data, "distortion_center")
    if len(centre) != 2:
        raise CameraFileError(f"{path}: distortion_center must be two numbers, x and y")
    rows = data.get("stretch_matrix")
    if not isinstance(rows, list) or len(rows) != 2:
        raise CameraFileError(f"{path}: stretch_matrix must be two rows of two numbers")
    stretch = [_vector(path, {"stretch_matrix": row}, "stretch_matrix") for row in rows]
    if any(len(row) != 2 for row in stretch):
        raise CameraFileError(f"{path}: stretch_matrix must be two rows of two numbers")
    return ocam_lens(
        f"{path}, taylor_coefficient",
        centre=(float(centre[0]), float(centre[1])),
        stretch=np.array(stretch),
        polynomial=polynomial,
        inverse=_shifted(inverse[::-1], math.pi / 2),
        image_size=image_size,
    )


def _shifted(coefficients: FloatArray, offset: float) -> FloatArray:
    """The coefficients of p(x + offset) from those of p, lowest order first."""
    result = np.array(coefficients, float)
    for start in range(len(result) - 1):
        for index in range(len(result) - 2, start - 1, -1):
            result[index] += offset * result[index + 1]
    return result


def _vector(path: Path, data: dict[str, Any], key: str) -> FloatArray:
    value = data.get(key)
    if (
        not isinstance(value, list)
        or not 0 < len(value) <= MAX_COEFFICIENTS
        or not all(isinstance(x, int | float) and not isinstance(x, bool) for x in value)
        or not all(abs(x) < 1e100 for x in value)
    ):
        raise CameraFileError(
            f"{path}: {key} must be a list of at most {MAX_COEFFICIENTS} finite numbers"
        )
    return np.array(value, float)


FORMAT = CameraFormat(
    lenses={"pyocamcalib": ScaramuzzaLens},
    file_name="calibration.json",
    write=lambda lens, note, poses: pyocamcalib_text(lens),
    comments=False,
    read=read_pyocamcalib,
    sizeless=True,
    marks=(("taylor_coefficient",),),
)
