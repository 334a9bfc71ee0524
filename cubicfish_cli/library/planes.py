"""The metric picture of a board's plane."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cubicfish_cli.arrays import Refusal
from cubicfish_cli.boards.board import Board
from cubicfish_cli.errors import ViewError
from cubicfish_cli.target import Target
from cubicfish_cli.undistortion.plane import PlaneView, PointProjector, plane_view
from cubicfish_cli.wording import did_you_mean, quoted

_LIMIT = 1e9
_ROTATION_TOLERANCE = 1e-6


def build_plane(
    camera: PointProjector,
    target: Target,
    board: str,
    rotation: npt.ArrayLike,
    translation: npt.ArrayLike,
    *,
    pixels_per_unit: float | None = None,
    margin: float | None = None,
) -> PlaneView:
    """The plane of a board, seen squarely from its front, as ``undistort --plane`` renders it.

    Args:
        camera: the camera that took the photo.
        target: the object.
        board: the name of one of its boards, a grid.
        rotation: (3, 3) of ``camera_from_world`` of this photo.
        translation: (3,) of the same, in the target's unit.
        pixels_per_unit: the picture's scale; by default the largest that the photo has there.
        margin: how far the picture goes on beyond the outer corners, in the target's unit; by
            default a square.

    Raises:
        ViewError: there is no such board, it has no plane, the pose is none, or the camera does
            not see the plane from its front.

    """
    refusal = Refusal(error=ViewError)
    turn = refusal.numbers(rotation, "rotation", 3, limit=_LIMIT)
    if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=_ROTATION_TOLERANCE):
        raise ViewError("rotation is no rotation matrix (3, 3)")
    place = refusal.numbers([np.asarray(translation)], "translation", 3, limit=_LIMIT)[0]
    return plane_of(
        camera,
        board_with_plane(target, board),
        turn,
        place,
        pixels_per_unit=pixels_per_unit,
        margin=margin,
    )


def board_with_plane(target: Target, name: str) -> Board:
    """A board of a target, by its name.

    Raises:
        ViewError: there is none, or it has no plane.

    """
    names = {board.name: board for board in target.boards}
    if name not in names:
        raise ViewError(
            f"the target has no board {quoted(name)}: {did_you_mean(name, sorted(names))}"
        )
    if names[name].points is not None:
        raise ViewError(
            f"board {quoted(name)} is a list of points and has no plane: name a board with a grid"
        )
    return names[name]


def plane_of(
    camera: PointProjector,
    board: Board,
    rotation: npt.NDArray[np.float64],
    translation: npt.NDArray[np.float64],
    *,
    pixels_per_unit: float | None,
    margin: float | None,
) -> PlaneView:
    """See :func:`build_plane`."""
    corners = board.plane_points([0, board.columns - 1], [0, board.rows - 1])
    beyond = board.square if margin is None else margin
    return plane_view(
        camera,
        origin=rotation @ np.asarray(board.origin) + translation,
        x_axis=rotation @ np.asarray(board.x_axis),
        y_axis=rotation @ np.asarray(board.y_axis),
        low=corners[0] - beyond,
        high=corners[1] + beyond,
        pixels_a_unit=pixels_per_unit,
    )
