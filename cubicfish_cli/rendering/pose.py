"""Where the camera is: ``camera_from_world`` as a rotation vector and a shift, and their table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.tables import csv_text, read_table
from cubicfish_cli.types import FloatArray

Pose = tuple[FloatArray, FloatArray]
"""camera_from_world: rotation vector (3,) in radians, translation (3,) in the target's units."""
POSE_COLUMNS = ("image", "rx", "ry", "rz", "tx", "ty", "tz")
_MOST = 1e9


def rotation_matrix(rotation: npt.ArrayLike) -> FloatArray:
    """Rotation vector (3,) in radians -> matrix (3, 3)."""
    return np.asarray(cv2.Rodrigues(np.asarray(rotation, float).reshape(3, 1))[0], float)


def camera_points(camera_from_world: Pose, world: npt.ArrayLike) -> FloatArray:
    """World points (..., 3) -> points in the camera frame (..., 3)."""
    rotation, translation = camera_from_world
    return np.asarray(world, float) @ rotation_matrix(rotation).T + translation


def look_at(
    eye: npt.ArrayLike, aim: npt.ArrayLike, *, up: npt.ArrayLike = (0, 0, 1), roll: float = 0.0
) -> Pose:
    """The pose of a camera at ``eye`` whose axis goes through ``aim`` (world points).

    ``up`` is the world direction that is up in the picture at ``roll`` 0; ``roll`` radians
    turn the camera clockwise about its axis, as seen from behind it. ``up`` must not be
    along the axis.
    """
    eye = np.asarray(eye, float)
    forward = np.asarray(aim, float) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, np.asarray(up, float))
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    turned_right = np.cos(roll) * right + np.sin(roll) * down
    turned_down = np.cos(roll) * down - np.sin(roll) * right
    return pose_of_matrix(np.stack([turned_right, turned_down, forward]), eye)


def pose_of_matrix(matrix: FloatArray, eye: FloatArray) -> Pose:
    """The pose of a camera at ``eye`` (3,) with a rotation (3, 3) from world to camera."""
    rotation = np.asarray(cv2.Rodrigues(matrix)[0], float).ravel()
    return rotation, -matrix @ eye


def pose_table_text(poses: Mapping[str, Pose]) -> str:
    """Poses by photo as CSV; numbers read back exactly.

    ``rx, ry, rz`` are the rotation vector in radians and ``tx, ty, tz`` the translation, in the
    target's units.
    """
    rows = [
        (name, *np.asarray(rotation, float).tolist(), *np.asarray(translation, float).tolist())
        for name, (rotation, translation) in poses.items()
    ]
    return "# cubicfish poses 1, camera_from_world\n" + csv_text([POSE_COLUMNS, *rows])


def load_poses(path: Path) -> dict[str, Pose]:
    """Read poses by photo, in the file's order.

    Raises:
        CorrespondenceError: the file cannot be read, is no such table, or names a photo twice;
            the text names the file and the line.

    """
    table = read_table(path, required=POSE_COLUMNS, optional=(), error=CorrespondenceError)
    names, code = table.codes("image")
    numbers = np.stack([table.floats(column) for column in POSE_COLUMNS[1:]], axis=-1)
    for row, values in enumerate(numbers):
        if (code[:row] == code[row]).any():
            table.refuse(row, f"{names[code[row]]} is there twice: give each photo one pose")
        if np.abs(values).max() > _MOST:
            table.refuse(row, f"the pose must lie within ±{_MOST:g}")
    return {names[code[row]]: (values[:3], values[3:]) for row, values in enumerate(numbers)}
