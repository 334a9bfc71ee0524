"""OCamCalib's calib_results.txt (MATLAB toolbox) and py-OCamCalib's JSON.

The toolbox's file, as its ``exportData2TXT`` writes it and ``get_ocam_model`` (ocam_functions.cpp)
and other readers want it: five remarks, each with a blank line below it and below its values. Some
readers skip white space, others take the values from lines 3, 7, 11, 15 and 19.

- The camera's axes are x down the rows, y along the columns and z BACKWARDS, so that f(0) < 0.
- The centre is (row, column), counted from 0 at the middle of the first pixel.
- row = c x + d y + centre row, column = e x + y + centre column.
- The inverse polynomial is the radius over atan(z / hypot(x, y)), lowest order first.

The JSON has x along the columns, y down the rows and z forward: ``taylor_coefficient`` with
a0 > 0, ``distortion_center`` (x, y), ``stretch_matrix`` [[c, d], [e, 1]], and ``inverse_poly``, the
radius over the angle from the axis, HIGHEST order first. It does not say how large the photos are.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.formats.bounded import read_bounded
from cubicfish_cli.formats.plain_json import parse_plain_json
from cubicfish_cli.model.lens_record import LensRecord
from cubicfish_cli.wording import quoted

FloatArray = npt.NDArray[np.float64]

MAX_BYTES = 1_000_000
# A calibration's JSON also holds a pose and an error for every photo.
MAX_JSON_BYTES = 16_000_000
# The toolbox's own C reader holds no more coefficients.
MAX_COEFFICIENTS = 64
MAX_SIDE = 100_000
_REMARKS = (
    "#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB). "
    "These are used by cam2world",
    "#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB). "
    "These are used by world2cam",
    '#center: "row" and "column", starting from 0 (C convention)',
    '#affine parameters "c", "d", "e"',
    '#image size: "height" and "width"',
)
_PARTS = ("the polynomial", "the inverse polynomial", "the center", "c, d, e", "the image size")
# x and y change places between the toolbox's axes and the image's.
_SWAP = np.array([[0.0, 1.0], [1.0, 0.0]])


def ocamcalib_text(record: LensRecord) -> str:
    """A record ``ocam`` as the text of calib_results.txt, numbers at full precision."""
    record = _scaled(record, float(_array(record, "stretch")[0, 0]))
    matrix = _SWAP @ _array(record, "stretch") @ _SWAP
    polynomial, inverse = -_array(record, "a"), _array(record, "inverse")
    width, height = record.image_size
    values = (
        f"{len(polynomial)} {_spaced(polynomial)}",
        f"{len(inverse)} {_spaced(inverse)}".rstrip(),
        _spaced([record.values["cy"], record.values["cx"]]),
        _spaced([matrix[0, 0], matrix[0, 1], matrix[1, 0]]),
        f"{height} {width}",
    )
    parts = zip(_REMARKS, values, strict=True)
    return "".join(f"{remark}\n\n{value}\n\n" for remark, value in parts)


def _spaced(values: Iterable[Any]) -> str:
    """Numbers that read back exactly; f's linear term is 0 and not -0."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def pyocamcalib_text(record: LensRecord, *, name: str = "camera") -> str:
    """A record ``ocam`` as the text of py-OCamCalib's JSON, numbers at full precision."""
    record = _scaled(record, float(_array(record, "stretch")[1, 1]))
    inverse = _shifted(_array(record, "inverse"), -math.pi / 2)
    data = {
        "camera_name": name,
        "taylor_coefficient": _array(record, "a").tolist(),
        "distortion_center": [float(record.values["cx"]), float(record.values["cy"])],
        "stretch_matrix": _array(record, "stretch").tolist(),
        "inverse_poly": inverse[::-1].tolist(),
    }
    return json.dumps(data, indent=4, allow_nan=False) + "\n"


def read_ocamcalib(path: Path) -> LensRecord:
    """Read calib_results.txt.

    Raises:
        CameraFileError: the file is not one; one line that names the file and the line.

    """
    text = read_bounded(path, max_bytes=MAX_BYTES)
    rows = [
        (number, line.split())
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(rows) < len(_PARTS):
        raise CameraFileError(
            f"{path}: {len(rows)} lines of numbers, not {len(_PARTS)} ({', '.join(_PARTS)}): "
            "is it OCamCalib's calib_results.txt?"
        )
    if len(rows) > len(_PARTS):
        raise CameraFileError(f"{path}, line {rows[len(_PARTS)][0]}: nothing is expected here")
    values = [
        _line(path, number, cells, part) for (number, cells), part in zip(rows, _PARTS, strict=True)
    ]
    polynomial, inverse = (_counted(path, rows[i][0], values[i], _PARTS[i]) for i in range(2))
    for index, wanted in ((2, 2), (3, 3), (4, 2)):
        if len(values[index]) != wanted:
            raise CameraFileError(
                f"{path}, line {rows[index][0]}: {wanted} numbers are expected for {_PARTS[index]}"
            )
    row, column = values[2]
    c, d, e = values[3]
    height, width = values[4]
    size = _size(f"{path}, line {rows[4][0]}", width, height)
    return _record(
        f"{path}, line {rows[0][0]}",
        centre=(float(column), float(row)),
        stretch=_SWAP @ np.array([[c, d], [e, 1.0]]) @ _SWAP,
        polynomial=-polynomial,
        inverse=inverse,
        size=size,
    )


def read_pyocamcalib(path: Path, *, image_size: tuple[int, int] | None) -> LensRecord:
    """Read py-OCamCalib's JSON.

    Args:
        path: the file.
        image_size: (width, height) of the photos, which the file does not state.

    Raises:
        CameraFileError: the file is not one, or the size is not given; one line that names the
            file and the key.

    """
    text = read_bounded(path, max_bytes=MAX_JSON_BYTES)
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
    return _record(
        f"{path}, taylor_coefficient",
        centre=(float(centre[0]), float(centre[1])),
        stretch=np.array(stretch),
        polynomial=polynomial,
        inverse=_shifted(inverse[::-1], math.pi / 2),
        size=image_size,
    )


def _record(
    where: str,
    *,
    centre: tuple[float, float],
    stretch: FloatArray,
    polynomial: FloatArray,
    inverse: FloatArray,
    size: tuple[int, int],
) -> LensRecord:
    if len(polynomial) < 2:
        raise CameraFileError(f"{where}: the polynomial has fewer than two coefficients")
    if not polynomial[0] > 0:
        raise CameraFileError(
            f"{where}: the first coefficient has the wrong sign (below 0 in calib_results.txt, "
            "above 0 in py-OCamCalib): the lens would look backwards"
        )
    if not 0.1 < np.linalg.det(stretch) < 10:
        raise CameraFileError(f"{where}: c, d and e are not those of a camera: c must be near 1")
    return LensRecord(
        model="ocam",
        values={
            "cx": centre[0],
            "cy": centre[1],
            "stretch": stretch,
            "a": polynomial,
            "inverse": inverse,
        },
        image_size=size,
    )


def _scaled(record: LensRecord, scale: float) -> LensRecord:
    """The same lens with the stretch matrix divided by ``scale`` and radii multiplied by it."""
    a = _array(record, "a")
    values = {
        **record.values,
        "stretch": _array(record, "stretch") / scale,
        "a": a * scale ** (1.0 - np.arange(len(a))),
        "inverse": _array(record, "inverse") * scale,
    }
    return LensRecord(model=record.model, values=values, image_size=record.image_size)


def _array(record: LensRecord, key: str) -> FloatArray:
    return np.asarray(record.values[key], float)


def _shifted(coefficients: FloatArray, offset: float) -> FloatArray:
    """The coefficients of p(x + offset) from those of p, lowest order first."""
    result = np.array(coefficients, float)
    for start in range(len(result) - 1):
        for index in range(len(result) - 2, start - 1, -1):
            result[index] += offset * result[index + 1]
    return result


def _line(path: Path, number: int, cells: list[str], part: str) -> FloatArray:
    values = []
    for cell in cells:
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not abs(value) < 1e100:  # NaN and infinities fail this too
            raise CameraFileError(
                f"{path}, line {number}: {quoted(cell)} in {part} is not a finite number"
            )
        values.append(value)
    return np.array(values)


def _counted(path: Path, number: int, values: FloatArray, part: str) -> FloatArray:
    """The coefficients behind their count."""
    if not 0 <= values[0] <= MAX_COEFFICIENTS or values[0] != len(values) - 1:
        raise CameraFileError(
            f"{path}, line {number}: {part} must be a count of at most {MAX_COEFFICIENTS} and as "
            f"many coefficients, not {values[0]:g} and {len(values) - 1}"
        )
    return values[1:]


def _size(where: str, width: float, height: float) -> tuple[int, int]:
    if not all(side == int(side) and 0 < side <= MAX_SIDE for side in (width, height)):
        raise CameraFileError(f"{where}: the image size must be two whole numbers above 0")
    return int(width), int(height)


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
