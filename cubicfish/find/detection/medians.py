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


def medians(values: npt.NDArray[np.floating], axis: int) -> FloatArray:
    """Medians along an axis that has at least one place; none of the values may be NaN."""
    inorder, count = np.sort(values, axis=axis), values.shape[axis]
    low, high = (inorder.take(place, axis=axis) for place in ((count - 1) // 2, count // 2))
    return np.asarray(0.5 * (low + high), float)
