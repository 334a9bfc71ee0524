"""OCamCalib's calib_results.txt, of the MATLAB toolbox.

The file, as its ``exportData2TXT`` writes it and ``get_ocam_model`` (ocam_functions.cpp)
and other readers want it: five remarks, each with a blank line below it and below its values. Some
readers skip white space, others take the values from lines 3, 7, 11, 15 and 19.

- The camera's axes are x down the rows, y along the columns and z BACKWARDS, so that f(0) < 0.
- The centre is (row, column), counted from 0 at the middle of the first pixel.
- row = c x + d y + centre row, column = e x + y + centre column.
- The inverse polynomial is the radius over atan(z / hypot(x, y)), lowest order first.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.app.lenses.camera_format import CameraFormat, numbers, read_bounded, size
from cubicfish_cli.app.lenses.scaramuzza import ScaramuzzaLens
from cubicfish_cli.core.errors import CameraFileError
from cubicfish_cli.core.types import FloatArray

MAX_BYTES = 1_000_000
# The toolbox's own C reader holds no more coefficients.
MAX_COEFFICIENTS = 64
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


def ocamcalib_text(lens: ScaramuzzaLens) -> str:
    """A lens as the text of calib_results.txt, numbers at full precision."""
    # The last entry of their matrix is 1: the stretch is divided by it, and radii multiplied.
    scale = float(lens.stretch[0, 0])
    matrix = _SWAP @ (lens.stretch / scale) @ _SWAP
    polynomial = -lens.a * scale ** (1.0 - np.arange(len(lens.a)))
    inverse = lens.inverse * scale
    width, height = lens.image_size
    values = (
        f"{len(polynomial)} {_spaced(polynomial)}",
        f"{len(inverse)} {_spaced(inverse)}".rstrip(),
        _spaced([lens.cy, lens.cx]),
        _spaced([matrix[0, 0], matrix[0, 1], matrix[1, 0]]),
        f"{height} {width}",
    )
    parts = zip(_REMARKS, values, strict=True)
    return "".join(f"{remark}\n\n{value}\n\n" for remark, value in parts)


def _spaced(values: Iterable[Any]) -> str:
    """Numbers that read back exactly; f's linear term is 0 and not -0."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def read_ocamcalib(path: Path) -> ScaramuzzaLens:
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
    image_size = size(Path(f"{path}, line {rows[4][0]}"), width, height, "the image size")
    where = f"{path}, line {rows[0][0]}"
    if len(polynomial) < 2:
        raise CameraFileError(f"{where}: the polynomial has fewer than two coefficients")
    if not polynomial[0] < 0:
        raise CameraFileError(
            f"{where}: the first coefficient must be below 0: the lens would look backwards"
        )
    stretch = _SWAP @ np.array([[c, d], [e, 1.0]]) @ _SWAP
    if not 0.1 < np.linalg.det(stretch) < 10:
        raise CameraFileError(f"{where}: c, d and e are not those of a camera: c must be near 1")
    return ScaramuzzaLens(
        image_size=image_size,
        cx=float(column),
        cy=float(row),
        stretch=stretch,
        a=-polynomial,
        inverse=inverse,
    )


def _line(path: Path, number: int, cells: list[str], part: str) -> FloatArray:
    where = Path(f"{path}, line {number}")
    try:
        return numbers(where, list(map(float, cells)), part, (len(cells),))
    except ValueError as problem:
        raise CameraFileError(f"{where}: {part} must hold finite numbers") from problem


def _counted(path: Path, number: int, values: FloatArray, part: str) -> FloatArray:
    """The coefficients behind their count."""
    if not 0 <= values[0] <= MAX_COEFFICIENTS or values[0] != len(values) - 1:
        raise CameraFileError(
            f"{path}, line {number}: {part} must be a count of at most {MAX_COEFFICIENTS} and as "
            f"many coefficients, not {values[0]:g} and {len(values) - 1}"
        )
    return values[1:]


FORMAT = CameraFormat(
    lenses={"ocamcalib": ScaramuzzaLens},
    file_name="calib_results.txt",
    # Readers count its lines: comments go nowhere but the end.
    write=lambda lens, note, poses: ocamcalib_text(lens) + "".join(f"#{one}\n" for one in note),
    read=read_ocamcalib,
    marks=(("cam2world",),),
    vague=True,
)
