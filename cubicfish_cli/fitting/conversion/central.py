"""Lens models of other tools that are also fitted as baselines, and Kannala–Brandt's.

Their records hold fx, fy, cx, cy and

- ``kannala_brandt``: ``k`` (4,), r = θ (1 + k1 θ² + ... + k4 θ⁸); maybe ``alpha``, skew / fx, as
  OpenCV's fisheye module has it;
- ``unified``: ``xi`` and ``d`` (4,) k1, k2, p1, p2 of radial-tangential distortion (Mei & Rives);
  maybe ``skew``, pixels, as cv2.omnidir has it;
- ``eucm``: ``alpha``, ``beta``;
- ``double_sphere``: ``xi``, ``alpha``;
- ``fov``: ``omega``, radians;
- ``division``: ``bend``, the ray of (x, y) being (x, y, 1 + bend (x² + y²)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from cubicfish_cli.angles import angle_from_axis
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.baselines.base import BaselineLens
from cubicfish_cli.fitting.baselines.division import DivisionLens
from cubicfish_cli.fitting.baselines.double_sphere import DoubleSphereLens
from cubicfish_cli.fitting.baselines.enhanced_unified import EnhancedUnifiedLens
from cubicfish_cli.fitting.baselines.field_of_view import FieldOfViewLens
from cubicfish_cli.fitting.baselines.unified import UnifiedLens
from cubicfish_cli.fitting.conversion.lens_model import Fit, FloatArray, LensModel, Project
from cubicfish_cli.fitting.lenses import RadialFit
from cubicfish_cli.fitting.poses import cross_matrix
from cubicfish_cli.model.cubic import CubicCamera
from cubicfish_cli.model.lens_record import LensRecord
from cubicfish_cli.model.radial import RadialCamera

CORE = ("fx", "fy", "cx", "cy")
_SKEW = 4  # of UnifiedLens.values: other tools have none


def core(record: LensRecord) -> FloatArray:
    """(4,) fx, fy, cx, cy of a record."""
    return np.array([record.values[key] for key in CORE], float)


def _baseline(kind: type[BaselineLens], values: Sequence[float] | FloatArray) -> BaselineLens:
    return kind(values=np.asarray(values, float), units=np.ones(len(values)))


def _projected(lens: BaselineLens, points: FloatArray) -> FloatArray:
    pixel = lens.project(points)
    return np.where(np.isfinite(pixel), pixel, np.nan)


def _project_kannala_brandt(record: LensRecord, points: FloatArray) -> FloatArray:
    k = np.asarray(record.values["k"], float)
    fx, fy, cx, cy = core(record)
    camera = RadialCamera(image_size=record.image_size, fx=fx, fy=fy, cx=cx, cy=cy, k=k)
    pixel = camera.project(points)
    alpha = float(record.values.get("alpha", 0.0))
    return pixel + np.stack([alpha * fx / fy * (pixel[:, 1] - cy), 0 * pixel[:, 1]], axis=-1)


def _project_unified(record: LensRecord, points: FloatArray) -> FloatArray:
    skew, xi = float(record.values.get("skew", 0.0)), float(record.values["xi"])
    values = [*core(record), skew, xi, *np.asarray(record.values["d"], float)]
    return _projected(_baseline(UnifiedLens, np.array(values, float)), points)


def _shape_projector(kind: type[BaselineLens], names: tuple[str, ...]) -> Project:
    def project(record: LensRecord, points: FloatArray) -> FloatArray:
        values = [*core(record), *(float(record.values[name]) for name in names)]
        return _projected(_baseline(kind, values), points)

    return project


def _fit_kannala_brandt(camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> LensRecord:
    lens = _nearest([RadialFit(values=camera.radial.parameters)], rays, pixel)
    record = {**dict(zip(CORE, lens[:4].tolist(), strict=True)), "k": lens[4:]}
    return LensRecord(model="kannala_brandt", values=record, image_size=camera.image_size)


def _fit_unified(camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> LensRecord:
    lenses = UnifiedLens.starts(camera.radial, float(angle_from_axis(rays).max()))
    values = _nearest(lenses, rays, pixel, fixed=(_SKEW,))
    record = {
        **dict(zip(CORE, values[:4].tolist(), strict=True)),
        "xi": float(values[5]),
        "d": values[6:],
    }
    return LensRecord(model="unified", values=record, image_size=camera.image_size)


def _shape_fitter(model: str, kind: type[BaselineLens], names: tuple[str, ...]) -> Fit:
    def fit(camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> LensRecord:
        lenses = kind.starts(camera.radial, float(angle_from_axis(rays).max()))
        values = _nearest(lenses, rays, pixel)
        place = len(CORE) + names.index("alpha")
        alpha = float(np.clip(values[place], 0.0, _MOST_ALPHA))
        if alpha != values[place]:  # of no lens that others read: the nearest that is
            held = values.copy()
            held[place] = alpha
            values = _nearest([replace(lenses[0], values=held)], rays, pixel, fixed=(place,))
        record = dict(zip((*CORE, *names), values.tolist(), strict=True))
        return LensRecord(model=model, values=record, image_size=camera.image_size)

    return fit


def symmetric_frame(camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> FloatArray:
    """The turn (3, 3) of rays (N, 3) after which a symmetric lens is nearest to their pixels.

    A lens that is decentred or tilted looks most symmetric from an axis of its own, and poses make
    up for the turn.
    """
    start = RadialFit(values=camera.radial.parameters)
    count = len(start.parameters)

    def turned(values: FloatArray) -> tuple[RadialFit, FloatArray]:
        return start.with_parameters(values[:count]), Rotation.from_rotvec(values[count:]).apply(
            rays
        )

    def residual(values: FloatArray) -> FloatArray:
        lens, points = turned(values)
        return np.asarray((lens.project(points) - pixel).reshape(-1))

    def slope(values: FloatArray) -> FloatArray:
        lens, points = turned(values)
        _, by_point, by_values = lens.project_jacobian(points)
        by_turn = -by_point @ cross_matrix(points)  # turns are small: of first order
        return np.concatenate([by_values, by_turn], axis=2).reshape(2 * len(rays), -1)

    first = np.concatenate([start.parameters, np.zeros(3)])
    found = least_squares(residual, first, jac=slope, x_scale="jac", max_nfev=100)
    return np.asarray(Rotation.from_rotvec(found.x[count:]).as_matrix())


def _nearest(
    lenses: Sequence[BaselineLens | RadialFit],
    rays: FloatArray,
    pixel: FloatArray,
    fixed: tuple[int, ...] = (),
) -> FloatArray:
    """Values of the lens nearest to pixels, from the best of several starts."""
    best: tuple[float, FloatArray] | None = None
    for start in lenses:
        free = np.setdiff1d(np.arange(len(start.parameters)), fixed)

        def moved(
            values: FloatArray, start: BaselineLens | RadialFit = start, free: FloatArray = free
        ) -> BaselineLens | RadialFit:
            parameters = start.parameters.copy()
            parameters[free] = values
            return start.with_parameters(parameters)

        def residual(values: FloatArray, moved: object = moved) -> FloatArray:
            miss = moved(values).project(rays) - pixel  # type: ignore[operator]
            # A step to a lens that does not see all rays is turned down by its cost.
            return np.where(np.isfinite(miss), miss, _BLIND_PX).reshape(-1)

        def slope(values: FloatArray, moved: object = moved, free: FloatArray = free) -> FloatArray:
            _, _, by_values = moved(values).project_jacobian(rays)  # type: ignore[operator]
            return np.nan_to_num(by_values[:, :, free]).reshape(2 * len(rays), -1)

        first = start.parameters[free]
        with np.errstate(all="ignore"):
            found = least_squares(residual, first, jac=slope, x_scale="jac", max_nfev=200)
        if best is None or found.cost < best[0]:
            lens = moved(found.x)
            best = (found.cost, lens.values)
    if best is None or not np.isfinite(best[1]).all():
        raise FitError("no lens of this model is near the camera: choose another format")
    return best[1]


# Other programs read an α from 0 on and below 1.
_MOST_ALPHA = 0.9999
# What a ray that a lens does not see counts for.
_BLIND_PX = 1e4

MODELS = (
    LensModel(name="kannala_brandt", project=_project_kannala_brandt, fit=_fit_kannala_brandt),
    LensModel(name="unified", project=_project_unified, fit=_fit_unified),
    LensModel(
        name="eucm",
        project=_shape_projector(EnhancedUnifiedLens, ("alpha", "beta")),
        fit=_shape_fitter("eucm", EnhancedUnifiedLens, ("alpha", "beta")),
    ),
    LensModel(
        name="double_sphere",
        project=_shape_projector(DoubleSphereLens, ("xi", "alpha")),
        fit=_shape_fitter("double_sphere", DoubleSphereLens, ("xi", "alpha")),
    ),
    LensModel(name="fov", project=_shape_projector(FieldOfViewLens, ("omega",))),
    LensModel(name="division", project=_shape_projector(DivisionLens, ("bend",))),
)
