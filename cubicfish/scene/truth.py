"""Exact pixels of a target's corners through a lens, and which of them are visible.

The target's boards are plates: rays find which one is in front, and where they hit it. Poses are
``camera_from_world``, a rotation vector and a translation.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.files.tables import Table
from cubicfish.scene.faces import Face, board_face
from cubicfish.target.target import Target
from cubicfish.types import FloatArray

Pose = tuple[FloatArray, FloatArray]
"""camera_from_world: rotation vector (3,) in radians, translation (3,) in the target's units."""


def rotation_matrix(rotation: npt.ArrayLike) -> FloatArray:
    """Turn a rotation vector (3,) in radians into a matrix (3, 3)."""
    return np.asarray(cv2.Rodrigues(np.asarray(rotation, float).reshape(3, 1))[0], float)


def camera_points(camera_from_world: Pose, world: npt.ArrayLike) -> FloatArray:
    """Turn world points (..., 3) into points in the camera frame (..., 3)."""
    rotation, translation = camera_from_world
    return np.asarray(world, float) @ rotation_matrix(rotation).T + translation


def pose_of_matrix(matrix: FloatArray, eye: FloatArray) -> Pose:
    """Return the pose of a camera at ``eye`` (3,) with a rotation (3, 3) from world to camera."""
    rotation = np.asarray(cv2.Rodrigues(matrix)[0], float).ravel()
    return rotation, -matrix @ eye


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
        """Return where rays (N, 3) of the camera meet the plate; ``starts`` as in :func:`nearest`.

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


def plates(target: Target, camera_from_world: Pose) -> list[Plate]:
    """Return the boards of a target as the camera at ``camera_from_world`` sees them.

    Raises:
        TargetError: a board of a kind that cannot be drawn.

    """
    rotation = rotation_matrix(camera_from_world[0])
    eye = -rotation.T @ np.asarray(camera_from_world[1], float)
    return [
        Plate(
            face=board_face(board, margin=MARGIN_SQUARES),
            board_from_camera=board.axes @ rotation.T,
            eye=board.axes @ (eye - board.origin),
        )
        for board in target.boards
    ]


def nearest(
    plates: list[Plate], rays: FloatArray, starts: FloatArray | None = None
) -> tuple[npt.NDArray[np.intp], FloatArray, FloatArray]:
    """Return the first plate that each ray (N, 3) meets.

    Rays start at the camera's centre, or at ``starts`` (N,) along its axis.

    Returns its index (N,), -1 where the ray meets none, the distance (N,) in ray lengths and
    the position (N, 2) in that board's plane.
    """
    index = np.full(len(rays), -1, np.intp)
    distance = np.full(len(rays), np.inf)
    position = np.zeros((len(rays), 2))
    for i, plate in enumerate(plates):
        hit_distance, plane = plate.hit(rays, starts)
        nearer = hit_distance < distance
        index[nearer] = i
        distance[nearer] = hit_distance[nearer]
        position[nearer] = plane[nearer]
    return index, distance, position


class AnyLens(Protocol):
    """Anything that projects points (..., 3) to pixels (..., 2), NaN outside its field."""

    def project(self, points: npt.ArrayLike, /) -> FloatArray:
        """Project points in the camera frame (..., 3) to pixels (..., 2)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueCorners:
    """All corners of a target as one camera sees them.

    Attributes:
        board: (N,) index into the target's boards.
        column, row: (N,) place on the board.
        world: (N, 3) world points.
        camera: (N, 3) the same points in the camera frame.
        pixel: (N, 2) exact pixels, NaN outside the lens's field.
        visible: (N,) whether the corner and its neighbourhood are seen; see
            :func:`project_corners`.

    """

    board: npt.NDArray[np.intp]
    column: npt.NDArray[np.intp]
    row: npt.NDArray[np.intp]
    world: FloatArray
    camera: FloatArray
    pixel: FloatArray
    visible: npt.NDArray[np.bool_]


def project_corners(
    target: Target,
    lens: AnyLens,
    camera_from_world: Pose,
    image_size: tuple[int, int],
    *,
    neighbourhood: float = 0.5,
) -> TrueCorners:
    """Project all corners exactly, and tell whether each is visible.

    Visible means: the camera is in front of the printed face, and the corner and eight points
    around it, ``neighbourhood`` squares away in the board's plane, are all in the lens's
    field, in the picture, and not behind another board.

    Raises:
        TargetError: a board of a kind that cannot be drawn.

    """
    board, column, row, world = target.corners()
    x_axis = np.stack([b.x_axis for b in target.boards])[board]
    y_axis = np.stack([b.y_axis for b in target.boards])[board]
    to_side = neighbourhood * np.array([b.square for b in target.boards])[board]
    step = np.array([(i, j) for j in (-1, 0, 1) for i in (-1, 0, 1)], float)
    middle = len(step) // 2
    around = world[:, None] + to_side[:, None, None] * (
        step[:, :1] * x_axis[:, None] + step[:, 1:] * y_axis[:, None]
    )
    around = camera_points(camera_from_world, around)
    seen = plates(target, camera_from_world)
    in_front = np.ones(around.shape[:2], bool)
    if len(seen) > 1:  # else no other board is in the way
        _, distance, _ = nearest(seen, around.reshape(-1, 3))
        # A ray is as long as the way to its point: a hit well short of 1 is another board.
        in_front = (distance > 1 - 1e-6).reshape(around.shape[:2])
    pixel = lens.project(around)
    limit = np.array(image_size) - 0.5
    with np.errstate(invalid="ignore"):
        in_picture = ((pixel > -0.5) & (pixel < limit)).all(axis=-1)
    faces_camera = np.array([plate.faces_camera for plate in seen])[board]
    return TrueCorners(
        board=board,
        column=column,
        row=row,
        world=world,
        camera=around[:, middle],
        pixel=pixel[:, middle],
        visible=faces_camera & (in_front & in_picture).all(axis=1),
    )


def true_corners_text(
    target: Target, lens: AnyLens, poses: Mapping[str, Pose], image_size: tuple[int, int]
) -> str:
    """Return the visible corners of photos, by the photos' names, as the text of a corners.csv.

    Raises:
        TargetError: a board of a kind that cannot be drawn.

    """
    rows: list[tuple[object, ...]] = [("image", "board", "column", "row", "x", "y")]
    for name, pose in poses.items():
        seen = project_corners(target, lens, pose, image_size)
        for one in np.flatnonzero(seen.visible):
            own = target.boards[seen.board[one]].name
            x, y = seen.pixel[one]
            rows.append((name, own, seen.column[one], seen.row[one], f"{x:.6f}", f"{y:.6f}"))
    width, height = image_size
    return f"# cubicfish corners 1, image_size {width}x{height}\n" + Table.text(rows)
