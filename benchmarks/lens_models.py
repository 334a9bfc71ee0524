"""Other lens models on the corners of a calibration: the same loss, the same folds.

Beside those that formats of other tools hold there are two here that no format needs:

- ``division`` (Fitzgibbon 2001): the ray of (x, y) is (x, y, 1 + λ(x² + y²));
- ``fov``, the field-of-view model (Devernay & Faugeras 2001): r = atan(2 tan θ tan(ω/2)) / ω.

Written with rays, and with the arc tangent of two arguments, both hold beyond 180° too.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any, Self, TypeVar

import numpy as np

from cubicfish import Calibration, FitError, FloatArray, Observations, Target
from cubicfish.fit.cubic_fit import fit_cubic
from cubicfish.fit.folds import folds_of
from cubicfish.fit.nearest_cubic import MARGIN_DEG, cone_angle
from cubicfish.fit.prior import Prior, choose_prior
from cubicfish.fit.radial_reference import RadialReference, radial_near, refit_radial
from cubicfish.models import FocalLens, FormulaLens, RadialCamera, angle_from_axis, cone_rays
from cubicfish.models.formula_lens import usable_angle_deg
from cubicfish.solve import Poses, nearest_lens, rms_px
from cubicfish.solve.adjustment import Adjustment, adjust
from cubicfish.solve.fit_lens import FitLens, FixedLens, FreeLens
from cubicfish.solve.statistics import wide_px
from cubicfish.solve.subset import select, select_photos, world_scale
from cubicfish.threads import one_blas_thread
from cubicfish_cli.extensions.formats.lenses import DoubleSphereLens, UnifiedLens
from cubicfish_cli.extensions.formats.ocamcalib import ScaramuzzaLens

L = TypeVar("L", bound=FormulaLens)
F = TypeVar("F", bound=FitLens)

CUBIC = "cubic"
# Free numbers of the cubic: 3 x 16 on the sphere, less the scale and the frame's rotation.
_CUBIC_PARAMETERS = 44
_START_RAYS = 400
_LOST_PX = 1e3
# Below this share of ρ in |X| the limit on the axis replaces quotients that are 0/0 there.
_NEAR_AXIS = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class SymmetricLens(FocalLens):
    """An axially symmetric lens: its shape's parameters come after fx, fy, cx, cy."""

    def scale(self, points: FloatArray) -> FloatArray:
        """The model itself: s (N,) of camera-frame points (N, 3) with (x, y) = s · (X, Y).

        Not finite where the lens sees nothing.
        """
        raise NotImplementedError

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            scale = self.scale(points)[:, None]
            pixel = points[:, :2] * scale * [self.fx, self.fy] + [self.cx, self.cy]
        return np.where(np.isfinite(scale), pixel, np.inf)


@dataclass(frozen=True, kw_only=True, eq=False)
class DivisionLens(SymmetricLens):
    """The shape's parameter ``bend`` is λ."""

    name = "division"
    label = "division"

    bend: float

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """λ = −1/4 is the stereographic lens."""
        return (cls.near(radial, bend=-0.25),)

    def scale(self, points: FloatArray) -> FloatArray:
        """The s that solves λρ²s² − Zs + 1 = 0: the root that is 1/Z on the axis."""
        z = points[:, 2]
        rho_squared = np.sum(points[:, :2] ** 2, axis=1)
        root = np.sqrt(z * z - 4 * self.bend * rho_squared)
        # Where Z < 0 the two terms cancel: the other form of the same root is exact there.
        value = np.where(z > 0, 2 / (z + root), (z - root) / (2 * self.bend * rho_squared))
        return np.where(value > 0, value, np.inf)


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldOfViewLens(SymmetricLens):
    """The shape's parameter ``omega`` is ω in radians."""

    name = "fov"
    label = "field of view"

    omega: float

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """2 tan(ω/2) = 1 makes it the equidistant lens."""
        omega = 2 * np.arctan(0.5)
        return (cls.near(radial, stretch=omega, omega=omega),)

    def scale(self, points: FloatArray) -> FloatArray:
        """The profile over ρ: s = atan2(aρ, Z) / (ωρ) with a = 2 tan(ω/2)."""
        omega = self.omega
        if not 0 < omega < np.pi:
            return np.full(len(points), np.inf)
        a = 2 * np.tan(omega / 2)
        x, y, z = np.moveaxis(np.asarray(points, float), -1, 0).copy()
        rho = np.hypot(x, y)
        axis = (rho < _NEAR_AXIS * np.abs(z)) & (z > 0)
        value = np.where(axis, a / z, np.arctan2(a * rho, z) / np.where(axis, 1, rho)) / omega
        return np.where((z != 0) | (rho > 0), value, np.inf)


COMPARED = (DivisionLens, FieldOfViewLens, ScaramuzzaLens, UnifiedLens, DoubleSphereLens)


@dataclass(frozen=True, kw_only=True)
class ModelFigures:
    """How one lens model did.

    Attributes:
        model: its name.
        parameters: how many numbers of the lens are free, poses not counted.
        rms_px: reprojection error over all corners; None when the model could not be fitted.
        held_out_rms_px: the same over photos that took no part; None when not measured, or
            when a fold could not be fitted.
        largest_angle_deg: how far from its axis the fitted model is still a camera: every
            pixel finite, the picture neither folded nor mirrored.
        seconds: for the fit to all photos, from the common start.

    """

    model: str
    parameters: int
    rms_px: float | None = None
    held_out_rms_px: float | None = None
    largest_angle_deg: float | None = None
    seconds: float

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fold:
    """Photos to learn from, and corners of the others to be judged on."""

    reference: RadialReference
    left_out: Observations
    poses: Poses


# From a reference to a fitted lens.
_Fit = Callable[[RadialReference], tuple[FitLens, FloatArray]]


@one_blas_thread()
def compare_models(
    calibration: Calibration, *, drawn: Target | None = None, hold_out: bool = True
) -> list[ModelFigures]:
    """Fit every lens model to the corners that a calibration used, the cubic among them.

    Each starts at the radial reference: first the model is fitted to the reference's pixels on
    the covered cone, then lens and poses are adjusted jointly. The Huber loss follows the noise
    of each model's own residuals by one rule. Held-out errors count the corners within the
    cubic's cone, the same ones for every model.

    Args:
        calibration: the fit of the cubic camera.
        drawn: the target as drawn. A target that was refined was so with the cubic's help and
            on all photos; needed where it was, and every model is then fitted to the drawing.
        hold_out: also measure the held-out error (five more fits per model).

    Returns:
        One row per model: the cubic, Kannala–Brandt, then :data:`COMPARED`.

    """
    pairs = calibration.pairs
    if drawn is not None and calibration.refined != "off":
        pairs = pairs.with_world(drawn.world_points(pairs.board, pairs.column, pairs.row))
    reference, prior = _reference(calibration, pairs), calibration.prior
    if pairs is not calibration.pairs:
        prior = choose_prior(reference, folds_of(reference)).prior
    folds = _folds(reference) if hold_out else []
    known = calibration.held_out if pairs is calibration.pairs and folds else None
    rows = [
        _figures(
            CUBIC, _CUBIC_PARAMETERS, partial(_fit_cubic, prior), reference, () if known else folds
        ),
        _figures(RadialCamera.label, 4 + reference.terms, _fit_radial, reference, folds),
    ]
    if known is not None:  # one thing has one figure, and that of the fit is known
        rows[0] = replace(rows[0], rms_px=calibration.fit.rms_px, held_out_rms_px=known.rms_px)
    camera = calibration.camera
    rows[0] = replace(
        rows[0],
        largest_angle_deg=float(min(rows[0].largest_angle_deg or np.inf, camera.max_angle_deg)),
    )
    for kind in COMPARED:
        start = FreeLens.of(kind.starts(reference.camera, reference.covered)[0])
        rows.append(
            _figures(kind.label, len(start.parameters), partial(_fit_model, kind), reference, folds)
        )
    return rows


def _reference(calibration: Calibration, pairs: Observations) -> RadialReference:
    """The reference of the corners that were used, adjusted to just these."""
    scale = world_scale(pairs)
    pairs = pairs.with_world(pairs.world / scale)
    poses = calibration.poses.scaled(1 / scale)
    camera = calibration.camera.radial
    return radial_near(camera, pairs, poses)


def _folds(reference: RadialReference) -> list[_Fold]:
    """The same folds as :func:`cubicfish.fit.held_out.held_out_error`."""
    pairs = reference.pairs
    photos = np.arange(len(pairs.images))
    folds = []
    for test in folds_of(reference):
        train = np.setdiff1d(photos, test)
        fitted = refit_radial(reference, select_photos(pairs, train), reference.poses[train])
        cone = cone_angle(fitted.camera, fitted.covered, MARGIN_DEG)
        left_out, poses = select_photos(pairs, test), reference.poses[test]
        inside = angle_from_axis(poses.apply(left_out.image, left_out.world)) <= cone
        counted, kept = select(left_out, inside)
        folds.append(_Fold(reference=fitted, left_out=counted, poses=poses[kept]))
    return folds


def _figures(
    name: str,
    parameters: int,
    fit: _Fit,
    reference: RadialReference,
    folds: Sequence[_Fold],
) -> ModelFigures:
    begun = time.perf_counter()
    figures = ModelFigures(model=name, parameters=parameters, seconds=0.0)
    try:
        lens, residual = fit(reference)
    except FitError:
        return replace(figures, seconds=time.perf_counter() - begun)
    return replace(
        figures,
        seconds=time.perf_counter() - begun,
        rms_px=rms_px(residual),
        held_out_rms_px=_held_out(fit, folds),
        largest_angle_deg=usable_angle_deg(lambda rays: lens.pixel_and_slopes(rays)[:2]),
    )


def _held_out(fit: _Fit, folds: Sequence[_Fold]) -> float | None:
    residuals = []
    for fold in folds:
        try:
            lens, _ = fit(fold.reference)
            frozen = FixedLens(camera=lens)
            judged = adjust(frozen, fold.poses, fold.left_out, huber_px=10.0)
            judged = judged.again(fold.left_out).again(fold.left_out)
        except FitError:
            return None
        residuals.append(judged.residual)
    return rms_px(np.vstack(residuals)) if residuals else None


def _adjusted(lens: F, poses: Poses, pairs: Observations, limit: float) -> Adjustment[F]:
    """Adjust with a loss that then follows the residuals."""
    return adjust(lens, poses, pairs, huber_px=limit).again(pairs)


def _fit_cubic(prior: Prior, reference: RadialReference) -> tuple[FitLens, FloatArray]:
    result = fit_cubic(reference, prior)
    return result.lens, result.residual


def _fit_radial(reference: RadialReference) -> tuple[FitLens, FloatArray]:
    fit = _adjusted(reference.lens, reference.poses, reference.pairs, wide_px(reference.residual))
    return fit.lens, fit.residual


def _fit_model(kind: type[FormulaLens], reference: RadialReference) -> tuple[FitLens, FloatArray]:
    lens = FreeLens.of(near_reference(kind, reference))
    poses, pairs = reference.poses, reference.pairs
    seen = lens.project(poses.apply(pairs.image, pairs.world))
    with np.errstate(invalid="ignore"):
        miss = np.nan_to_num(seen - pairs.pixel, nan=1e6, posinf=1e6, neginf=-1e6)
    fitted = _adjusted(lens, poses, pairs, max(wide_px(miss), wide_px(reference.residual)))
    return fitted.lens, fitted.residual


def near_reference(kind: type[L], reference: RadialReference) -> L:
    """The lens of a kind that agrees best with the reference's pixels on the covered cone.

    Raises:
        FitError: the model cannot see that cone at all.

    """
    camera = reference.camera
    rays = cone_rays(reference.covered, _START_RAYS)
    wanted = camera.project(rays)
    rays, wanted = rays[np.isfinite(wanted[:, 0])], wanted[np.isfinite(wanted[:, 0])]
    starts = [
        start
        for start in kind.starts(camera, reference.covered)
        if np.isfinite(start.pixels(rays)).all()
    ]
    if not starts:
        raise FitError(
            f"the {kind.label} model does not reach {np.rad2deg(reference.covered):.0f}°"
        )
    return nearest_lens(starts, rays, wanted)
