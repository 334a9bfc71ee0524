"""Clock offsets between the films of a rig's cameras, from their motion.

A body moves with all of its cameras, so films are still and lively at the same moments. That tells
their clocks apart to about a frame, where they are alike in one way alone: what moves in a steady
rhythm is alike again one beat later. The fit does the rest (``rigs/times.py``).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish import FloatArray

# Two films must share so long a time, in frames and as a share of the shorter one.
_LEAST_COMMON, _LEAST_SHARE = 40, 0.4
# Less motion, beside that of a frame that counts as still, is what noise and compression leave.
_NO_MOTION = 0.1
# The likeness of two films' motion is accepted where it stands out of what chance gives by so many
# standard deviations, and beats that at any other offset, the clocks' own too, by so many.
_SURE, _BETTER = 5.0, 3.0
_LEAST_LIKENESS = 0.5
# Offsets next to the best one are of the same match while their likeness is such a share of its.
_SAME_MATCH = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class FilmMotion:
    """How what a film shows moves from each frame to the next.

    Attributes:
        time: (N,) seconds, half-way between both frames.
        moved: (N,) how far, where a frame that counts as still moved by less than 1.

    """

    time: FloatArray
    moved: FloatArray


@dataclass(frozen=True, kw_only=True)
class FilmMatch:
    """By how much the second of two films' clocks is ahead of the first's, seconds.

    Attributes:
        ahead: by so much; 0 where the clocks agree, or that is not sure.
        alike: two offsets at which the films are about as much alike; empty where there is but one,
            or none.

    """

    ahead: float = 0.0
    alike: tuple[float, ...] = ()


def match_films(first: FilmMotion, second: FilmMotion) -> FilmMatch:
    """By how much the second film's clock is ahead of the first's, by when they move."""
    if min(len(first.time), len(second.time)) < _LEAST_COMMON:
        return FilmMatch()
    step = min(float(np.median(np.diff(film.time))) for film in (first, second))
    if not step > 0:
        return FilmMatch()
    one, other = _measure_liveliness(first, step), _measure_liveliness(second, step)
    least = max(_LEAST_COMMON, int(_LEAST_SHARE * min(len(one), len(other))))
    lags = np.arange(-(len(other) - least), len(one) - least + 1)
    if not len(lags):
        return FilmMatch()
    likeness, free = _correlate(one, other, lags)
    # In these, chance has a standard deviation of one (Fisher 1921).
    score = np.arctanh(np.clip(likeness, -0.999999, 0.999999)) * np.sqrt(np.maximum(free - 3, 0))
    best = int(np.argmax(score))
    if likeness[best] < _LEAST_LIKENESS or score[best] < _SURE:
        return FilmMatch()
    # A lag is by how many steps the second begins later than the first, by what they show.
    shift = np.asarray(lags * step + (first.time[0] - second.time[0]), float)
    elsewhere = np.where(_same_match(likeness, best), -np.inf, score)
    runner_up = int(np.argmax(elsewhere))
    if score[best] - elsewhere[runner_up] < _BETTER:
        return FilmMatch(alike=(-float(shift[best]), -float(shift[runner_up])))
    by_clocks = int(np.argmin(np.abs(shift)))
    stated_score = score[by_clocks] if abs(shift[by_clocks]) <= step else 0.0
    return FilmMatch(
        ahead=-_find_peak(score, best, shift) if score[best] - stated_score >= _BETTER else 0.0
    )


def _measure_liveliness(film: FilmMotion, step: float) -> FloatArray:
    """Logarithms of the motion at even steps of time."""
    even = np.arange(film.time[0], film.time[-1] + step / 2, step)
    return np.asarray(np.interp(even, film.time, np.log(np.maximum(film.moved, _NO_MOTION))))


def _correlate(
    one: FloatArray, other: FloatArray, lags: npt.NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Correlation at each lag, and how many of the common steps are free of the others."""
    found, free = np.zeros(len(lags)), np.zeros(len(lags))
    memory = _measure_memory(one, other)
    for number, lag in enumerate(lags.tolist()):
        first = one[max(0, lag) : len(other) + lag]
        second = other[max(0, -lag) : len(one) - lag]
        spread = float(first.std() * second.std())
        if spread > 0:
            found[number] = np.mean((first - first.mean()) * (second - second.mean())) / spread
        free[number] = len(first) / memory
    return found, free


def _measure_memory(one: FloatArray, other: FloatArray) -> float:
    """How many times fewer steps are free than there are, where two signals are unlike.

    By what both have in common with themselves some steps later (Bartlett 1935), which a steady
    rhythm has again and again.
    """
    later = np.arange(1, min(len(one), len(other)) // 4)
    both = _with_itself(one, later) * _with_itself(other, later)
    return 1 + 2 * max(float(both.sum()), 0.0)


def _with_itself(signal: FloatArray, later: npt.NDArray[np.intp]) -> FloatArray:
    """(L,) correlation of a signal with itself so many steps later."""
    centred = signal - signal.mean()
    power = float(centred @ centred)
    if not power > 0:
        return np.ones(len(later))
    return np.array([centred[lag:] @ centred[:-lag] for lag in later.tolist()]) / power


def _same_match(likeness: FloatArray, best: int) -> npt.NDArray[np.bool_]:
    """(L,) the best lag and those about it, as far as they are alike because it is."""
    less = np.flatnonzero(likeness < _SAME_MATCH * likeness[best])
    lag = np.arange(len(likeness))
    before, after = less[less < best].max(initial=-1), less[less > best].min(initial=len(lag))
    return (lag > before) & (lag < after)


def _find_peak(score: FloatArray, best: int, shift: FloatArray) -> float:
    """Where a parabola through the best and its neighbours is highest."""
    if not 0 < best < len(score) - 1:
        return float(shift[best])
    before, top, after = score[best - 1 : best + 2]
    curve = before - 2 * top + after
    way = 0.0 if curve >= 0 else 0.5 * (before - after) / curve
    return float(shift[best] + way * (shift[best + 1] - shift[best]))
