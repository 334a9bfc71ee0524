"""ds-msp of PyPI: its own Double Sphere, and the model that it calls the dependable one."""

import numpy as np
from ds_msp.calib import calibrate
from ds_msp.calib.board import CheckerboardBoard
from ds_msp.detect.checkerboard import CheckerboardSpec
from ds_msp.models import DoubleSphereModel, KannalaBrandtModel
from ds_msp.models.registry import seed_from_K

PACKAGES = ["ds-msp==0.22.2", "opencv-python==5.0.0.93"]
VARIANTS = {"ds-msp double sphere": 1, "ds-msp Kannala-Brandt": 1}
EXPORT = "Kalibr's camchain of the same model, without loss"


def fit(job, variant, start):
    """The README's call: a generic seed, its own restarts, Huber's loss."""
    w, h = job.size
    kind = DoubleSphereModel if "sphere" in variant else KannalaBrandtModel
    seed = seed_from_K(kind, np.array([[0.5 * w, 0, 0.5 * w], [0, 0.5 * w, 0.5 * h], [0, 0, 1]]))
    points, _, pixels = map(list, zip(*job.views(), strict=True))
    seen = [np.ones(len(one), bool) for one in points]
    found = calibrate(seed, points, pixels, seen, loss="huber", f_scale=1.0)
    return {"lens": found["model"], "claimed": {"rms_px": float(found["rms_px"])}}


def project(model, points):
    seen, good = model["lens"].project(points)
    return np.where(np.asarray(good)[:, None], seen, np.nan)


def detect(file, job):
    """Its finder of checkerboards; a corner's point says its column and row."""
    board, grid = job.one_board(), job.grid(0)
    if board["type"] != "checkerboard":
        raise NotImplementedError("its ChArUco boards are of DICT_6X6_1000")
    square = float(board["square"])
    finder = CheckerboardBoard(CheckerboardSpec(*board["corners"], square))
    seen = finder.detect([file])
    here = np.asarray(seen[0].visibility, bool)
    place = np.rint(np.asarray(seen[0].points_3d)[here, :2] / square).astype(int)
    return grid[place[:, 1], place[:, 0]], np.asarray(seen[0].pixels)[here]
