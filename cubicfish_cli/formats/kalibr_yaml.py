"""Kalibr's camchain.yaml: one or more cameras, cam0, cam1, ...

Of several cameras, ``T_cn_cnm1`` takes points of the camera before to each one's frame, metres.
``pinhole`` with radtan, equidistant, fov or no distortion, ``omni`` with radtan or none, ``eucm``
and ``ds`` with none; intrinsics in Kalibr's order.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.errors import CameraFileError
from cubicfish_cli.formats.fields import focal, mapping, numbers, size
from cubicfish_cli.formats.lens_rig import LensRig, matrix_rows
from cubicfish_cli.model.lens_record import LensRecord
from cubicfish_cli.plain_yaml import load_plain_yaml
from cubicfish_cli.wording import quoted

LENSES = {
    "pinhole-equi": "kannala_brandt",
    "omni": "unified",
    "eucm": "eucm",
    "ds": "double_sphere",
}
"""Kalibr's name of a lens -> the model of its record."""

_CORE = ("fx", "fy", "cx", "cy")
_INTRINSICS = {"pinhole": (), "omni": ("xi",), "eucm": ("alpha", "beta"), "ds": ("xi", "alpha")}
_DISTORTIONS = {"radtan": 4, "equidistant": 4, "fov": 1, "none": 0}
_USED_WITH = {
    "pinhole": ("radtan", "equidistant", "fov", "none"),
    "omni": ("radtan", "none"),
    "eucm": ("none",),
    "ds": ("none",),
}


def kalibr_text(record: LensRecord, note: Sequence[str]) -> str:
    """A record of one of :data:`LENSES`' models as a camchain of one camera.

    Raises:
        CameraFileError: the lens's values lie outside what Kalibr takes.

    """
    return "\n".join([*(f"# {line}" for line in note), *_camera_lines(record, 0, []), ""])


def kalibr_rig_text(rig: LensRig) -> str:
    """Lenses of one of :data:`LENSES`' models as a camchain.

    Raises:
        CameraFileError: a lens's values lie outside what Kalibr takes, or the rig's unit of length
            is not known.

    """
    lines = []
    for number, one in enumerate(rig.lenses):
        overlaps = np.flatnonzero(rig.overlaps[number]).tolist()
        lines += [f"# cam{number} is {one.name}", *(f"# {line}" for line in one.note)]
        lines += _camera_lines(one.record, number, overlaps)
        if number:
            turn, shift = rig.between(number, number - 1)
            rows = matrix_rows(turn, shift * rig.metres)
            lines += ["  T_cn_cnm1:", *(f"  - {_list(row)}" for row in rows)]
    return "\n".join([*lines, ""])


def _camera_lines(record: LensRecord, number: int, overlaps: Sequence[int]) -> list[str]:
    values = record.values
    camera, distortion, key = {
        "kannala_brandt": ("pinhole", "equidistant", "k"),
        "unified": ("omni", "radtan", "d"),
        "eucm": ("eucm", "none", ""),
        "double_sphere": ("ds", "none", ""),
    }[record.model]
    d = np.asarray(values.get(key, np.zeros(0)), float)
    own = [float(values[name]) for name in _INTRINSICS[camera]]
    _check(Path("camchain.yaml"), camera, own)
    intrinsics = [*own, *(float(values[key]) for key in _CORE)]
    width, height = record.image_size
    return [
        f"cam{number}:",
        f"  cam_overlaps: {list(overlaps)}",
        f"  camera_model: {camera}",
        f"  distortion_coeffs: {_list(d.tolist())}",
        f"  distortion_model: {distortion}",
        f"  intrinsics: {_list(intrinsics)}",
        f"  resolution: [{width}, {height}]",
        f"  rostopic: /cam{number}/image_raw",
    ]


def _list(values: Sequence[float]) -> str:
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"


def read_kalibr(path: Path, *, camera: str | None = None) -> LensRecord:
    """Read one camera of a camchain.

    Args:
        path: the file.
        camera: its name, such as cam1; not needed where there is one.

    Raises:
        CameraFileError: the file is not one, or holds no such camera; one line.

    """
    chain = mapping(path, load_plain_yaml(path, error=CameraFileError), "the file")
    names = [name for name in chain if name.startswith("cam") and name[3:].isdecimal()]
    if camera is None and len(names) == 1:
        camera = names[0]
    if camera not in names:
        there = ", ".join(names) or "none"
        raise CameraFileError(f"{path}: name one of its cameras with --camera: {there}")
    record = mapping(path, chain[camera], camera)
    kind, distortion = record.get("camera_model"), record.get("distortion_model")
    if not isinstance(kind, str) or kind not in _INTRINSICS:
        raise CameraFileError(
            f"{path}: {camera}.camera_model {quoted(str(kind))} is not known: "
            + ", ".join(_INTRINSICS)
        )
    if not isinstance(distortion, str) or distortion not in _USED_WITH[kind]:
        raise CameraFileError(
            f"{path}: {camera}.distortion_model {quoted(str(distortion))} does not go with {kind}: "
            + ", ".join(_USED_WITH[kind])
        )
    own = _INTRINSICS[kind]
    given = numbers(path, record.get("intrinsics"), f"{camera}.intrinsics", (4 + len(own),))
    _check(path, kind, given[: len(own)].tolist())
    focal(path, given[len(own) : len(own) + 2], f"{camera}.intrinsics")
    d = numbers(
        path,
        record.get("distortion_coeffs", []),
        f"{camera}.distortion_coeffs",
        (_DISTORTIONS[distortion],),
    )
    resolution = record.get("resolution")
    if not isinstance(resolution, list) or len(resolution) != 2:
        raise CameraFileError(f"{path}: {camera}.resolution must be two whole numbers")
    values: dict[str, Any] = dict(zip((*own, *_CORE), given.tolist(), strict=True))
    model = {"omni": "unified", "eucm": "eucm", "ds": "double_sphere"}.get(kind)
    if kind == "omni":
        values["d"] = d if len(d) else np.zeros(4)
    elif kind == "pinhole" and distortion == "equidistant":
        model, values["k"] = "kannala_brandt", d
    elif kind == "pinhole" and distortion == "fov":
        model, values["omega"] = "fov", float(d[0])
    elif kind == "pinhole":
        model, values["d"] = "pinhole", d
    return LensRecord(
        model=str(model),
        values=values,
        image_size=size(path, resolution[0], resolution[1], f"{camera}.resolution"),
    )


def _check(path: Path, kind: str, own: Sequence[float]) -> None:
    if kind == "omni" and not own[0] > 0:
        raise CameraFileError(f"{path}: xi of an omni lens must be above 0")
    if kind == "ds" and not 0 <= own[1] < 1:
        raise CameraFileError(f"{path}: alpha of a ds lens must be from 0 to below 1")
    if kind == "eucm" and not (0 <= own[0] <= 1 and own[1] >= 0):
        raise CameraFileError(f"{path}: an eucm lens has alpha from 0 to 1 and beta from 0 on")
