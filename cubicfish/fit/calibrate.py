"""2D-3D pairs -> camera: the whole fit, with the outliers and the measures of its quality."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cubicfish.angles import angle_from_axis
from cubicfish.errors import FitError
from cubicfish.fit import coverage, rejection
from cubicfish.fit.alignment import in_references_frame
from cubicfish.fit.calibration import Calibration, Diagnose, FailedFit, FitEvidence
from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.fit.folds import repeated_groups
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.model_selection import (
    Progress,
    RefineTarget,
    begin,
    select_model,
)
from cubicfish.fit.photo_shifts import photo_shifts_px
from cubicfish.fit.photo_spread import PhotoSpread, photo_spread
from cubicfish.fit.prior import RADIAL
from cubicfish.fit.radial_reference import (
    CHECK_ALL,
    RadialReference,
    fit_radial,
    terms_beyond,
)
from cubicfish.fit.refinement import fit_nominal_target, to_the_bottom
from cubicfish.fit.uncertainty import (
    Uncertainty,
    field_grid,
    radial_uncertainty,
    uncertainty_grid,
)
from cubicfish.judge.finding import Finding
from cubicfish.judge.fit_record import DroppedCorner, FitRecord, MarkedPoints, PhotoRecord
from cubicfish.judge.pupil import pupil_effect
from cubicfish.judge.uncertainty import UncertaintyGrid, end_px
from cubicfish.judge.verdict import FEWEST_OF_A_CUBIC
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.lift import lift
from cubicfish.models.pupil import from_pupil
from cubicfish.models.radial import RadialCamera
from cubicfish.models.sphere import cone_rays
from cubicfish.solve.deformable_target import TARGET_MODELS, departures
from cubicfish.solve.fit_lens import lens_beside
from cubicfish.solve.statistics import error_statistics, photo_records, rms_px, within_noise
from cubicfish.solve.subset import flatness, middle, with_mean_weight_one, world_scale
from cubicfish.target.observations import Observations
from cubicfish.target.placement import renamed
from cubicfish.target.target import Target
from cubicfish.threads import one_blas_thread

# Eq. 8–9: two equations per pair in 60 homogeneous unknowns.
MIN_PAIRS = FEWEST_OF_A_CUBIC
# Numbers of a radial lens, and of a pose: of a point there are two, and half of them are spare.
_OF_A_RADIAL_LENS, _OF_A_POSE = 8, 6
# Boards whose corners leave a plane by less than this share of their extent count as flat.
_FLAT = 1e-4
# A fitted sheet is bent a little; a target of two boards leaves a plane by far more.
_NEARLY_FLAT = 0.02
# Beyond this relative uncertainty of the focal length the photos do not determine the lens.
_MAX_FOCAL_UNCERTAINTY = 0.05
_RAYS = 500
NO_CONVERGENCE = "the fit does not converge"
"""What is said where no step of a fit leads on."""


class _UndeterminedError(FitError):
    """The corners fit, but do not determine the lens."""


@one_blas_thread()
def calibrate(
    pairs: Observations,
    *,
    target: Target | None = None,
    refine_target: RefineTarget = "auto",
    hold_out: bool = True,
    goal_px: float | None = None,
    diagnose: Diagnose | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """Fit the cubic camera (``ray`` lift) and the pose of every photo to 2D-3D pairs.

    Zhu & Yin (2010): poses and the radial reference first, without any guess; then P by the
    linear equations 8–9 and Levenberg–Marquardt on Eq. 10, jointly with all poses and, where it
    helps photos that were left out, with the target itself.

    Args:
        pairs: 2D-3D pairs of one or more photos of one rigid target.
        target: the target; without it (for pairs of points) it stays nominal.
        refine_target: how much of the target is fitted too: ``off``, ``shape`` (boards bend, twist,
            stretch and move a little), ``points`` (each corner also has an offset of its own), or
            ``auto``: the richest of these that lowers the held-out error, and ``off`` where no
            corner's name is certain.
        hold_out: also measure the held-out error (five more fits per level); ``auto`` needs it.
        goal_px: the uncertainty wanted over 95 % of the field, pixels; by default what is usual.
        diagnose: finds what is likely wrong with the set-up; by default nothing does.
        progress: called with the current step, in words, and the share done, 0 to 1.

    Raises:
        FitError: the pairs are too few, are all in one photo of one flat board, do not fit the
            target, or do not determine the lens; the text says the likely cause where one is found.

    """
    refuse_too_little(pairs)
    _refuse_another_size(pairs)
    if refine_target == "auto" and not pairs.certain.any():
        refine_target = "off"  # uncertain corners say nothing about the target
    # The user's free choices, the world's origin and the unit of weights, must not matter.
    origin, weight = middle(pairs), pairs.weight.mean()
    pairs = with_mean_weight_one(pairs.with_world(pairs.world - origin))
    given, target = target, target and target.moved(-origin)
    try:
        begin(progress, "start")
        scale = world_scale(pairs)
        reference = fit_radial(pairs.with_world(pairs.world / scale))
        begin(progress, "cubic")
        rough, gross, gross_error = rejection.without_gross(reference)
        rough = rejection.without_noisy(rough)
        refuse_undetermined(rough.reference)
        nominal_fit = fit_nominal_target(rough, target, scale)
        fit = select_model(nominal_fit, refine_target, hold_out, progress)
        seen, residual = fit.reference.pairs, fit.residual
        astray = rejection.strays(seen, residual)
        if astray.any():
            fit = rejection.without(fit, astray)
        if target is not None:
            gross = renamed(gross, target, fit.nominal.renamed)
        dropped = rejection.dropped_corners(gross, gross_error)
        dropped += rejection.dropped_corners(
            seen.select(astray), np.linalg.norm(residual[astray], axis=1)
        )
        fit = to_the_bottom(fit)
        begin(progress, "checks")
        nominal_fit = fit if fit.level == "off" else nominal_fit
        near = _assess(fit, nominal_fit, dropped, pairs, goal_px, diagnose)
    except (FitError, np.linalg.LinAlgError) as failure:
        error = failure if isinstance(failure, FitError) else FitError(NO_CONVERGENCE, do=CHECK_ALL)
        if diagnose is not None:
            fits = isinstance(failure, _UndeterminedError)
            found = diagnose(FailedFit(pairs=pairs, target=target, fits=fits))
            # The likely cause in place of general advice.
            error = FitError(error.what, findings=found) if found else error
        raise error from failure
    used, poses = near.pairs, near.poses.of_world(origin)
    photos = tuple(
        replace(photo, moves_px=known.moves_px)
        for photo, known in zip(
            photo_records(used, near.residual, poses), near.fit.per_image, strict=True
        )
    )
    return replace(
        near,
        fit=replace(near.fit, per_image=photos),
        pairs=replace(used, world=used.world + origin, weight=used.weight * weight),
        poses=poses,
        target=near.target.moved(origin) if near.target and near.refined != "off" else given,
    )


def _assess(
    fit: CameraFit,
    nominal_fit: CameraFit,
    dropped: tuple[DroppedCorner, ...],
    pairs: Observations,
    goal_px: float | None,
    diagnose: Diagnose | None,
) -> Calibration:
    """Assess a fit, of which the fit to the nominal target is known too."""
    nominal, reference, left_out = fit.nominal, fit.reference, fit.held_out
    target, scale = nominal.target, nominal.scale
    used = nominal.pairs_at(fit.level).with_world(reference.pairs.world * scale)
    refined = nominal.refined(fit.world)
    departed = departures(target, refined)
    camera = CubicCamera(
        image_size=pairs.image_size,
        P=fit.lens.P,
        max_angle_deg=fit.max_angle_deg,
        radial=_find_far_radial(fit.lens, reference),
        pupil_travel=0.0 if fit.prior.central else fit.lens.pupil_travel * scale,
        units=None if target is None else target.units,
    )
    places = repeated_groups(fit.poses, reference.pairs, reference.camera.fx)
    spread: PhotoSpread | Uncertainty
    if fit.prior == RADIAL and len(reference.pairs.pixel) < FEWEST_OF_A_CUBIC:
        spread = radial_uncertainty(reference)
    else:
        spread = photo_spread(fit, places, fit.in_doubt)
    points = fit.poses.apply(reference.pairs.image, fit.world.points)
    effect = pupil_effect(camera, points * scale, reference.covered)
    points = from_pupil(points, fit.lens.pupil_travel)
    covered_deg = float(np.rad2deg(angle_from_axis(points).max()))
    trusted = coverage.trusted_angle_deg(camera, covered_deg, spread.sigma_px)
    camera = replace(camera, max_angle_deg=trusted)
    blind, limit = coverage.blind_angle(points), end_px(camera.image_size, goal_px)
    field, uncertainty = _find_certain_field(camera, blind, spread, limit)
    sees = field_grid(field, blind)[2].reshape(-1, 3)
    moves = photo_shifts_px(fit, sees[np.isfinite(sees[:, 0])])
    known_residual = np.where(used.error_known[:, None], fit.residual, np.nan)
    rim = coverage.coverage_extent(field, points, known_residual, spread.sigma_px)
    camera, poses = in_references_frame(camera, fit.poses.scaled(scale), reference.covered)
    camera = replace(camera, max_angle_deg=field.max_angle_deg)
    findings: Sequence[Finding] = ()
    if diagnose is not None:
        evidence = FitEvidence(
            pairs=pairs,
            target=target,
            nominal_fit=nominal_fit,
            fit=fit,
            dropped=dropped,
            departures=departed,
            uncertainty=uncertainty,
        )
        findings = diagnose(evidence)
    judged = sorted((fit, *fit.other_levels), key=lambda one: TARGET_MODELS.index(one.level))
    rays = fit.poses.apply(reference.pairs.image, reference.pairs.world)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    record = FitRecord(
        **vars(error_statistics(fit.errors, len(used.pixel))),
        images=len(used.images),
        held_out_rms_px=left_out.rms_px if left_out else np.nan,
        held_out_folds=left_out.folds if left_out else 0,
        radial_rms_px=rms_px(reference.errors),
        radial_held_out_rms_px=left_out.radial_rms_px if left_out else np.nan,
        refine_target=fit.level,
        held_out_by_level={one.level: one.held_out.rms_px for one in judged if one.held_out},
        renamed_images=tuple(nominal.renamed),
        departures=departed,
        rank=int(np.linalg.matrix_rank(lift(rays), tol=1e-9 * np.sqrt(len(rays)))),
        covered_deg=covered_deg,
        reach=rim,
        pupil=effect,
        flat=flatness(used.world) < _NEARLY_FLAT,
        prior_weight=fit.prior.weight,
        prior_spread=fit.prior.spread,
        coverage=coverage.FieldCells.of(camera, used.pixel).coverage,
        findings=tuple(findings),
        uncertainty=uncertainty,
        dropped=len(dropped),
        dropped_corners=dropped,
        unfit_images=reference.unfit,
        marked=None if pairs.boards else MarkedPoints(),
        goal_px=goal_px,
        per_image=tuple(
            PhotoRecord(image=name, moves_px=moved)
            for name, moved in zip(used.images, moves, strict=True)
        ),
    )
    return Calibration(
        camera=camera,
        poses=poses,
        pairs=used,
        residual=fit.residual,
        fit=record,
        held_out=left_out,
        prior=fit.prior,
        runners_up=fit.runners_up,
        target=refined,
        renamed=nominal.renamed,
    )


def _find_certain_field(
    camera: CubicCamera, blind: float, spread: PhotoSpread | Uncertainty, limit_px: float
) -> tuple[CubicCamera, UncertaintyGrid]:
    """Where a camera is certain, if that is most of its field, and its uncertainty there."""
    uncertainty = uncertainty_grid(spread, camera, blind)
    if not uncertainty.median_px < limit_px:
        return camera, uncertainty  # the rim alone is not to blame
    certain = coverage.certain_angle_deg(camera, spread.sigma_px, limit_px)
    if certain == camera.max_angle_deg:
        return camera, uncertainty
    camera = replace(camera, max_angle_deg=certain)
    return camera, uncertainty_grid(spread, camera, blind)


def _refuse_another_size(pairs: Observations) -> None:
    """Refuse photos whose corners all lie in the upper left quarter of the size that is given."""
    size, farthest = np.array(pairs.image_size), pairs.pixel.max(axis=0)
    if len(pairs.images) > 1 and bool((farthest < size / 2).all()):
        raise FitError(
            "all corners lie within the {:.0f}x{:.0f} pixels at the upper left of photos of "
            "{}x{}: correct the image size, or take photos with the target everywhere".format(
                *np.ceil(farthest), *pairs.image_size
            )
        )


def refuse_too_little(pairs: Observations) -> None:
    """Raise FitError where pairs are too few, or all of one photo of one flat board."""
    if not pairs.boards:
        _refuse_too_few_points(pairs)
    elif len(pairs.pixel) < MIN_PAIRS:
        raise FitError(
            f"{len(pairs.pixel)} corners are too few: a cubic camera needs at least {MIN_PAIRS} "
            "(and some hundreds to be good); take more photos or use a board with more squares"
        )
    if len(pairs.images) == 1 and flatness(pairs.world) < _FLAT:
        raise FitError(
            f"{pairs.images[0]} alone shows one flat board, which cannot determine a lens",
            do="add photos of it from other sides (five or more, tilted), or use a target with two "
            "or more boards at an angle, of which one photo is enough",
        )


def _refuse_too_few_points(pairs: Observations) -> None:
    """Refuse points by which not even a radial lens and the poses are determined."""
    points, photos = len(pairs.pixel), len(pairs.images)
    least = _OF_A_RADIAL_LENS + _OF_A_POSE * photos
    if points < least:
        many = photos != 1
        raise FitError(
            f"{points} point{'s' * (points != 1)} in {photos} photo{'s' * many} "
            f"{'are' if points != 1 else 'is'} too few for a lens and the "
            f"place{'s' * many} of the camera",
            do=f"mark at least {least}, from the middle out to the rim of the picture",
        )


def refuse_undetermined(reference: RadialReference) -> None:
    """Raise FitError where the photos leave the lens open."""
    if reference.focal_uncertainty > _MAX_FOCAL_UNCERTAINTY:
        fits = within_noise(reference.pairs, reference.residual) and not reference.unfit
        raise (_UndeterminedError if fits else FitError)(
            "the photos do not determine the lens (its focal length is uncertain by "
            f"{100 * reference.focal_uncertainty:.0f} %)",
            do="add photos in which the boards are tilted and nearer to the rim",
        )


def _find_far_radial(lens: CubicFit, reference: RadialReference) -> RadialCamera:
    """Find the radial lens nearest to P for distant points: the reference fits near corners."""
    if not lens.pupil_travel:
        return reference.camera
    rays = cone_rays(reference.covered, _RAYS)
    fixed = terms_beyond(reference.terms)
    found = lens_beside(reference.camera, rays, lens.far(rays), fixed=fixed)
    sees = min(reference.covered, reference.camera.max_angle)
    return found if found.max_angle >= sees else reference.camera
