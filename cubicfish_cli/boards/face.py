"""What is printed on a board: a function from the board's plane to brightness."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cubicfish_cli.types import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True)
class Face:
    """The printed face of a board, in the board's own plane.

    Attributes:
        lower, upper: opposite corners of the plate, (x, y) in the target's units; the white
            margin is inside.
        is_dark: (..., 2) plane positions -> (...) whether there is ink.
        steps: positions along x and along y, (N,) and (M,), between which ink neither begins
            nor ends: cells between them are of one colour.

    """

    lower: tuple[float, float]
    upper: tuple[float, float]
    is_dark: Callable[[FloatArray], BoolArray]
    steps: tuple[FloatArray, FloatArray]

    def covers(self, plane: FloatArray) -> BoolArray:
        """Whether plane positions (..., 2) are on the plate -> (...)."""
        return (
            (plane[..., 0] >= self.lower[0])
            & (plane[..., 0] <= self.upper[0])
            & (plane[..., 1] >= self.lower[1])
            & (plane[..., 1] <= self.upper[1])
        )

    def in_mirror(self, last: float) -> Face:
        """The face whose columns run the other way: x of its first corner is ``last`` here."""

        def is_dark(plane: FloatArray) -> BoolArray:
            return self.is_dark(np.stack([last - plane[..., 0], plane[..., 1]], axis=-1))

        x, y = self.steps
        return Face(
            lower=(last - self.upper[0], self.lower[1]),
            upper=(last - self.lower[0], self.upper[1]),
            is_dark=is_dark,
            steps=((last - x)[::-1], y),
        )
