"""The corners' own noise: what in their errors changes from each corner to the next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cubicfish_cli.core.fit.robust import noise_px
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

# Errors of neighbouring corners that go together make a fit so much worse than their noise.
_BEYOND_NOISE = 1.5


def neighbours(pairs: Observations) -> tuple[IntArray, IntArray]:
    """(N,) index of the corner in the next column, and in the next row; -1 where it is not seen."""
    right, down = _at(pairs, [(1, 0), (0, 1)]).T
    return right, down


def around(pairs: Observations) -> IntArray:
    """(N, 8) indices of the corners around each on its board; -1 where they are not seen."""
    return _at(pairs, [(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y])


def _at(pairs: Observations, steps: Sequence[tuple[int, int]]) -> IntArray:
    """(N, K) index of the corner so many columns and rows on, in the same photo and board."""
    # One free column and row beyond the last, so that no step ends on another row or board.
    width, height = int(pairs.column.max()) + 2, int(pairs.row.max()) + 2
    view = pairs.image * max(len(pairs.boards), 1) + pairs.board
    key = (view * height + pairs.row) * width + pairs.column
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    wanted = key[:, None] + np.array([row * width + column for column, row in steps])
    place = np.minimum(np.searchsorted(ordered, wanted), len(ordered) - 1)
    found = (ordered[place] == wanted) & (pairs.board >= 0)[:, None]
    return np.where(found, order[place], -1)


def local_noise_px(pairs: Observations, residual: FloatArray) -> float:
    """Standard deviation a coordinate of what is not smooth in residuals (N, 2), pixels.

    What a wrong lens, pose or target leaves changes little from corner to corner, noise changes
    fully: second differences along the rows keep the noise and lose the rest. 0 when unknown.
    """
    if not len(residual) or (pairs.board < 0).any():
        return 0.0
    right, _ = neighbours(pairs)
    middle = np.flatnonzero(right >= 0)
    middle = middle[(right[right[middle]] >= 0) & pairs.tells_error[middle]]
    if len(middle) < 20:
        return 0.0
    last = right[right[middle]]
    bend = residual[middle] - 2 * residual[right[middle]] + residual[last]
    # The median length of a 2D normal vector, and 1 + 4 + 1 variances.
    return float(np.median(np.hypot(bend[:, 0], bend[:, 1])) / 1.17741 / np.sqrt(6))


def times_noise(pairs: Observations, residual: FloatArray) -> float | None:
    """How many times the corners' own noise residuals (N, 2) are; None where it is not known."""
    noise = local_noise_px(pairs, residual)
    return noise_px(residual[pairs.tells_error]) / noise if noise else None


def within_noise(pairs: Observations, residual: FloatArray) -> bool:
    """Whether residuals (N, 2) are no larger than the corners' own noise explains."""
    times = times_noise(pairs, residual)
    return times is not None and times < _BEYOND_NOISE
