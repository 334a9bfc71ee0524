"""Fisheye lenses with tangential and thin-prism terms, as COLMAP has them (sensor/models.h).

A point at the angle θ from the axis is first (u, v), θ along its azimuth. With ρ² = x² + y²,

    T(x, y) = (t1 (ρ² + 2x²) + 2 t2 x y + s1 ρ² + s2 ρ⁴,
               t2 (ρ² + 2y²) + 2 t1 x y + s3 ρ² + s4 ρ⁴),

and (a, b) = (1 + k1 θ² + k2 θ⁴ + ...) (u, v), the pixel is f · ((a, b) + T) + c where

- ``thin_prism_fisheye`` (THIN_PRISM_FISHEYE) has T of (u, v), k1..k4, s2 = s4 = 0;
- ``rad_tan_thin_prism_fisheye`` (RAD_TAN_THIN_PRISM_FISHEYE, Project Aria's Fisheye624) has T of
  (a, b), k1..k6.

T follows a tilted axis too, so these lenses keep the camera's own frame.

Records hold ``fx``, ``fy``, ``cx``, ``cy``, ``k`` (4,) or (6,), ``t`` (2,) and ``s`` (4,).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from cubicfish_cli.angles import columns
from cubicfish_cli.fitting.conversion.central import CORE, core
from cubicfish_cli.fitting.conversion.lens_model import Fit, FloatArray, LensModel, Project
from cubicfish_cli.model.cubic import CubicCamera
from cubicfish_cli.model.lens_record import LensRecord

# Profiles are looked through for a fold in such steps.
_STEP_RAD = np.deg2rad(0.05)


def _fisheye(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(u, v) (N, 2) and θ (N,) of camera-frame points; NaN straight behind, where none is told."""
    x, y, z = columns(points)
    rho = np.hypot(x, y)
    theta = np.arctan2(rho, z)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(rho > 0, theta / rho, np.where(z > 0, 0.0, np.nan))
        return points[:, :2] * scale[:, None], theta


def _fold_rad(k: FloatArray) -> float:
    """The angle up to which the radial part grows, at most π."""
    theta = np.arange(0, np.pi, _STEP_RAD)
    slope = np.ones_like(theta)
    for index, value in enumerate(k, start=1):
        slope += (2 * index + 1) * value * theta ** (2 * index)
    falls = np.flatnonzero(slope <= 0)
    return float(theta[max(falls[0] - 1, 0)]) if falls.size else float(np.pi)


def _terms(xy: FloatArray) -> FloatArray:
    """T = _terms @ (t1, t2, s1, s2, s3, s4): (N, 2, 6)."""
    x, y = xy.T
    square = x * x + y * y
    terms = np.zeros((len(xy), 2, 6))
    terms[:, 0, 0] = square + 2 * x * x
    terms[:, 0, 1] = terms[:, 1, 0] = 2 * x * y
    terms[:, 1, 1] = square + 2 * y * y
    terms[:, 0, 2] = terms[:, 1, 4] = square
    terms[:, 0, 3] = terms[:, 1, 5] = square * square
    return terms


def _terms_slope(xy: FloatArray, shape: FloatArray) -> FloatArray:
    """dT/d(x, y) for the six values of T: (N, 2, 2)."""
    x, y = xy.T
    t1, t2, s1, s2, s3, s4 = shape
    square = x * x + y * y
    slope = np.empty((len(xy), 2, 2))
    slope[:, 0, 0] = 6 * t1 * x + 2 * t2 * y + 2 * x * (s1 + 2 * s2 * square)
    slope[:, 0, 1] = 2 * t1 * y + 2 * t2 * x + 2 * y * (s1 + 2 * s2 * square)
    slope[:, 1, 0] = 2 * t2 * x + 2 * t1 * y + 2 * x * (s3 + 2 * s4 * square)
    slope[:, 1, 1] = 6 * t2 * y + 2 * t1 * x + 2 * y * (s3 + 2 * s4 * square)
    return slope


def _bent(
    uv: FloatArray, k: FloatArray, shape: FloatArray, *, of_bent: bool
) -> tuple[FloatArray, FloatArray]:
    """Where (u, v) go (N, 2), and the derivatives by k and by the six values of T (N, 2, K + 6)."""
    powers = (uv**2).sum(axis=1)[:, None] ** np.arange(1, len(k) + 1)
    radial = uv * (1 + powers @ k)[:, None]
    by_k = uv[:, :, None] * powers[:, None, :]
    base = radial if of_bent else uv
    terms = _terms(base)
    if of_bent:
        by_k = by_k + _terms_slope(base, shape) @ by_k
    return radial + terms @ shape, np.concatenate([by_k, terms], axis=2)


def _projector(of_bent: bool) -> Project:
    def project(record: LensRecord, points: FloatArray) -> FloatArray:
        k = np.asarray(record.values["k"], float)
        shape = np.concatenate([record.values["t"], record.values["s"]])
        fx, fy, cx, cy = core(record)
        uv, theta = _fisheye(points)
        with np.errstate(over="ignore", invalid="ignore"):
            pixel = _bent(uv, k, shape, of_bent=of_bent)[0] * [fx, fy] + [cx, cy]
        seen = (theta <= _fold_rad(k)) & np.isfinite(pixel).all(axis=1)
        return np.where(seen[:, None], pixel, np.nan)

    return project


def _fitter(model: str, count: int, free: tuple[int, ...], of_bent: bool) -> Fit:
    """A fit of fx, fy, cx, cy, ``count`` radial values and those of T's six that are free."""

    def fit(camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> LensRecord:
        uv = _fisheye(rays)[0]
        radial = camera.radial
        unit = np.ones(4 + count + len(free))
        unit[:4] = radial.fx
        start = np.zeros(len(unit))
        start[:8] = radial.parameters[: min(8, len(unit))]
        chosen = [*range(count), *(count + index for index in free)]

        def split(values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            values = values * unit
            shape = np.zeros(6)
            shape[list(free)] = values[4 + count :]
            return values[:4], values[4 : 4 + count], shape

        def residual(values: FloatArray) -> FloatArray:
            lens, k, shape = split(values)
            return np.asarray(
                (_bent(uv, k, shape, of_bent=of_bent)[0] * lens[:2] + lens[2:] - pixel).ravel()
            )

        def slope(values: FloatArray) -> FloatArray:
            lens, k, shape = split(values)
            bent, by_shape = _bent(uv, k, shape, of_bent=of_bent)
            by_values = np.zeros((len(uv), 2, len(unit)))
            by_values[:, 0, 0], by_values[:, 1, 1] = bent.T
            by_values[:, 0, 2] = by_values[:, 1, 3] = 1
            by_values[:, :, 4:] = lens[:2, None] * by_shape[:, :, chosen]
            return np.asarray((by_values * unit).reshape(2 * len(uv), -1))

        found = least_squares(residual, start / unit, jac=slope, x_scale="jac", max_nfev=200)
        lens, k, shape = split(found.x)
        values = {**dict(zip(CORE, lens.tolist(), strict=True)), "k": k}
        values |= {"t": shape[:2], "s": shape[2:]}
        return LensRecord(model=model, values=values, image_size=camera.image_size)

    return fit


MODELS = (
    LensModel(
        name="thin_prism_fisheye",
        symmetric=False,
        project=_projector(of_bent=False),
        fit=_fitter("thin_prism_fisheye", 4, (0, 1, 2, 4), of_bent=False),
    ),
    LensModel(
        name="rad_tan_thin_prism_fisheye",
        symmetric=False,
        project=_projector(of_bent=True),
        fit=_fitter("rad_tan_thin_prism_fisheye", 6, (0, 1, 2, 3, 4, 5), of_bent=True),
    ),
)
