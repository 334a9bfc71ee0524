"""cubicfish, this checkout, by its public names."""

import os
from pathlib import Path

import cv2
import numpy as np
from job import read_table

from cubicfish import Target, calibrate, load_corners, save_corners
from cubicfish import detect as detect_all
from cubicfish_cli import export_camera

PACKAGES = ["-e", "{root}[all]"]
VARIANTS = {"cubicfish": 1, "cubicfish, board as drawn": 1}
EXPORT = "OpenCV's K and D, by `cubicfish export --to opencv`"


def fit(job, variant, start):
    """``cubicfish calibrate corners.csv``; what it prints is what it claims."""
    pairs = load_corners(job.table(), Target.load(job.target))
    found = calibrate(pairs, refine_target="off" if "drawn" in variant else "auto")
    x, y = np.meshgrid(*(np.linspace(0, side - 1, 24) for side in job.size))
    sigma = found.uncertainty(np.stack([x, y], axis=-1))
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
    if not hasattr(job, "own"):
        table = job.path.parent / "table.csv"  # there if cubicfish made the table for all
        if not table.exists():
            table = table.with_name(f"own_{os.getpid()}.csv")
            photos = [one[1] for one in job.photos]
            save_corners(table, detect_all(photos, Target.load(job.target)).corners)
        grids = [job.grid(board) for board in range(len(job.boards))]
        job.own = read_table(table, [board["name"] for board in job.boards], grids)[1]
    return job.own.get(Path(file).name, (np.zeros(0, int), np.zeros((0, 2))))


def export(model):
    """The file's lens, as OpenCV reads and projects it."""
    text = export_camera(model["found"], "opencv", max_error=1e9, max_angle_deg=89).text
    store = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    k, d = (store.getNode(name).mat() for name in ("camera_matrix", "distortion_coefficients"))

    def through(points):
        with np.errstate(all="ignore"):
            seen = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), k, d)[0]
        return np.where(points[:, 2:] > 0, seen[:, 0], np.nan)

    return through
