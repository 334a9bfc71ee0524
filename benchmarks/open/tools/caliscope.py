"""caliscope of PyPI: the fisheye camera of its scripting interface, and its own trackers."""

import caliscope.api as api
import cv2
import numpy as np
import pandas as pd
from caliscope.core.calibrate_intrinsics import run_intrinsic_calibration
from job import by_fisheye

# Its fisheye asks OpenCV for names that version 5 has no more.
PACKAGES = ["caliscope==0.11.8", "opencv-python==4.14.0.94"]
VARIANTS = {"caliscope fisheye": 1}
EXPORT = "its own K and D, without loss"


def fit(job, variant, start):
    """Its choice of some thirty frames, then its intrinsic calibration."""
    columns = ["sync_index", "keypoint_id", "img_loc_x", "img_loc_y", "obj_loc_x", "obj_loc_y"]
    parts = [
        np.column_stack([np.full(len(point), number), point, pixel, points[:, :2]])
        for number, (points, point, pixel) in enumerate(job.views())
    ]
    table = pd.DataFrame(np.concatenate(parts), columns=columns)
    table = table.assign(cam_id=0, object_id=0, obj_loc_z=0.0)
    camera = api.CameraData(cam_id=0, size=job.size, fisheye=True)
    found = run_intrinsic_calibration(camera, api.ImagePoints(table))
    note = f"{found.report.frames_used} views chosen"
    return {"lens": found.camera, "claimed": {"rms_px": float(found.report.rmse)}, "note": note}


def project(model, points):
    return by_fisheye(model["lens"].matrix, model["lens"].distortions, points)


def detect(file, job):
    """Its trackers, a frame at a time."""
    board, numbers = job.one_board(), job.grid(0).ravel()
    columns, rows = board["corners"]
    if board["type"] == "checkerboard":
        tracker = api.ChessboardTracker(api.Chessboard(rows=rows, columns=columns))
    else:
        charuco = api.Charuco.from_squares(
            columns + 1, rows + 1, float(board["square"]), dictionary=board["dictionary"],
            aruco_scale=board["marker"] / board["square"],
            legacy_pattern=board.get("first_square") == "light",
        )  # fmt: skip
        tracker = api.CharucoTracker(charuco)
    seen = tracker.get_points(cv2.imread(file))
    return numbers[np.asarray(seen.keypoint_id, int)], seen.img_loc
