"""The ground as seen from above: a plane in the frame of a body, and its metric picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cubicfish_cli.errors import ViewError
from cubicfish_cli.types import FloatArray
from cubicfish_cli.undistortion.mosaic import Body
from cubicfish_cli.undistortion.plane import PlaneView, plane_view
from cubicfish_cli.undistortion.view import matrix_of_rotation, rotation_from_angles

# What is left of a direction along the ground, for it to be the picture's way up.
_LEAST_ALONG = 0.1
_MARGIN_HEIGHTS = 3.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """A plane below a body.

    Attributes:
        down: (3,) unit vector that points into it, in the body's frame.
        height: how far it lies below the body's origin.
        marks: (N, 3) points of the body's frame that its picture shall show, such as a board's.

    """

    down: FloatArray
    height: float
    marks: FloatArray

    @classmethod
    def below(cls, height: float, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> Ground:
        """The ground so far below a camera that looks up by an angle and is rolled clockwise."""
        level = rotation_from_angles(pitch_deg=pitch_deg, roll_deg=roll_deg)
        down = matrix_of_rotation(np.array(level)).T @ np.array([0.0, 1.0, 0.0])
        return cls(down=down, height=height, marks=np.zeros((0, 3)))

    @classmethod
    def of_board(cls, corners: FloatArray, down: FloatArray) -> Ground:
        """The ground that a board lies on, face up.

        Args:
            corners: (N, 3) of the board, in the body's frame.
            down: (3,) unit vector into the board.

        Raises:
            ViewError: the body is behind the board.

        """
        height = float(np.mean(corners @ down))
        if height <= 0:
            raise ViewError(
                "the rig is behind this board's plane: name a board that lies on the ground, its "
                "face up"
            )
        return cls(down=down, height=height, marks=corners)

    def view(
        self,
        body: Body,
        *,
        margin: float | None = None,
        pixels_a_unit: float | None = None,
        size: int | None = None,
    ) -> PlaneView:
        """The picture from above, what is ahead of the body's first camera at the top.

        Args:
            body: the cameras.
            margin: how far it goes on beyond the cameras and the marks; None for three heights.
            pixels_a_unit: its scale; None for a longer side as long as the photos' longer one.
            size: pixels of that longer side instead.

        Raises:
            ViewError: no camera sees any of it.

        """
        foot = self.height * self.down
        for wish in (np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])):  # ahead, or up
            ahead = wish - (wish @ self.down) * self.down
            if np.linalg.norm(ahead) > _LEAST_ALONG:
                break
        ahead /= np.linalg.norm(ahead)
        right = np.cross(self.down, ahead)
        shown = np.vstack([*(one.position for one in body.cameras), self.marks])
        place = np.stack([(shown - foot) @ right, -(shown - foot) @ ahead], axis=-1)
        around = _MARGIN_HEIGHTS * self.height if margin is None else margin
        low, high = place.min(axis=0) - around, place.max(axis=0) + around
        if not (high > low).all():
            raise ViewError("this picture of the ground has no width: choose a larger --margin")
        scale = pixels_a_unit or (size or max(body.image_size)) / float((high - low).max())
        return plane_view(
            Body(cameras=body.cameras, points=True),
            origin=foot,
            x_axis=right,
            y_axis=-ahead,
            low=low,
            high=high,
            pixels_a_unit=scale,
        )
