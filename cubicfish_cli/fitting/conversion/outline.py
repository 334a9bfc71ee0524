"""Which pixels lie inside an outline."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

# Pixels at a time, against all edges at once.
_BLOCK = 4096


def within(pixel: FloatArray, outline: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether pixels (N, 2) lie inside a polygon (K, 2); NaN does not."""
    end = np.roll(outline, -1, axis=0)
    inside = np.zeros(len(pixel), bool)
    for begin in range(0, len(pixel), _BLOCK):
        x, y = pixel[begin : begin + _BLOCK].T[:, :, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            crossed = (outline[:, 1] > y) != (end[:, 1] > y)
            share = (y - outline[:, 1]) / (end[:, 1] - outline[:, 1])
            crossed &= x < outline[:, 0] + share * (end[:, 0] - outline[:, 0])
        inside[begin : begin + _BLOCK] = crossed.sum(axis=1) % 2 == 1
    return inside & np.isfinite(pixel).all(axis=1)
