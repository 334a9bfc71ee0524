"""NVIDIA's f-theta lens: the angle from the axis as a polynomial of the distance in the picture.

Records ``ftheta`` hold cx, cy, ``polynomial`` (6,) of θ = k0 + k1 r + ... + k5 r⁵ in radians and
pixels, and ``linear`` (3,) c, d, e: a ray at r and azimuth φ is seen at (cx, cy) + [[c, d], [e, 1]]
r (cos φ, sin φ).
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import polynomial
from scipy.optimize import least_squares

from cubicfish_cli.angles import angle_from_axis, unit_rays
from cubicfish_cli.fitting.conversion.lens_model import FloatArray, LensModel
from cubicfish_cli.model.cubic import CubicCamera
from cubicfish_cli.model.lens_record import LensRecord

_ROUNDS = 30
_TOLERANCE = 1e-9  # radians


def _matrix(linear: FloatArray) -> FloatArray:
    c, d, e = linear
    return np.array([[c, d], [e, 1.0]])


def _project(record: LensRecord, points: FloatArray) -> FloatArray:
    k = np.asarray(record.values["polynomial"], float)
    theta = angle_from_axis(points)
    slope = polynomial.polyder(k)
    r = (theta - k[0]) / k[1]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(_ROUNDS):  # Newton's, each step no longer than half the way
            step = (polynomial.polyval(r, k) - theta) / polynomial.polyval(r, slope)
            r = r - np.clip(step, -0.5 * r - 1, 0.5 * r + 1)
        found = np.abs(polynomial.polyval(r, k) - theta) < _TOLERANCE
        found &= (polynomial.polyval(r, slope) > 0) & (r > -1)
        across = np.hypot(points[:, 0], points[:, 1])
        way = np.where(across[:, None] > 0, points[:, :2] / across[:, None], 0.0)
    pixel = (way * r[:, None]) @ _matrix(np.asarray(record.values["linear"], float)).T
    pixel += [float(record.values["cx"]), float(record.values["cy"])]
    return np.where(found[:, None], pixel, np.nan)


def _fit(camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> LensRecord:
    """By angles between rays, which needs no inverse; times the focal length they are pixels."""
    radial = camera.radial
    rays = unit_rays(rays)
    focal = 0.5 * (radial.fx + radial.fy)

    def residual(values: FloatArray) -> FloatArray:
        centre, k, linear = values[:2], values[2:7], values[7:]
        offset = (pixel - centre) @ np.linalg.inv(_matrix(linear)).T
        r = np.hypot(offset[:, 0], offset[:, 1])
        theta = polynomial.polyval(r / focal, np.concatenate([[0.0], k]))
        way = offset / np.maximum(r, 1e-300)[:, None]
        seen = np.column_stack([np.sin(theta)[:, None] * way, np.cos(theta)])
        return np.asarray((focal * (seen - rays)).ravel())

    start = np.array([radial.cx, radial.cy, 1.0, 0, 0, 0, 0, radial.fx / radial.fy, 0, 0])
    found = least_squares(residual, start, x_scale="jac", max_nfev=200).x
    scaled = found[2:7] / focal ** np.arange(1, 6)
    values = {
        "cx": float(found[0]),
        "cy": float(found[1]),
        "polynomial": np.concatenate([[0.0], scaled]),
        "linear": found[7:],
    }
    return LensRecord(model="ftheta", values=values, image_size=camera.image_size)


MODEL = LensModel(name="ftheta", project=_project, fit=_fit)
