"""What the errors of a rig's corners say of cameras, pairs of cameras, and shots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cubicfish_cli.fitting.adjustment import Adjustment, adjust
from cubicfish_cli.fitting.fit_lens import FitLens
from cubicfish_cli.fitting.rig.start import common_shots
from cubicfish_cli.fitting.rig_lens import RigLens
from cubicfish_cli.fitting.statistics import rms_px
from cubicfish_cli.fitting.subset import select
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import FloatArray


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
    fit: Adjustment, lens: RigLens, pairs: Observations, held: Sequence[FitLens], limit: float
) -> FloatArray:
    """(N, 2) residuals with every view's pose free, each camera's lens held."""
    views = lens.views(fit.poses)
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
    common = common_shots(lens, len(names))
    camera, shot = lens.camera[pairs.image], lens.shot[pairs.image]
    found = []
    for a in range(len(names)):
        for b in range(a + 1, len(names)):
            both = np.intersect1d(lens.shot[lens.camera == a], lens.shot[lens.camera == b])
            own = np.isin(shot, both) & ((camera == a) | (camera == b))
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
    """A plain record a shot: its RMS in pixels, its corners and cameras."""
    shot = lens.shot[pairs.image]
    return [
        {
            "shot": name,
            "rms_px": rms_px(residual[shot == number]),
            "corners": int(np.sum(shot == number)),
            "cameras": [names[camera] for camera in lens.camera[lens.shot == number]],
        }
        for number, name in enumerate(shots)
    ]
