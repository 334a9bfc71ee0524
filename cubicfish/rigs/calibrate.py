"""Photos of several cameras on one body -> the rig: lenses, and where each camera stands.

Each camera is calibrated alone first, without any guess. What the shots that two cameras share
say of their places is a start; one adjustment then has lenses, places, shots and target at once.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from cubicfish.calibration import observed
from cubicfish.errors import FitError
from cubicfish.find.identification.identified import Detection
from cubicfish.fit.alignment import in_references_frame
from cubicfish.fit.folds import FOLDS, MIN_PHOTOS, dealt_out
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.model_selection import RefineTarget
from cubicfish.fit.refinement import FIRST_SPREAD, estimate_spread
from cubicfish.io.camera_yaml import Calibrated
from cubicfish.judge.codes import Severity
from cubicfish.judge.fit_record import NAN
from cubicfish.listener import Listener
from cubicfish.models.cubic import CubicCamera, pole_or_fold_deg
from cubicfish.models.sphere import cone_rays
from cubicfish.rigs.evaluate import camera_pairs, shot_errors
from cubicfish.rigs.faults import (
    Moved,
    RigEvidence,
    find_rig_faults,
    moved_camera,
)
from cubicfish.rigs.names import with_agreeing_names
from cubicfish.rigs.rig import ErrorsInRig, Rig, RigCamera, RigFit, refuse_name
from cubicfish.rigs.rig_lens import RigLens
from cubicfish.rigs.shots import TOLERANCE, Matching, Times, match_shots
from cubicfish.rigs.spread import place_covariances
from cubicfish.rigs.start import connected, refuse_exchanged, start_rig
from cubicfish.rigs.times import Motion, Moving, Timing, on_time
from cubicfish.rigs.views import Alone, JoinedViews, calibrate_alone
from cubicfish.solve.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish.solve.deformable_target import LEVELS, Level, NominalTarget
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import (
    error_statistics,
    huber_px,
    noise_px,
    photo_records,
    rms_px,
    weighed,
)
from cubicfish.solve.subset import select, world_scale
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.threads import one_blas_thread
from cubicfish.types import FloatArray

# While cameras and shots are far off, the loss must still feel every corner.
_WIDE_HUBER_PX = 50.0
_ROUGH_DECREASE = 1e-5
_FINE_DECREASE = 1e-9
_RAYS = 300
# How the target moves follows from its shots, whose poses follow from that.
_TIMED_ROUNDS = 3
# Shots are set apart for a camera that moved where that explains more than so much of what shots
# have against its one place: they may be of different moments, too.
_CLEAR_MOVE = 0.5


@one_blas_thread()
def calibrate_rig(
    cameras: Mapping[str, Observations | Detection],
    target: Target | None = None,
    *,
    shots: Matching = "name",
    tolerance: float = TOLERANCE,
    times: Times | None = None,
    moving: Mapping[str, Moving] | None = None,
    known: Mapping[str, Calibrated] | None = None,
    hold_lenses: bool = False,
    refine_target: RefineTarget = "auto",
    listener: Listener = Listener(),
) -> Rig:
    """Fit the lenses of several cameras on one body, and how the cameras stand to each other.

    Each camera is calibrated alone first, without any guess; the fields of view need not overlap
    as long as two cameras each see some board of the rigid target in a shot.

    Args:
        cameras: by name, what :func:`detect` found in each one's photos, named corners, or pairs.
            The first camera's frame is the rig's.
        target: the calibration target; pairs need none.
        shots: which photos are of one shot: those of the same ``name`` (without folder and
            ending), those of one ``time``, or rows (shot, camera, photo).
        tolerance: how far apart photos of one time may be, seconds.
        times: by camera and photo, when it was taken, seconds on one clock; by default as photos'
            names say.
        moving: by camera, how its corners move; by default as shots beside each other say.
        known: cameras that are calibrated already; their lenses stay as they are.
        hold_lenses: leave all lenses as each camera alone has them; only places and shots are
            fitted together.
        refine_target: as in :func:`calibrate`.
        listener: who is told how far it is.

    Returns:
        Cameras with camera_from_rig (target's units) and its covariance, errors in pixels, and
        findings.

    Raises:
        CorrespondenceError: corners come without their target, or do not fit it.
        FitError: a camera cannot be calibrated, no shot connects the cameras, or the shots do
            not fit one rig; one line that says which and what to do.

    """
    names, known = list(cameras), known or {}
    for name in names:
        refuse_name(name, "camera", FitError)
    given = {name: observed(own, target) for name, own in cameras.items()}
    matched = match_shots(
        {name: own.images for name, own in given.items()}, shots, tolerance, times
    )
    if len(names) < 2:
        raise FitError("a rig has two cameras or more: calibrate a single one with 'calibrate'")
    refuse_exchanged(given, {name: known[name] for name in names if name in known})
    everything = np.concatenate([own.world for own in given.values()])
    origin = everything.mean(axis=0)
    scale = world_scale(given[names[0]].with_world(everything))
    progress = listener.stages("Fitting")
    singly = []
    for number, (name, own) in enumerate(given.items()):
        progress(f"camera {name} alone", 0.8 * number / len(names))
        singly.append(
            calibrate_alone(
                name,
                own,
                known.get(name),
                target,
                refine_target,
                origin,
                scale,
                keep_lens=hold_lenses,
            )
        )
    progress("all cameras together", 0.8)
    joined = JoinedViews.of_cameras([one.lens for one in singly], singly, matched)
    when = Motion.of_names(names, matched.names, matched.photos, times)
    if moving:
        moves = [(one.seen, moving.get(name)) for name, one in zip(names, singly, strict=True)]
        camera_of = joined.lens.camera[joined.pairs.image]
        when = when.with_flow(Moving.of_cameras(moves, camera_of, joined.pairs), moves)
    if target is not None:
        joined = with_agreeing_names(joined, target.moved(-origin), scale)
    try:
        start = start_rig(names, joined)
    except FitError as error:
        bad = [one for camera in singly for one in camera.findings if one.severity is Severity.BAD]
        raise FitError(f"{error}; {bad[0].line}" if bad else str(error)) from error
    joined = replace(joined, lens=replace(joined.lens, places=start.places))
    joined, poses = joined.set_apart(start.shots, np.flatnonzero(start.apart))
    units, pairs = None if target is None else target.units, joined.pairs
    level: Level = "off"
    if target is not None:
        level = max((one.level for one in singly), key=LEVELS.index)
        points = target.world_points(pairs.board, pairs.column, pairs.row)
        pairs = pairs.with_world((points - origin) / scale)
    nominal = NominalTarget(target=target and target.moved(-origin), pairs=pairs, scale=scale)
    moved: list[Moved] = []
    while True:
        fit, pairs, timing = _fit(singly, joined, poses, nominal, when, level)
        evidence = RigEvidence(
            names=names,
            fit=fit,
            pairs=pairs.with_world(fit.world.points),
            moved=tuple(moved),
            timing=timing,
            start=start,
            views=replace(joined, lens=fit.lens),
            scale=scale,
            units=units,
        )
        found = moved_camera(evidence)
        # What two places explain little better has another cause, and is reported as that.
        if found is None or found.share <= _CLEAR_MOVE:
            break
        apart, poses = evidence.views.set_apart(fit.poses, found.apart)
        if not connected(apart.lens.common_shots):
            # It stands in one place: where it stood in most shots.
            mean = replace(found, apart=found.apart[:0])
            evidence = replace(evidence, moved=(*moved, mean))
            break
        moved.append(found)
        joined = apart
    progress("how certain it is", 0.95)
    refined = nominal.refined(fit.world) if fit.world.free else None
    refined = refined and refined.moved(origin)
    placed, poses = _find_places(evidence, singly, origin)
    held_out = _measure_held_out(fit, evidence.shots)
    errors = error_statistics(fit.errors, len(fit.residual))
    return Rig(
        units=units,
        cameras=tuple(_make_cameras(evidence, singly, placed, held_out, level)),
        pairs=camera_pairs(names, fit),
        fit=RigFit(
            **vars(errors),
            held_out_rms_px=NAN if held_out is None else rms_px(held_out[fit.pairs.error_known]),
            shots=len(evidence.shots),
            refine_target=level,
            held_lenses=not any(isinstance(own, CubicFit) for own in fit.lens.lenses),
            findings=(
                *(finding for one in singly for finding in one.findings),
                *find_rig_faults(evidence),
            ),
            per_shot=shot_errors(evidence.shots, names, fit, poses),
        ),
        target=refined,
    )


def _fit(
    singly: Sequence[Alone],
    joined: JoinedViews,
    poses: Poses,
    nominal: NominalTarget,
    when: Motion,
    level: Level,
) -> tuple[Adjustment[RigLens], Observations, Timing | None]:
    """Places, shots and the photos' times first, the lenses held; then all at once.

    Returns:
        The fit, in which photos count by their noise; the pairs, which all count alike; and how
        the photos' times were fitted.

    """
    pairs, rough = nominal.pairs, _ROUGH_DECREASE
    fixed = joined.lens.with_lenses([FixedLens(camera=one.as_camera(one.lens)) for one in singly])
    fit = adjust(fixed, poses, pairs, huber_px=_WIDE_HUBER_PX, relative_decrease=rough)
    fit = fit.again(pairs, relative_decrease=rough)
    fit, timing = on_time(fit, when, joined.shots, joined.photos)
    pairs = replace(pairs, error_known=nominal.pairs_at(level).error_known)
    alike = pairs
    if level != "off":
        start, spread = replace(nominal, pairs=pairs), FIRST_SPREAD if level == "points" else None
        world = start.free(noise=noise_px(fit.errors), offset_spread=spread)
        fit = fit.again(pairs, world=world, relative_decrease=1e-3)
        fit = estimate_spread(fit, pairs)
    # Photos that are not quite of one moment, too, say less than others.
    pairs = weighed(pairs, fit.residual)
    if level != "off":
        fit = estimate_spread(fit, pairs)
    lenses = [one.lens for one in singly]
    while any(isinstance(one, CubicFit) for one in lenses):
        joint = adjust(
            fit.lens.with_lenses(lenses),
            fit.poses,
            pairs,
            huber_px=huber_px(fit.errors),
            world=fit.world,
            relative_decrease=rough,
        )
        joint = _fit_finely(joint, weighed(alike, joint.residual), timing)
        spoilt = [
            number
            for number, (own, one) in enumerate(zip(joint.lens.lenses, singly, strict=True))
            if isinstance(own, CubicFit) and not _is_valid(one.as_camera(own))
        ]
        if not spoilt:
            return joint, alike, timing
        for number in spoilt:  # these alone stay as their own photos have them
            lenses[number] = fixed.lenses[number]
    return _fit_finely(fit, pairs, timing), alike, timing


def _is_valid(camera: CubicCamera) -> bool:
    return pole_or_fold_deg(camera.P, camera.max_angle_deg) is None


def _fit_finely(
    fit: Adjustment[RigLens], pairs: Observations, timing: Timing | None
) -> Adjustment[RigLens]:
    if timing is not None:
        for _ in range(_TIMED_ROUNDS):
            fit = timing.again(fit).again(pairs, relative_decrease=_ROUGH_DECREASE)
    return fit.again(pairs, relative_decrease=_FINE_DECREASE, damping=WARM_DAMPING, limit=huber_px)


def _find_places(
    evidence: RigEvidence, singly: Sequence[Alone], origin: FloatArray
) -> tuple[tuple[list[CubicCamera], Poses, Poses], Poses]:
    """The cameras in their references' frames, their places, the views and the shots.

    All are in the target's units; places are from the frame of the first camera.
    """
    cameras, parts = [], []
    for number, (own, one) in enumerate(zip(evidence.lens.lenses, singly, strict=True)):
        camera, place = one.as_camera(own), evidence.lens.places[np.array([number])]
        if isinstance(own, CubicFit):  # one that is held stays as it is, its frame too
            camera, place = in_references_frame(camera, place, one.covered)
        cameras.append(camera.scaled(evidence.scale))
        parts.append(place)
    zero, places = parts[0], Poses.joined(parts)
    shots, lens = evidence.fit.poses, evidence.lens
    poses, at_views = (
        (zero @ one).scaled(evidence.scale).of_world(origin)
        for one in (shots, lens.at_views(shots))
    )
    places = places @ zero.inverse()
    places.rotation[0], places.translation[0] = np.eye(3), 0.0
    places = places.scaled(evidence.scale)
    return (cameras, places, places[lens.camera] @ at_views), poses


def _make_cameras(
    evidence: RigEvidence,
    singly: Sequence[Alone],
    placed: tuple[list[CubicCamera], Poses, Poses],
    held_out: FloatArray | None,
    level: Level,
) -> Iterator[RigCamera]:
    """The rig's cameras, with their errors and how surely they stand where they do."""
    fit, lens, clocks = evidence.fit, evidence.lens, evidence.clocks
    cameras, places, views = placed
    covariance = place_covariances(
        fit,
        [cone_rays(one.covered, _RAYS) for one in singly],
        evidence.shots,
        [one.runners_up for one in singly],
        evidence.timing,
    )
    late = sigma = np.full(len(cameras), np.nan)
    if clocks is not None and clocks.in_seconds:
        late, sigma = clocks.late, clocks.sigma
    in_units = np.repeat([1.0, evidence.scale], 3)
    covariance = covariance * in_units[:, None] * in_units
    own_views, camera_of = lens.views(fit.poses), lens.camera[fit.pairs.image]
    error_known = fit.pairs.error_known
    for number, (name, one) in enumerate(zip(evidence.names, singly, strict=True)):
        own, taken = camera_of == number, np.flatnonzero(lens.camera == number)
        known = own & error_known if (own & error_known).any() else own
        pairs, seen = select(fit.pairs.with_world(fit.world.points), own)
        alone = adjust(
            FixedLens(camera=one.as_camera(lens.lenses[number])),
            own_views[seen],
            pairs,
            huber_px=huber_px(fit.errors),
        )
        errors = error_statistics(fit.residual[known], int(own.sum()))
        out = NAN if held_out is None else rms_px(held_out[known])
        yield RigCamera(
            name=name,
            camera=replace(cameras[number], units=evidence.units),
            fit=replace(
                one.record,
                **vars(errors),
                images=len(taken),
                held_out_rms_px=out,
                refine_target=level,
                per_image=photo_records(
                    replace(pairs, images=tuple(evidence.views.photos[view] for view in seen)),
                    fit.residual[own],
                    views[seen],
                ),
            ),
            path=f"{name}/camera.yaml",
            rotation=places.rotation[number],
            translation=places.translation[number],
            covariance=covariance[number],
            in_rig=ErrorsInRig(
                **vars(errors),
                images=len(taken),
                held_out_rms_px=out,
                alone_rms_px=rms_px(alone.residual[known[own]]),
                late_ms=1e3 * float(late[number]),
                late_sigma_ms=1e3 * float(sigma[number]),
            ),
        )


def _measure_held_out(fit: Adjustment[RigLens], shots: Sequence[str]) -> FloatArray | None:
    """(N, 2) residuals of each corner under a fit without its shot, to first order."""
    count = len(fit.poses)
    if count < MIN_PHOTOS:
        return None
    if fit.lens.times is not None:
        # A photo's time is its own, as its pose is.
        known = replace(fit.lens, times=replace(fit.lens.times, known=True))
        fit = _fit_finely(replace(fit, lens=known), fit.pairs, None)
    groups = dealt_out(np.arange(count), shots, min(FOLDS, count))
    shot = fit.lens.shot[fit.pairs.image]
    found = np.empty_like(fit.residual)
    for number, residual in LeaveOneOut(fit, groups).residuals():
        found[shot == number] = residual[:, :, 0]  # by view, as they are left out
    return found
