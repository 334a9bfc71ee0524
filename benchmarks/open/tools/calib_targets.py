"""calib-targets of PyPI, which finds corners and fits no camera: it has a recall only."""

import calib_targets as ct
import cv2
import numpy as np

PACKAGES = ["calib-targets==0.15.5", "opencv-python-headless==5.0.0.93", "scipy"]
VARIANTS = {"calib-targets": 1}


def detect(file, job):
    """The README's calls. Where a corner is on the board does not matter to its recall."""
    board = job.one_board()
    gray = cv2.imread(file, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    if board["type"] == "checkerboard":
        found = ct.detect_chessboard_best(gray, [ct.ChessboardParams()])
    else:
        spec = ct.CharucoBoardSpec(
            rows=board["corners"][1] + 1, cols=board["corners"][0] + 1, cell_size=1.0,
            marker_size_rel=board["marker"] / board["square"], dictionary=board["dictionary"],
        )  # fmt: skip
        found = ct.detect_charuco(gray, params=ct.CharucoParams(board=spec))
    return np.zeros(len(found.corners), int), [one.position for one in found.corners]
