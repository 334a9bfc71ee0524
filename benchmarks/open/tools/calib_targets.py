"""calib-targets of PyPI, which finds corners and fits no camera: it has a recall only."""

import calib_targets
import cv2
import numpy as np

PACKAGES = ["calib-targets==0.15.5", "opencv-python-headless"]
VARIANTS = {"calib-targets": 1}


def detect(file, job):
    """The README's calls. Where a corner is on the board does not matter to its recall."""
    board = job.one_board()
    gray = cv2.imread(file, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    columns, rows = board["corners"]
    if board["type"] == "checkerboard":
        found = calib_targets.detect_chessboard_best(gray, [calib_targets.ChessboardParams()])
    else:
        spec = calib_targets.CharucoBoardSpec(
            rows=rows + 1, cols=columns + 1, cell_size=1.0, dictionary=board["dictionary"],
            marker_size_rel=board["marker"] / board["square"],
        )  # fmt: skip
        try:
            found = calib_targets.detect_charuco(
                gray, params=calib_targets.CharucoParams(board=spec)
            )
        except RuntimeError:  # none in this photo
            found = None
    corners = found.corners if found else []
    return np.zeros(len(corners), int), np.array([one.position for one in corners]).reshape(-1, 2)
