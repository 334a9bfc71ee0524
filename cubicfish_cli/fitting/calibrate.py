"""2D-3D pairs -> camera: the whole fit, with what it left out and how good it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from cubicfish_cli.angles import angle_from_axis
from cubicfish_cli.assess.pupil import PupilEffect, pupil_effect
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.cubic_fit import NEAR_DECREASE, CubicResult, Hold, Rival, fit_cubic
from cubicfish_cli.fitting.deformation import Deformation, deformations
from cubicfish_cli.fitting.evidence import Diagnose, FailedFit, FitEvidence
from cubicfish_cli.fitting.findings import (
    coverage,
    dropped_groups,
)
from cubicfish_cli.fitting.folds import folds_of
from cubicfish_cli.fitting.frame import in_references_frame
from cubicfish_cli.fitting.held_out import HeldOut, held_out_error
from cubicfish_cli.fitting.hold import FIRMEST
from cubicfish_cli.fitting.lenses import CubicFit
from cubicfish_cli.fitting.local_noise import within_noise
from cubicfish_cli.fitting.orientation import oriented
from cubicfish_cli.fitting.photo_spread import photo_spread
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.radial_reference import (
    CHECK_ALL,
    RadialReference,
    fit_radial,
    terms_beyond,
)
from cubicfish_cli.fitting.reach import Reach, reach, trusted_angle_deg
from cubicfish_cli.fitting.refinement import (
    LEVELS,
    Drawing,
    Level,
    TargetFit,
    as_drawn,
    refine_object,
    to_the_bottom,
)
from cubicfish_cli.fitting.rejection import (
    DroppedCorner,
    dropped_corners,
    strays,
    without,
    without_gross,
    without_noisy,
)
from cubicfish_cli.fitting.repeats import repeated_groups
from cubicfish_cli.fitting.stages import Progress, Stage, Stages
from cubicfish_cli.fitting.statistics import (
    ErrorStatistics,
    error_statistics,
    photo_records,
    rms_px,
)
from cubicfish_cli.fitting.subset import (
    flatness,
    middle,
    with_mean_weight_one,
    world_scale,
)
from cubicfish_cli.fitting.uncertainty import uncertainty_record
from cubicfish_cli.formats.calibrated import Calibrated
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.lift import lift
from cubicfish_cli.lenses.nearest import nearest_lens
from cubicfish_cli.lenses.pupil import from_pupil
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.lenses.sphere import cone_rays
from cubicfish_cli.observations import Observations
from cubicfish_cli.placement import Symmetry, renamed
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray
from cubicfish_cli.words.codes import Code
from cubicfish_cli.words.finding import Finding

# Eq. 8–9: two equations a pair in 60 homogeneous unknowns.
MIN_PAIRS = 30
# Boards whose corners leave a plane by less than this share of their extent count as flat.
_FLAT = 1e-4
# A sheet that is fitted too is bent a little; a target of two boards leaves a plane by far more.
_NEARLY_FLAT = 0.02
# Beyond this relative uncertainty of the focal length the photos do not determine the lens.
_MAX_FOCAL_UNCERTAINTY = 0.05
_RAYS = 500
# A richer target must lower photos' held-out errors at least to this share of the poorer one's.
_WORTH = 0.99
_NO_CONVERGENCE = "the fit does not converge"
_INSTEAD_OF_DOUBTS = (
    Code.BOARD_PLACE,
    Code.BOARD_SQUARE,
    Code.TWO_LENSES,
    Code.ZOOM,
    Code.SCALED,
    Code.SHIFTED,
    Code.TURNED,
)
_STAGES: dict[Level, tuple[Stage, Stage]] = {
    "shape": ("shape", "shape held out"),
    "points": ("points", "points held out"),
}

RefineTarget = Literal["off", "shape", "points", "auto"]


class _UndeterminedError(FitError):
    """The corners fit, and do not determine the lens."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Calibration(Calibrated):
    """A fitted camera and how well it fits.

    Attributes:
        camera: the camera.
        poses: camera_from_world of each of ``pairs.images``.
        pairs: the pairs that were used.
        residual: (N, 2) projection less pixel of those, pixels.
        errors: reprojection errors over the used pairs.
        companion_rms_px: RMS of the radial reference on the same pairs.
        held_out: cross-validated errors; None when the photos are too few.
        held_out_by_level: held-out RMS of every level of ``refine_target`` that was tried.
        rank: numerical rank of Φ over the used rays (16 on the sphere).
        covered_deg: angle from the axis of the farthest used corner.
        reach: what corners say of the field's rim.
        pupil: what it matters that the entrance pupil wanders.
        hold: how P was held to the reference.
        rival: how photos that were left out would rather have it held, and how likely they are
            right; None where nothing was left out.
        dropped: corners left out because they were grossly off.
        unfit: photos left out, with the reason.
        refined: what of the target was fitted: ``off``, ``shape`` or ``points``.
        target: the target as fitted (the given one where nothing was refined); None for pairs
            that came without one.
        renamed: photos that show the target the other way round than they said, as its print
            says, and the motion of the target that their corners were named anew by.
        departures: by how much the target departs from its drawing, a board each.
        uncertainty_grid: how far the pixels of distant points may be off, on a grid over the photo,
            as ``uncertainty_record`` of fitting/uncertainty.py has it.
        coverage: share of the valid field that corners cover, 0 to 1.
        notes: what a person should know beyond the figures.
        findings: what is likely wrong with the set-up, with its evidence.
        made_by: where it comes from, plain data.

    """

    load = staticmethod(load_camera)

    camera: CubicCamera
    poses: Poses
    pairs: Observations
    residual: FloatArray
    errors: ErrorStatistics
    companion_rms_px: float
    held_out: HeldOut | None
    held_out_by_level: dict[Level, float]
    rank: int
    covered_deg: float
    reach: Reach
    pupil: PupilEffect
    hold: Hold
    rival: Rival | None
    dropped: tuple[DroppedCorner, ...]
    unfit: dict[str, Finding]
    refined: Level
    target: Target | None
    renamed: Mapping[str, Symmetry]
    departures: tuple[Deformation, ...]
    uncertainty_grid: dict[str, Any]
    coverage: float
    notes: tuple[Finding, ...]
    findings: tuple[Finding, ...]
    made_by: Mapping[str, Any] = field(default_factory=dict)

    @property
    def remarks(self) -> tuple[Finding, ...]:
        """What is told beside the findings: notes, photos that were left out, doubts."""
        unfit = (replace(why, images=(photo,)) for photo, why in self.unfit.items())
        doubts = (doubt for one in self.departures for doubt in one.doubts)
        return (*self.notes, *unfit, *doubts)

    def named(self, corners: Observations) -> Observations:
        """Corners of the photos by the names that the fit gave them, of the target as fitted."""
        return renamed(corners, self.target, self.renamed) if self.target else corners

    def as_record(self) -> dict[str, Any]:
        """Plain data: ``fit`` of camera.yaml and the command's JSON."""
        held_out = self.held_out
        return {
            **self.errors.as_record(),
            "images": len(self.pairs.images),
            "held_out_rms_px": held_out.rms_px if held_out else None,
            "held_out_folds": held_out.folds if held_out else 0,
            "companion_rms_px": self.companion_rms_px,
            "companion_held_out_rms_px": held_out.companion_rms_px if held_out else None,
            "refine_target": self.refined,
            "held_out_by_level": dict(self.held_out_by_level),
            "renamed_images": list(self.renamed),
            "departures": [departure.as_record() for departure in self.departures],
            "rank": self.rank,
            "covered_deg": self.covered_deg,
            "reach": self.reach.as_record(),
            "pupil": self.pupil.as_record(),
            "flat": flatness(self.pairs.world) < _NEARLY_FLAT,
            "prior_weight": self.hold.weight,
            "prior_spread": self.hold.spread,
            "coverage": self.coverage,
            "notes": [note.line for note in self.notes],
            "findings": [finding.as_record() for finding in self.findings],
            "uncertainty": self.uncertainty_grid,
            "dropped": len(self.dropped),
            "dropped_corners": [corner.as_record() for corner in self.dropped],
            "unfit_images": {photo: why.line for photo, why in self.unfit.items()},
            "per_image": photo_records(
                self.pairs.images, self.pairs.image, self.residual, self.poses
            ),
        }


def calibrate(
    pairs: Observations,
    *,
    target: Target | None = None,
    refine_target: RefineTarget = "auto",
    hold_out: bool = True,
    diagnose: Diagnose | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """Fit the cubic camera (``ray`` lift) and the pose of every photo to 2D-3D pairs.

    Zhu & Yin (2010): poses and the radial reference first, without any guess; then P by the
    linear equations 8–9 and Levenberg–Marquardt on Eq. 10, jointly with all poses and, where it
    helps photos that were left out, with the target itself.

    Args:
        pairs: 2D-3D pairs of one or more photos of one rigid target.
        target: the target; without it (pairs that came as such) it stays as it is.
        refine_target: what of the target is fitted too: ``off``, ``shape`` (boards bend, twist,
            stretch and move a little), ``points`` (each corner has an offset of its own as
            well), or ``auto``: the richest of these that lowers the held-out error, and ``off``
            where it is not certain of any corner which it is.
        hold_out: also measure the held-out error (five more fits per level); ``auto`` needs it.
        diagnose: tells what is likely wrong with the set-up; by default nobody does.
        progress: called with what is done now, in words, and the share done, 0 to 1.

    Raises:
        FitError: the pairs are too few, all in one photo of one flat board, do not fit the
            target, or do not determine the lens; where its likely cause is found, the text says
            it.

    """
    _refuse_too_little(pairs)
    if refine_target == "auto" and not pairs.certain.any():
        refine_target = "off"  # corners that may be others say nothing about the target
    # What the user chose freely, the world's origin and the unit of weights, must not matter.
    origin, weight = middle(pairs), pairs.weight.mean()
    pairs = with_mean_weight_one(pairs.with_world(pairs.world - origin))
    given, target = target, target and target.moved(-origin)
    refined = target is not None and (hold_out or refine_target != "auto")
    stages = Stages(progress, refined=refined and refine_target != "off", hold_out=hold_out)
    try:
        near = _calibrated(pairs, target, refine_target, hold_out, diagnose, stages)
    except (FitError, np.linalg.LinAlgError) as failure:
        error = (
            failure if isinstance(failure, FitError) else FitError(_NO_CONVERGENCE, do=CHECK_ALL)
        )
        if diagnose is not None:
            fits = isinstance(failure, _UndeterminedError)
            found = diagnose(FailedFit(pairs=pairs, target=target, fits=fits))
            # The likely cause in place of general advice.
            error = FitError(error.what, do=found[0].line) if found else error
        raise error from failure
    used = near.pairs
    return replace(
        near,
        pairs=replace(used, world=used.world + origin, weight=used.weight * weight),
        poses=near.poses.of_world(origin),
        target=near.target.moved(origin) if near.target and near.refined != "off" else given,
    )


def _calibrated(
    pairs: Observations,
    target: Target | None,
    refine_target: RefineTarget,
    hold_out: bool,
    diagnose: Diagnose | None,
    stages: Stages,
) -> Calibration:
    stages.begin("start")
    scale = world_scale(pairs)
    reference = fit_radial(pairs.with_world(pairs.world / scale))
    stages.begin("cubic")
    rough, gross, gross_error = without_gross(reference)
    rough = without_noisy(rough)
    _refuse_undetermined(rough.reference)
    drawing = Drawing(target=target, pairs=rough.reference.pairs, scale=scale)
    drawn = as_drawn(rough, drawing)
    fit, drawing, held_out, refused = _climb(drawn, drawing, refine_target, hold_out, stages)
    astray = strays(fit.reference.pairs, fit.cubic.residual)
    stray = fit.reference.pairs.select(astray)
    stray_error = np.linalg.norm(fit.cubic.residual[astray], axis=1)
    if astray.any():
        fit, drawing = without(fit, astray), drawing.of(drawing.pairs.select(~astray))
        held_out = {level: error and error.of(~astray) for level, error in held_out.items()}
    fit = to_the_bottom(fit)
    drawn = fit if fit.level == "off" else drawn
    stages.begin("checks")
    held_out_by_level = {level: error.rms_px for level, error in held_out.items() if error}
    cubic, reference = fit.cubic, fit.reference
    used = drawing.pairs.with_world(reference.pairs.world * scale)
    refined = fit.refined_target(drawing)
    camera = CubicCamera(
        image_size=pairs.image_size,
        P=cubic.lens.P,
        max_angle_deg=cubic.max_angle_deg,
        radial=_far_radial(cubic.lens, reference),
        pupil_travel=0.0 if cubic.hold.central else cubic.lens.travel * scale,
        units=None if target is None else target.units,
    )
    places = repeated_groups(cubic.poses, reference.pairs, reference.camera.fx)
    spread = photo_spread(cubic, reference, places, _in_doubt(fit, held_out, refused))
    points = cubic.poses.apply(reference.pairs.image, cubic.fit.world.points)
    effect = pupil_effect(camera, points * scale, reference.covered)
    points = from_pupil(points, cubic.lens.travel)
    covered_deg = float(np.rad2deg(angle_from_axis(points).max()))
    trusted = trusted_angle_deg(camera, covered_deg, spread.sigma_px)
    camera = replace(camera, max_angle_deg=trusted)
    uncertainty = uncertainty_record(spread, camera)
    rim = reach(camera, points, cubic.residual, spread.sigma_px)
    poses = cubic.poses.scaled(scale)
    camera, poses = in_references_frame(camera, poses, reference.covered)
    share = coverage(used.pixel, camera.outline(), pairs.image_size)
    if target is not None:
        gross = renamed(gross, target, drawing.renamed)
    dropped = dropped_corners(gross, gross_error) + dropped_corners(stray, stray_error)
    notes = dropped_groups(pairs, [(c.image, c.board, c.error_px) for c in dropped])
    findings: Sequence[Finding] = ()
    if diagnose is not None:
        findings = diagnose(
            FitEvidence(
                pairs=pairs,
                target=target,
                drawn=drawn,
                fit=fit,
                drawing=drawing,
                dropped=[(corner.image, corner.board) for corner in dropped],
            )
        )
    # What is put down to one board, or to the lens, is not doubted of every board.
    wrong = any(finding.code in _INSTEAD_OF_DOUBTS for finding in findings)
    return Calibration(
        camera=camera,
        poses=poses,
        pairs=used,
        residual=cubic.residual,
        errors=error_statistics(cubic.residual),
        companion_rms_px=rms_px(reference.residual),
        held_out=held_out.get(fit.level),
        held_out_by_level=held_out_by_level,
        rank=_rank(reference, cubic),
        covered_deg=covered_deg,
        reach=rim,
        pupil=effect,
        hold=cubic.hold,
        rival=cubic.rival,
        dropped=dropped,
        unfit=reference.unfit,
        refined=fit.level,
        target=refined,
        renamed=drawing.renamed,
        departures=tuple(deformations(target, refined, doubted=not wrong))
        if target and refined
        else (),
        uncertainty_grid=uncertainty,
        coverage=share,
        notes=tuple(notes),
        findings=tuple(findings),
    )


Judged = tuple[TargetFit, HeldOut | None, Drawing]


def _climb(
    fit: TargetFit, drawing: Drawing, refine_target: RefineTarget, hold_out: bool, stages: Stages
) -> tuple[TargetFit, Drawing, dict[Level, HeldOut | None], TargetFit | None]:
    """Refine the target up to the level asked for, or as far as held-out photos gain by it.

    The drawing's pairs have the fit's names. The last is a richer fit by which photos that were
    left out did not gain.
    """
    measured: dict[Level, HeldOut | None] = {}
    auto = refine_target == "auto"
    if auto and (drawing.target is None or not hold_out):
        refine_target = "off"
    if hold_out and (auto or refine_target == "off"):
        fit, measured["off"] = _judged(fit, partial(stages.begin, "held out"))
    if drawing.target is None or refine_target == "off" or (auto and measured["off"] is None):
        return fit, drawing, measured, None
    groups = folds_of(fit.reference)
    for level in LEVELS[1:]:
        fitting, holding = _STAGES[level]
        stages.begin(fitting)
        starts = oriented(fit, drawing) if level == "points" else [(fit, drawing)]
        judge = hold_out and (auto or level == refine_target)
        found: list[Judged] = [
            (refine_object(start, own, level, groups), None, own)
            for start, own in (starts if judge else starts[-1:])
        ]
        if judge:
            progress = partial(stages.begin, holding)
            found = [(*_judged(one, progress), own) for one, _, own in found]
        richer, error, own = _better_named(found)
        if judge:
            measured[level] = error
        if auto:
            before, after = measured[fit.level], measured[level]
            if before is None or after is None or after.times(before) > _WORTH:
                return fit, drawing, measured, richer
        fit, drawing = richer, own
        if level == refine_target:
            break
    return fit, drawing, measured, None


def _better_named(judged: Sequence[Judged]) -> Judged:
    """Of fits with the names that were given, and with likelier ones, if photos agree."""
    (*_, given, _), (*_, likelier, _) = judged[0], judged[-1]
    if given is None or likelier is None or likelier.times(given) > 1:
        return judged[0]
    return judged[-1]


def _in_doubt(
    fit: TargetFit, measured: Mapping[Level, HeldOut | None], refused: TargetFit | None
) -> list[tuple[CubicFit, float]]:
    """The lens of a richer fit, and how likely it is the better one.

    A few photos may gain nothing by a refined target and be bent by its departures all the same.
    """
    if refused is None:
        return []
    mine, other = measured[fit.level], measured[refused.level]
    return [(refused.cubic.lens, mine.doubt(other))] if mine and other else []


def _judged(
    fit: TargetFit, progress: Callable[[int, int], None]
) -> tuple[TargetFit, HeldOut | None]:
    """The held-out error, which has the last word on how P is held.

    The choice was made to first order. Where the cubic is worse than its reference on photos that
    were left out, its pupil stands still, or it is held as firmly as can be, or both, whichever is
    best.
    """
    held_out = held_out_error(fit, progress)
    if held_out is None or held_out.rms_px <= held_out.companion_rms_px:
        return fit, held_out
    best, error = fit, held_out
    central = replace(fit.cubic.hold, central=True)
    for hold in (central, FIRMEST, replace(FIRMEST, central=True)):
        cubic = fit_cubic(
            fit.reference,
            hold,
            world=fit.cubic.fit.world,
            start=fit.cubic,
            relative_decrease=NEAR_DECREASE,
        )
        firm = replace(fit, cubic=cubic)
        measured = held_out_error(firm, progress)
        if measured is not None and measured.rms_px < error.rms_px:
            rival = Rival(hold=fit.cubic.hold, likely=measured.doubt(held_out))
            best, error = replace(firm, cubic=replace(cubic, rival=rival)), measured
    return best, error


def _refuse_too_little(pairs: Observations) -> None:
    if len(pairs.pixel) < MIN_PAIRS:
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


def _refuse_undetermined(reference: RadialReference) -> None:
    if reference.focal_uncertainty > _MAX_FOCAL_UNCERTAINTY:
        fits = within_noise(reference.pairs, reference.residual) and not reference.unfit
        raise (_UndeterminedError if fits else FitError)(
            "the photos do not determine the lens (its focal length is uncertain by "
            f"{100 * reference.focal_uncertainty:.0f} %)",
            do="add photos in which the boards are tilted and nearer to the rim",
        )


def _far_radial(lens: CubicFit, reference: RadialReference) -> RadialCamera:
    """The radial lens nearest to P: the reference is fitted to corners, which are near."""
    if not lens.travel:
        return reference.camera
    rays = cone_rays(reference.covered, _RAYS)
    held = terms_beyond(reference.terms)
    found = nearest_lens([reference.camera], rays, lens.far(rays), held=held)
    sees = min(reference.covered, reference.camera.max_angle)
    return found if found.max_angle >= sees else reference.camera


def _rank(reference: RadialReference, cubic: CubicResult) -> int:
    points = cubic.poses.apply(reference.pairs.image, reference.pairs.world)
    rays = points / np.linalg.norm(points, axis=-1, keepdims=True)
    return int(np.linalg.matrix_rank(lift(rays), tol=1e-9 * np.sqrt(len(rays))))
