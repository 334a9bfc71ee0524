"""The boards of a target as plates that rays hit: who is in front, and what is seen of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cubicfish_cli.boards.board import Face
from cubicfish_cli.rendering.pose import Pose, rotation_matrix
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray, IntArray

MARGIN_SQUARES = 0.4
"""White paper around the print, in squares."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Plate:
    """A board as one camera sees it.

    Attributes:
        face: what is printed on it.
        board_from_camera: (3, 3) rotation into the board's x, y and its inward normal.
        eye: (3,) the camera's centre in the board's frame; its third coordinate is negative
            where the printed face is seen.

    """

    face: Face
    board_from_camera: FloatArray
    eye: FloatArray

    @property
    def faces_camera(self) -> bool:
        """Whether the camera is on the printed side."""
        return bool(self.eye[2] < 0)

    def hit(
        self, rays: FloatArray, starts: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Where rays (N, 3) of the camera meet the plate; ``starts`` as in :func:`nearest`.

        Returns the distance in ray lengths (N,), infinite where the plate is missed, and the
        position in the board's plane (N, 2).
        """
        along = rays @ self.board_from_camera.T
        eye = self.eye[:, None]
        if starts is not None:
            eye = eye + self.board_from_camera[:, 2:] * starts
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = -eye[2] / along[:, 2]
            plane = eye[:2].T + distance[:, None] * along[:, :2]
        met = (distance > 0) & np.isfinite(distance) & self.face.covers(plane)
        return np.where(met, distance, np.inf), plane


def plates(target: Target, camera_from_world: Pose, *, margin: float) -> list[Plate]:
    """The boards of a target as the camera at ``camera_from_world`` sees them.

    Raises:
        TargetError: a board of a kind that cannot be drawn.

    """
    rotation = rotation_matrix(camera_from_world[0])
    eye = -rotation.T @ np.asarray(camera_from_world[1], float)
    seen = []
    for board in target.boards:
        seen.append(
            Plate(
                face=board.face(margin=margin),
                board_from_camera=board.axes @ rotation.T,
                eye=board.axes @ (eye - board.origin),
            )
        )
    return seen


def nearest(
    plates: list[Plate], rays: FloatArray, starts: FloatArray | None = None
) -> tuple[IntArray, FloatArray, FloatArray]:
    """The first plate that each ray (N, 3) meets.

    Rays start at the camera's centre, or at ``starts`` (N,) along its axis.

    Returns its index (N,), -1 where the ray meets none, the distance (N,) in ray lengths and
    the position (N, 2) in that board's plane.
    """
    index = np.full(len(rays), -1, np.intp)
    distance = np.full(len(rays), np.inf)
    position = np.zeros((len(rays), 2))
    for i, plate in enumerate(plates):
        reached, plane = plate.hit(rays, starts)
        nearer = reached < distance
        index[nearer] = i
        distance[nearer] = reached[nearer]
        position[nearer] = plane[nearer]
    return index, distance, position
