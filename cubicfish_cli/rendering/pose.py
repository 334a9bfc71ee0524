"""Where the camera is: ``camera_from_world`` as a rotation vector and a translation."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.types import FloatArray

Pose = tuple[FloatArray, FloatArray]
"""camera_from_world: rotation vector (3,) in radians, translation (3,) in the target's units."""


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
