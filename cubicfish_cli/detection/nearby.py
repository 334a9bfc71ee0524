"""Nearest neighbours among points in the plane."""

from __future__ import annotations

import cv2
import numpy as np

from cubicfish_cli.detection.grids import FloatArray, IntArray


def nearest(points: FloatArray, others: FloatArray, count: int) -> tuple[FloatArray, IntArray]:
    """Distances and indices of the nearest others of each point, nearest first.

    Args:
        points: (N, 2).
        others: (M, 2), M at least 1.
        count: how many K; fewer when there are fewer others.

    Returns:
        (N, K) distances and (N, K) indices into ``others``.

    """
    count = min(count, len(others))
    if not len(points):
        return np.zeros((0, count)), np.zeros((0, count), int)
    distance, index = cv2.batchDistance(
        points.astype(np.float32), others.astype(np.float32), cv2.CV_32F, K=count
    )
    return distance.astype(float), index.astype(int)
