"""How well a known rig explains other shots, and what errors say of cameras, pairs and shots.

Where the rig was is fitted, nothing else.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from cubicfish.calibration import observed
from cubicfish.errors import FitError
from cubicfish.find.identification.identified import Detection
from cubicfish.fit.evaluate import evaluate
from cubicfish.judge.fit_record import NAN, ErrorStatistics
from cubicfish.rigs.names import with_agreeing_names
from cubicfish.rigs.rig import CameraPair, Rig, ShotErrors
from cubicfish.rigs.rig_lens import RigLens
from cubicfish.rigs.shots import TOLERANCE, Matching, Times, match_shots
from cubicfish.rigs.start import place_shots
from cubicfish.rigs.times import Motion, on_time
from cubicfish.rigs.views import JoinedViews
from cubicfish.solve.adjustment import Adjustment, adjust
from cubicfish.solve.fit_lens import FixedLens
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import error_statistics, photo_records, rms_px
from cubicfish.solve.subset import select
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.threads import one_blas_thread

# While shots are placed by one camera's view, the loss must still feel every corner.
_WIDE_HUBER_PX = 50.0


def camera_pairs(names: Sequence[str], fit: Adjustment[RigLens]) -> tuple[CameraPair, ...]:
    """Every two cameras of a fitted rig."""
    lens, error_known = fit.lens, fit.pairs.error_known
    camera, shot = lens.camera[fit.pairs.image], lens.shot[fit.pairs.image]
    found = []
    for a, b in combinations(range(len(names)), 2):
        both = np.intersect1d(lens.shot[lens.camera == a], lens.shot[lens.camera == b])
        own = np.isin(shot, both) & ((camera == a) | (camera == b)) & error_known
        found.append(
            CameraPair(
                cameras=(names[a], names[b]),
                shots=int(lens.common_shots[a, b]),
                rms_px=rms_px(fit.residual[own]) if own.any() else NAN,
            )
        )
    return tuple(found)


def shot_errors(
    shots: Sequence[str], names: Sequence[str], fit: Adjustment[RigLens], poses: Poses
) -> tuple[ShotErrors, ...]:
    """Every shot of a fitted rig, where ``poses`` say that it was."""
    lens = fit.lens
    of_shots = replace(fit.pairs, images=tuple(shots), image=lens.shot[fit.pairs.image])
    records = photo_records(of_shots, fit.residual, poses)
    return tuple(
        ShotErrors(
            shot=one.image,
            rms_px=one.rms_px,
            corners=one.corners,
            cameras=tuple(names[camera] for camera in lens.camera[lens.shot == number]),
            rig_from_world=one.camera_from_world,
        )
        for number, one in enumerate(records)
    )


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
    tolerance: float = TOLERANCE,
    times: Times | None = None,
) -> RigEvaluation:
    """Measure a known rig on other shots: where it was is fitted, nothing else.

    Args:
        rig: as ``load_rig`` or ``calibrate_rig`` gives it.
        cameras: by the rig's names, as for :func:`calibrate_rig`.
        target: the calibration target, in the rig's units; pairs need none.
        shots: as for :func:`calibrate_rig`.
        tolerance: likewise.
        times: likewise.

    Raises:
        CorrespondenceError: corners come without their target, or do not fit it.
        CameraFileError: the rig has no such camera.
        FitError: the rig has other units than the target; photos are of another size, or cannot
            be placed.

    """
    known = [rig.camera(name) for name in cameras]
    if target is not None and rig.units is not None and target.units != rig.units:
        raise FitError(
            f"the rig's lengths are in {rig.units} and the target's in {target.units}: write the "
            "target in the rig's units"
        )
    pairs = {name: observed(own, target) for name, own in cameras.items()}
    matched = match_shots(
        {name: own.images for name, own in pairs.items()}, shots, tolerance, times
    )
    alone = []
    for camera, own, listed in zip(known, pairs.values(), matched.photos, strict=True):
        rows = np.array([name in listed for name in own.images])[own.image]
        try:
            alone.append(evaluate(camera.camera, select(own, rows)[0]))
        except FitError as error:
            raise error.amid(f"camera {camera.name}: ") from error
    joined = JoinedViews.of_cameras(
        [FixedLens(camera=camera.camera) for camera in known],
        alone,
        matched,
        Poses(
            rotation=np.stack([one.rotation for one in known]),
            translation=np.stack([one.translation for one in known]),
        ),
    )
    of = next(iter(pairs.values())).target
    if of is not None:
        joined = with_agreeing_names(joined, of, 1.0, known=True)
    fit = adjust(joined.lens, place_shots(joined)[0], joined.pairs, huber_px=_WIDE_HUBER_PX)
    fit = fit.again(joined.pairs)
    when = Motion.of_names(list(cameras), matched.names, matched.photos, times)
    fit, _ = on_time(fit, when, joined.shots, joined.photos)
    fit = fit.again(joined.pairs)
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
        per_shot=shot_errors(joined.shots, names, fit, fit.poses),
    )
