"""Photos of several cameras on one body -> the rig: lenses, and where each camera stands.

Each camera is calibrated alone first, without any guess. What the shots that two cameras share
say of their places is a start; one adjustment then has lenses, places, shots and target at once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cubicfish.errors import FitError
from cubicfish.find.identification.identified import Detection
from cubicfish.fit.model_selection import RefineTarget
from cubicfish.io.camera_yaml import Calibrated
from cubicfish.judge.codes import Severity
from cubicfish.listener import Listener
from cubicfish.rigs.alone import Alone, CommonWorld, calibrate_alone
from cubicfish.rigs.faults import Moved, RigEvidence, moved_camera
from cubicfish.rigs.fitted_rig import rig_of
from cubicfish.rigs.joint_fit import RigProblem, fit_jointly
from cubicfish.rigs.names import with_agreeing_names
from cubicfish.rigs.rig import Rig, RigCamera
from cubicfish.rigs.shots import Matching, Times
from cubicfish.rigs.start import RigStart, connected, refuse_exchanged, start_rig
from cubicfish.rigs.times import CornerMotion, Motion
from cubicfish.rigs.views import JoinedViews, observed_shots
from cubicfish.solve.deformable_target import TARGET_MODELS, NominalTarget
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.threads import one_blas_thread

# Shots are set apart for a camera that moved where that explains more than so much of what shots
# have against its one place: they may be of different moments, too.
_CLEAR_MOVE = 0.5


@one_blas_thread()
def calibrate_rig(
    cameras: Mapping[str, Observations | Detection],
    target: Target | None = None,
    *,
    shots: Matching = "name",
    tolerance: float | None = None,
    times: Times | None = None,
    moving: Mapping[str, CornerMotion] | None = None,
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
        target: the calibration target that corners are of, where they do not bring it; pairs have
            none.
        shots: which photos are of one shot: those of the same ``name`` (without folder and
            ending), those of one ``time``, or rows (shot, camera, photo).
        tolerance: how far apart photos of one time may be, seconds; by default 5 ms.
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
        RigCamera.refuse_name(name, "camera", FitError)
    RigCamera.refuse_same(names, "the rig", FitError)
    if len(names) < 2:
        raise FitError("a rig has two cameras or more: calibrate a single one with 'calibrate'")
    seen, target, matched = observed_shots(cameras, target, shots, tolerance, times)
    refuse_exchanged(seen, {name: known[name] for name in names if name in known})
    common, progress = CommonWorld.of(list(seen.values())), listener.stages("Fitting")
    singly = []
    for number, (name, own) in enumerate(seen.items()):
        progress(f"camera {name} alone", 0.8 * number / len(names))
        singly.append(
            calibrate_alone(
                name, own, known.get(name), target, refine_target, common, keep_lens=hold_lenses
            )
        )
    progress("all cameras together", 0.8)
    views = JoinedViews.of_cameras([one.lens for one in singly], singly, matched)
    motion = Motion.of_shots(names, matched, times)
    if moving:
        flows = [(one.seen, moving.get(name)) for name, one in zip(names, singly, strict=True)]
        motion = motion.with_flow(flows, views.lens.camera[views.pairs.image], views.pairs)
    if target is not None:
        views = with_agreeing_names(views, common.target(target), common.scale)
    problem = RigProblem(
        names=names,
        singly=singly,
        common=common,
        nominal=_make_nominal(views.pairs, target, common),
        level="off"
        if target is None
        else max((one.level for one in singly), key=TARGET_MODELS.index),
        motion=motion,
        start=_start(names, views, singly),
    )
    evidence = _fit_where_all_stand(problem, views)
    progress("how certain it is", 0.95)
    return rig_of(evidence)


def _make_nominal(pairs: Observations, target: Target | None, common: CommonWorld) -> NominalTarget:
    """The target, and the pairs with its own points, which cameras alone may have refined."""
    if target is None:
        return NominalTarget(pairs=pairs, scale=common.scale)
    points = common.points(target.world_points(pairs.board, pairs.column, pairs.row))
    centred = common.target(target)
    return NominalTarget(target=centred, pairs=pairs.with_world(points), scale=common.scale)


def _start(names: Sequence[str], views: JoinedViews, singly: Sequence[Alone]) -> RigStart:
    """Where cameras and shots stand at first; what is bad about a camera alone may say why not."""
    try:
        return start_rig(names, views)
    except FitError as error:
        bad = [one for camera in singly for one in camera.findings if one.severity is Severity.BAD]
        raise FitError(error.what, do=error.do, findings=bad) from error


def _fit_where_all_stand(problem: RigProblem, views: JoinedViews) -> RigEvidence:
    """The fit, with cameras that clearly moved where they stood in most shots."""
    start, moved = problem.start, list[Moved]()
    views = replace(views, lens=replace(views.lens, places=start.places))
    views, poses = views.set_apart(start.shots, np.flatnonzero(start.apart))
    while True:
        fit, timing = fit_jointly(problem, views, poses)
        views = replace(views, lens=fit.lens)
        evidence = RigEvidence(
            problem=problem, views=views, fit=fit, timing=timing, moved=tuple(moved)
        )
        found = moved_camera(evidence)
        # What two places explain little better has another cause, and is reported as that.
        if found is None or found.share <= _CLEAR_MOVE:
            return evidence
        views, poses = views.set_apart(fit.poses, found.apart)
        if not connected(views.lens.common_shots):
            # It stands in one place: where it stood in most shots.
            mean = replace(found, apart=found.apart[:0])
            return replace(evidence, moved=(*moved, mean))
        moved.append(found)
