"""OpenCV's two models of wide lenses, of the contrib wheel, and its tutorials' finders.

Of OpenCV 4: ``cv2.fisheye.calibrate`` of 5.0.0 is hundreds of pixels off where that is not.
"""

import cv2
import numpy as np
from job import PLAUSIBLE, by_fisheye

PACKAGES = ["opencv-contrib-python-headless==4.14.0.94", "scipy"]
VARIANTS = {"OpenCV fisheye": 3, "OpenCV omnidir": 1}
EXPORT = "its own K and D, without loss"
CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 300, 1e-10)
GUESSES = (None, 0.33, 0.2)  # focal length by start, as a share of the width; None: OpenCV's own
# Its fisheye starts from a homography, which corners near 90° break: in later starts those are
# taken away, from the rim inwards, until it fits. All corners count in the errors all the same.
SHARES = (1.0, 0.95, 0.9, 0.85, 0.8, 0.7, 0.6)


def fit(job, variant, start):
    """As the documentation has it; later starts have a focal length and may leave out the rim."""
    views = [(points[:, None], pixel[:, None]) for points, _, pixel in job.views()]
    middle, matrix = (np.array(job.size) - 1) / 2, None
    if "omnidir" in variant:
        rms, k, xi, d, *_ = cv2.omnidir.calibrate(
            *map(list, zip(*views, strict=True)), job.size, None, None, None, 0, CRITERIA
        )
        return {"k": k, "xi": float(np.ravel(xi)[0]), "d": d, "claimed": {"rms_px": rms}}
    flags = cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC | cv2.fisheye.CALIB_FIX_SKEW
    if GUESSES[start] is not None:
        flags |= cv2.fisheye.CALIB_USE_INTRINSIC_GUESS
        focal = GUESSES[start] * job.size[0]
        matrix = np.array([[focal, 0, middle[0]], [0, focal, middle[1]], [0, 0, 1]])
    away = [np.linalg.norm(pixel[:, 0] - middle, axis=1) for _, pixel in views]
    best, shares = None, SHARES if start else SHARES[:1]
    for share in shares:
        near = [one <= share * max(map(np.max, away)) for one in away]
        kept = [(p[n], q[n]) for (p, q), n in zip(views, near, strict=True) if n.sum() >= 8]
        try:
            rms, k, d, *_ = cv2.fisheye.calibrate(
                *map(list, zip(*kept, strict=True)), job.size, matrix, np.zeros((4, 1)),
                flags=flags, criteria=CRITERIA,
            )  # fmt: skip
        except cv2.error:
            if best is None and share == shares[-1]:
                raise
            continue
        if best is None or rms < best["claimed"]["rms_px"]:
            note = "" if share == 1 else f"fitted within {share:.0%} of the largest radius"
            best = {"k": k, "d": d, "claimed": {"rms_px": rms}, "note": note}
        if rms < PLAUSIBLE * job.size[0]:
            break
    return best


def project(model, points):
    if "xi" not in model:
        return by_fisheye(model["k"], model["d"], points)
    where, zero = np.ascontiguousarray(points[:, None], float), np.zeros(3)
    lens = [model[key] for key in ("k", "xi", "d")]
    return cv2.omnidir.projectPoints(where, zero, zero, *lens)[0].reshape(-1, 2)


def detect(file, job):
    """findChessboardCorners with cornerSubPix, and CharucoDetector."""
    board, numbers = job.one_board(), job.grid(0).ravel()
    gray = cv2.imread(file, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    columns, rows = board["corners"]
    if board["type"] == "checkerboard":
        corners = cv2.findChessboardCorners(gray, (columns, rows))[1]
        stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
        return numbers, cv2.cornerSubPix(gray, corners, (5, 5), (-1, -1), stop)
    words = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board["dictionary"]))
    charuco = cv2.aruco.CharucoBoard(
        (columns + 1, rows + 1), board["square"], board["marker"], words
    )
    charuco.setLegacyPattern(board.get("first_square") == "light")
    corners, ids, *_ = cv2.aruco.CharucoDetector(charuco).detectBoard(gray)
    return numbers[ids.ravel()], corners
