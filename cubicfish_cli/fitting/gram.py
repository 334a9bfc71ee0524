"""Gram matrices of pseudo-observations."""

from __future__ import annotations

import numpy as np

from cubicfish_cli.types import FloatArray


def gram(slope: FloatArray, residual: FloatArray) -> FloatArray:
    """(K + 1, K + 1) products of derivatives (L, K) and, last, of residuals (L,)."""
    rows = np.column_stack([slope, residual])
    return np.asarray(rows.T @ rows)
