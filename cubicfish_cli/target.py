"""``target.yaml`` -> Target: the boards of the calibration object and their world points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoardKind = Literal["checkerboard", "charuco", "aprilgrid", "points"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Markers:
    """The markers printed on a ``charuco`` or ``aprilgrid`` board.

    Attributes:
        dictionary: name of the marker family as cv2.aruco spells it (``DICT_...``).
        side: side of a marker, in the target's units.
        first: id of the board's first marker.
        count: how many markers the board carries; ids are ``first .. first + count - 1``.

    """

    dictionary: str
    side: float
    first: int
    count: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Board:
    """One rigid part of the object: a planar grid of corners, or a list of points.

    Attributes:
        name: unique within the target.
        kind: ``checkerboard``, ``charuco``, ``aprilgrid`` or ``points``.
        columns, rows: number of corners along x and along y (``points``: their count and 1).
        square: side of a square, in the target's units (0 for ``points``; the side of a tag
            for ``aprilgrid``).
        origin: (3,) world position of corner (0, 0).
        x_axis, y_axis: (3,) unit world directions of growing column and growing row. Seen by
            someone who looks at the printed face, x is to the right and y down, so x × y
            points into the board, away from the viewer.
        first_square: whether the square up-left of corner (0, 0) is ``dark`` or ``light``.
        markers: the markers of a ``charuco`` or ``aprilgrid`` board, else None.
        spacing: for ``aprilgrid``, gap between tags / side of a tag; else 0.
        points: (N, 3) world points of a ``points`` board, else None.

    """

    name: str
    kind: BoardKind
    columns: int
    rows: int
    square: float
    origin: FloatArray
    x_axis: FloatArray
    y_axis: FloatArray
    first_square: Literal["dark", "light"] = "dark"
    markers: Markers | None = None
    spacing: float = 0.0
    points: FloatArray | None = None

    def plane_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """Positions in the board's own plane: (...,) columns and rows -> (..., 2) in units."""
        column, row = np.asarray(column, float), np.asarray(row, float)
        if self.kind == "aprilgrid":
            return np.stack([self._tag_offset(column), self._tag_offset(row)], axis=-1)
        return np.stack([column, row], axis=-1) * self.square

    def _tag_offset(self, index: FloatArray) -> FloatArray:
        tag = np.floor(index / 2)
        return self.square * (tag * (1 + self.spacing) + (index - 2 * tag))

    def world_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """World points of corners: (...,) columns and rows -> (..., 3), in the target's units."""
        if self.points is not None:
            return self.points[np.asarray(column, int)]
        plane = self.plane_points(column, row)
        return self.origin + plane[..., :1] * self.x_axis + plane[..., 1:] * self.y_axis


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """A rigid calibration object: several boards in one world frame, in one unit of length."""

    units: str
    boards: tuple[Board, ...]
