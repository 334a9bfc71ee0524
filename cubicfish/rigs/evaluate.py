"""How well a known rig explains other shots: where it was is fitted, nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cubicfish.errors import FitError
from cubicfish.find.identification.identified import Detection
from cubicfish.judge.fit_record import ErrorStatistics
from cubicfish.rigs.alone import place_alone
from cubicfish.rigs.joint_fit import fit_places
from cubicfish.rigs.names import with_agreeing_names
from cubicfish.rigs.residuals import camera_pairs, shot_errors
from cubicfish.rigs.rig import CameraPair, Rig, ShotErrors
from cubicfish.rigs.shots import Matching, Times
from cubicfish.rigs.start import place_shots
from cubicfish.rigs.times import Motion
from cubicfish.rigs.views import JoinedViews, observed_shots
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import error_statistics, rms_px
from cubicfish.solve.subset import select
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.threads import one_blas_thread

_LAST_DECREASE = 1e-10


@dataclass(frozen=True, kw_only=True)
class EvaluatedCamera(ErrorStatistics):
    """What one camera's corners say: their errors with the rig as it is, and more.

    Attributes:
        name: of the camera.
        images: how many photos were placed.
        alone_rms_px: RMS of the same corners with each photo's pose free.
        outside_field: corners beyond where its lens may be trusted; not counted.
        unplaced: photos with too few corners to be placed.

    """

    name: str
    images: int
    alone_rms_px: float
    outside_field: int
    unplaced: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class RigEvaluation(ErrorStatistics):
    """Reprojection errors of a known rig over all corners, none dropped.

    Attributes:
        alone_rms_px: RMS of the same corners with each photo's pose free, the lenses as they are:
            what is more than that is the rig's.
        cameras: camera by camera.
        pairs: every two cameras.
        per_shot: each shot.

    """

    alone_rms_px: float
    cameras: tuple[EvaluatedCamera, ...]
    pairs: tuple[CameraPair, ...]
    per_shot: tuple[ShotErrors, ...]


@one_blas_thread()
def evaluate_rig(
    rig: Rig,
    cameras: Mapping[str, Observations | Detection],
    target: Target | None = None,
    *,
    shots: Matching = "name",
    tolerance: float | None = None,
    times: Times | None = None,
) -> RigEvaluation:
    """Measure a known rig on other shots: where it was is fitted, nothing else.

    Args:
        rig: as ``load_rig`` or ``calibrate_rig`` gives it.
        cameras: by the rig's names, as for :func:`calibrate_rig`.
        target: as for :func:`calibrate_rig`, in the rig's units.
        shots: as for :func:`calibrate_rig`.
        tolerance: likewise.
        times: likewise.

    Raises:
        CorrespondenceError: corners come without their target, or do not fit it.
        CameraFileError: the rig has no such camera.
        FitError: the rig has other units than the target; photos are of another size, or cannot
            be placed.

    """
    if not cameras:
        raise FitError("no camera of the rig has corners: give those of two or more, by name")
    known = [rig.camera(name) for name in cameras]
    seen, target, matched = observed_shots(cameras, target, shots, tolerance, times)
    if target is not None and rig.units is not None and target.units != rig.units:
        raise FitError(
            f"the rig's lengths are in {rig.units} and the target's in {target.units}: write the "
            "target in the rig's units"
        )
    alone = []
    for camera, own, listed in zip(known, seen.values(), matched.photos, strict=True):
        rows = np.array([name in listed for name in own.images])[own.image]
        alone.append(place_alone(camera.name, camera.camera, select(own, rows)[0]))
    places = Poses(
        rotation=np.stack([one.rotation for one in known]),
        translation=np.stack([one.translation for one in known]),
    )
    lenses = [FixedLens(camera=camera.camera) for camera in known]
    views = JoinedViews.of_cameras(lenses, alone, matched, places)
    if target is not None:
        views = with_agreeing_names(views, target, 1.0, known=True)
    motion = Motion.of_shots(list(cameras), matched, times)
    fit, _ = fit_places(views, place_shots(views)[0], views.pairs, motion, _LAST_DECREASE)
    fit = fit.again(views.pairs, relative_decrease=_LAST_DECREASE)
    names, camera_of = list(cameras), fit.lens.camera[fit.pairs.image]
    return RigEvaluation(
        **vars(error_statistics(fit.residual)),
        alone_rms_px=rms_px(np.concatenate([one.residual for one in alone])),
        cameras=tuple(
            EvaluatedCamera(
                **vars(error_statistics(fit.residual[camera_of == number])),
                name=name,
                images=int(np.sum(fit.lens.camera == number)),
                alone_rms_px=rms_px(one.residual),
                outside_field=one.outside,
                unplaced=one.unplaced,
            )
            for number, (name, one) in enumerate(zip(names, alone, strict=True))
        ),
        pairs=camera_pairs(names, fit),
        per_shot=shot_errors(views.shots, names, fit, fit.poses),
    )
