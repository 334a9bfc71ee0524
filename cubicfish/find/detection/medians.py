"""Medians of the many small arrays that grids are judged by.

numpy's own take longer to look at their arguments than to find a median, and load the module of
masked arrays to ask for these.
"""

import numpy as np
import numpy.typing as npt

from cubicfish.types import FloatArray


def median(values: npt.NDArray[np.floating]) -> float:
    """The median of all values, at least one; NaN where one of them is."""
    middle, odd = divmod(values.size, 2)
    # One place at a time: numpy does that with vector instructions.
    inorder = np.partition(values, middle, axis=None)
    if np.isnan(inorder[middle:].max()):
        return np.nan
    above = inorder[middle]
    return float(above if odd else 0.5 * (inorder[:middle].max() + above))


def row_medians(values: FloatArray) -> FloatArray:
    """Medians (N, ...) along the second axis of (N, K, ...) values, K at least 1; none is NaN."""
    inorder, count = np.sort(values, axis=1), values.shape[1]
    return np.asarray(0.5 * (inorder[:, (count - 1) // 2] + inorder[:, count // 2]), float)
