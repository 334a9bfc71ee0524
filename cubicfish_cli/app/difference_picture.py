"""Colour maps of magnitudes."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.types import FloatArray

Picture = npt.NDArray[np.uint8]

# Cividis (Nuñez, Anderton & Renslow 2018) in ten bands, RGB: lightness grows all the way, and
# people with and without colour blindness see nearly the same.
_BANDS = bytes.fromhex("00204d 00336f 39486b 575c6d 707173 8a8779 a69d75 c4b56c e4cf5b ffea46")
COLOURS = np.frombuffer(_BANDS, np.uint8).reshape(10, 3)
_PAPER = 255
_INK = 0
# Differences far below any noise are not worth a scale of their own.
_SMALLEST_TOP = 1e-3
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_CAPITAL = 22  # height of its capitals at scale 1, pixels


def round_up(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten at or above a positive value."""
    power = 10.0 ** math.floor(math.log10(max(value, 1e-6)))
    return next(power * step for step in (1, 2, 5, 10) if power * step >= value * 0.999999)


def difference_picture(magnitude: FloatArray, *, top: float | None = None) -> Picture:
    """Draw magnitudes in ten bands of colour, with a scale below.

    Args:
        magnitude: (H, W) pixels; NaN is left white.
        top: where the last band ends, and beyond which all is of its colour; by default a round
            number at or above 99 of 100 magnitudes.

    Returns:
        (H + scale, W, 3) uint8, BGR as :mod:`cv2` writes it.

    """
    known = np.isfinite(magnitude)
    if top is None:
        most = float(np.percentile(magnitude[known], 99)) if known.any() else 1.0
        top = max(round_up(most), _SMALLEST_TOP)
    share = np.where(known, magnitude, 0) / top
    band = np.clip((share * len(COLOURS)).astype(int), 0, len(COLOURS) - 1)
    picture = np.where(known[..., None], COLOURS[band], np.uint8(_PAPER)).astype(np.uint8)
    return np.ascontiguousarray(np.vstack([picture, _scale(magnitude.shape[1], top)])[..., ::-1])


def _scale(width: int, top: float) -> Picture:
    dot = max(1, width // 240)
    margin, bar, letter = 4 * dot, 8 * dot, 7 * dot
    picture = np.full((2 * margin + bar + 8 * dot, width, 3), _PAPER, np.uint8)
    edges = np.linspace(8 * dot, width - 24 * dot, len(COLOURS) + 1).astype(int)
    for left, right, colour in zip(edges[:-1], edges[1:], COLOURS, strict=True):
        picture[margin : margin + bar, left:right] = colour
    for share in (0.0, 0.5, 1.0):
        text = f"{share * top:.6f}".rstrip("0").rstrip(".") + (" px" if share == 1 else "")
        size = letter / _CAPITAL
        (length, _), _ = cv2.getTextSize(text, _FONT, size, dot)
        middle = int(edges[0] + share * (edges[-1] - edges[0]))
        left = max(0, min(middle - 2 * dot, width - length))
        below = (left, margin + bar + 2 * dot + letter)
        cv2.putText(picture, text, below, _FONT, size, (_INK,) * 3, dot, cv2.LINE_AA)
    return picture
