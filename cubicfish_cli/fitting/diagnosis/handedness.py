"""Which way round boards are seen: from the printed face, or as in a mirror.

No lens turns a picture inside out: on every photo of a printed face the row grows to the right of
the direction in which the column grows, or corners are in another order, or the photo is mirrored.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Correspondences

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]

# Fewer squares than this, or a smaller majority of them, say nothing.
_FEWEST = 3
_MAJORITY = 0.9


def seen_sides(pairs: Correspondences) -> IntArray:
    """(photos, boards): 1 where a board is seen from its face, -1 mirrored, 0 where it is unknown.

    Boards whose corners have no rows and columns, such as lists of points, are never known.
    """
    photos, boards = len(pairs.images), max(len(pairs.boards), 1)
    sides = np.zeros((photos, boards), np.intp)
    if not len(pairs.pixel) or (pairs.board < 0).any():
        return sides
    right, down = neighbours(pairs)
    both = np.flatnonzero((right >= 0) & (down >= 0))
    along = pairs.pixel[right[both]] - pairs.pixel[both]
    across = pairs.pixel[down[both]] - pairs.pixel[both]
    sign = np.sign(along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0])
    view = pairs.image[both] * boards + pairs.board[both]
    count = np.bincount(view, minlength=photos * boards)
    total = np.bincount(view, weights=sign, minlength=photos * boards)
    known = (count >= _FEWEST) & (np.abs(total) >= (2 * _MAJORITY - 1) * count)
    return np.where(known, np.sign(total), 0).astype(np.intp).reshape(photos, boards)


def neighbours(pairs: Correspondences) -> tuple[IntArray, IntArray]:
    """(N,) index of the corner in the next column, and in the next row; -1 where it is not seen."""
    width, height = int(pairs.column.max()) + 2, int(pairs.row.max()) + 2
    view = pairs.image * max(len(pairs.boards), 1) + pairs.board
    key = (view * height + pairs.row) * width + pairs.column
    order = np.argsort(key, kind="stable")
    ordered = key[order]

    def at(wanted: IntArray) -> IntArray:
        place = np.minimum(np.searchsorted(ordered, wanted), len(ordered) - 1)
        return np.where(ordered[place] == wanted, order[place], -1)

    return at(key + 1), at(key + width)


def local_noise_px(pairs: Correspondences, residual: FloatArray) -> float:
    """Standard deviation a coordinate of what is not smooth in residuals (N, 2), pixels.

    What a wrong lens, pose or object leaves changes little from corner to corner, noise changes
    fully: second differences along the rows keep the noise and lose the rest. 0 when unknown.
    """
    if not len(residual) or (pairs.board < 0).any():
        return 0.0
    right, _ = neighbours(pairs)
    middle = np.flatnonzero(right >= 0)
    middle = middle[right[right[middle]] >= 0]
    if len(middle) < 20:
        return 0.0
    last = right[right[middle]]
    bend = residual[middle] - 2 * residual[right[middle]] + residual[last]
    # The median length of a 2D normal vector, and 1 + 4 + 1 variances.
    return float(np.median(np.hypot(bend[:, 0], bend[:, 1])) / 1.17741 / np.sqrt(6))
