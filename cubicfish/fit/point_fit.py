"""Fitting the ``point`` lift: P on the points themselves, as the paper's experiments do.

One photo: in the world frame, without any pose. Several: in the camera frame, with the poses
that the radial reference found.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from cubicfish.errors import FitError
from cubicfish.fit.calibrate import MIN_PAIRS
from cubicfish.fit.folds import photo_folds
from cubicfish.fit.nearest_cubic import ROUNDS, linear_ratios
from cubicfish.fit.radial_reference import fit_radial, refit_radial
from cubicfish.io.camera_yaml import CameraRecord
from cubicfish.judge.finding import Finding
from cubicfish.judge.fit_record import FitRecord, PhotoRecord
from cubicfish.models.lift import lift
from cubicfish.models.point import PointCamera
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import (
    error_statistics,
    gross_px,
    huber_px,
    photo_records,
    rms_px,
)
from cubicfish.solve.subset import select, world_scale
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.threads import one_blas_thread
from cubicfish.types import FloatArray

# Singular values of Φ below this share of the largest are rounding and print errors, not a view.
RANK_TOLERANCE = 1e-6
# Pulls of P3Φ towards 1 that are tried until no corner lies behind a pole.
_PULLS = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0)
_MAX_STEPS = 300
_DROP_ROUNDS = 3
# Corners at the very edge of the volume must stay inside when they are read back from text.
_EXTENT_SLACK = 1.001


@dataclass(frozen=True, kw_only=True, eq=False)
class RatioFit:
    """P on given points, at the paper's three stages.

    Attributes:
        plain: (3, 20) the linear solution of Eq. 8–9.
        reweighted: (3, 20) the same with each equation over its denominator.
        refined: (3, 20) after Levenberg–Marquardt on Eq. 10.
        null: (20 − rank of Φ, 20) orthonormal cubics that vanish on the points.

    """

    plain: FloatArray
    reweighted: FloatArray
    refined: FloatArray
    null: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PointCalibration(CameraRecord):
    """A fitted ``point`` camera and how well it fits.

    Attributes:
        camera: the camera.
        pairs: the pairs that were used.
        poses: camera_from_world of each photo, from the radial reference; None with one photo
            whose pose was not needed.
        residual: (N, 2) projection less pixel, pixels.
        target: the nominal calibration target; None of pairs.

    """

    camera: PointCamera
    pairs: Observations
    poses: Poses | None
    residual: FloatArray
    target: Target | None = None

    @property
    def unfit(self) -> Mapping[str, Finding]:
        """Photos that were left out, with the reason."""
        return self.fit.unfit_images


@one_blas_thread()
def calibrate_points(pairs: Observations, *, hold_out: bool = True) -> PointCalibration:
    """Fit the ``point`` lift to 2D-3D pairs.

    Args:
        pairs: of one photo (world frame), or of several (camera frame, poses from the radial
            reference).
        hold_out: also measure the held-out error (five more fits), with three photos or more.

    Raises:
        FitError: the pairs are too few, the photos cannot be placed, or no P without a pole among
            the corners was found.

    """
    used, poses, unfit = (pairs, None, {}) if len(pairs.images) == 1 else _place_photos(pairs)
    given = int(np.isin(pairs.image, [*map(pairs.images.index, unfit)], invert=True).sum())
    camera, stages, residual = _fit(used, poses)
    for _ in range(_DROP_ROUNDS):
        near = np.hypot(*residual.T) <= gross_px(residual)
        if near.all():
            break
        used, photos = select(used, near)
        poses = poses[photos] if poses is not None else None
        camera, stages, residual = _fit(used, poses)
    errors = error_statistics(residual)
    return PointCalibration(
        camera=camera,
        pairs=used,
        poses=poses,
        residual=residual,
        fit=FitRecord(
            **vars(errors),
            images=len(used.images),
            held_out_rms_px=_measure_held_out(used, poses) if hold_out and poses else np.nan,
            lift="point",
            frame=camera.frame,
            rank=camera.rank,
            plain_rms_px=stages[0],
            reweighted_rms_px=stages[1],
            dropped=given - len(used.pixel),
            unfit_images=unfit,
            per_image=(PhotoRecord(image=used.images[0], **vars(errors)),)
            if poses is None
            else photo_records(used, residual, poses),
        ),
        target=pairs.target,
    )


def _measure_held_out(pairs: Observations, poses: Poses) -> float:
    """Return the RMS over corners of left-out photos, in the folds of the ``ray`` lift."""
    residuals = [np.zeros((0, 2))]
    for fold in photo_folds(poses, pairs, max(pairs.image_size) / np.pi):
        left_out = np.isin(pairs.image, fold)
        train, photos = select(pairs, ~left_out)
        try:
            camera, _, _ = _fit(train, poses[photos])
        except FitError:
            return np.nan
        points = poses.apply(pairs.image[left_out], pairs.world[left_out])
        residuals.append(camera.project(points) - pairs.pixel[left_out])
    residual = np.vstack(residuals)
    # Beyond the volume of the training corners there is no answer to judge.
    judged = residual[np.isfinite(residual[:, 0])]
    return rms_px(judged) if len(judged) else np.nan


def _place_photos(pairs: Observations) -> tuple[Observations, Poses, dict[str, Finding]]:
    """Return the pairs that fit a radial lens, their poses, and the photos that do not fit."""
    scale = world_scale(pairs)
    reference = fit_radial(pairs.with_world(pairs.world / scale))
    near = np.hypot(*reference.residual.T) <= gross_px(reference.residual)
    kept, photos = select(reference.pairs, near)
    reference = refit_radial(reference, kept, reference.poses[photos])
    used = reference.pairs.with_world(reference.pairs.world * scale)
    return used, reference.poses.scaled(scale), reference.unfit


def _fit(
    pairs: Observations, poses: Poses | None
) -> tuple[PointCamera, tuple[float, float], FloatArray]:
    """Return the camera, the RMS of both linear solutions, and the residual (N, 2), pixels."""
    points = pairs.world if poses is None else poses.apply(pairs.image, pairs.world)
    offset = points.mean(axis=0)
    scale = float(np.sqrt(np.mean(np.square(points - offset)))) or 1.0
    local = (points - offset) / scale
    fit = fit_ratio(local, pairs.pixel)
    camera = PointCamera(
        image_size=pairs.image_size,
        P=fit.refined,
        frame="world" if poses is None else "camera",
        offset=offset,
        scale=scale,
        null=fit.null,
        extent=float(_EXTENT_SLACK * np.linalg.norm(local, axis=1).max()),
        valid=pairs.pixel[ConvexHull(pairs.pixel).vertices],
    )
    values = lift(local)
    linear = [rms_px(ratio(P, values) - pairs.pixel) for P in (fit.plain, fit.reweighted)]
    return camera, (linear[0], linear[1]), ratio(fit.refined, values) - pairs.pixel


def fit_ratio(local: FloatArray, pixel: FloatArray) -> RatioFit:
    """Fit P (3, 20) to points by Eq. 8–9, plain and reweighted, and by Eq. 10.

    All three are solved in the numerical row space of Φ: points on few planes leave cubics that
    vanish on every one of them, and the smallest singular vector of the whole system would consist
    of those.

    Args:
        local: (N, 3) points of order 1 about 0.
        pixel: (N, 2).

    Raises:
        FitError: the points are too few, or every P has a pole among them.

    """
    if len(local) < MIN_PAIRS:
        raise FitError(
            f"{len(local)} corners are too few for the point lift: at least {MIN_PAIRS} are needed "
            "(and some hundreds to be good)"
        )
    lifted = lift(local)
    _, size, right = np.linalg.svd(lifted, full_matrices=True)
    rank = int(np.sum(size > RANK_TOLERANCE * size[0]))
    basis, null = right[:rank].T, right[rank:]
    values = lifted @ basis
    centre = pixel.mean(axis=0)
    scale = float(np.sqrt(np.mean(np.square(pixel - centre)))) or 1.0
    target = (pixel - centre) / scale
    to_pixels = np.array([[scale, 0, centre[0]], [0, scale, centre[1]], [0, 0, 1]])

    def as_P(coefficients: FloatArray) -> FloatArray:
        P = to_pixels @ coefficients @ basis.T
        return P / np.linalg.norm(P)

    plain = linear_ratios(values, target, denominator_pull=0, rounds=0)
    reweighted = _solve_without_pole(values, target)
    return RatioFit(
        plain=as_P(plain),
        reweighted=as_P(reweighted),
        refined=as_P(_refine(values, target, reweighted, scale)),
        null=null,
    )


def _solve_without_pole(values: FloatArray, pixel: FloatArray) -> FloatArray:
    """Return the reweighted linear solution, damped until no point lies behind a pole."""
    for pull in _PULLS:
        coefficients = linear_ratios(values, pixel, denominator_pull=pull, rounds=ROUNDS)
        if (values @ coefficients[2] > 0).all():
            return coefficients
    raise FitError(
        "no ratio of cubics without a pole among the corners was found: check that the corners "
        "are named rightly, or use lift 'ray'"
    )


def _refine(values: FloatArray, pixel: FloatArray, start: FloatArray, scale: float) -> FloatArray:
    """Refine P by Levenberg–Marquardt on Eq. 10, in the basis of ``values``, at about scale 1."""
    from scipy.optimize import least_squares  # it takes long to load, and is seldom needed

    rank = values.shape[1]

    def residual(parameters: FloatArray) -> FloatArray:
        return scale * (ratio(parameters.reshape(3, rank), values) - pixel).ravel()

    def slope(parameters: FloatArray) -> FloatArray:
        coefficients = parameters.reshape(3, rank)
        share = scale * values / (values @ coefficients[2])[:, None]
        jacobian = np.zeros((len(values), 2, 3 * rank))
        jacobian[:, 0, :rank] = jacobian[:, 1, rank : 2 * rank] = share
        jacobian[:, :, 2 * rank :] = -ratio(coefficients, values)[:, :, None] * share[:, None, :]
        return jacobian.reshape(2 * len(values), -1)

    first = start.ravel()
    limit = huber_px(residual(first).reshape(-1, 2))
    fit = least_squares(
        residual, first, jac=slope, loss="huber", f_scale=limit, x_scale="jac", max_nfev=_MAX_STEPS
    )
    return np.asarray(fit.x.reshape(3, rank))


def ratio(P: FloatArray, values: FloatArray) -> FloatArray:
    """Return ratios of P · Φ: (3, K), (N, K) -> (N, 2), inf where P3Φ is not positive."""
    homogeneous = values @ P.T
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        pixel = homogeneous[:, :2] / homogeneous[:, 2:]
    return np.where(homogeneous[:, 2:] > 0, pixel, np.inf)
