"""Where the boards really are: an object is never quite as drawn.

A box glued by hand is off by millimetres. Then the right names fit badly, and a symmetry of the
drawing is none of the object: names that differ from photo to photo by such a symmetry would
blur it. Each named grid says where its board is in front of the camera, so the photos together
say how the boards lie to each other, and names that fit this object agree from photo to photo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.geometry import mean_rotation
from cubicfish_cli.identification.placement import Placement

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sighting:
    """One named grid in one photo.

    Attributes:
        side, offset: its place.
        middle: (2,) mean cell.
        rotation: (3, 3) camera_from_grid.
        camera_middle: (3,) the mean cell in the camera frame, squares.
        camera_from_world: the photo's rotation (3, 3) and translation (3,).
        corners: how many corners it has.

    """

    side: int
    offset: IntArray
    middle: FloatArray
    rotation: FloatArray
    camera_middle: FloatArray
    camera_from_world: tuple[FloatArray, FloatArray]
    corners: int


def built_sides(sides: Placement, sightings: Sequence[Sighting]) -> Placement:
    """The sides with every board where the sightings have it on average.

    Boards without a sighting stay where they are.
    """
    origin, axes, frame = sides.origin.copy(), sides.axes.copy(), sides.frame.copy()
    for board in np.unique(sides.board):
        own = [one for one in sightings if sides.board[one.side] == board]
        if not own:
            continue
        rows = np.flatnonzero(sides.board == board)
        turned, corner = _placed(sides, own)
        origin[rows] = corner
        axes[rows] = turned[:, :2]
        ij = axes[rows] @ sides.matrix[rows]
        frame[rows] = np.concatenate([ij, np.cross(ij[..., 0], ij[..., 1])[..., None]], axis=-1)
    return replace(sides, origin=origin, axes=axes, frame=frame)


def _placed(sides: Placement, own: Sequence[Sighting]) -> tuple[FloatArray, FloatArray]:
    """World directions of a board's columns, rows and depth (3, 3), and its corner (0, 0)."""
    weight = np.array([one.corners**2 for one in own], float)
    turns, points, cells = [], [], []
    for one in own:
        rotation, translation = one.camera_from_world
        back = np.eye(3)
        back[:2, :2] = sides.matrix[one.side].T
        turns.append(rotation.T @ one.rotation @ back)
        seen = sides.square[one.side] * one.camera_middle
        points.append(rotation.T @ (seen - translation))
        cells.append(sides.matrix[one.side] @ one.middle + one.offset)
    turned = mean_rotation(np.stack(turns), weight)
    square = sides.square[own[0].side]
    corner = np.stack(points) - square * np.stack(cells) @ turned[:, :2].T
    return turned, np.average(corner, axis=0, weights=weight)
