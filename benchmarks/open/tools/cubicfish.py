"""cubicfish, this checkout, by its public names."""

from functools import partial
from pathlib import Path

import cv2
import numpy as np
from job import by_fisheye

from cubicfish import Target, calibrate, load_corners
from cubicfish import detect as detect_all
from cubicfish_cli import export_camera

PACKAGES = ["-e", "{root}[all]"]
VERSION = ["git", "log", "-1", "--format=cubicfish %h of %cs"]
VARIANTS = {"cubicfish": 1, "cubicfish, board as drawn": 1}
EXPORT = "OpenCV's K and D, by `cubicfish export --to opencv`"


def fit(job, variant, start):
    """``cubicfish calibrate corners.csv``; what it prints is what it claims."""
    pairs = load_corners(job.table(), Target.load(job.target))
    found = calibrate(pairs, refine_target="off" if "drawn" in variant else "auto")
    sigma = found.uncertainty(job.spread()[1])
    claimed = {"rms_px": found.errors.rms_px, "uncertainty_px": float(np.nanmedian(sigma))}
    if found.held_out:
        claimed["held_out_px"] = found.held_out.rms_px
    refined = found.as_record()["refine_target"] != "off"
    world = found.target.corners()[3] if refined else None
    return {"found": found, "world": world, "claimed": claimed, "note": str(found.verdict.level)}


def project(model, points):
    return model["found"].camera.project(points, near=True)


def detect(file, job):
    """``cubicfish detect`` of all photos, once: it looks again where its own fit expects more."""
    if (job.path.parent / "table.csv").exists():
        raise NotImplementedError("the one table is what it finds")
    if not hasattr(job, "own"):
        job.own = detect_all([one[1] for one in job.photos], Target.load(job.target)).corners
    seen = job.own.image == job.own.images.index(Path(file).name)
    places = zip(job.own.board[seen], job.own.row[seen], job.own.column[seen], strict=True)
    return [job.grid(board)[row, column] for board, row, column in places], job.own.pixel[seen]


def export(model):
    """The file's lens, as OpenCV reads and projects it."""
    text = export_camera(model["found"], "opencv", max_error=1e9, max_angle_deg=89).text
    store = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    names = ("camera_matrix", "distortion_coefficients")
    return partial(by_fisheye, *(store.getNode(name).mat() for name in names))
