"""How well a known rig explains other shots, and what errors say of cameras, pairs and shots.

Where the rig was is fitted, nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cubicfish_cli.core.assess.fit_record import ErrorStatistics
from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.fit.adjustment import Adjustment, adjust
from cubicfish_cli.core.fit.evaluate import named_as_refined
from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.known_lens import fit_poses
from cubicfish_cli.core.fit.lenses import FixedLens
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.rig_lens import RigLens
from cubicfish_cli.core.fit.robust import huber_px
from cubicfish_cli.core.fit.statistics import error_statistics, rms_px
from cubicfish_cli.core.fit.subset import select
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.threads import one_blas_thread
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.extensions.rigs.fit.gather import Placed, gathered, unplaced
from cubicfish_cli.extensions.rigs.fit.names import agreeing
from cubicfish_cli.extensions.rigs.fit.shots import Shots
from cubicfish_cli.extensions.rigs.fit.start import place_shots
from cubicfish_cli.extensions.rigs.rig_yaml import KnownCamera

# While shots are placed by one camera's view, the loss must still feel every corner.
_WIDE_HUBER_PX = 50.0


@dataclass(frozen=True, kw_only=True)
class CameraPair:
    """Two cameras and what connects them.

    Attributes:
        first, second: names of the cameras.
        shots: in how many shots both see the target.
        rms_px: RMS of the corners of both in these shots, pixels; None without any.

    """

    first: str
    second: str
    shots: int
    rms_px: float | None

    def as_record(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "cameras": [self.first, self.second],
            "shots": self.shots,
            "rms_px": self.rms_px,
        }


def alone_residual(
    fit: Adjustment[RigLens], pairs: Observations, held: Sequence[FitLens], limit: float
) -> FloatArray:
    """(N, 2) residuals with every view's pose free, each camera's lens held."""
    lens, views = fit.lens, fit.lens.views(fit.poses)
    found = np.empty_like(fit.residual)
    for camera, own in enumerate(held):
        mine = lens.camera[pairs.image] == camera
        part, kept = select(pairs, mine)
        if len(part.pixel):
            found[mine] = adjust(own, views[kept], part, huber_px=limit).residual
    return found


def camera_pairs(
    names: Sequence[str], lens: RigLens, pairs: Observations, residual: FloatArray
) -> list[CameraPair]:
    """Every two cameras."""
    common = lens.common_shots
    camera, shot = lens.camera[pairs.image], lens.shot[pairs.image]
    found = []
    for a in range(len(names)):
        for b in range(a + 1, len(names)):
            both = np.intersect1d(lens.shot[lens.camera == a], lens.shot[lens.camera == b])
            own = np.isin(shot, both) & ((camera == a) | (camera == b)) & pairs.tells_error
            found.append(
                CameraPair(
                    first=names[a],
                    second=names[b],
                    shots=int(common[a, b]),
                    rms_px=rms_px(residual[own]) if own.any() else None,
                )
            )
    return found


def shot_records(
    shots: Sequence[str],
    lens: RigLens,
    pairs: Observations,
    residual: FloatArray,
    names: Sequence[str],
) -> list[dict[str, Any]]:
    """A plain record per shot: its RMS in pixels, its corners and cameras."""
    shot = lens.shot[pairs.image]
    told = [pairs.tells_error & (shot == number) for number in range(len(shots))]
    return [
        {
            "shot": name,
            "rms_px": rms_px(residual[told[number]]) if told[number].any() else None,
            "corners": int(np.sum(shot == number)),
            "cameras": [names[camera] for camera in lens.camera[lens.shot == number]],
        }
        for number, name in enumerate(shots)
    ]


@dataclass(frozen=True, kw_only=True)
class CameraErrors:
    """What one camera's corners say.

    Attributes:
        name: of the camera.
        photos: how many were placed.
        errors: with the rig as it is, pixels; None without any photo.
        alone_rms_px: RMS of the same corners with each photo's pose free.
        outside: corners beyond where its lens may be trusted; not counted.
        unplaced: photos with too few corners to be placed.

    """

    name: str
    photos: int
    errors: ErrorStatistics | None
    alone_rms_px: float | None
    outside: int
    unplaced: tuple[str, ...]

    def as_record(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "name": self.name,
            "images": self.photos,
            **(self.errors.as_record() if self.errors else {}),
            "alone_rms_px": self.alone_rms_px,
            "outside_field": self.outside,
            "unplaced": list(self.unplaced),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class RigEvaluation:
    """Reprojection errors of a known rig.

    Attributes:
        errors: over all corners, none dropped.
        alone_rms_px: RMS of the same corners with each photo's pose free, the lenses as they are:
            what is more than that is the rig's.
        cameras: camera by camera.
        pairs: every two cameras.
        per_shot: a plain record per shot.

    """

    errors: ErrorStatistics
    alone_rms_px: float
    cameras: tuple[CameraErrors, ...]
    pairs: tuple[CameraPair, ...]
    per_shot: tuple[dict[str, Any], ...]

    def as_record(self) -> dict[str, Any]:
        """Plain data."""
        return {
            **self.errors.as_record(),
            "alone_rms_px": self.alone_rms_px,
            "cameras": [one.as_record() for one in self.cameras],
            "pairs": [one.as_record() for one in self.pairs],
            "per_shot": list(self.per_shot),
        }


@one_blas_thread()
def evaluate_rig(
    cameras: Sequence[KnownCamera], pairs: Sequence[Observations], shots: Shots
) -> RigEvaluation:
    """Place every shot with the rig as it is, and measure what is left.

    Args:
        cameras: the rig's; lengths are in the units of the pairs' world points.
        pairs: of each camera.
        shots: which photos are of one shot.

    Raises:
        FitError: photos are of another size than their camera's, or none can be placed.

    """
    placed, outside, unplaced = [], [], []
    for camera, own in zip(cameras, pairs, strict=True):
        if own.image_size != camera.camera.image_size:
            raise FitError(
                "camera {}: its photos have {}x{} pixels and its lens is of {}x{}: use photos of "
                "its own size, and check that no two cameras are exchanged".format(
                    camera.name, *own.image_size, *camera.camera.image_size
                )
            )
        one, beyond, lost = _placed(camera, named_as_refined(camera.camera, own))
        placed.append(one)
        outside.append(beyond)
        unplaced.append(lost)
    lens, views, joint, seen, _ = gathered(placed, shots, [None] * len(placed))
    places = Poses(
        rotation=np.stack([one.rotation for one in cameras]),
        translation=np.stack([one.translation for one in cameras]),
    )
    lens, target = replace(lens, places=places, held=True), pairs[0].target
    if target is not None:
        views, joint = agreeing(lens, views, joint, target, 1.0, known=True)
    start, _ = place_shots(lens, views, joint)
    fit = adjust(lens, start, joint, huber_px=_WIDE_HUBER_PX)
    limit = huber_px(fit.residual)
    fit = fit.again(joint)
    names = [one.name for one in cameras]
    alone = alone_residual(fit, joint, lens.lenses, limit)
    camera_of = lens.camera[joint.image]
    by_camera = []
    for number, name in enumerate(names):
        mine = camera_of == number
        some = bool(mine.any())
        by_camera.append(
            CameraErrors(
                name=name,
                photos=int(np.sum(lens.camera == number)),
                errors=error_statistics(fit.residual[mine]) if some else None,
                alone_rms_px=rms_px(alone[mine]) if some else None,
                outside=outside[number],
                unplaced=unplaced[number],
            )
        )
    return RigEvaluation(
        errors=error_statistics(fit.residual),
        alone_rms_px=rms_px(alone),
        cameras=tuple(by_camera),
        pairs=tuple(camera_pairs(names, lens, joint, fit.residual)),
        per_shot=tuple(shot_records(seen.shot, lens, joint, fit.residual, names)),
    )


def _placed(camera: KnownCamera, pairs: Observations) -> tuple[Placed, int, tuple[str, ...]]:
    """Photos placed by one camera alone, corners beyond its field, photos that cannot be placed."""
    found, own, photos = fit_poses(camera.camera.radial, pairs)
    if found is None:
        raise unplaced(camera.name)
    lens = FixedLens(camera=camera.camera)
    inside = np.asarray(
        np.isfinite(lens.project(found.poses.apply(own.image, own.world))).all(axis=1), bool
    )
    counted, kept = select(own, inside)
    if not len(kept):
        raise FitError(
            f"camera {camera.name}: no corner lies where its lens may be trusted: check that "
            "camera and photos belong together"
        )
    lost = set(range(len(pairs.images))) - set(photos.tolist())
    return (
        Placed(lens=lens, pairs=counted, poses=found.poses[kept]),
        int(np.sum(~inside)),
        tuple(pairs.images[photo] for photo in sorted(lost)),
    )
