"""nerfstudio's transforms.json: one lens, and poses of frames with OpenGL's axes.

A frame's ``transform_matrix`` is world_from_camera with x to the right, y UP and the view along
-z. The centre of the first pixel is (0.5, 0.5), as in COLMAP, whose lenses it takes over: its
cameras look through ``image_coords``, a grid that starts there (nerfstudio's issue 3048). Its
FISHEYE624 is COLMAP's RAD_TAN_THIN_PRISM_FISHEYE, but for rays of z = 1: it sees nothing behind.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish.models import Lens, RadialCamera
from cubicfish_cli.extensions.formats.colmap_cameras import RadTanThinPrismLens
from cubicfish_cli.extensions.formats.lenses import PINHOLE, PinholeLens, named_lens, named_numbers
from cubicfish_cli.foreign.file_contents import (
    Fields,
    LensRig,
    PlacedLens,
    Pose,
    json_text,
    load_plain_json,
    transform_rows,
)

MAX_BYTES = 64_000_000
_WRITTEN = "OPENCV_FISHEYE"
_FREE = "FISHEYE624"
_FREE_SHAPE = ("k1", "k2", "k3", "k4", "k5", "k6", "t1", "t2", "s1", "s2", "s3", "s4")
_CORE = {"fx": "fl_x", "fy": "fl_y", "cx": "cx", "cy": "cy"}
_FISHEYE = ("k1", "k2", "k3", "k4")
_MODELS: Mapping[str, tuple[type[Lens], tuple[str, ...]]] = {
    "OPENCV": (PinholeLens, PINHOLE[:8]),
    _WRITTEN: (RadialCamera, _FISHEYE),
    _FREE: (RadTanThinPrismLens, _FREE_SHAPE),
    "PINHOLE": (PinholeLens, PINHOLE[:8]),
    "SIMPLE_PINHOLE": (PinholeLens, PINHOLE[:8]),
}
_HALF = {"cx": 0.5, "cy": 0.5}
# From nerfstudio's camera axes to those here.
_FLIP = np.diag([1.0, -1.0, -1.0])


def nerfstudio_text(one: PlacedLens) -> str:
    """Write a lens, radial or thin prism, and camera_from_world of its photos."""
    frames = [
        {"file_path": name, "transform_matrix": _make_matrix(pose)}
        for name, pose in one.poses.items()
    ]
    return json_text(
        {**_record_lens(one.lens, _name_of(one.lens)), "made_by": list(one.note), "frames": frames}
    )


def nerfstudio_rig_text(rig: LensRig) -> str:
    """Write lenses and camera_from_world of their photos as transforms.json.

    Every frame has its own lens, all of one model; the photos of each are in a folder of its name.
    """
    model = max((_name_of(one.lens) for one in rig.lenses), key=lambda name: name == _FREE)
    frames = [
        {
            "file_path": f"{one.name}/{name}",
            "transform_matrix": _make_matrix(pose),
            **_record_lens(one.lens, model),
        }
        for one in rig.lenses
        for name, pose in one.poses.items()
    ]
    note = [f"{one.name}: {line}" for one in rig.lenses for line in one.note]
    return json_text({"camera_model": model, "made_by": note, "frames": frames})


def _name_of(lens: Lens) -> str:
    return _FREE if isinstance(lens, RadTanThinPrismLens) else _WRITTEN


def _record_lens(lens: Lens, model: str) -> dict[str, Any]:
    """Record a lens as of a model: a radial one is a thin prism without its other terms too."""
    named, (width, height) = named_numbers(lens), lens.image_size
    shape = {name: named.get(name, 0.0) for name in _MODELS[model][1]}
    return {
        "camera_model": model,
        **{theirs: named[ours] + _HALF.get(ours, 0.0) for ours, theirs in _CORE.items()},
        "w": width,
        "h": height,
        **({"distortion_params": [*shape.values()]} if model == _FREE else shape),
    }


def _make_matrix(camera_from_world: Pose) -> list[list[float]]:
    rotation, translation = camera_from_world
    return transform_rows(rotation.T @ _FLIP, -rotation.T @ translation)


def read_nerfstudio(path: Path) -> Lens:
    """Read the lens of a transforms.json.

    Raises:
        CameraFileError: the file is not one, or its lens is not known; one line.

    """
    record = load_plain_json(path, max_bytes=MAX_BYTES)
    values = {"camera_model": "OPENCV", **record.values}
    frames = values.get("frames")
    if "fl_x" not in values and isinstance(frames, list) and isinstance([*frames, 0][0], dict):
        values.update(frames[0])
    record = Fields(path=path, values=values)
    model, coefficients = _MODELS[record.name("camera_model", tuple(_MODELS))]
    named = {ours: record.number(theirs) - _HALF.get(ours, 0.0) for ours, theirs in _CORE.items()}
    if model is RadTanThinPrismLens:
        shape = record.numbers("distortion_params", len(coefficients))
        named |= zip(coefficients, shape.tolist(), strict=True)
    else:
        named |= {name: record.number(name) for name in coefficients if name in record.values}
        named |= {name: named.get(name, 0.0) for name in coefficients}
    return named_lens(path, model, record.size("w", "h"), named)
