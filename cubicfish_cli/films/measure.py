"""How sharp a frame is, and how far it moved: what can be told of every frame, at little cost.

Both are ratios of grey-level differences, so that neither brightness nor contrast counts.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Grey = npt.NDArray[np.integer[Any] | np.floating[Any]]
Float32Array = npt.NDArray[np.float32]

# Lines of the frame that are looked at for its sharpness, along and across.
_LINES = 160
# Edges that count are at least this share of the strongest: the rest is noise and shading.
_STRONG = 0.4
_FEWEST_EDGES = 20
# The small picture's width, and its blur: motion up to twice that is told from more.
_SMALL = 320
_BLUR = 1.5
_BLOCKS = (6, 8)  # rows, columns
# A block shows motion when its texture is this share of that of the block with most.
_TEXTURED = 0.2


def sharpness(grey: Grey) -> float:
    """How steep the strong edges of a picture (H, W) are: 1 is a step from pixel to pixel.

    Of two directions the worse counts, since motion blurs in one. A picture without edges has 0.
    """
    height, width = grey.shape
    step = max(4, round(max(width, height) / 240))
    along = grey[:: max(1, height // _LINES)]
    across = grey[:, :: max(1, width // _LINES)].T
    found = [_steepness(np.ascontiguousarray(part), step) for part in (along, across)]
    seen = [value for value in found if value is not None]
    return min(seen, default=0.0)


def _steepness(lines: Grey, step: int) -> float | None:
    """Median over strong edges of the largest rise in one pixel, as a share of the whole rise."""
    if lines.shape[1] <= 2 * step:
        return None
    values = lines.astype(np.int32)
    rise = np.abs(values[:, step:] - values[:, :-step])
    strong = rise >= max(_STRONG * float(np.quantile(rise, 0.999)), 1.0)
    if int(strong.sum()) < _FEWEST_EDGES:
        return None
    one = np.abs(np.diff(values, axis=1))
    steepest = one[:, : rise.shape[1]]
    for shift in range(1, step):
        steepest = np.maximum(steepest, one[:, shift : shift + rise.shape[1]])
    return float(np.median(steepest[strong] / rise[strong]))


def small_picture(grey: Grey) -> Float32Array:
    """A small and slightly blurred copy of a picture (H, W), by which motion is measured."""
    height, width = grey.shape
    scale = min(1.0, _SMALL / width)
    size = (max(16, round(scale * width)), max(16, round(scale * height)))
    small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), _BLUR))


def motion(before: Float32Array, after: Float32Array, width: int) -> float:
    """How far the part that moves most moved between two small pictures.

    Of each block of the picture, the difference between both is held against the slopes in it.
    Beyond some pixels of the small picture the figure grows no more.

    Args:
        before: a small picture.
        after: that of a neighbour.
        width: of the frames.

    Returns:
        Pixels of the frames.

    """
    level = float(before.mean())
    other = float(after.mean())
    if level > 0 and other > 0:  # the exposure may have changed
        after = after * (level / other)
    slope_y, slope_x = np.gradient((before + after) / 2)
    slope = np.hypot(slope_x, slope_y)
    blocks = [
        (float(part.sum()), float(texture.sum()))
        for part, texture in zip(
            _blocks(np.abs(after - before) * slope), _blocks(slope * slope), strict=True
        )
    ]
    most = max(texture for _, texture in blocks)
    if most <= 0:
        return 0.0
    moved = max(part / texture for part, texture in blocks if texture >= _TEXTURED * most)
    return moved * width / before.shape[1]


def _blocks(picture: Float32Array) -> list[Float32Array]:
    rows, columns = _BLOCKS
    return [
        block
        for row in np.array_split(picture, rows, axis=0)
        for block in np.array_split(row, columns, axis=1)
    ]
