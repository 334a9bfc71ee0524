"""lensboy of PyPI: its splines, and OpenCV's pinhole model by its solver, both with its warp."""

import cv2
import lensboy
import numpy as np

# Its ChArUco finder expects arrays of the shapes that OpenCV 4 gives.
PACKAGES = ["lensboy==4.0.3", "opencv-contrib-python==4.14.0.94", "scipy"]
VARIANTS = {"lensboy splined": 1, "lensboy OpenCV": 1}


def fit(job, variant, start):
    """calibrate_camera, as the README has it; a view is of one board."""
    size = {"image_width": job.size[0], "image_height": job.size[1]}
    if "splined" in variant:
        config = lensboy.PinholeSplinedConfig(**size, num_knots_x=10, num_knots_y=8)
    else:
        config = lensboy.OpenCVConfig(**size)
    columns, rows, _ = job.one_shape()
    points = np.column_stack([job.local, 0 * job.local[:, 0]])[: columns * rows]
    frames = [lensboy.Frame(point % len(points), pixel) for _, point, pixel in job.views()]
    found = lensboy.calibrate_camera(points, frames, config)
    told = [one.residuals[one.inlier_mask] for one in found.frame_diagnostics if one is not None]
    rms, world = float(np.sqrt(np.mean(np.sum(np.concatenate(told) ** 2, axis=1)))), None
    if found.target_warp is not None:
        bent = found.target_warp.warp_target(points)[:, 2]
        world = job.lifted(np.tile(bent, len(job.boards)))
    return {"lens": found.camera_model, "world": world, "claimed": {"rms_px": rms}}


def project(model, points):
    seen = np.asarray(model["lens"].project_points(np.ascontiguousarray(points)), float)
    return np.where(points[:, 2:] > 0, seen, np.nan)


def detect(file, job):
    """Its only finder is of ChArUco boards."""
    board, numbers = job.one_board(), job.grid(0).ravel()
    if board["type"] != "charuco":
        raise NotImplementedError("it has a finder of ChArUco boards only")
    words = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board["dictionary"]))
    squares = (board["corners"][0] + 1, board["corners"][1] + 1)
    charuco = cv2.aruco.CharucoBoard(squares, board["square"], board["marker"], words)
    charuco.setLegacyPattern(board.get("first_square") == "light")
    _, frames, _ = lensboy.extract_frames_from_charuco(charuco, [cv2.imread(file)])
    return numbers[frames[0].target_point_indices], frames[0].detected_points_in_image
