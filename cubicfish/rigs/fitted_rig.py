"""A fit of all cameras -> the record of the rig: lenses, places, errors, and how sure they are."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish.fit.alignment import in_references_frame
from cubicfish.fit.lenses import CubicFit
from cubicfish.judge.fit_record import NAN
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.sphere import cone_rays
from cubicfish.rigs.faults import RigEvidence, find_rig_faults
from cubicfish.rigs.joint_fit import leave_shots_out
from cubicfish.rigs.residuals import camera_pairs, shot_errors
from cubicfish.rigs.rig import ErrorsInRig, Rig, RigCamera, RigFit
from cubicfish.rigs.spread import place_covariances
from cubicfish.solve.adjustment import adjust
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import error_statistics, huber_px, photo_records, rms_px
from cubicfish.solve.subset import select
from cubicfish.target.observations import Observations
from cubicfish.types import BoolArray, FloatArray, IntArray

_RAYS = 300


def rig_of(evidence: RigEvidence) -> Rig:
    """The rig that was fitted, with what its cameras' own fits and its own say of themselves."""
    fit, problem = evidence.fit, evidence.problem
    refined = problem.nominal.refined(fit.world) if fit.world.free else None
    placed = _find_places(evidence)
    held_out = leave_shots_out(fit, evidence.shots, evidence.places)
    errors = error_statistics(fit.errors, len(fit.residual))
    return Rig(
        units=problem.units,
        cameras=tuple(_make_cameras(evidence, placed, held_out)),
        pairs=camera_pairs(evidence.names, fit),
        fit=RigFit(
            **vars(errors),
            held_out_rms_px=_measure_rms(held_out, fit.pairs.error_known),
            shots=len(evidence.shots),
            refine_target=problem.level,
            held_lenses=not any(isinstance(own, CubicFit) for own in fit.lens.lenses),
            findings=tuple(find_rig_faults(evidence)),
            per_shot=shot_errors(evidence.shots, evidence.names, fit, placed.shots),
        ),
        target=refined and refined.moved(problem.common.origin),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Placed:
    """Where a rig's cameras stand, in the target's units and from the first camera's frame.

    Attributes:
        cameras: in the frames of their references.
        places: camera_from_rig of each.
        views: camera_from_world of each view.
        shots: rig_from_world of each shot.

    """

    cameras: Sequence[CubicCamera]
    places: Poses
    views: Poses
    shots: Poses


def _find_places(evidence: RigEvidence) -> _Placed:
    lens, common, shots = evidence.lens, evidence.problem.common, evidence.fit.poses
    cameras, parts = [], []
    for number, (own, one) in enumerate(zip(lens.lenses, evidence.problem.singly, strict=True)):
        camera, place = one.as_camera(own), lens.places[np.array([number])]
        if isinstance(own, CubicFit):  # one that is held stays as it is, its frame too
            camera, place = in_references_frame(camera, place, one.covered)
        cameras.append(camera.scaled(common.scale))
        parts.append(place)
    zero = parts[0]
    places = Poses.joined(parts) @ zero.inverse()
    places.rotation[0], places.translation[0] = np.eye(3), 0.0
    places = places.scaled(common.scale)
    at_shots, at_views = (
        common.poses_of_target(zero @ one) for one in (shots, lens.at_views(shots))
    )
    views = places[lens.camera] @ at_views
    return _Placed(cameras=cameras, places=places, views=views, shots=at_shots)


def _make_cameras(
    evidence: RigEvidence, placed: _Placed, held_out: FloatArray | None
) -> Iterator[RigCamera]:
    """The rig's cameras, with their errors and how surely they stand where they do."""
    fit, lens, singly = evidence.fit, evidence.lens, evidence.problem.singly
    covariance = place_covariances(
        fit,
        [cone_rays(one.covered, _RAYS) for one in singly],
        evidence.shots,
        evidence.places,
        [one.runners_up for one in singly],
        evidence.timing,
    )
    in_units = np.repeat([1.0, evidence.problem.common.scale], 3)
    covariance = covariance * in_units[:, None] * in_units
    late, sigma = _find_lateness(evidence)
    for number, (name, one) in enumerate(zip(evidence.names, singly, strict=True)):
        own = lens.camera[fit.pairs.image] == number
        told = own & fit.pairs.error_known
        known = told if told.any() else own
        pairs, views = select(fit.pairs.with_world(fit.world.points), own)
        errors = error_statistics(fit.residual[known], len(pairs.image))
        held_out_px = _measure_rms(held_out, known)
        photos = tuple(evidence.views.photos[view] for view in views)
        yield RigCamera(
            name=name,
            camera=replace(placed.cameras[number], units=evidence.problem.units),
            fit=replace(
                one.record,
                **vars(errors),
                images=len(views),
                held_out_rms_px=held_out_px,
                refine_target=evidence.problem.level,
                per_image=photo_records(
                    replace(pairs, images=photos), fit.residual[own], placed.views[views]
                ),
            ),
            path=f"{name}/camera.yaml",
            rotation=placed.places.rotation[number],
            translation=placed.places.translation[number],
            covariance=covariance[number],
            in_rig=ErrorsInRig(
                **vars(errors),
                images=len(views),
                held_out_rms_px=held_out_px,
                alone_rms_px=rms_px(_fit_alone(evidence, number, pairs, views)[known[own]]),
                late_ms=1e3 * float(late[number]),
                late_sigma_ms=1e3 * float(sigma[number]),
            ),
        )


def _find_lateness(evidence: RigEvidence) -> tuple[FloatArray, FloatArray]:
    """(C,) by how much each camera is late, and (C,) how surely, seconds; NaN where not known."""
    clocks = evidence.clocks
    if clocks is None or not clocks.in_seconds:
        return (np.full(len(evidence.names), np.nan),) * 2
    return clocks.late, clocks.sigma


def _fit_alone(
    evidence: RigEvidence, number: int, pairs: Observations, views: IntArray
) -> FloatArray:
    """(N, 2) residuals of one camera's pairs, the pose of each of its views free, the lens held."""
    fit, lens = evidence.fit, evidence.lens
    held = FixedLens(camera=evidence.problem.singly[number].as_camera(lens.lenses[number]))
    poses = lens.views(fit.poses)[views]
    return adjust(held, poses, pairs, huber_px=huber_px(fit.errors)).residual


def _measure_rms(residual: FloatArray | None, rows: BoolArray) -> float:
    """RMS of some rows (N,) of residuals; NaN where they were not measured."""
    return NAN if residual is None else rms_px(residual[rows])
