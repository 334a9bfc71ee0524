"""Clock offsets between the films of a rig's cameras, from their motion.

A body moves with all of its cameras, so films are still and lively at the same moments. That tells
their clocks apart to about a frame; the fit does the rest (``fit/times.py``).
"""

from collections.abc import Sequence

import numpy as np

from cubicfish_cli.core.types import FloatArray, IntArray

# Two films must share so long a time, in frames and as a share of the shorter one.
_LEAST_COMMON, _LEAST_SHARE = 40, 0.4
# The likeness of two films' motion is accepted where it stands out of what chance gives by so many
# standard deviations, and beats that of the clocks as they are by so many.
_SURE, _BETTER = 5.0, 3.0
_LEAST_LIKENESS = 0.5


def film_offset(
    times: tuple[Sequence[float], Sequence[float]], motions: tuple[Sequence[float], Sequence[float]]
) -> float:
    """How far the second film's clock is ahead of the first's, seconds; 0 where that is not sure.

    Args:
        times: seconds of each frame, of both films.
        motions: how far each frame moved, in any measure, of both films.

    """
    first, second = (np.asarray(one, float) for one in times)
    if min(len(first), len(second)) < _LEAST_COMMON:
        return 0.0
    step = min(float(np.median(np.diff(one))) for one in (first, second))
    if not step > 0:
        return 0.0
    one, other = (
        _lively(*pair, step)
        for pair in zip((first, second), (np.asarray(m, float) for m in motions), strict=True)
    )
    least = max(_LEAST_COMMON, int(_LEAST_SHARE * min(len(one), len(other))))
    lags = np.arange(-(len(other) - least), len(one) - least + 1)
    if not len(lags):
        return 0.0
    likeness, free = _likeness(one, other, lags)
    # In these, chance has a standard deviation of one (Fisher 1921).
    score = np.arctanh(np.clip(likeness, -0.999999, 0.999999)) * np.sqrt(np.maximum(free - 3, 0))
    best = int(np.argmax(score))
    # A lag is by how many steps the second begins later than the first, by what they show.
    begun = float(first[0] - second[0])
    shift = np.array([lag * step + begun for lag in lags])
    as_told = int(np.argmin(np.abs(shift)))
    told = score[as_told] if abs(shift[as_told]) <= step else 0.0
    if likeness[best] < _LEAST_LIKENESS or score[best] < _SURE or score[best] - told < _BETTER:
        return 0.0
    return -_peak(score, best, shift)


def _lively(time: FloatArray, motion: FloatArray, step: float) -> FloatArray:
    """Logarithms of the motion at even steps of time."""
    even = np.arange(time[0], time[-1] + step / 2, step)
    positive = motion[motion > 0]
    floor = 0.1 * float(np.median(positive)) if len(positive) else 1.0
    return np.asarray(np.interp(even, time, np.log(np.maximum(motion, floor))))


def _likeness(one: FloatArray, other: FloatArray, lags: IntArray) -> tuple[FloatArray, FloatArray]:
    """Correlation at each lag, and how many of the common steps are free of their neighbours."""
    found, free = np.zeros(len(lags)), np.zeros(len(lags))
    memory = sum(_memory(signal) for signal in (one, other)) / 2
    for number, lag in enumerate(lags.tolist()):
        first = one[max(0, lag) : len(other) + lag]
        second = other[max(0, -lag) :][: len(first)]
        first = first[: len(second)]
        spread = float(first.std() * second.std())
        if spread > 0:
            found[number] = np.mean((first - first.mean()) * (second - second.mean())) / spread
        free[number] = len(first) / memory
    return found, free


def _memory(signal: FloatArray) -> float:
    """Over how many steps a signal keeps its value: the sum of its correlations with itself."""
    centred = signal - signal.mean()
    power = float(centred @ centred)
    if not power > 0:
        return float(len(signal))
    total = 1.0
    for lag in range(1, len(signal) // 4):
        own = float(centred[lag:] @ centred[:-lag]) / power
        if own < 0:
            break
        total += 2 * own * own
    return total


def _peak(score: FloatArray, best: int, shift: FloatArray) -> float:
    """Where a parabola through the best and its neighbours is highest."""
    if not 0 < best < len(score) - 1:
        return float(shift[best])
    before, top, after = score[best - 1 : best + 2]
    curve = before - 2 * top + after
    way = 0.0 if curve >= 0 else 0.5 * (before - after) / curve
    return float(shift[best] + way * (shift[best + 1] - shift[best]))
