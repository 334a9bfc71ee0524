"""nerfstudio's transforms.json: one lens, and poses of frames with OpenGL's axes.

A frame's ``transform_matrix`` is world_from_camera with x to the right, y UP and the view along
-z. The centre of the first pixel is (0.5, 0.5), as in COLMAP, whose lenses it takes over: its
cameras look through ``image_coords``, a grid that starts there (nerfstudio's issue 3048).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.app.lenses.camera_format import (
    CameraFormat,
    LensRig,
    Poses,
    focal,
    json_text,
    number,
    parse_plain_json,
    read_bounded,
    size,
)
from cubicfish_cli.core.errors import CameraFileError
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.plain_yaml import mapping
from cubicfish_cli.core.wording import quoted
from cubicfish_cli.extensions.formats.lenses import PinholeLens

MAX_BYTES = 64_000_000
_CORE = {"fx": "fl_x", "fy": "fl_y", "cx": "cx", "cy": "cy"}
_SHIFT = {"fx": 0.0, "fy": 0.0, "cx": 0.5, "cy": 0.5}
_FISHEYE = ("k1", "k2", "k3", "k4")
_PINHOLE = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
_MODELS = ("OPENCV", "OPENCV_FISHEYE", "PINHOLE", "SIMPLE_PINHOLE")
_WRITTEN = "OPENCV_FISHEYE"
# From nerfstudio's camera axes to those here.
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


def nerfstudio_text(lens: RadialCamera, note: Sequence[str], poses: Poses) -> str:
    """A lens and camera_from_world of photos as transforms.json.

    Args:
        lens: the lens.
        note: how it was made.
        poses: rotation (3, 3) and translation (3,) of camera_from_world, by the photo's name.

    """
    return _text(
        {**_lens(lens), "made_by": list(note)},
        [{"file_path": name, "transform_matrix": _matrix(*pose)} for name, pose in poses.items()],
    )


def nerfstudio_rig_text(rig: LensRig) -> str:
    """Lenses and camera_from_world of their photos as transforms.json.

    Every frame has its own lens; the photos of each are in a folder of its name.
    """
    frames = [
        {
            "file_path": f"{one.name}/{name}",
            "transform_matrix": _matrix(*pose),
            **_lens(one.lens),
        }
        for one in rig.lenses
        for name, pose in one.poses.items()
    ]
    note = [f"{one.name}: {line}" for one in rig.lenses for line in one.note]
    return _text({"camera_model": _WRITTEN, "made_by": note}, frames)


def _lens(lens: RadialCamera) -> dict[str, Any]:
    width, height = lens.image_size
    return {
        "camera_model": _WRITTEN,
        **{theirs: getattr(lens, ours) + _SHIFT[ours] for ours, theirs in _CORE.items()},
        "w": width,
        "h": height,
        **dict(zip(_FISHEYE, lens.k.tolist(), strict=True)),
    }


def _matrix(
    rotation: npt.NDArray[np.float64], translation: npt.NDArray[np.float64]
) -> list[list[float]]:
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = rotation.T
    world_from_camera[:3, 3] = -rotation.T @ translation
    return (world_from_camera @ _FLIP).tolist()


def _text(data: Mapping[str, Any], frames: Sequence[Mapping[str, Any]]) -> str:
    whole = {**data, "frames": list(frames)}
    return json_text(whole)


def read_nerfstudio(path: Path) -> RadialCamera | PinholeLens:
    """Read the lens of a transforms.json.

    Raises:
        CameraFileError: the file is not one, or its lens is not known; one line.

    """
    data = parse_plain_json(path, read_bounded(path, max_bytes=MAX_BYTES))
    record = mapping(path, data, "the file")
    if "fl_x" not in record:
        frames = record.get("frames")
        if isinstance(frames, list) and frames and isinstance(frames[0], dict):
            record = {**record, **frames[0]}
    model = record.get("camera_model", "OPENCV")
    if model not in _MODELS:
        raise CameraFileError(
            f"{path}: camera_model {quoted(str(model))} is not known: {', '.join(_MODELS)}"
        )
    core = {ours: number(path, record, theirs) - _SHIFT[ours] for ours, theirs in _CORE.items()}
    focal(path, np.array([core["fx"], core["fy"]]), "fl_x and fl_y")
    image_size = size(path, record.get("w"), record.get("h"), "w and h")
    names = _FISHEYE if model == _WRITTEN else _PINHOLE
    d = np.array([number(path, record, name) if name in record else 0.0 for name in names])
    if model == _WRITTEN:
        return RadialCamera(image_size=image_size, **core, k=d)
    return PinholeLens(image_size=image_size, **core, d=d)


FORMAT = CameraFormat(
    lenses={"nerfstudio": RadialCamera},
    file_name="transforms.json",
    write=nerfstudio_text,
    read=read_nerfstudio,
    marks=(("fl_x",),),
    rig=("transforms.json", nerfstudio_rig_text),
)
