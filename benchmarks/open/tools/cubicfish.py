"""cubicfish, this checkout, by its public names."""

from pathlib import Path

import numpy as np

PACKAGES = ["-e", "{root}[all]"]
VARIANTS = {"cubicfish": 1, "cubicfish, board as drawn": 1}
EXPORT = "OpenCV K, D (cv2.fisheye), by `export --to opencv`"


def fit(job, variant, start):
    """``cubicfish calibrate corners.csv``; what it prints is what it claims."""
    from cubicfish import Target, calibrate, load_corners

    pairs = load_corners(job.table(), Target.load(job.target))
    level = "off" if "drawn" in variant else "auto"
    found = calibrate(pairs, refine_target=level)
    x, y = np.meshgrid(*(np.linspace(0, side - 1, 24) for side in job.size))
    sigma = found.uncertainty(np.stack([x, y], axis=-1))
    held_out = found.held_out.rms_px if found.held_out else None
    claimed = {"rms_px": found.errors.rms_px, "held_out_px": held_out,
               "uncertainty_px": float(np.nanmedian(sigma))}  # fmt: skip
    refined = found.as_record()["refine_target"] != "off"
    world = found.target.corners()[3] if refined else None
    return {"found": found, "world": world, "claimed": claimed, "note": found.verdict.level}


def project(model, points):
    return model["found"].camera.project(points, near=True)


def detect(file, job):
    """``cubicfish detect`` of all photos, once: it looks again where its own fit expects more."""
    if not hasattr(job, "own_table"):
        from cubicfish import Target, save_corners
        from cubicfish import detect as detect_all

        found = detect_all([one[1] for one in job.photos], Target.load(job.target))
        table = job.path.parent / "own.csv"
        table.unlink(missing_ok=True)
        save_corners(table, found.corners)
        job.own_table = job.read(table)
    return job.own_table.get(Path(file).name, (np.zeros(0, int), np.zeros((0, 2))))


def export(model, folder):
    """The lens of OpenCV's file, read and projected by OpenCV."""
    import cv2

    from cubicfish import export_camera

    text = export_camera(model["found"], "opencv", max_error=1e9, max_angle_deg=89).text
    store = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    k, d = (store.getNode(name).mat() for name in ("camera_matrix", "distortion_coefficients"))

    def through(points):
        with np.errstate(all="ignore"):
            seen = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), k, d)[0]
        return np.where(points[:, 2:] > 0, seen[:, 0], np.nan)

    return through
