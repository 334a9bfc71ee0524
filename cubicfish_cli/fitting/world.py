"""The object's points as least squares sees them: fixed as drawn, or free within limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cubicfish_cli.types import FloatArray, IntArray


class World(Protocol):
    """World points of all pairs, and what of them may move."""

    @property
    def points(self) -> FloatArray:
        """(N, 3) world point of each pair."""

    @property
    def parameters(self) -> FloatArray:
        """(S,) free parameters of the boards' shapes and places; S may be 0."""

    @property
    def corner(self) -> IntArray:
        """(N,) which free corner each pair is of; empty when corners have no offsets."""

    @property
    def offsets(self) -> FloatArray:
        """(Q, 3) offset of each free corner; Q is 0 when corners have none."""

    @property
    def offset_weight(self) -> float:
        """Pixels that an offset of one unit counts as."""

    def moved(self, parameters: FloatArray, offsets: FloatArray) -> World:
        """The same object after steps (S,) and (Q, 3)."""

    def select(self, rows: IntArray) -> World:
        """The same object for some of the pairs, (n,) increasing."""

    def chain(self, d_world: FloatArray, run: slice) -> FloatArray:
        """From d pixel / d world point (n, 2, 3) to d pixel / d parameters (n, 2, S).

        The n pairs are those of ``run``, which has a start and a stop.
        """

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """Pull of the parameters to the drawing: residuals (L,) in pixels, derivatives (L, S)."""


@dataclass(frozen=True, eq=False)
class DrawnWorld:
    """Points exactly as the target file has them."""

    points: FloatArray

    @property
    def parameters(self) -> FloatArray:
        """(0,)."""
        return np.zeros(0)

    @property
    def corner(self) -> IntArray:
        """(0,)."""
        return np.zeros(0, np.intp)

    @property
    def offsets(self) -> FloatArray:
        """(0, 3)."""
        return np.zeros((0, 3))

    @property
    def offset_weight(self) -> float:
        """There are no offsets."""
        return 0.0

    def moved(self, parameters: FloatArray, offsets: FloatArray) -> DrawnWorld:
        """Itself: nothing is free."""
        return self

    def select(self, rows: IntArray) -> DrawnWorld:
        """Some of the points."""
        return DrawnWorld(self.points[rows])

    def chain(self, d_world: FloatArray, run: slice) -> FloatArray:
        """(n, 2, 0)."""
        return np.zeros((len(d_world), 2, 0))

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """None."""
        return np.zeros(0), np.zeros((0, 0))
