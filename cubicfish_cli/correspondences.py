"""Named corners, their known world points, and the CSV files that hold either.

``Corners`` is what a detector found: which corner of which board is where in which photo.
``Correspondences`` is what a fit needs: world points and pixels. Both keep one row a corner
in flat arrays, since all the maths runs over all corners at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]


@dataclass(frozen=True, kw_only=True, eq=False)
class Corners:
    """Corners found in photos, named by board, column and row.

    Attributes:
        image_size: (width, height) of every photo, pixels.
        images: names of the photos, in order.
        boards: names of the boards, in the target's order.
        image: (N,) index into ``images``.
        board: (N,) index into ``boards``.
        column, row: (N,) the corner's place on its board.
        pixel: (N, 2) x, y in pixels.
        weight: (N,) relative weight, 1 where nothing else is known.

    """

    image_size: tuple[int, int]
    images: tuple[str, ...]
    boards: tuple[str, ...]
    image: IntArray
    board: IntArray
    column: IntArray
    row: IntArray
    pixel: FloatArray
    weight: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Correspondences:
    """2D-3D pairs: the paper's M ↔ m.

    Attributes:
        image_size: (width, height) of every photo, pixels.
        images: names of the photos, in order.
        boards: names of the boards; empty when the pairs came without a target.
        image: (N,) index into ``images``, non-decreasing (pairs are kept sorted by photo).
        world: (N, 3) points in the world frame, in the target's units.
        pixel: (N, 2) x, y in pixels.
        weight: (N,) relative weight.
        board: (N,) index into ``boards``, or -1 without a target.
        column, row: (N,) the corner's place on its board; without a target the column is
            the row's number in the file and the row is 0.

    """

    image_size: tuple[int, int]
    images: tuple[str, ...]
    boards: tuple[str, ...]
    image: IntArray
    world: FloatArray
    pixel: FloatArray
    weight: FloatArray
    board: IntArray
    column: IntArray
    row: IntArray
