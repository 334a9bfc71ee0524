"""Nearest neighbours among points in the plane."""

import cv2
import numpy as np

from cubicfish.types import BoolArray, FloatArray, IntArray

# Of FLANN: one k-d tree, searched to the end, so that the answer is exact.
_TREE: dict[str, bool | int | float | str] = {"algorithm": 4, "leaf_max_size": 10}
_EXACT: dict[str, bool | int | float | str] = {"checks": -1, "eps": 0.0, "sorted": True}


class Tree:
    """Points that many are asked for: OpenCV's tree, which takes a tenth of scipy's time to load.

    Attributes:
        points: (M, 2 or more).

    """

    def __init__(self, points: FloatArray) -> None:
        """Build it; there may be no points."""
        self.points = points
        if len(points):
            self._index = cv2.flann.Index(np.asarray(points, np.float32, order="C"), _TREE)

    def __len__(self) -> int:
        return len(self.points)

    def nearest(self, points: FloatArray, count: int) -> tuple[FloatArray, IntArray]:
        """See :func:`nearest`."""
        asked = np.asarray(points, np.float32, order="C")
        index = self._index.knnSearch(asked, count, params=_EXACT)[0].astype(np.intp)
        # The tree holds single precision, which decides only between points as far as each other.
        return np.sqrt(np.square(points[:, None] - self.points[index]).sum(-1)), index


def nearest(
    points: FloatArray, others: FloatArray | Tree, count: int
) -> tuple[FloatArray, IntArray]:
    """Distances and indices of the nearest others of each point, nearest first.

    Args:
        points: (N, 2).
        others: (M, 2), M at least 1; or the tree of them, which serves many calls.
        count: how many K; fewer when there are fewer others.

    Returns:
        (N, K) distances and (N, K) indices into ``others``.

    """
    tree = others if isinstance(others, Tree) else Tree(others)
    count = min(count, len(tree))
    if not len(points):
        return np.zeros((0, count)), np.zeros((0, count), int)
    return tree.nearest(points, count)


def connected(linked: BoolArray) -> IntArray:
    """Which points hang together by links (N, N), either way: (N,) the first of each piece."""
    linked = linked | linked.T | np.eye(len(linked), dtype=bool)
    first = np.arange(len(linked))
    while True:
        before, first = first, np.where(linked, first, len(linked)).min(axis=1, initial=len(linked))
        if np.array_equal(before, first):
            return first
