"""How large an error is noise, and from where on it is gross."""

from __future__ import annotations

import numpy as np

from cubicfish_cli.core.types import FloatArray, IntArray

# Median of the length of a 2D normal vector of unit standard deviation a component.
_MEDIAN_OF_RAYLEIGH = 1.17741
# The same of 95 in a hundred.
_MOST, _MOST_OF_RAYLEIGH = 95, 2.44775
# The Huber loss leaves errors within this many standard deviations alone: of normal ones, all but
# three in ten thousand.
_HUBER_SIGMAS = 4.0
# While it is not known yet whether it is the fewer that are wrong: photos of another lens, a board
# that moved.
_WIDE_SIGMAS = 8.0
_SMALLEST_HUBER_PX = 0.1
# A corner is dropped when it is off by more than both of these.
GROSS_PX = 3.0
_GROSS_SIGMAS = 12.0


def noise_px(residual: FloatArray) -> float:
    """Robust standard deviation a component, from the median length: (N, 2) -> pixels."""
    if not len(residual):
        return 0.0
    return float(np.median(np.hypot(residual[:, 0], residual[:, 1])) / _MEDIAN_OF_RAYLEIGH)


def noise_by_photo(image: IntArray, residual: FloatArray, photos: int) -> FloatArray:
    """(M,) :func:`noise_px` of each photo's residuals (N, 2); ``image`` (N,) is non-decreasing."""
    length = np.hypot(residual[:, 0], residual[:, 1])
    ordered = length[np.lexsort((length, image))]
    first, stop = np.searchsorted(image, [np.arange(photos), np.arange(1, photos + 1)])
    noise, seen = np.zeros(photos), first < stop
    middle = np.array([first + stop - 1, first + stop])[:, seen] // 2
    noise[seen] = ordered[middle].mean(axis=0) / _MEDIAN_OF_RAYLEIGH
    return noise


def tail_px(residual: FloatArray) -> float:
    """Standard deviation a component as 95 in a hundred residuals (N, 2) have it, pixels.

    Real finders' errors have longer tails than a normal distribution of the median's.
    """
    if not len(residual):
        return 0.0
    length = np.hypot(residual[:, 0], residual[:, 1])
    return float(np.percentile(length, _MOST) / _MOST_OF_RAYLEIGH)


def huber_px(residual: FloatArray) -> float:
    """Where the Huber loss turns linear, pixels: it follows the noise of these residuals."""
    return max(_SMALLEST_HUBER_PX, _HUBER_SIGMAS * noise_px(residual))


def wide_px(residual: FloatArray) -> float:
    """Where it turns linear at first, pixels."""
    return max(_SMALLEST_HUBER_PX, _WIDE_SIGMAS * noise_px(residual))


def gross_px(residual: FloatArray) -> float:
    """From which length on a residual is gross, pixels."""
    return max(GROSS_PX, _GROSS_SIGMAS * noise_px(residual))


def stray_px(noise: FloatArray) -> FloatArray:
    """From which length on what sets a corner off from its neighbours is no noise, pixels."""
    return np.maximum(_SMALLEST_HUBER_PX, _GROSS_SIGMAS * noise)
