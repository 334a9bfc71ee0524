"""Photos of several cameras on one body -> the rig: lenses, and where each camera stands.

Each camera is calibrated alone first, without any guess. What the shots that two cameras share
say of their places is a start; one adjustment then has lenses, places, shots and target at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish_cli.fitting.calibrate import RefineTarget, calibrate
from cubicfish_cli.fitting.cubic_fit import fit_cubic, held
from cubicfish_cli.fitting.evidence import Diagnose
from cubicfish_cli.fitting.fit_lens import FitLens
from cubicfish_cli.fitting.folds import FOLDS, MIN_PHOTOS, dealt_out
from cubicfish_cli.fitting.frame import in_references_frame
from cubicfish_cli.fitting.hold import UNTOLD
from cubicfish_cli.fitting.known_lens import fit_poses
from cubicfish_cli.fitting.left_out import Leaving
from cubicfish_cli.fitting.lenses import CubicFit, FixedLens
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.radial_reference import radial_near
from cubicfish_cli.fitting.refinement import LEVELS, Level, settled_spread
from cubicfish_cli.fitting.rig.clocks import Clocks, Moving, fitted_clocks
from cubicfish_cli.fitting.rig.evaluate import (
    CameraPair,
    alone_residual,
    camera_pairs,
    shot_records,
)
from cubicfish_cli.fitting.rig.evidence import Moved, RigEvidence
from cubicfish_cli.fitting.rig.gather import gathered, set_apart
from cubicfish_cli.fitting.rig.moved import moved_camera
from cubicfish_cli.fitting.rig.shots import Shots
from cubicfish_cli.fitting.rig.spread import place_covariances
from cubicfish_cli.fitting.rig.start import common_shots, connected, refuse_exchanged, start_rig
from cubicfish_cli.fitting.rig_lens import RigLens
from cubicfish_cli.fitting.robust import huber_px, noise_px
from cubicfish_cli.fitting.stages import Progress
from cubicfish_cli.fitting.statistics import (
    ErrorStatistics,
    error_statistics,
    photo_records,
    rms_px,
)
from cubicfish_cli.fitting.subset import with_mean_weight_one, world_scale
from cubicfish_cli.fitting.world import World
from cubicfish_cli.geometry import camera_centre, total_sigma
from cubicfish_cli.lenses.cubic import CubicCamera, check_validity
from cubicfish_cli.lenses.sphere import cone_rays
from cubicfish_cli.observations import Observations
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray
from cubicfish_cli.words.codes import Severity
from cubicfish_cli.words.finding import Finding, RigFinding, of_camera

# While cameras and shots are far off, the loss must still feel every corner.
_WIDE_HUBER_PX = 50.0
_ROUGH_DECREASE = 1e-5
_FINE_DECREASE = 1e-9
_RAYS = 300
_FIRST_OFFSET = 1e-4
# The way back to a shot's moment is a step along the motion, and is taken a few times.
_CLOCK_ROUNDS = 4
# Shots are set apart for a camera that moved where that explains more than so much of what shots
# have against its one place: they may be of different moments, too.
_CLEAR_MOVE = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class RigCamera:
    """What is known of one camera before the rig is fitted.

    Attributes:
        name: of the camera.
        pairs: its 2D-3D pairs, in the target's units.
        camera: its lens, where it is calibrated already, and is left as it is; None to calibrate
            it from its pairs.
        fit: the record of that calibration; empty where there is none.
        moving: how its corners move, where that is known: photos of a shot then need not be of
            one moment.

    """

    name: str
    pairs: Observations
    camera: CubicCamera | None = None
    fit: Mapping[str, Any] | None = None
    moving: Moving | None = None


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
    fit: Mapping[str, Any]
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Alone:
    """One camera calibrated alone, in the common scale of all.

    Its lens is free, or fixed where it is held. The rival has the prior of the hold that predicted
    best, and says how likely that is the better one.
    """

    camera: CubicCamera
    lens: FitLens
    rival: tuple[FitLens, float] | None
    record: Mapping[str, Any]
    level: Level
    pairs: Observations
    poses: Poses
    told: tuple[RigFinding, ...]


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
        target: the object; without it it stays as it is.
        refine_target: what of the object is fitted, as for one camera.
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
    alone = []
    for number, camera in enumerate(cameras):
        if progress is not None:
            progress(f"camera {camera.name} alone", 0.8 * number / len(cameras))
        alone.append(_alone(camera, target, refine_target, origin, scale, hold_lenses, diagnose))
    if progress is not None:
        progress("all cameras together", 0.8)
    names = [camera.name for camera in cameras]
    moves = [None if one.moving is None else (one.pairs, one.moving) for one in cameras]
    lens, views, pairs, seen, moving = gathered(alone, shots, moves)
    try:
        start = start_rig(names, lens, views, pairs, seen.shot)
    except FitError as error:
        told = [one for camera in alone for one in camera.told if one.severity is Severity.BAD]
        raise FitError(f"{error}; {told[0].line}" if told else str(error)) from error
    lens, poses, seen = set_apart(
        replace(lens, places=start.places), start.shots, views, seen, np.flatnonzero(start.apart)
    )
    moved: list[Moved] = []
    while True:
        fit, level, on_time, clocks = _fitted(
            alone, lens, poses, pairs, moving, target, scale, origin
        )
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
        if not clear or not connected(common_shots(apart[0], len(names))):
            mean = replace(found, apart=found.apart[:0])
            evidence = replace(evidence, moved=(*moved, mean))
            break
        moved.append(found)
        lens, poses, seen = apart
    if progress is not None:
        progress("how certain it is", 0.95)
    return _calibration(evidence, alone, level, target, origin, diagnose)


def _alone(
    camera: RigCamera,
    target: Target | None,
    refine_target: RefineTarget,
    origin: FloatArray,
    scale: float,
    hold: bool,
    diagnose: Diagnose | None,
) -> _Alone:
    """Calibrate a camera, or take it as it was calibrated; then its fit in the common scale."""
    if camera.camera is None:
        try:
            found = calibrate(
                camera.pairs, target=target, refine_target=refine_target, diagnose=diagnose
            )
        except FitError as error:
            raise FitError(f"camera {camera.name}: {error}") from error
        lens, record, pairs, poses = found.camera, found.as_record(), found.pairs, found.poses
        level, held_by, rival = found.refined, found.hold, found.rival
        told = tuple(of_camera(camera.name, one) for one in found.findings)
    else:
        lens, record, hold = camera.camera, dict(camera.fit or {}), True
        placed, pairs, _ = fit_poses(lens.radial, camera.pairs)
        if placed is None:
            raise FitError(
                f"camera {camera.name}: none of its photos can be placed with its lens: check "
                "that they are of this camera and of this target"
            )
        poses, level, held_by, rival, told = placed.poses, "off", UNTOLD, None, ()
    pairs = with_mean_weight_one(pairs.with_world((pairs.world - origin) / scale))
    poses = poses.of_world(-origin)
    poses = replace(poses, translation=poses.translation / scale)
    free: FitLens
    other: tuple[FitLens, float] | None = None
    if hold:
        free = FixedLens(camera=lens)
        fit = adjust(free, poses, pairs, huber_px=_WIDE_HUBER_PX, relative_decrease=_ROUGH_DECREASE)
        poses = adjust(free, fit.poses, pairs, huber_px=huber_px(fit.residual)).poses
    else:
        reference = radial_near(lens.radial, pairs, poses)
        result = fit_cubic(reference, held_by, relative_decrease=_ROUGH_DECREASE)
        free, poses = result.lens, result.poses
        if rival is not None:
            other = held(result.lens, reference, rival.hold), rival.likely
    return _Alone(
        camera=lens,
        lens=free,
        rival=other,
        record=record,
        level=level,
        pairs=pairs,
        poses=poses,
        told=told,
    )


def _fitted(
    alone: Sequence[_Alone],
    lens: RigLens,
    poses: Poses,
    pairs: Observations,
    moving: Moving | None,
    target: Target | None,
    scale: float,
    origin: FloatArray,
) -> tuple[Adjustment[RigLens], Level, Observations, Clocks | None]:
    """Places, shots and clocks first, the lenses held; then all at once."""
    level: Level = "off"
    if target is not None:
        level = max((one.level for one in alone), key=LEVELS.index)
        board, column, row = pairs.board, pairs.column, pairs.row
        drawn = (target.world_points(board, column, row) - origin) / scale
        pairs = pairs.with_world(drawn)
    held = [FixedLens(camera=_as_camera(one.lens, one)) for one in alone]
    fit = adjust(
        lens.with_lenses(held),
        poses,
        pairs,
        huber_px=_WIDE_HUBER_PX,
        relative_decrease=_ROUGH_DECREASE,
    )
    fit = _further(fit, pairs, fit.lens, World(as_drawn=pairs.world), _ROUGH_DECREASE)
    clocks = None
    if moving is not None:
        fit, pairs, clocks = _on_time(fit, pairs, moving)
    world: World = World(as_drawn=pairs.world)
    if level != "off" and target is not None:
        world = _free_world(fit, pairs, target.moved(-origin), level, scale)
        fit = _further(fit, pairs, fit.lens, world, 1e-3)
        fit, _ = settled_spread(fit, pairs, _FIRST_OFFSET if level == "points" else None)
    if any(isinstance(one.lens, CubicFit) for one in alone):
        free = fit.lens.with_lenses([one.lens for one in alone])
        joint = _further(fit, pairs, free, fit.world, _ROUGH_DECREASE)
        joint = _further(joint, pairs, joint.lens, joint.world, _FINE_DECREASE)
        if all(_sound(own, one) for own, one in zip(joint.lens.lenses, alone, strict=True)):
            return joint, level, pairs, clocks
    return _further(fit, pairs, fit.lens, fit.world, _FINE_DECREASE), level, pairs, clocks


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
        fit = _further(fit, pairs, fit.lens, World(as_drawn=pairs.world), _ROUGH_DECREASE)
    speed = np.nan_to_num(np.hypot(moving.velocity[:, 0], moving.velocity[:, 1]))
    effect = [rms_px(np.outer(speed[camera == own], [abs(one), 0])) for own, one in enumerate(late)]
    return fit, pairs, Clocks(late=late, sigma=found.sigma, effect_px=np.array(effect))


def _further(
    fit: Adjustment[RigLens], pairs: Observations, lens: RigLens, world: World, decrease: float
) -> Adjustment[RigLens]:
    return adjust(
        lens,
        fit.poses,
        pairs,
        huber_px=huber_px(fit.residual),
        world=world,
        relative_decrease=decrease,
        damping=WARM_DAMPING if decrease < _ROUGH_DECREASE else 1e-4,
    )


def _free_world(
    fit: Adjustment[RigLens], pairs: Observations, target: Target, level: Level, scale: float
) -> World:
    return World.drawn(
        pairs,
        target,
        noise=noise_px(fit.residual),
        offset_spread=_FIRST_OFFSET if level == "points" else None,
        scale=scale,
    )


def _as_camera(lens: FitLens, alone: _Alone) -> CubicCamera:
    """The camera of a lens of the adjustment, in the adjustment's frame."""
    if isinstance(lens, CubicFit):
        return replace(alone.camera, P=lens.P)
    if isinstance(lens, FixedLens) and isinstance(lens.camera, CubicCamera):
        return lens.camera
    return alone.camera


def _sound(lens: FitLens, alone: _Alone) -> bool:
    camera = _as_camera(lens, alone)
    return check_validity(camera.P, camera.max_angle_deg).valid


def _calibration(
    evidence: RigEvidence,
    alone: Sequence[_Alone],
    level: Level,
    target: Target | None,
    origin: FloatArray,
    diagnose: Diagnose | None,
) -> RigCalibration:
    names, fit, lens, drawn = evidence.names, evidence.fit, evidence.lens, evidence.pairs
    clocks, scale = evidence.clocks, evidence.scale
    limit = huber_px(fit.residual)
    rays = [cone_rays(np.deg2rad(_covered_deg(one)), _RAYS) for one in alone]
    rivals = [one.rival for one in alone]
    covariance = place_covariances(fit, drawn, limit, rays, evidence.shots, rivals)
    covariance[:, 3:] *= scale
    covariance[:, :, 3:] *= scale
    held_out = _held_out(fit, drawn, limit, evidence.shots)
    turned, places = _in_references_frames(lens, alone)
    zero = places[np.array([0])]
    poses = zero @ fit.poses
    poses = poses.scaled(scale).of_world(origin)
    places = places @ zero.inverse()
    places.rotation[0], places.translation[0] = np.eye(3), 0.0
    places = places.scaled(scale)
    views = places[lens.camera] @ poses[lens.shot]
    camera_of = lens.camera[drawn.image]
    held = [
        FixedLens(camera=_as_camera(own, one)) for own, one in zip(lens.lenses, alone, strict=True)
    ]
    alone_px = alone_residual(fit, lens, drawn, held, limit)
    placed = []
    for number, (name, one) in enumerate(zip(names, alone, strict=True)):
        own = camera_of == number
        of_camera = np.flatnonzero(lens.camera == number)
        errors = error_statistics(fit.residual[own])
        records = photo_records(
            [evidence.photos[view] for view in of_camera.tolist()],
            np.searchsorted(of_camera, drawn.image[own]),
            fit.residual[own],
            views[of_camera],
        )
        out = None if held_out is None else rms_px(held_out[own])
        record = {
            **one.record,
            **errors.as_record(),
            "images": len(of_camera),
            "held_out_rms_px": out,
            "refine_target": level,
            "per_image": records,
        }
        placed.append(
            PlacedCamera(
                name=name,
                camera=turned[number],
                rotation=places.rotation[number],
                translation=places.translation[number],
                covariance=covariance[number],
                errors=errors,
                alone_rms_px=rms_px(alone_px[own]),
                held_out_rms_px=out,
                fit=record,
                late_s=None if clocks is None else float(clocks.late[number]),
                late_sigma_s=None if clocks is None else float(clocks.sigma[number]),
            )
        )
    refined = target
    if target is not None and fit.world.free:
        refined = fit.world.refined_target(target.moved(-origin), drawn, scale=scale).moved(origin)
    found: Sequence[Finding] = ()
    if diagnose is not None:
        found = diagnose(evidence)
    return RigCalibration(
        units=None if target is None else target.units,
        cameras=tuple(placed),
        shots=tuple(evidence.shots),
        poses=poses,
        errors=error_statistics(fit.residual),
        held_out_rms_px=None if held_out is None else rms_px(held_out),
        pairs=tuple(camera_pairs(names, lens, drawn, fit.residual)),
        per_shot=tuple(shot_records(evidence.shots, lens, drawn, fit.residual, names)),
        refined=level,
        target=refined,
        held_lenses=not any(isinstance(own, CubicFit) for own in lens.lenses),
        findings=(
            *(told for one in alone for told in one.told),
            *(one for one in found if isinstance(one, RigFinding)),
        ),
    )


def _covered_deg(one: _Alone) -> float:
    covered = one.record.get("covered_deg")
    if isinstance(covered, int | float) and 0 < covered < 180:
        return float(covered)
    return one.camera.max_angle_deg


def _in_references_frames(
    lens: RigLens, alone: Sequence[_Alone]
) -> tuple[list[CubicCamera], Poses]:
    """Each camera in its reference's frame, and camera_from_rig with it."""
    cameras, places = [], []
    for number, (own, one) in enumerate(zip(lens.lenses, alone, strict=True)):
        camera = _as_camera(own, one)
        place = lens.places[np.array([number])]
        if isinstance(own, CubicFit):  # one that is held stays as it is, its frame too
            camera, place = in_references_frame(camera, place, np.deg2rad(_covered_deg(one)))
        cameras.append(camera)
        places.append(place)
    return cameras, Poses.joined(places)


def _held_out(
    fit: Adjustment[RigLens], pairs: Observations, limit: float, shots: Sequence[str]
) -> FloatArray | None:
    """(N, 2) residuals of each corner under a fit without its shot, to first order."""
    count = len(fit.poses)
    if count < MIN_PHOTOS:
        return None
    groups = dealt_out(np.arange(count), shots, min(FOLDS, count))
    shot = fit.lens.shot[pairs.image]
    found = np.empty_like(fit.residual)
    for number, residual in Leaving(fit, pairs, limit, groups).residuals():
        found[shot == number] = residual[:, :, 0]  # by view, as they are left out
    return found
