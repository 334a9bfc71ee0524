"""What least squares asks of a lens."""

from __future__ import annotations

from typing import Protocol, Self

import numpy as np

from cubicfish_cli.core.types import FloatArray


class FitLens(Protocol):
    """A lens that least squares can adjust."""

    @property
    def parameters(self) -> FloatArray:
        """(K,) the free parameters; K may be 0."""

    def with_parameters(self, parameters: FloatArray) -> Self:
        """The same lens with other parameters."""

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Camera-frame points (N, 3) -> pixel (N, 2), d/d point (N, 2, 3), d/d param (N, 2, K)."""

    def project(self, points: FloatArray) -> FloatArray:
        """Camera-frame points (N, 3) -> pixel (N, 2), without derivatives."""

    def prior(self) -> FloatArray:
        """Gram matrix (K + 1, K + 1) of pseudo-observations.

        Products of their derivatives by the parameters and, last, of their residuals, pixels.
        """


def gram(slope: FloatArray, residual: FloatArray) -> FloatArray:
    """(K + 1, K + 1) products of derivatives (L, K) and, last, of residuals (L,)."""
    rows = np.column_stack([slope, residual])
    return np.asarray(rows.T @ rows)
