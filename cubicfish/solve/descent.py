"""Levenberg–Marquardt for a lens alone: its normal equations are formed by whoever asks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, Self, TypeVar

from cubicfish.solve.normal_equations import damped, solve_scaled
from cubicfish.types import FloatArray

COLD_DAMPING = 1e-4
"""First damping for a start that may be far from the optimum."""
_HOPELESS = 1e8  # a damping that leaves no step


class Adjustable(Protocol):
    """What has parameters."""

    @property
    def parameters(self) -> FloatArray:
        """(K,)."""

    def with_parameters(self, parameters: FloatArray) -> Self:
        """The same with others."""


A = TypeVar("A", bound=Adjustable)


def descended(
    start: A, square_of: Callable[[A], FloatArray], steady: float, most: int
) -> tuple[A, FloatArray]:
    """The nearest of its kind to what is wanted, by least squares from a start.

    Args:
        start: the start.
        square_of: the Gram matrix (F + 1, F + 1) of derivatives by the first F parameters, which
            are free, and, last, of residuals.
        steady: stop when a step lowers the squares by less than this share.
        most: steps to try at most.

    Returns:
        The best that was found, and its Gram matrix.

    """
    found, square, damping = start, square_of(start), COLD_DAMPING
    for _ in range(most):
        step = solve_scaled(damped(square[:-1, :-1], damping), square[:-1, -1:])[:, 0]
        parameters = found.parameters.copy()
        parameters[: len(step)] -= step
        moved = found.with_parameters(parameters)
        before, new = float(square[-1, -1]), square_of(moved)
        if new[-1, -1] < before:
            found, square, damping = moved, new, damping / 10
            if new[-1, -1] > (1 - steady) * before:
                break
        else:
            damping *= 10
            if damping > _HOPELESS:
                break
    return found, square
