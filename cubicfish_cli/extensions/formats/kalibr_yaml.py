"""Kalibr's camchain.yaml: one or more cameras, cam0, cam1, ...

Of several cameras, ``T_cn_cnm1`` takes points of the camera before to each one's frame, metres.
``pinhole`` with radtan, equidistant or no distortion, ``omni`` with radtan and ``ds`` with none;
intrinsics in Kalibr's order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish_cli.app.lenses.camera_format import (
    CameraFormat,
    LensRig,
    chosen_camera,
    focal,
    matrix_rows,
    numbers,
    size,
)
from cubicfish_cli.core.errors import CameraFileError
from cubicfish_cli.core.lenses.lens import Lens
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.plain_yaml import load_plain_yaml, mapping
from cubicfish_cli.core.wording import quoted
from cubicfish_cli.extensions.formats.lenses import DoubleSphereLens, PinholeLens, UnifiedLens

_CORE = ("fx", "fy", "cx", "cy")
# Kalibr's camera_model -> what stands before the core in its intrinsics.
_INTRINSICS = {"pinhole": (), "omni": ("xi",), "ds": ("xi", "alpha")}
# camera_model and distortion_model -> the lens, its attribute with the coefficients, how many.
_MODELS: Mapping[tuple[str, str], tuple[type[Lens], str, int]] = {
    ("pinhole", "radtan"): (PinholeLens, "d", 4),
    ("pinhole", "equidistant"): (RadialCamera, "k", 4),
    ("pinhole", "none"): (PinholeLens, "d", 0),
    ("omni", "radtan"): (UnifiedLens, "d", 4),
    ("ds", "none"): (DoubleSphereLens, "", 0),
}
# Of a lens with several the first is written.
_WRITTEN = {made[0]: (*names, made[1]) for names, made in [*_MODELS.items()][::-1]}


def kalibr_text(lens: Lens, note: Sequence[str]) -> str:
    """A lens of a model of :data:`FORMAT` as a camchain of one camera.

    Raises:
        CameraFileError: the lens's values lie outside what Kalibr takes.

    """
    return "\n".join([*(f"# {line}" for line in note), *_camera_lines(lens, 0, []), ""])


def kalibr_rig_text(rig: LensRig) -> str:
    """Lenses of a model of :data:`FORMAT` as a camchain.

    Raises:
        CameraFileError: a lens's values lie outside what Kalibr takes, or the rig's unit of length
            is not known.

    """
    lines = []
    for number, one in enumerate(rig.lenses):
        overlaps = np.flatnonzero(rig.overlaps[number]).tolist()
        lines += [f"# cam{number} is {one.name}", *(f"# {line}" for line in one.note)]
        lines += _camera_lines(one.lens, number, overlaps)
        if number:
            turn, shift = rig.between(number, number - 1)
            rows = matrix_rows(turn, shift * rig.metres)
            lines += ["  T_cn_cnm1:", *(f"  - {_list(row)}" for row in rows)]
    return "\n".join([*lines, ""])


def _camera_lines(lens: Lens, number: int, overlaps: Sequence[int]) -> list[str]:
    camera, distortion, key = _WRITTEN[type(lens)]
    d = getattr(lens, key) if key else np.zeros(0)
    own = [float(getattr(lens, name)) for name in _INTRINSICS[camera]]
    _check(Path("camchain.yaml"), camera, own)
    intrinsics = [*own, *(float(getattr(lens, key)) for key in _CORE)]
    width, height = lens.image_size
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


def read_kalibr(path: Path, *, camera: str | None = None) -> Lens:
    """Read one camera of a camchain.

    Args:
        path: the file.
        camera: its name, such as cam1; not needed where there is one.

    Raises:
        CameraFileError: the file is not one, or holds no such camera; one line.

    """
    chain = mapping(path, load_plain_yaml(path, error=CameraFileError), "the file")
    names = [name for name in chain if name.startswith("cam") and name[3:].isdecimal()]
    camera = chosen_camera(path, names, camera)
    record = mapping(path, chain[camera], camera)
    kind, distortion = record.get("camera_model"), record.get("distortion_model")
    if not isinstance(kind, str) or kind not in _INTRINSICS:
        raise CameraFileError(
            f"{path}: {camera}.camera_model {quoted(str(kind))} is not known: "
            + ", ".join(_INTRINSICS)
        )
    if not isinstance(distortion, str) or (kind, distortion) not in _MODELS:
        raise CameraFileError(
            f"{path}: {camera}.distortion_model {quoted(str(distortion))} does not go with {kind}: "
            + ", ".join(fitting for own, fitting in _MODELS if own == kind)
        )
    model, key, count = _MODELS[kind, distortion]
    own = _INTRINSICS[kind]
    given = numbers(path, record.get("intrinsics"), f"{camera}.intrinsics", (4 + len(own),))
    _check(path, kind, given[: len(own)].tolist())
    focal(path, given[len(own) : len(own) + 2], f"{camera}.intrinsics")
    d = numbers(path, record.get("distortion_coeffs", []), f"{camera}.distortion_coeffs", (count,))
    resolution = record.get("resolution")
    if not isinstance(resolution, list) or len(resolution) != 2:
        raise CameraFileError(f"{path}: {camera}.resolution must be two whole numbers")
    values: dict[str, Any] = dict(zip((*own, *_CORE), given.tolist(), strict=True))
    if key:
        values[key] = d
    image_size = size(path, resolution[0], resolution[1], f"{camera}.resolution")
    return model(image_size=image_size, **values)


def _check(path: Path, kind: str, own: Sequence[float]) -> None:
    if kind == "omni" and not own[0] > 0:
        raise CameraFileError(f"{path}: xi of an omni lens must be above 0")
    if kind == "ds" and not 0 <= own[1] < 1:
        raise CameraFileError(f"{path}: alpha of a ds lens must be from 0 to below 1")


FORMAT = CameraFormat(
    lenses={
        "kalibr-pinhole-equi": RadialCamera,
        "kalibr-omni": UnifiedLens,
        "kalibr-ds": DoubleSphereLens,
    },
    file_name="camchain.yaml",
    write=lambda lens, note, poses: kalibr_text(lens, note),
    read=read_kalibr,
    holds_several=True,
    marks=(("camera_model:", "intrinsics:", "resolution:"),),
    rig=("camchain.yaml", kalibr_rig_text),
    front_only={"kalibr-pinhole-equi": "Kalibr's pinhole-equi"},
)
