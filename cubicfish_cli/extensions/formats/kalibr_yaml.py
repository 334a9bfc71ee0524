"""Kalibr's camchain.yaml: one or more cameras, cam0, cam1, ...

``T_cn_cnm1`` takes points from the frame of the camera before to each camera's, in metres. Models
are ``pinhole`` with radtan, equidistant or no distortion, ``omni`` with radtan and ``ds`` with
none, with intrinsics in Kalibr's order.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from cubicfish import CameraFileError, quoted
from cubicfish.files import parse_plain_yaml, read_text
from cubicfish.models import Lens, RadialCamera
from cubicfish_cli.extensions.formats.lenses import (
    DoubleSphereLens,
    PinholeLens,
    UnifiedLens,
    named_lens,
    named_numbers,
)
from cubicfish_cli.foreign.file_contents import (
    Fields,
    LensRig,
    PlacedLens,
    chosen_camera,
    transform_rows,
)

# camera_model -> its intrinsics.
_INTRINSICS = {
    "pinhole": ("fx", "fy", "cx", "cy"),
    "omni": ("xi", "fx", "fy", "cx", "cy"),
    "ds": ("xi", "alpha", "fx", "fy", "cx", "cy"),
}
_RADTAN = ("k1", "k2", "p1", "p2")
# camera_model and distortion_model -> the lens, its coefficients.
_MODELS: Mapping[tuple[str, str], tuple[type[Lens], Sequence[str]]] = {
    ("pinhole", "radtan"): (PinholeLens, _RADTAN),
    ("pinhole", "equidistant"): (RadialCamera, ("k1", "k2", "k3", "k4")),
    ("pinhole", "none"): (PinholeLens, ()),
    ("omni", "radtan"): (UnifiedLens, _RADTAN),
    ("ds", "none"): (DoubleSphereLens, ()),
}
_WRITTEN = {
    lens: (*names, coefficients)
    for names, (lens, coefficients) in _MODELS.items()
    if lens is not PinholeLens
}

_MAX_BYTES = 1_000_000


def kalibr_text(one: PlacedLens) -> str:
    """Write a lens as a camchain of one camera."""
    return "\n".join([*(f"# {line}" for line in one.note), *_write_camera(one.lens, 0, []), ""])


def kalibr_rig_text(rig: LensRig) -> str:
    """Write lenses as a camchain.

    Raises:
        CameraFileError: the rig's unit of length is not known.

    """
    lines = []
    for number, one in enumerate(rig.lenses):
        overlaps = np.flatnonzero(rig.overlaps[number]).tolist()
        lines += [f"# cam{number} is {one.name}", *(f"# {line}" for line in one.note)]
        lines += _write_camera(one.lens, number, overlaps)
        if number:
            turn, shift = rig.between(number, number - 1)
            rows = transform_rows(turn, shift * rig.metres)
            lines += ["  T_cn_cnm1:", *(f"  - {row}" for row in rows)]
    return "\n".join([*lines, ""])


def _write_camera(lens: Lens, number: int, overlaps: Sequence[int]) -> list[str]:
    camera, distortion, coefficients = _WRITTEN[type(lens)]
    named = named_numbers(lens)
    width, height = lens.image_size
    return [
        f"cam{number}:",
        f"  cam_overlaps: {list(overlaps)}",
        f"  camera_model: {camera}",
        f"  distortion_coeffs: {[named[name] for name in coefficients]}",
        f"  distortion_model: {distortion}",
        f"  intrinsics: {[named[name] for name in _INTRINSICS[camera]]}",
        f"  resolution: [{width}, {height}]",
        f"  rostopic: /cam{number}/image_raw",
    ]


def read_kalibr(path: Path, *, camera: str | None = None) -> Lens:
    """Read one camera of a camchain.

    Args:
        path: the file.
        camera: its name, such as cam1; not needed where there is one.

    Raises:
        CameraFileError: the file is not one, or holds no such camera; one line.

    """
    text = read_text(path, max_bytes=_MAX_BYTES, error=CameraFileError)
    chain = Fields.of(path, parse_plain_yaml(path, text, error=CameraFileError))
    names = [name for name in chain.values if name.startswith("cam") and name[3:].isdecimal()]
    record = chain.part(chosen_camera(path, names, camera))
    kind = record.name("camera_model", tuple(_INTRINSICS))
    distortion = str(record.values.get("distortion_model"))
    if (kind, distortion) not in _MODELS:
        raise CameraFileError(
            f"{path}: {record.at}distortion_model {quoted(distortion)} does not go with {kind}: "
            + ", ".join(fitting for own, fitting in _MODELS if own == kind)
        )
    model, coefficients = _MODELS[kind, distortion]
    intrinsics = _INTRINSICS[kind]
    named = dict(zip(intrinsics, record.numbers("intrinsics", len(intrinsics)), strict=True))
    if coefficients or "distortion_coeffs" in record.values:
        d = record.numbers("distortion_coeffs", len(coefficients))
        named.update(zip(coefficients, d, strict=True))
    return named_lens(path, model, record.size_of("resolution"), named)
