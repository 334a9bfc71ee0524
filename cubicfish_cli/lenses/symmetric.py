"""Lenses that are symmetric about their axis: x and y are those of the point times one scale."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from cubicfish_cli.lenses.lens import FocalLens
from cubicfish_cli.types import FloatArray

ALPHA = {"alpha": (0.0, 0.9999)}
"""Other programs read an α from 0 on and below 1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scale:
    """How far from the axis an axially symmetric lens puts a point: (x, y) = s · (X, Y).

    Attributes:
        value: (N,) s; inf where the lens sees nothing.
        d_across: (N,) (ds/dρ)/ρ with ρ = hypot(X, Y): finite on the axis too.
        d_along: (N,) ds/dZ.
        d_shape: (N, K) ds/d shape parameters.

    """

    value: FloatArray
    d_across: FloatArray
    d_along: FloatArray
    d_shape: FloatArray

    def point(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Normalised pixel (N, 2), its d/d point (N, 2, 3) and its d/d shape (N, 2, K)."""
        across = points[:, :2]
        d_point = np.empty((len(points), 2, 3))
        d_point[:, :, :2] = (
            across[:, :, None] * across[:, None, :] * self.d_across[:, None, None]
            + np.eye(2) * self.value[:, None, None]
        )
        d_point[:, :, 2] = across * self.d_along[:, None]
        return (
            across * self.value[:, None],
            d_point,
            across[:, :, None] * self.d_shape[:, None, :],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class SymmetricLens(FocalLens):
    """An axially symmetric lens: its shape's parameters come after fx, fy, cx, cy."""

    @abstractmethod
    def scale(self, points: FloatArray) -> Scale:
        """The model itself: camera-frame points (N, 3) -> s and its derivatives."""

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`Lens`."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            scale = self.scale(points)
            pixel, by_point, by_parameter = self.through_focal(*scale.point(points))
        return np.where(np.isfinite(scale.value)[:, None], pixel, np.inf), by_point, by_parameter
