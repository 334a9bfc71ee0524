"""How well a known rig explains other shots, and what errors say of cameras, pairs and shots.

Where the rig was is fitted, nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from cubicfish_cli.commands.calibration import observed
from cubicfish_cli.core.assess.fit_record import NAN, ErrorStatistics
from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.fit.adjustment import adjust
from cubicfish_cli.core.fit.evaluate import evaluate
from cubicfish_cli.core.fit.lenses import FixedLens
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.statistics import error_statistics, rms_px
from cubicfish_cli.core.fit.subset import select
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.threads import one_blas_thread
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.corners.identification.identified import Detection
from cubicfish_cli.extensions.rigs.fit.names import agreeing
from cubicfish_cli.extensions.rigs.fit.rig_lens import RigLens
from cubicfish_cli.extensions.rigs.fit.shots import TOLERANCE, Matching, Times, match_shots
from cubicfish_cli.extensions.rigs.fit.start import place_shots
from cubicfish_cli.extensions.rigs.fit.times import Motion, on_time
from cubicfish_cli.extensions.rigs.fit.views import Placed, joined_views
from cubicfish_cli.extensions.rigs.rig import CameraPair, Rig, ShotErrors

# While shots are placed by one camera's view, the loss must still feel every corner.
_WIDE_HUBER_PX = 50.0


def camera_pairs(
    names: Sequence[str], lens: RigLens, pairs: Observations, residual: FloatArray
) -> list[CameraPair]:
    """Every two cameras."""
    camera, shot = lens.camera[pairs.image], lens.shot[pairs.image]
    found = []
    for a, b in combinations(range(len(names)), 2):
        both = np.intersect1d(lens.shot[lens.camera == a], lens.shot[lens.camera == b])
        own = np.isin(shot, both) & ((camera == a) | (camera == b)) & pairs.tells_error
        found.append(
            CameraPair(
                cameras=(names[a], names[b]),
                shots=int(lens.common_shots[a, b]),
                rms_px=rms_px(residual[own]) if own.any() else NAN,
            )
        )
    return found


def shot_errors(
    shots: Sequence[str],
    lens: RigLens,
    pairs: Observations,
    residual: FloatArray,
    names: Sequence[str],
) -> list[ShotErrors]:
    """Every shot."""
    shot = lens.shot[pairs.image]
    told = [pairs.tells_error & (shot == number) for number in range(len(shots))]
    return [
        ShotErrors(
            shot=name,
            rms_px=rms_px(residual[told[number]]) if told[number].any() else NAN,
            corners=int(np.sum(shot == number)),
            cameras=tuple(names[camera] for camera in lens.camera[lens.shot == number]),
        )
        for number, name in enumerate(shots)
    ]


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
            raise FitError(f"camera {camera.name}: {error}") from error
    lens, views, joint, seen = joined_views(
        [
            Placed(lens=FixedLens(camera=camera.camera), pairs=one.pairs, poses=one.poses)
            for camera, one in zip(known, alone, strict=True)
        ],
        matched,
        Poses(
            rotation=np.stack([one.rotation for one in known]),
            translation=np.stack([one.translation for one in known]),
        ),
    )
    of = next(iter(pairs.values())).target
    if of is not None:
        views, joint = agreeing(lens, views, joint, of, 1.0, known=True)
    fit = adjust(lens, place_shots(lens, views, joint)[0], joint, huber_px=_WIDE_HUBER_PX)
    fit = fit.again(joint)
    when = Motion.of_names(list(cameras), matched.names, matched.photos, times)
    fit, _ = on_time(fit, when, seen.shot, seen.photo)
    fit = fit.again(joint)
    names, camera_of = list(cameras), lens.camera[joint.image]
    return RigEvaluation(
        **vars(error_statistics(fit.residual)),
        alone_rms_px=rms_px(np.concatenate([one.residual for one in alone])),
        cameras=tuple(
            EvaluatedCamera(
                **vars(error_statistics(fit.residual[camera_of == number])),
                name=name,
                images=int(np.sum(lens.camera == number)),
                alone_rms_px=rms_px(one.residual),
                outside_field=one.outside,
                unplaced=one.unplaced,
            )
            for number, (name, one) in enumerate(zip(names, alone, strict=True))
        ),
        pairs=tuple(camera_pairs(names, lens, joint, fit.residual)),
        per_shot=tuple(shot_errors(seen.shot, lens, joint, fit.residual, names)),
    )
