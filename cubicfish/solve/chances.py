"""Probabilities of tests by Student's t and by F, without a library that is slow to load."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from cubicfish.types import FloatArray

# The continued fraction needs some tens of terms, and of thousands of degrees of freedom hundreds.
_MOST_TERMS = 10_000
_ACCURATE = 1e-15
# Beyond this no quantile is asked for.
_FARTHEST = 1e6


def normal_quantile(share: float) -> float:
    """The value that a standard normal variable stays below with a probability in (0, 1)."""
    return _invert(lambda x: math.erfc(-x / math.sqrt(2)) / 2, share)


def student_quantile(freedom: int, share: float) -> float:
    """The value that Student's t stays below with a probability in (0, 1)."""
    return _invert(lambda t: student(freedom, t), share)


def student(freedom: int, t: float) -> float:
    """The probability that Student's t, of 1 or more degrees of freedom, stays below a value."""
    square = t * t
    if square < freedom:  # near the middle, of which its distance to the end says too little
        within = incomplete_beta(0.5, freedom / 2, square / (freedom + square)) / 2
        return 0.5 + math.copysign(within, t)
    beyond = incomplete_beta(freedom / 2, 0.5, freedom / (freedom + square)) / 2
    return beyond if t < 0 else 1 - beyond


def beyond_f(first: float, second: npt.ArrayLike, ratio: npt.ArrayLike) -> FloatArray:
    """The probability that a ratio of variances exceeds a value by chance (the tail of F).

    Args:
        first: degrees of freedom of the variance above.
        second: (...,) those of the variance below.
        ratio: (...,) the values, 0 or more.

    """
    second, ratio = np.asarray(second, float), np.asarray(ratio, float)
    each = np.vectorize(incomplete_beta, otypes=[float])
    return np.asarray(each(second / 2, first / 2, second / (second + first * ratio)))


def incomplete_beta(a: float, b: float, x: float) -> float:
    """The regularised incomplete beta function I_x(a, b), for x from 0 to 1.

    By its continued fraction (Press et al., Numerical Recipes, 6.4), which converges fast on the
    side of the mean from which it is taken.
    """
    if not 0 < x < 1:
        return x  # which is 0, 1, or no number
    if x > (a + 1) / (a + b + 2):
        return 1 - incomplete_beta(b, a, 1 - x)
    log_beta = math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)
    return math.exp(a * math.log(x) + b * math.log1p(-x) - log_beta) / a * _fraction(a, b, x)


def _fraction(a: float, b: float, x: float) -> float:
    """The continued fraction of the incomplete beta function, by Lentz's method."""
    above, below = 1.0, 1 / (1 - (a + b) * x / (a + 1))
    value = below
    for m in range(1, _MOST_TERMS):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        for term in (even, odd):
            below, above = 1 / (1 + term * below), 1 + term / above
            value *= below * above
        if abs(below * above - 1) < _ACCURATE:
            break
    return value


def _invert(growing: Callable[[float], float], share: float) -> float:
    """Where a distribution reaches a probability, by halving."""
    low, high = -_FARTHEST, _FARTHEST
    while low < (middle := (low + high) / 2) < high:
        low, high = (middle, high) if growing(middle) < share else (low, middle)
    return middle
