"""Kalibr's camchain.yaml: one or more cameras, cam0, cam1, ...

``T_cn_cnm1`` takes points from the frame of the camera before to each camera's, in metres. Models
are ``pinhole`` with radtan, equidistant or no distortion, ``omni`` with radtan and ``ds`` with
none, with intrinsics in Kalibr's order.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from cubicfish.models import Lens, RadialCamera
from cubicfish_cli.extensions.formats.camera_keys import Layout, Program
from cubicfish_cli.extensions.formats.lenses import (
    DoubleSphereLens,
    PinholeLens,
    UnifiedLens,
    named_numbers,
)
from cubicfish_cli.foreign.file_contents import LensRig, PlacedLens, transform_rows

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


def _list_keys(lens: str, coefficients: Sequence[str]) -> str:
    """Return the parameters of a lens, as they stand in the lists of a camera."""
    keys = f"intrinsics[{','.join(_INTRINSICS[lens])}]"
    return f"{keys} distortion_coeffs[{','.join(coefficients)}]" if coefficients else keys


read_kalibr = Program(
    Layout(
        file="a Kalibr {}camchain",
        camera=r"((cam\d+)\.)camera_model",
        kind=("camera_model", "distortion_model"),
        lenses={
            "-".join(names): (lens, _list_keys(names[0], coefficients))
            for names, (lens, coefficients) in _MODELS.items()
        },
        size=("resolution.0", "resolution.1"),
    )
).read
