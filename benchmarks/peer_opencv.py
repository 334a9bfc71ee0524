"""OpenCV's part of peers.py, run by a Python with opencv-contrib-python(-headless) 4.x.

``python peer_opencv.py CORNERS.npz`` prints one JSON object: by model and set of photos,
its parameters and seconds. What they are worth is measured by peers.py.
"""

import json
import sys
import time

import cv2
import numpy as np

# OpenCV's fisheye starts from a homography, which corners near 90° and beyond break: those are
# taken away, from the rim inwards, until it runs. Its error is then measured on all corners.
SHARES = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5)
CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 300, 1e-10)


def lists_of(grid, spacing):
    """Object and image points of each photo, (1, N, 3) and (1, N, 2)."""
    rows, columns = grid.shape[1:3]
    y, x = np.mgrid[:rows, :columns] * spacing
    board = np.stack([x, y, np.zeros_like(x)], axis=-1)
    seen = np.isfinite(grid[..., 0])
    return (
        [board[mask][None].astype(np.float64) for mask in seen],
        [one[mask][None].astype(np.float64) for one, mask in zip(grid, seen, strict=True)],
    )


def within(grid, size, share):
    """The grid without corners farther from the middle than a share of the farthest."""
    radius = np.linalg.norm(grid - (np.array(size) - 1) / 2, axis=-1)
    near = radius <= share * np.nanmax(radius)
    return np.where(near[..., None], grid, np.nan)


def fisheye(objects, images, size, focal):
    """cv2.fisheye.calibrate from a focal length."""
    matrix = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])
    flags = (
        cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC
        | cv2.fisheye.CALIB_FIX_SKEW
        | cv2.fisheye.CALIB_USE_INTRINSIC_GUESS
    )
    _, K, D, turns, _ = cv2.fisheye.calibrate(
        objects, images, size, matrix, np.zeros((4, 1)), flags=flags, criteria=CRITERIA
    )
    values = [K[0, 0], K[1, 1], K[0, 2], K[1, 2], *D.ravel()]
    return values, len(turns)


def omnidir(objects, images, size, focal):
    """cv2.omnidir.calibrate, which finds its own start."""
    _, K, xi, D, turns, _, _ = cv2.omnidir.calibrate(
        objects, images, size, None, None, None, 0, CRITERIA
    )
    xi = float(np.ravel(xi)[0])
    values = [K[0, 0], K[1, 1], K[0, 2], K[1, 2], K[0, 1], xi, *D.ravel()]
    return values, len(turns)


def first_that_works(calibrate, grid, spacing, size, focal):
    """The fit with as many of the outer corners as OpenCV can take, and how long it took."""
    problem = ""
    for share in SHARES:
        objects, images = lists_of(within(grid, size, share), spacing)
        enough = [len(one[0]) >= 8 for one in images]
        objects = [one for one, good in zip(objects, enough, strict=True) if good]
        images = [one for one, good in zip(images, enough, strict=True) if good]
        begun = time.process_time()
        try:
            values, count = calibrate(objects, images, size, float(focal))
        except cv2.error as error:
            problem = " ".join(str(error).split())[:100]
            continue
        return {
            "seconds": time.process_time() - begun,
            "values": [float(value) for value in values],
            "share": share,
            "photos": count,
        }
    return {"problem": problem}


def main():
    """Fit both to all photos and to every fold's training photos."""
    data = np.load(sys.argv[1])
    grid, spacing, folds = data["grid"], float(data["spacing"]), int(data["folds"])
    size = tuple(int(side) for side in data["size"])
    photo = np.arange(len(grid))
    result = {"version": cv2.__version__}
    for name, calibrate in (("fisheye", fisheye), ("omnidir", omnidir)):
        runs = []
        for fold in (-1, *range(folds)):
            chosen = np.flatnonzero(photo % folds != fold)
            runs.append(first_that_works(calibrate, grid[chosen], spacing, size, data["focal"]))
        result[name] = runs
    json.dump(result, sys.stdout)


if __name__ == "__main__":
    main()
