"""Colour maps of magnitudes."""

import math

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish import FloatArray

Picture = npt.NDArray[np.uint8]

_WHITE, _BLACK = (255,) * 3, (0,) * 3
# Differences far below any noise are not worth a scale of their own.
_SMALLEST_TOP = 1e-3


def round_up(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten at or above a positive value."""
    power = 10.0 ** math.floor(math.log10(max(value, 1e-6)))
    return next(power * step for step in (1, 2, 5, 10) if power * step >= value * 0.999999)


def difference_picture(magnitude: FloatArray, *, top: float | None = None) -> Picture:
    """Draw magnitudes in OpenCV's cividis, with a scale below.

    Args:
        magnitude: (H, W) pixels; NaN is left white.
        top: where the scale ends, and beyond which all is of its last colour; by default a round
            number at or above 99 of 100 magnitudes.

    Returns:
        (H + scale, W, 3) uint8, BGR as :mod:`cv2` writes it.

    """
    known = np.isfinite(magnitude)
    if top is None:
        most = float(np.percentile(magnitude[known], 99)) if known.any() else 1.0
        top = max(round_up(most), _SMALLEST_TOP)
    share = np.where(known, np.clip(magnitude, 0, top), 0) / top
    picture = _colour_shares(share)
    picture[~known] = _WHITE
    width = magnitude.shape[1]
    bar = max(8, width // 30)
    scale = _colour_shares(np.tile(np.linspace(0, 1, width), (bar, 1)))
    text = np.full_like(scale, 255)
    for words, left in (("0", 0.01), (f"{top:g} px", 0.8)):
        place = (int(left * width), bar - bar // 4)
        cv2.putText(text, words, place, cv2.FONT_HERSHEY_SIMPLEX, bar / 40, _BLACK, 1, cv2.LINE_AA)
    return np.vstack([picture, scale, text])


def _colour_shares(share: FloatArray) -> Picture:
    """(H, W, 3) colours of shares from 0 to 1: lightness grows, also to the colour-blind."""
    levels = np.round(255 * share).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_CIVIDIS), np.uint8)
