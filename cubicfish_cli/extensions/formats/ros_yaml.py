"""ROS CameraInfo YAML, as camera_calibration writes and camera_info_manager reads it.

``equidistant`` holds the four coefficients of OpenCV's fisheye module; ``plumb_bob`` and
``rational_polynomial`` are OpenCV's pinhole lens. The projection matrix is that of the rectified
picture: here of one with the same focal lengths and centre.

Of a rig there are a CameraInfo for each camera and, for tf2, where each stands: as records of
geometry_msgs/TransformStamped in YAML, and as fixed joints in URDF. Lengths are metres.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish_cli.app.lenses.camera_format import CameraFormat, LensRig, focal, numbers, size
from cubicfish_cli.core.errors import CameraFileError
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.plain_yaml import load_plain_yaml, mapping
from cubicfish_cli.core.wording import quoted
from cubicfish_cli.extensions.formats.lenses import PinholeLens

_COUNTS = {"plumb_bob": (0, 4, 5), "rational_polynomial": (8,), "equidistant": (4,)}


def ros_text(lens: RadialCamera, note: Sequence[str], *, name: str = "camera") -> str:
    """A lens as CameraInfo YAML with the model ``equidistant``."""
    fx, fy, cx, cy = lens.fx, lens.fy, lens.cx, lens.cy
    width, height = lens.image_size
    return "\n".join(
        [
            *(f"# {line}" for line in note),
            f"image_width: {width}",
            f"image_height: {height}",
            f"camera_name: {name}",
            *_matrix("camera_matrix", 3, 3, [fx, 0, cx, 0, fy, cy, 0, 0, 1]),
            "distortion_model: equidistant",
            *_matrix("distortion_coefficients", 1, 4, lens.k.tolist()),
            *_matrix("rectification_matrix", 3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1]),
            *_matrix("projection_matrix", 3, 4, [fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]),
            "",
        ]
    )


def ros_rig_texts(rig: LensRig) -> dict[str, str]:
    """Radial lenses as CameraInfo, static transforms and URDF: name -> text.

    The frame ``rig`` is the first camera's as it was calibrated, and ``NAME_optical_frame`` that
    of a camera's lens: x to the right, y down, z forward.

    Raises:
        CameraFileError: the rig's unit of length is not known.

    """
    places = [rig.rig_from_lens(number) for number in range(len(rig.lenses))]
    frames = [f"{re.sub('[^A-Za-z0-9_]', '_', one.name)}_optical_frame" for one in rig.lenses]
    texts = {
        f"{one.name}.camera_info.yaml": ros_text(one.lens, one.note, name=one.name)
        for one in rig.lenses
    }
    lines = ["# geometry_msgs/TransformStamped: where each camera stands in the rig, metres"]
    urdf = ['<?xml version="1.0"?>', '<robot name="rig">', '  <link name="rig"/>']
    for frame, (turn, shift) in zip(frames, places, strict=True):
        rotation, metres = Rotation.from_matrix(turn), (shift * rig.metres + 0.0).tolist()
        lines += [
            "- header: {frame_id: rig}",
            f"  child_frame_id: {frame}",
            "  transform:",
            f"    translation: {_named('xyz', metres)}",
            f"    rotation: {_named('xyzw', rotation.as_quat().tolist())}",
        ]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # turns by 90 degrees about y have several angles
            angles = rotation.as_euler("xyz").tolist()
        urdf += [
            f'  <link name="{frame}"/>',
            f'  <joint name="rig_to_{frame}" type="fixed">',
            '    <parent link="rig"/>',
            f'    <child link="{frame}"/>',
            f'    <origin xyz="{_spaced(metres)}" rpy="{_spaced(angles)}"/>',
            "  </joint>",
        ]
    texts["static_transforms.yaml"] = "\n".join([*lines, ""])
    texts["rig.urdf"] = "\n".join([*urdf, "</robot>", ""])
    return texts


def _named(names: str, values: Sequence[float]) -> str:
    return "{" + ", ".join(f"{a}: {v!r}" for a, v in zip(names, values, strict=True)) + "}"


def _spaced(values: Sequence[float]) -> str:
    return " ".join(map(repr, values))


def _matrix(name: str, rows: int, columns: int, data: Sequence[float]) -> list[str]:
    text = ", ".join(repr(float(value)) for value in data)
    return [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{text}]"]


def read_ros(path: Path) -> RadialCamera | PinholeLens:
    """Read CameraInfo YAML.

    Raises:
        CameraFileError: the file is not one, or its model is not known; one line.

    """
    record = mapping(path, load_plain_yaml(path, error=CameraFileError), "the file")
    image_size = size(
        path, record.get("image_width"), record.get("image_height"), "image_width and image_height"
    )
    matrix = _data(path, record, "camera_matrix", (9,))
    fx, _, cx, _, fy, cy = matrix[:6].tolist()
    if fx == 0:
        raise CameraFileError(f"{path}: camera_matrix[0] is 0: this camera was not calibrated")
    focal(path, np.array([fx, fy]), "camera_matrix")
    model = record.get("distortion_model")
    if not isinstance(model, str) or model not in _COUNTS:
        raise CameraFileError(
            f"{path}: distortion_model {quoted(str(model))} is not known: {', '.join(_COUNTS)}"
        )
    d = _data(path, record, "distortion_coefficients", _COUNTS[model])
    core = {"fx": fx, "fy": fy, "cx": cx, "cy": cy}
    if model == "equidistant":
        return RadialCamera(image_size=image_size, **core, k=d)
    return PinholeLens(image_size=image_size, **core, d=d)


def _data(
    path: Path, record: dict[str, Any], key: str, counts: tuple[int, ...]
) -> np.ndarray[Any, Any]:
    matrix = mapping(path, record.get(key), key)
    return numbers(path, matrix.get("data"), f"{key}.data", counts)


FORMAT = CameraFormat(
    lenses={"ros": RadialCamera},
    file_name="camera_info.yaml",
    write=lambda lens, note, poses: ros_text(lens, note),
    read=read_ros,
    marks=(("distortion_model:", "camera_matrix:", "image_width:"),),
    rig=("ros", ros_rig_texts),
    front_only={"ros": "cv2.fisheye"},
)
