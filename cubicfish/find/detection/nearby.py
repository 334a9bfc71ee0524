"""Nearest neighbours among points in the plane."""

import numpy as np
from scipy.spatial import cKDTree

from cubicfish.types import FloatArray, IntArray


def nearest(
    points: FloatArray, others: FloatArray | cKDTree, count: int
) -> tuple[FloatArray, IntArray]:
    """Distances and indices of the nearest others of each point, nearest first.

    Args:
        points: (N, 2).
        others: (M, 2), M at least 1; or the tree of them, which serves many calls.
        count: how many K; fewer when there are fewer others.

    Returns:
        (N, K) distances and (N, K) indices into ``others``.

    """
    tree = others if isinstance(others, cKDTree) else cKDTree(others)
    count = min(count, tree.n)
    if not len(points):
        return np.zeros((0, count)), np.zeros((0, count), int)
    distance, index = tree.query(points, k=np.arange(1, count + 1))
    return np.asarray(distance, float), np.asarray(index, np.intp)
