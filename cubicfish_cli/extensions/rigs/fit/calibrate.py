"""Photos of several cameras on one body -> the rig: lenses, and where each camera stands.

Each camera is calibrated alone first, without any guess. What the shots that two cameras share
say of their places is a start; one adjustment then has lenses, places, shots and target at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cubicfish_cli.core.assess.fit_record import ErrorStatistics, FitRecord
from cubicfish_cli.core.codes import Severity
from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.finding import RigFinding
from cubicfish_cli.core.fit.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish_cli.core.fit.alignment import in_references_frame
from cubicfish_cli.core.fit.evidence import Diagnose
from cubicfish_cli.core.fit.folds import FOLDS, MIN_PHOTOS, dealt_out
from cubicfish_cli.core.fit.left_out import LeaveOneOut
from cubicfish_cli.core.fit.lenses import CubicFit, FixedLens
from cubicfish_cli.core.fit.model_selection import RefineTarget
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.refinement import (
    FIRST_SPREAD,
    LEVELS,
    Level,
    NominalTarget,
    estimate_spread,
    free_target,
)
from cubicfish_cli.core.fit.rig_lens import RigLens
from cubicfish_cli.core.fit.robust import huber_px, noise_px, weighed
from cubicfish_cli.core.fit.stages import Progress
from cubicfish_cli.core.fit.statistics import (
    error_statistics,
    photo_records,
    rms_px,
)
from cubicfish_cli.core.fit.subset import world_scale
from cubicfish_cli.core.geometry import camera_centre, total_sigma
from cubicfish_cli.core.lenses.cubic import CubicCamera, check_validity
from cubicfish_cli.core.lenses.sphere import cone_rays
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.threads import one_blas_thread
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.extensions.rigs.fit.alone import Alone, RigCamera, alone
from cubicfish_cli.extensions.rigs.fit.clocks import Clocks, Moving, fitted_clocks
from cubicfish_cli.extensions.rigs.fit.evaluate import (
    CameraPair,
    alone_residual,
    camera_pairs,
    shot_records,
)
from cubicfish_cli.extensions.rigs.fit.evidence import Moved, RigEvidence
from cubicfish_cli.extensions.rigs.fit.gather import gathered, set_apart
from cubicfish_cli.extensions.rigs.fit.moved import moved_camera
from cubicfish_cli.extensions.rigs.fit.names import agreeing
from cubicfish_cli.extensions.rigs.fit.shots import Shots
from cubicfish_cli.extensions.rigs.fit.spread import place_covariances
from cubicfish_cli.extensions.rigs.fit.start import connected, refuse_exchanged, start_rig

# While cameras and shots are far off, the loss must still feel every corner.
_WIDE_HUBER_PX = 50.0
_ROUGH_DECREASE = 1e-5
_FINE_DECREASE = 1e-9
_RAYS = 300
# The way back to a shot's moment is a step along the motion, and is taken a few times.
_CLOCK_ROUNDS = 4
# Shots are set apart for a camera that moved where that explains more than so much of what shots
# have against its one place: they may be of different moments, too.
_CLEAR_MOVE = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedCamera:
    """One camera of a calibrated rig.

    Attributes:
        name: of the camera.
        camera: its lens.
        rotation: (3, 3) of camera_from_rig.
        translation: (3,) of camera_from_rig, in the target's units.
        covariance: (6, 6) of camera_from_rig: a turn in the camera's frame (radians), then the
            translation; zero for the first camera, whose frame is the rig's.
        errors: its reprojection errors in the rig's fit, pixels.
        alone_rms_px: RMS of the same corners with each photo's pose free, the lens as it is.
        held_out_rms_px: RMS on shots that were left out; None where there are too few.
        fit: the record of its lens, for its camera.yaml.
        late_s: by how much its photos are later than the first camera's, which was taken out;
            None where that could not be told.
        late_sigma_s: its standard deviation.

    """

    name: str
    camera: CubicCamera
    rotation: FloatArray
    translation: FloatArray
    covariance: FloatArray
    errors: ErrorStatistics
    alone_rms_px: float
    held_out_rms_px: float | None
    fit: FitRecord
    late_s: float | None = None
    late_sigma_s: float | None = None

    @property
    def position(self) -> FloatArray:
        """(3,) the camera's centre in the rig's frame, in the target's units."""
        return camera_centre(self.rotation, self.translation)

    @property
    def turn_sigma_deg(self) -> float:
        """Standard deviation of the turn: root of the sum over its three axes, degrees."""
        return float(np.rad2deg(total_sigma(self.covariance[:3, :3])))

    @property
    def shift_sigma(self) -> float:
        """Standard deviation of the translation, likewise, in the target's units."""
        return total_sigma(self.covariance[3:, 3:])


@dataclass(frozen=True, kw_only=True, eq=False)
class RigCalibration:
    """A fitted rig and how well it fits.

    Attributes:
        units: of lengths: the target's; None for pairs that came without one.
        cameras: the cameras; the first one's frame is the rig's.
        shots: names of the shots that took part.
        poses: rig_from_world of each, in the target's units.
        errors: reprojection errors over all corners, pixels.
        held_out_rms_px: RMS on shots left out of the fit; None with fewer than three.
        pairs: every two cameras.
        per_shot: of each shot its RMS in pixels, its corners and cameras.
        refined: what of the target was fitted: ``off``, ``shape`` or ``points``.
        target: the target as fitted; None for pairs that came without one.
        held_lenses: whether the lenses stayed as they were.
        findings: what is likely wrong with the set-up.

    """

    units: str | None
    cameras: tuple[PlacedCamera, ...]
    shots: tuple[str, ...]
    poses: Poses
    errors: ErrorStatistics
    held_out_rms_px: float | None
    pairs: tuple[CameraPair, ...]
    per_shot: tuple[Mapping[str, Any], ...]
    refined: Level
    target: Target | None
    held_lenses: bool
    findings: tuple[RigFinding, ...]


@one_blas_thread()
def calibrate_rig(
    cameras: Sequence[RigCamera],
    shots: Shots,
    *,
    target: Target | None = None,
    refine_target: RefineTarget = "auto",
    hold_lenses: bool = False,
    diagnose: Diagnose | None = None,
    progress: Progress | None = None,
) -> RigCalibration:
    """Fit the lenses of several cameras and how they stand to each other.

    Args:
        cameras: two or more; the first one's frame becomes the rig's.
        shots: which photos are of one shot.
        target: the target; without it it stays as it is.
        refine_target: what of the target is fitted, as for one camera.
        hold_lenses: leave the lenses as each camera alone has them.
        diagnose: tells what is likely wrong with each camera alone, and with the rig; by
            default nobody does.
        progress: called with what is done now, in words, and the share done, 0 to 1.

    Raises:
        FitError: a camera cannot be calibrated alone, the cameras are not connected, or the
            shots do not fit one rig.

    """
    if len(cameras) < 2:
        raise FitError("a rig has two cameras or more: calibrate a single one with 'calibrate'")
    refuse_exchanged(cameras)
    everything = np.concatenate([camera.pairs.world for camera in cameras])
    origin = everything.mean(axis=0)
    scale = world_scale(cameras[0].pairs.with_world(everything))
    singly = []
    for number, camera in enumerate(cameras):
        if progress is not None:
            progress(f"camera {camera.name} alone", 0.8 * number / len(cameras))
        singly.append(
            alone(camera, target, refine_target, origin, scale, hold=hold_lenses, diagnose=diagnose)
        )
    if progress is not None:
        progress("all cameras together", 0.8)
    names = [camera.name for camera in cameras]
    moves = [
        None if given.moving is None else (own.seen, given.moving)
        for given, own in zip(cameras, singly, strict=True)
    ]
    lens, views, pairs, seen, moving = gathered(singly, shots, moves)
    if target is not None:
        views, pairs = agreeing(lens, views, pairs, target.moved(-origin), scale)
    try:
        start = start_rig(names, lens, views, pairs, seen.shot)
    except FitError as error:
        told = [one for camera in singly for one in camera.told if one.severity is Severity.BAD]
        raise FitError(f"{error}; {told[0].line}" if told else str(error)) from error
    lens, poses, seen = set_apart(
        replace(lens, places=start.places), start.shots, views, seen, np.flatnonzero(start.apart)
    )
    level: Level = "off"
    if target is not None:
        level = max((one.level for one in singly), key=LEVELS.index)
        drawn = target.world_points(pairs.board, pairs.column, pairs.row)
        pairs = pairs.with_world((drawn - origin) / scale)
    nominal = NominalTarget(target=target and target.moved(-origin), pairs=pairs, scale=scale)
    moved: list[Moved] = []
    while True:
        fit, on_time, clocks = _fitted(singly, lens, poses, nominal, moving, level)
        evidence = RigEvidence(
            names=names,
            fit=fit,
            pairs=on_time.with_world(fit.world.points),
            moved=tuple(moved),
            clocks=clocks,
            start=start,
            photos=seen.photo,
            shots=seen.shot,
            scale=scale,
        )
        found = moved_camera(evidence)
        if found is None:
            break
        # It stands in one place: where it stood in most shots.
        apart = set_apart(fit.lens, fit.poses, views, seen, found.apart)
        clear = found.share > _CLEAR_MOVE
        if not clear or not connected(apart[0].common_shots):
            mean = replace(found, apart=found.apart[:0])
            evidence = replace(evidence, moved=(*moved, mean))
            break
        moved.append(found)
        lens, poses, seen = apart
    if progress is not None:
        progress("how certain it is", 0.95)
    refined = target
    if nominal.target is not None and fit.world.free:
        nearby = fit.world.refined_target(nominal.target, evidence.pairs, scale=scale)
        refined = nearby.moved(origin)
    placed, poses, held_out_px = _judged(evidence, singly, level, origin, target)
    found_wrong = diagnose(evidence) if diagnose is not None else ()
    return RigCalibration(
        units=None if target is None else target.units,
        cameras=placed,
        shots=tuple(evidence.shots),
        poses=poses,
        errors=error_statistics(fit.errors, len(fit.residual)),
        held_out_rms_px=held_out_px,
        pairs=tuple(camera_pairs(names, fit.lens, evidence.pairs, fit.residual)),
        per_shot=tuple(shot_records(evidence.shots, fit.lens, evidence.pairs, fit.residual, names)),
        refined=level,
        target=refined,
        held_lenses=not any(isinstance(own, CubicFit) for own in fit.lens.lenses),
        findings=(
            *(told for one in singly for told in one.told),
            *(one for one in found_wrong if isinstance(one, RigFinding)),
        ),
    )


def _fitted(
    singly: Sequence[Alone],
    lens: RigLens,
    poses: Poses,
    nominal: NominalTarget,
    moving: Moving | None,
    level: Level,
) -> tuple[Adjustment[RigLens], Observations, Clocks | None]:
    """Places, shots and clocks first, the lenses held; then all at once.

    Returns:
        The fit, in which photos count by their noise; the pairs as of their shots' moments, which
        all count alike, and what clocks say.

    """
    pairs, rough = nominal.pairs, _ROUGH_DECREASE
    held = lens.with_lenses([FixedLens(camera=one.as_camera(one.lens)) for one in singly])
    fit = adjust(held, poses, pairs, huber_px=_WIDE_HUBER_PX, relative_decrease=rough)
    fit = fit.again(pairs, relative_decrease=rough)
    clocks = None
    if moving is not None:
        fit, pairs, clocks = _on_time(fit, pairs, moving)
    pairs = replace(pairs, tells_error=nominal.pairs_at(level).tells_error)
    alike, spread = pairs, FIRST_SPREAD if level == "points" else None
    if level != "off":
        world = free_target(nominal.of(pairs), noise=noise_px(fit.errors), offset_spread=spread)
        fit = fit.again(pairs, world=world, relative_decrease=1e-3)
        fit, spread = estimate_spread(fit, pairs, spread)
    # Photos that are not quite of one moment, too, say less than others.
    pairs = weighed(pairs, fit.residual)
    if level != "off":
        fit, _ = estimate_spread(fit, pairs, spread)
    if any(isinstance(one.lens, CubicFit) for one in singly):
        joint = adjust(
            fit.lens.with_lenses([one.lens for one in singly]),
            fit.poses,
            pairs,
            huber_px=huber_px(fit.errors),
            world=fit.world,
            relative_decrease=rough,
        )
        joint = _finely(joint, weighed(alike, joint.residual))
        cameras = (one.as_camera(own) for own, one in zip(joint.lens.lenses, singly, strict=True))
        if all(check_validity(one.P, one.max_angle_deg).valid for one in cameras):
            return joint, alike, clocks
    return _finely(fit, pairs), alike, clocks


def _finely(fit: Adjustment[RigLens], pairs: Observations) -> Adjustment[RigLens]:
    return fit.again(pairs, relative_decrease=_FINE_DECREASE, damping=WARM_DAMPING, limit=huber_px)


def _on_time(
    fit: Adjustment[RigLens], pairs: Observations, moving: Moving
) -> tuple[Adjustment[RigLens], Observations, Clocks]:
    """The fit with corners where they were at their shot's moment, and what clocks say of it."""
    camera = fit.lens.camera[pairs.image]
    late = np.zeros(len(fit.lens.lenses))
    for _ in range(_CLOCK_ROUNDS):
        found = fitted_clocks(fit, pairs, moving)
        if not found.late.any():
            break
        late += found.late
        pairs = replace(pairs, pixel=moving.at_once(pairs.pixel, found.late[camera]))
        fit = fit.again(pairs, relative_decrease=_ROUGH_DECREASE)
    speed = np.nan_to_num(np.hypot(moving.velocity[:, 0], moving.velocity[:, 1]))
    effect = [rms_px(np.outer(speed[camera == own], [abs(one), 0])) for own, one in enumerate(late)]
    return fit, pairs, Clocks(late=late, sigma=found.sigma, effect_px=np.array(effect))


def _judged(
    evidence: RigEvidence,
    singly: Sequence[Alone],
    level: Level,
    origin: FloatArray,
    target: Target | None,
) -> tuple[tuple[PlacedCamera, ...], Poses, float | None]:
    """The cameras and the shots' poses in the target's units, and the held-out RMS."""
    fit, lens, clocks = evidence.fit, evidence.lens, evidence.clocks
    pairs = fit.pairs.with_world(fit.world.points)
    scale, limit, tells = evidence.scale, huber_px(fit.errors), pairs.tells_error
    covariance = place_covariances(
        fit,
        [cone_rays(one.covered, _RAYS) for one in singly],
        evidence.shots,
        [one.runners_up for one in singly],
    )
    in_units = np.repeat([1.0, scale], 3)
    covariance = covariance * in_units[:, None] * in_units
    held_out = _held_out(fit, pairs, evidence.shots)
    cameras, places = _in_references_frames(lens, singly)
    zero = places[np.array([0])]
    poses = (zero @ fit.poses).scaled(scale).of_world(origin)
    places = places @ zero.inverse()
    places.rotation[0], places.translation[0] = np.eye(3), 0.0
    places = places.scaled(scale)
    views = places[lens.camera] @ poses[lens.shot]
    camera_of = lens.camera[pairs.image]
    held = [
        FixedLens(camera=one.as_camera(own)) for own, one in zip(lens.lenses, singly, strict=True)
    ]
    alone_px = alone_residual(fit, pairs, held, limit)
    placed = []
    for number, (name, one) in enumerate(zip(evidence.names, singly, strict=True)):
        own, taken = camera_of == number, np.flatnonzero(lens.camera == number)
        known = own & tells if (own & tells).any() else own
        errors = error_statistics(fit.residual[known], int(own.sum()))
        out = None if held_out is None else rms_px(held_out[known])
        record = replace(
            one.record,
            **vars(errors),
            images=len(taken),
            held_out_rms_px=np.nan if out is None else out,
            refine_target=level,
            per_image=photo_records(
                [evidence.photos[view] for view in taken.tolist()],
                np.searchsorted(taken, pairs.image[own]),
                fit.residual[own],
                views[taken],
                tells[own],
            ),
        )
        placed.append(
            PlacedCamera(
                name=name,
                camera=replace(
                    cameras[number].scaled(scale), units=None if target is None else target.units
                ),
                rotation=places.rotation[number],
                translation=places.translation[number],
                covariance=covariance[number],
                errors=errors,
                alone_rms_px=rms_px(alone_px[known]),
                held_out_rms_px=out,
                fit=record,
                late_s=None if clocks is None else float(clocks.late[number]),
                late_sigma_s=None if clocks is None else float(clocks.sigma[number]),
            )
        )
    return tuple(placed), poses, None if held_out is None else rms_px(held_out[tells])


def _in_references_frames(
    lens: RigLens, singly: Sequence[Alone]
) -> tuple[list[CubicCamera], Poses]:
    """Each camera in its reference's frame, and camera_from_rig with it."""
    cameras, places = [], []
    for number, (own, one) in enumerate(zip(lens.lenses, singly, strict=True)):
        camera, place = one.as_camera(own), lens.places[np.array([number])]
        if isinstance(own, CubicFit):  # one that is held stays as it is, its frame too
            camera, place = in_references_frame(camera, place, one.covered)
        cameras.append(camera)
        places.append(place)
    return cameras, Poses.joined(places)


def _held_out(
    fit: Adjustment[RigLens], pairs: Observations, shots: Sequence[str]
) -> FloatArray | None:
    """(N, 2) residuals of each corner under a fit without its shot, to first order."""
    count = len(fit.poses)
    if count < MIN_PHOTOS:
        return None
    groups = dealt_out(np.arange(count), shots, min(FOLDS, count))
    shot = fit.lens.shot[pairs.image]
    found = np.empty_like(fit.residual)
    for number, residual in LeaveOneOut(fit, groups).residuals():
        found[shot == number] = residual[:, :, 0]  # by view, as they are left out
    return found
