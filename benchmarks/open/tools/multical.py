"""multical of PyPI: its fisheye camera, with the versions of OpenCV and numpy that it needs."""

import numpy as np
from multical.camera_fisheye import CameraFisheye
from structs.struct import struct

PACKAGES = ["multical==0.4.0", "opencv-contrib-python==4.6.0.66", "numpy<2"]
VARIANTS = {"multical fisheye": 1}
EXPORT = "its own K and D, without loss"


def fit(job, variant, start):
    """Its call for the intrinsics of one camera, criteria as they are by default."""
    points = np.column_stack([job.local, 0 * job.local[:, 0]])
    board = struct(points=points, has_min_detections=lambda found: len(found.ids) >= 6)
    detections = [[struct(ids=point, corners=pixel)] for _, point, pixel in job.views()]
    lens, rms = CameraFisheye.calibrate([board], detections, job.size)
    return {"lens": lens, "claimed": {"rms_px": float(rms)}}


def project(model, points):
    with np.errstate(all="ignore"):
        seen = model["lens"].project(np.ascontiguousarray(points, float))
    return np.where(points[:, 2:] > 0, seen, np.nan)
