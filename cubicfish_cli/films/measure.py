"""Sharpness and motion of every frame, at low cost.

Both are ratios of grey-level differences, so that neither brightness nor contrast counts.
"""

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Grey = npt.NDArray[np.integer[Any] | np.floating[Any]]
Bytes = npt.NDArray[np.uint8]
Float32Array = npt.NDArray[np.float32]

# Lines of the frame whose edges tell its sharpness, along and across.
_LINES = 32
# Edges that count are at least this share of the strongest: the rest is noise and shading.
_STRONG = 0.4
_FEWEST_EDGES = 20
# The small picture is up to so many pixels wide, and its shorter side has these at least; and its
# blur: motion up to twice that is told from more.
_SMALL, _LEAST_SMALL = 270, 16
_BLUR, _BLUR_SIZE = 1.5, (9, 9)
_BLOCKS = (6, 8)  # rows, columns
# A block shows motion when its texture is this share of that of the block with most.
_TEXTURED = 0.2


def sharpness(grey: Grey) -> float:
    """Return how steep the strong edges of a picture (H, W) are: 1 is a step from pixel to pixel.

    The worse of two directions counts, since motion blurs in one. A picture without edges has 0.
    """
    height, width = grey.shape
    step = max(4, round(max(width, height) / 240))
    along = grey[:: max(1, height // _LINES)]
    across = grey[:, :: max(1, width // _LINES)].T
    found = [_measure_steepness(_scale_to_8_bits(part), step) for part in (along, across)]
    seen = [value for value in found if value is not None]
    return min(seen, default=0.0)


def _scale_to_8_bits(lines: Grey) -> Bytes:
    if lines.dtype == np.uint8:
        return np.ascontiguousarray(lines, np.uint8)
    low, high = float(lines.min()), float(lines.max())
    return np.rint((lines - low) * (255 / max(high - low, 1e-9))).astype(np.uint8)


def _measure_steepness(lines: Bytes, step: int) -> float | None:
    """Median over strong edges of the largest rise in one pixel, as a share of the whole rise."""
    if lines.shape[1] <= 2 * step:
        return None
    rise = cv2.absdiff(lines[:, step:], lines[:, :-step])
    counts = cv2.calcHist([rise], [0], None, [256], [0, 256]).ravel()
    top = int(np.searchsorted(np.cumsum(counts), 0.999 * rise.size))
    strong = rise >= max(_STRONG * top, 1.0)
    whole = rise[strong].astype(np.float32)
    if len(whole) < _FEWEST_EDGES:
        return None
    one = cv2.absdiff(lines[:, 1:], lines[:, :-1])
    steepest = cv2.dilate(one, np.ones((1, step), np.uint8), anchor=(0, 0))
    shares = steepest[:, : rise.shape[1]][strong] / whole
    middle = len(shares) // 2
    return float(np.partition(shares, middle)[middle])  # many times faster than np.median


def small_picture(grey: Grey) -> Float32Array:
    """Return a small and slightly blurred copy of a picture (H, W), by which motion is measured."""
    # Half by half, which is many times faster than any other share.
    while grey.shape[1] > _SMALL and min(grey.shape) >= 2 * _LEAST_SMALL:
        height, width = (side // 2 for side in grey.shape)
        whole = grey[: 2 * height, : 2 * width]
        grey = cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(grey.astype(np.float32), _BLUR_SIZE, _BLUR))


def motion(before: Float32Array, after: Float32Array, width: int) -> float:
    """Return how far the fastest part of the picture moved between two small pictures.

    In each block of the picture, the difference of both is divided by the slopes. The figure
    saturates at some pixels of the small picture.

    Args:
        before: a small picture.
        after: that of a neighbour.
        width: of the frames.

    Returns:
        Pixels of the frames.

    """
    level, other = (cv2.mean(picture)[0] for picture in (before, after))
    if level > 0 and other > 0:  # the exposure may have changed
        after = after * (level / other)
    middle = cv2.addWeighted(before, 0.5, after, 0.5, 0)
    # Scharr's differences, as a rise a pixel.
    slope = cv2.magnitude(*(cv2.Scharr(middle, -1, *way, scale=1 / 32) for way in ((1, 0), (0, 1))))
    differ = _average_blocks(cv2.multiply(cv2.absdiff(after, before), slope))
    texture = _average_blocks(cv2.multiply(slope, slope))
    most = float(texture.max())
    if most <= 0:
        return 0.0
    textured = texture >= _TEXTURED * most
    moved = float((differ[textured] / texture[textured]).max())
    return moved * width / before.shape[1]


def _average_blocks(picture: cv2.typing.MatLike) -> Float32Array:
    """Return the mean of each block; pixels left over at the right and below are in none."""
    (rows, columns), (height, width) = _BLOCKS, picture.shape
    # Whole pixels go into one, which is many times faster than parts of pixels.
    whole = picture[: height // rows * rows or height, : width // columns * columns or width]
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA))
