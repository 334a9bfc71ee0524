"""Where a camera is that looks at something."""

import numpy as np
import numpy.typing as npt

from cubicfish.scene.truth import Pose, pose_of_matrix


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
