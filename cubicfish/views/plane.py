"""Metric picture of a plane in the scene, such as a board's: a constant number of pixels per unit.

Pixels are points of the plane, not mere directions, so that the picture is right from wherever
the photo was taken, as long as the plane's place in the camera's frame is known.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from cubicfish.arrays import Refusal
from cubicfish.errors import ViewError
from cubicfish.views.fields import in_picture
from cubicfish.views.maps import seen_near
from cubicfish.views.view import PlaneView, PointProjector, matrix_of_rotation

if TYPE_CHECKING:
    from cubicfish.target.target import Target

_SQUARE_TOLERANCE = 1e-6
# Number of places along each side of the plane's part at which the photo's scale is measured.
_SAMPLES = 15
_STEP = 1e-3
# Without a scale from the user the picture is no larger than this.
_MOST_DEFAULT_SIDE = 8192


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
    """The plane of a board, seen squarely from its front, as ``undistort`` renders it.

    Args:
        camera: the camera that took the photo.
        target: the calibration target.
        board: the name of one of its boards, a grid.
        rotation: (3, 3) of ``camera_from_world`` of this photo, or its rotation vector (3,).
        translation: (3,) of the same, in the target's unit.
        pixels_per_unit: the picture's scale; by default the largest that the photo has there.
        margin: how far the picture goes on beyond the outer corners, in the target's unit; by
            default a square.

    Raises:
        TargetError: there is no such board, or it has no plane.
        ViewError: the pose is not one, or the camera does not see the plane, or sees it from
            behind, where the picture would be mirrored.

    """
    refusal = Refusal(error=ViewError)
    for name, value in (("pixels_per_unit", pixels_per_unit), ("margin", margin)):
        if value is not None and not (math.isfinite(value) and value >= 0):
            raise ViewError(f"{name} must be a finite number of 0 or more, not {value}")
    if pixels_per_unit == 0:
        raise ViewError("pixels_per_unit must be above 0")
    given = np.asarray(rotation)
    turn = refusal.numbers(given[None] if given.shape == (3,) else given, "rotation", 3)
    if given.shape == (3,):
        turn = matrix_of_rotation(turn[0])
    if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=_SQUARE_TOLERANCE):
        raise ViewError("rotation is no rotation matrix (3, 3)")
    place = refusal.numbers([np.asarray(translation)], "translation", 3)[0]
    plane = target.board(board, flat=True)
    beyond = plane.square if margin is None else margin
    low, high = plane.plane_points([0, plane.columns - 1], [0, plane.rows - 1])
    low, high = low - beyond, high + beyond
    # Seen from the front, x is to the right and y down.
    axes = np.array([turn @ np.asarray(axis) for axis in (plane.x_axis, plane.y_axis)])
    origin = turn @ np.asarray(plane.origin) + place
    sides = high - low
    along = [np.linspace(start, end, _SAMPLES) for start, end in zip(low, high, strict=True)]
    here = origin + np.stack(np.meshgrid(*along), axis=-1) @ axes
    step, project = _STEP * float(sides.max()), seen_near(camera)
    across, down = ((project(here + step * axis) - project(here)) / step for axis in axes)
    area = across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0]
    seen = np.isfinite(area) & in_picture(project(here), camera.image_size)
    if not seen.any():
        raise ViewError("the camera does not see this plane: check the pose and the board's name")
    if np.median(area[seen]) <= 0:
        raise ViewError(
            "the camera is behind this plane, whose picture would be mirrored: "
            "check the target's axes and the pose"
        )
    scale = pixels_per_unit
    if scale is None:
        # The larger of the two stretches at the place where the photo shows most.
        lengths = np.stack([np.hypot(*np.moveaxis(part, -1, 0)) for part in (across, down)])
        scale = float(min(lengths[:, seen].max(), _MOST_DEFAULT_SIDE / sides.max()))
    first = origin + (low + 0.5 / scale) @ axes  # the middle of the first pixel
    vectors: dict[str, Any] = {
        name: tuple(vector.tolist())
        for name, vector in (("origin", first), ("x_axis", axes[0]), ("y_axis", axes[1]))
    }
    size = (max(1, round(float(sides[0]) * scale)), max(1, round(float(sides[1]) * scale)))
    return PlaneView(size=size, pixels_per_unit=scale, **vectors)
