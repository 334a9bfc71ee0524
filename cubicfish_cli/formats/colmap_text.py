"""COLMAP's cameras.txt. Its pixel (0, 0) is the top-left CORNER of the first pixel: centres are
half a pixel more than here.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.formats.bounded import read_bounded
from cubicfish_cli.formats.fields import focal, numbers, size
from cubicfish_cli.model.lens_record import LensRecord
from cubicfish_cli.wording import quoted

MAX_BYTES = 16_000_000
HALF = 0.5
# Parameters of each model, in COLMAP's order; f stands for fx and fy.
_MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": (
        "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6",
    ),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k1"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
    "SIMPLE_FISHEYE": ("f", "cx", "cy"),
    "FISHEYE": ("fx", "fy", "cx", "cy"),
    "FOV": ("fx", "fy", "cx", "cy", "omega"),
}  # fmt: skip
_PINHOLE = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


def colmap_text(record: LensRecord, note: Sequence[str]) -> str:
    """A record ``kannala_brandt`` as a cameras.txt with one OPENCV_FISHEYE camera."""
    values = record.values
    width, height = record.image_size
    parameters = [
        float(values["fx"]), float(values["fy"]),
        float(values["cx"]) + HALF, float(values["cy"]) + HALF,
        *np.asarray(values["k"], float).tolist(),
    ]  # fmt: skip
    return "\n".join(
        [
            "# Camera list with one line of data per camera:",
            "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]",
            "# Number of cameras: 1",
            *(f"# {line}" for line in note),
            f"1 OPENCV_FISHEYE {width} {height} " + " ".join(map(repr, parameters)),
            "",
        ]
    )


def read_colmap(path: Path, *, camera: str | None = None) -> LensRecord:
    """Read one camera of a cameras.txt.

    Args:
        path: the file.
        camera: its CAMERA_ID; not needed where there is one.

    Raises:
        CameraFileError: the file is not one, or holds no such camera; one line.

    """
    lines = {}
    for number, line in enumerate(read_bounded(path, max_bytes=MAX_BYTES).splitlines(), start=1):
        cells = line.split()
        if cells and not cells[0].startswith("#"):
            lines[cells[0]] = number, cells
    if camera is None and len(lines) == 1:
        camera = next(iter(lines))
    if camera not in lines:
        there = ", ".join(list(lines)[:10]) or "none"
        raise CameraFileError(f"{path}: name one of its cameras with --camera: {there}")
    number, cells = lines[camera]
    where = Path(f"{path}, line {number}")
    if len(cells) < 4 or cells[1] not in _MODELS:
        model = quoted(cells[1]) if len(cells) > 1 else "nothing"
        raise CameraFileError(f"{where}: {model} is no camera model that is known here")
    names = _MODELS[cells[1]]
    try:
        given = [float(cell) for cell in cells[2:]]
    except ValueError as problem:
        raise CameraFileError(f"{where}: what follows the model must be numbers") from problem
    values = dict(
        zip(names, numbers(where, given[2:], "PARAMS", (len(names),)).tolist(), strict=True)
    )
    image_size = size(where, given[0], given[1], "WIDTH and HEIGHT")
    fx, fy = values.pop("f", None), None
    fx, fy = (fx, fx) if fx is not None else (values.pop("fx"), values.pop("fy"))
    focal(where, np.array([fx, fy]), "PARAMS")
    core: dict[str, Any] = {
        "fx": fx,
        "fy": fy,
        "cx": values.pop("cx") - HALF,
        "cy": values.pop("cy") - HALF,
    }
    if cells[1] == "FOV":
        return LensRecord(model="fov", values={**core, **values}, image_size=image_size)
    if cells[1].endswith("FISHEYE"):
        k = np.array([values.get(f"k{index}", 0.0) for index in (1, 2, 3, 4)])
        return LensRecord(model="kannala_brandt", values={**core, "k": k}, image_size=image_size)
    d = np.array([values.get(name, 0.0) for name in _PINHOLE])
    return LensRecord(model="pinhole", values={**core, "d": d}, image_size=image_size)
