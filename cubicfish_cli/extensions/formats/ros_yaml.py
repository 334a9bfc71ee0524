"""ROS CameraInfo YAML, as camera_calibration writes and camera_info_manager reads it.

``equidistant`` has the four coefficients of OpenCV's fisheye module; ``plumb_bob`` and
``rational_polynomial`` are OpenCV's pinhole lens. The projection matrix is that of the rectified
picture: here of one with the same focal lengths and centre.

A rig becomes a CameraInfo for each camera and, for tf2, the pose of each: as records of
geometry_msgs/TransformStamped in YAML, and as fixed joints in URDF. Lengths are metres.
"""

import re
import warnings
from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish import FloatArray
from cubicfish.models import RadialCamera
from cubicfish_cli.extensions.formats.camera_keys import Layout, Program
from cubicfish_cli.extensions.formats.lenses import PINHOLE, PinholeLens, matrix_rows
from cubicfish_cli.foreign.file_contents import LensRig, PlacedLens


def ros_text(one: PlacedLens) -> str:
    """Write a radial lens as CameraInfo YAML with the model ``equidistant``."""
    width, height = one.lens.image_size
    matrix = np.array(matrix_rows(one.lens))
    matrices = {
        "distortion_coefficients": one.lens.k[None],
        "rectification_matrix": np.eye(3),
        "projection_matrix": np.column_stack([matrix, np.zeros(3)]),
    }
    return "\n".join(
        [
            *(f"# {line}" for line in one.note),
            f"image_width: {width}",
            f"image_height: {height}",
            f"camera_name: {one.name}",
            *_write_matrix("camera_matrix", matrix),
            "distortion_model: equidistant",
            *(line for key, value in matrices.items() for line in _write_matrix(key, value)),
            "",
        ]
    )


def _write_matrix(name: str, matrix: FloatArray) -> list[str]:
    rows, columns = matrix.shape
    return [
        f"{name}:",
        f"  rows: {rows}",
        f"  cols: {columns}",
        f"  data: {matrix.ravel().tolist()}",
    ]


def ros_rig_texts(rig: LensRig) -> dict[str, str]:
    """Write radial lenses as CameraInfo, static transforms and URDF: name -> text.

    The frame ``rig`` is the first camera's as it was calibrated, and ``NAME_optical_frame`` that
    of a camera's lens: x to the right, y down, z forward.

    Raises:
        CameraFileError: the rig's unit of length is not known.

    """
    places = [rig.rig_from_lens(number) for number in range(len(rig.lenses))]
    frames = [f"{re.sub('[^A-Za-z0-9_]', '_', one.name)}_optical_frame" for one in rig.lenses]
    texts = {f"{one.name}.camera_info.yaml": ros_text(one) for one in rig.lenses}
    lines = ["# geometry_msgs/TransformStamped: where each camera stands in the rig, metres"]
    urdf = ['<?xml version="1.0"?>', '<robot name="rig">', '  <link name="rig"/>']
    for frame, (turn, shift) in zip(frames, places, strict=True):
        rotation, metres = Rotation.from_matrix(turn), (shift * rig.metres + 0.0).tolist()
        lines += [
            "- header: {frame_id: rig}",
            f"  child_frame_id: {frame}",
            "  transform:",
            f"    translation: {_write_named('xyz', metres)}",
            f"    rotation: {_write_named('xyzw', rotation.as_quat().tolist())}",
        ]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # turns by 90 degrees about y have several angles
            angles = rotation.as_euler("xyz").tolist()
        urdf += [
            f'  <link name="{frame}"/>',
            f'  <joint name="rig_to_{frame}" type="fixed">',
            '    <parent link="rig"/>',
            f'    <child link="{frame}"/>',
            f'    <origin xyz="{_write_spaced(metres)}" rpy="{_write_spaced(angles)}"/>',
            "  </joint>",
        ]
    texts["static_transforms.yaml"] = "\n".join([*lines, ""])
    texts["rig.urdf"] = "\n".join([*urdf, "</robot>", ""])
    return texts


def _write_named(names: str, values: Sequence[float]) -> str:
    return "{" + ", ".join(f"{a}: {v!r}" for a, v in zip(names, values, strict=True)) + "}"


def _write_spaced(values: Sequence[float]) -> str:
    return " ".join(map(repr, values))


_MATRIX = "camera_matrix.data[fx,,cx,,fy,cy,,,]"
_D = "distortion_coefficients.data"
read_ros = Program(
    Layout(
        file="a ROS {}CameraInfo",
        camera=r"()camera_matrix\.data\.0",
        kind=("distortion_model",),
        lenses={
            "plumb_bob": (PinholeLens, f"{_MATRIX} {_D}[k1?,k2?,p1?,p2?,k3?]"),
            "rational_polynomial": (PinholeLens, f"{_MATRIX} {_D}[{','.join(PINHOLE[:8])}]"),
            "equidistant": (RadialCamera, f"{_MATRIX} {_D}[k1,k2,k3,k4]"),
        },
        size=("image_width", "image_height"),
    )
).read
