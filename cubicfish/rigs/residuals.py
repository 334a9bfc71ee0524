"""What the residuals of a rig say of every two cameras, and of every shot."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from cubicfish.judge.fit_record import NAN
from cubicfish.rigs.rig import CameraPair, ShotErrors
from cubicfish.rigs.rig_lens import RigLens
from cubicfish.solve.adjustment import Adjustment
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import photo_records, rms_px


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
