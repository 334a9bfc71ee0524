"""From the light on a sensor to the grey levels of a photo: exposure, blur, blooming and noise."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.types import FloatArray

_WHITE_LEVEL = 240.0  # of light 1 at exposure 1
_DARK_LEVEL = 6.0  # what a sensor reads where no light comes
_FULL = 255.0
# Over how many pixels the light that a full pixel cannot hold falls by a factor of e, and how far
# it is followed.
_SPILL_PX, _SPILL_REACH_PX = 0.8, 9


def sensed(
    light: FloatArray, *, exposure: float, blur: float, noise: float, seed: int | Sequence[int]
) -> npt.NDArray[np.uint8]:
    """What a sensor makes of light (height, width) -> grey levels (height, width) uint8.

    Args:
        light: 1 is what white paper throws back when it is lit well.
        exposure: factor on the light. From about 1.15 on white paper is burnt out, and the more
            it is, the farther it bleeds into dark squares: see :func:`bloomed`.
        blur: standard deviation of the lens's blur, pixels.
        noise: standard deviation of the sensor's noise, grey levels.
        seed: of the noise.

    """
    level = _DARK_LEVEL + light * exposure * (_WHITE_LEVEL - _DARK_LEVEL)
    if blur > 0:
        level = np.asarray(cv2.GaussianBlur(level, (0, 0), blur), float)
    level = bloomed(level)
    if noise > 0:
        level += np.random.default_rng(seed).normal(0.0, noise, level.shape)
    return np.clip(np.rint(level), 0, 255).astype(np.uint8)


def bloomed(level: FloatArray) -> FloatArray:
    """Grey levels (height, width) of a sensor whose pixels overflow into their neighbours.

    What a pixel has above 255 goes to the pixels around it, less and less by exp(-distance/0.8 px),
    the same on all sides. A straight edge between white and dark moves into the dark by as much as
    the logarithm of the overflow, so that dark squares that meet at a corner come apart by a gap
    whose middle is the corner still. Where nothing is above 255 nothing changes.
    """
    over = level - _FULL
    if not (over > 0).any():
        return level
    reach = np.arange(-_SPILL_REACH_PX, _SPILL_REACH_PX + 1.0)
    spill = np.exp(-np.hypot(reach[:, None], reach) / _SPILL_PX)
    spill /= spill.sum()
    received = cv2.filter2D(np.maximum(over, 0), -1, spill, borderType=cv2.BORDER_REFLECT)
    return np.asarray(np.minimum(level, _FULL) + received, float)
