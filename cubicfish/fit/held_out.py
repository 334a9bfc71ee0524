"""Held-out error: the reprojection error on photos that did not take part in the fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cubicfish.errors import FitError
from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.fit.folds import photo_folds
from cubicfish.fit.lenses import CubicFit
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.radial import RadialCamera
from cubicfish.solve.adjustment import WARM_DAMPING, Adjustment, State, adjust, huber_cost
from cubicfish.solve.chances import student
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import huber_px, wide_px
from cubicfish.solve.subset import select, select_photos
from cubicfish.target.observations import Observations
from cubicfish.types import FloatArray, IntArray

# A step expected to lower a fold's cost by a smaller share is taken without evaluating it.
_FOLD_DECREASE = 1e-4
# The ratios of photos are never known better than this.
_LEAST_SPREAD = 1e-3
_FEWEST_TO_COMPARE = 2
_RADIAL_DECREASE = 1e-5
# For fits of poses alone.
_WIDE_PX = 10.0
_POSE_DECREASE = 1e-6


@dataclass(frozen=True, kw_only=True)
class HeldOut:
    """Errors on photos left out of the fit, their poses refitted.

    Attributes:
        square: (N,) squared error of the cubic camera at each pair, pixels²; NaN where a pair does
            not tell its error, or lies outside the field of the camera that was fitted without its
            photo.
        radial_square: (N,) the same of the radial reference, on the same folds.
        image: (N,) photo of each pair.
        folds: the number of folds of the photos.

    """

    square: FloatArray
    radial_square: FloatArray
    image: IntArray
    folds: int

    @property
    def rms_px(self) -> float:
        """RMS of the cubic camera, pixels."""
        return float(np.sqrt(np.nanmean(self.square)))

    @property
    def radial_rms_px(self) -> float:
        """RMS of the radial reference, pixels."""
        return float(np.sqrt(np.nanmean(self.radial_square)))

    @cached_property
    def photos_px(self) -> FloatArray:
        """(M,) RMS of the cubic camera on each photo, pixels; NaN where it sees none of it."""
        seen = np.isfinite(self.square)
        count = np.bincount(self.image, seen)
        with np.errstate(invalid="ignore"):
            return np.sqrt(np.bincount(self.image, np.where(seen, self.square, 0)) / count)

    def of(self, pairs: IntArray) -> HeldOut:
        """The errors of some rows (n,)."""
        square, radial_square = self.square[pairs], self.radial_square[pairs]
        return replace(self, square=square, radial_square=radial_square, image=self.image[pairs])

    def times(self, other: HeldOut) -> float:
        """The ratio to the error of another fit of the same photos.

        It is the geometric mean of the ratio over all corners and of that of the typical photo: one
        photo on which one fit fails counts, but does not decide.
        """
        mine, theirs = self.beside(other), other.beside(self)
        photos = np.log(mine.photos_px / theirs.photos_px)
        typical = np.nanmean(photos) if np.isfinite(photos).any() else np.inf
        return float(np.exp((typical + np.log(mine.rms_px / theirs.rms_px)) / 2))

    def beside(self, other: HeldOut) -> HeldOut:
        """The errors where the other ones are known too, since only these can be compared."""
        return replace(self, square=np.where(np.isnan(other.square), np.nan, self.square))

    def doubt(self, other: HeldOut) -> float:
        """The probability that the other fit predicts other photos better, 0 to 1.

        It is Student's t of the photos' ratios: photos are drawn at random, their corners are not.
        """
        photos = np.log(self.beside(other).photos_px / other.beside(self).photos_px)
        photos = photos[np.isfinite(photos)]
        if len(photos) < _FEWEST_TO_COMPARE:
            return 0.5
        error = max(np.std(photos, ddof=1) / np.sqrt(len(photos)), _LEAST_SPREAD)
        return student(len(photos) - 1, float(np.log(self.times(other))) / error)


def held_out_error(
    fit: CameraFit, progress: Callable[[int, int], None] | None = None
) -> HeldOut | None:
    """Cross-validation by photo: each photo is judged by a camera that never saw it.

    folds.py says which photos are left out together. In each fold the reference, P and, at its
    level, the target are fitted to the other photos; then only the poses of the photos left out are
    fitted. The cubic's fit starts one first-order step from the fit to all photos, poses and target
    included; the reference's fit starts where that fit ended. The priors and their weights are
    those that the fit to all photos chose.

    Args:
        fit: the fit to all photos.
        progress: called before each fold with folds done and all folds.

    Returns:
        The errors; None with fewer than :data:`~cubicfish.fit.folds.MIN_PHOTOS` places.

    """
    parts = photo_folds(fit.poses, fit.reference.pairs, fit.reference.camera.fx)
    if not parts:
        return None
    pairs = fit.reference.pairs
    squares = np.full((2, len(pairs.image)), np.nan)
    leave_one_out = LeaveOneOut(fit, parts)
    for done, (test, step) in enumerate(zip(parts, leave_one_out.steps(), strict=True)):
        if progress is not None:
            progress(done, len(parts))
        squares[:, np.isin(pairs.image, test)] = _judge_fold(fit, test, fit.moved(*step))
    squares[:, ~pairs.error_known] = np.nan
    of_cubic, of_radial = squares
    return HeldOut(square=of_cubic, radial_square=of_radial, image=pairs.image, folds=len(parts))


def _judge_fold(fit: CameraFit, test: IntArray, near: State[CubicFit]) -> FloatArray:
    """Squared errors (2, n) on the photos ``test``, pixels²; NaN beyond the field.

    They are those of the cubic and the reference, fitted to the other photos from ``near`` on.
    """
    pairs, world = fit.reference.pairs, near.world
    out = np.isin(pairs.image, test)
    train = np.setdiff1d(np.arange(len(pairs.images)), test)
    training = select_photos(pairs, train)

    # Of the fit to all photos, the other photos' part and the priors'.
    length = np.hypot(*fit.residual[out].T)
    cost = fit.cost - float(fit.pairs.weight[out] @ huber_cost(length, fit.huber_px))

    def trained_from(start: State[CubicFit], cost_before: float) -> Adjustment[CubicFit]:
        return adjust(
            start.lens,
            start.poses[train],
            training,
            huber_px(fit.errors),
            world=start.world.select(np.flatnonzero(~out)),
            relative_decrease=_FOLD_DECREASE,
            damping=WARM_DAMPING,
            trust_last=True,
            cost_before=cost_before,
        )

    try:
        trained = trained_from(near, cost)
    except FitError:  # the first-order step was too long: start where the fit ended
        trained = trained_from(fit, 0.0)
    reference, moved = fit.reference, training.with_world(trained.world.points)
    lens, poses, limit = reference.lens, reference.poses[train], wide_px(reference.errors)
    radial = adjust(
        lens,
        poses,
        moved,
        limit,
        relative_decrease=_RADIAL_DECREASE,
        damping=WARM_DAMPING,
        trust_last=True,
    )
    camera = CubicCamera(
        image_size=pairs.image_size,
        P=trained.lens.P,
        max_angle_deg=fit.max_angle_deg,
        radial=radial.lens.lens,
        pupil_travel=trained.lens.pupil_travel,
    )
    world = replace(world, parameters=trained.world.parameters, offsets=trained.world.offsets)
    left_out = select_photos(pairs, test).with_world(world.points[out])
    squares = np.full((2, len(left_out.pixel)), np.nan)
    lenses: tuple[CubicCamera | RadialCamera, ...] = (camera, camera.radial)
    starts = fit.poses, fit.reference.poses
    for square, known, start in zip(squares, lenses, starts, strict=True):
        _, residual, seen = pose_only_residual(known, left_out, start[test])
        square[seen] = np.sum(np.square(residual), axis=1)
    return squares


def pose_only_residual(
    camera: CubicCamera | RadialCamera, pairs: Observations, poses: Poses
) -> tuple[Poses, FloatArray, IntArray]:
    """Fit poses with the lens fixed, over the corners that lie in the camera's field.

    Args:
        camera: the lens.
        pairs: pairs of the photos.
        poses: a start for each photo, near enough that each corner's place in or out of the
            field is known.

    Returns:
        Poses of each photo; residuals (K, 2) of the corners in the field, pixels; and the
        indices (K,) of those corners.

    """
    seen = camera.project(poses.apply(pairs.image, pairs.world))
    inside = np.isfinite(seen[:, 0])
    index = np.flatnonzero(inside)
    if not index.size:
        return poses, np.zeros((0, 2)), index
    own, photos = select(pairs, inside)
    lens, found, limit = FixedLens(camera=camera), poses[photos], _WIDE_PX
    for _ in range(2):
        found = adjust(
            lens,
            found,
            own,
            limit,
            relative_decrease=_POSE_DECREASE,
            damping=WARM_DAMPING,
            trust_last=True,
        ).poses
        residual = lens.project(found.apply(own.image, own.world)) - own.pixel
        # Once more, with a loss that follows the residuals of the first fit, if it differs for any.
        before, limit = limit, wide_px(residual[own.error_known])
        if np.square(residual).sum(axis=1).max() <= min(limit, before) ** 2:
            break
    return poses.with_photos(photos, found), residual, index
