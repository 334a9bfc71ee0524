"""What is likely wrong with a rig's shots: a camera that moved, photos of other shots, too few."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.fitting.adjustment import Adjustment
from cubicfish_cli.fitting.rig.start import RigStart, common_shots
from cubicfish_cli.fitting.rig_lens import RigLens

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]

Code = Literal["shot_mismatched", "camera_moved", "few_common_shots"]
Level = Literal["note", "care", "bad"]
# Two cameras that fewer shots connect stand where one shot's errors put them.
_FEW = 5


@dataclass(frozen=True, kw_only=True)
class RigFinding:
    """Something that is likely wrong.

    Attributes:
        code: what.
        level: what it says of the rig.
        cameras: whose.
        shots: of which shots.
        figures: what says so.
        line: all of it in words, with what to do.

    """

    code: Code
    level: Level
    cameras: tuple[str, ...]
    shots: tuple[str, ...] = ()
    figures: Mapping[str, float] = field(default_factory=dict)
    line: str = ""

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON and YAML."""
        return {
            "code": self.code,
            "severity": self.level,
            "cameras": list(self.cameras),
            "shots": list(self.shots),
            "figures": dict(self.figures),
            "line": self.line,
        }


def find_rig_faults(
    names: Sequence[str],
    lens: RigLens,
    fit: Adjustment,
    pairs: Correspondences,
    start: RigStart,
    photos: Sequence[str],
    shots: Sequence[str],
) -> list[RigFinding]:
    """What is likely wrong with a set-up of which the fit succeeded."""
    return [
        *_mismatched(names, lens, start, photos, shots),
        *_few(names, lens),
    ]


def _mismatched(
    names: Sequence[str],
    lens: RigLens,
    start: RigStart,
    photos: Sequence[str],
    shots: Sequence[str],
) -> list[RigFinding]:
    return [
        RigFinding(
            code="shot_mismatched",
            level="bad",
            cameras=(names[lens.camera[view]],),
            shots=(photos[view],),
            figures={"off_px": float(start.misfit[view])},
            line=f"{photos[view]} of camera {names[lens.camera[view]]} is not of the shot that it "
            f"is matched to: its corners are {start.misfit[view]:.0f} px off, while alone it "
            "fits; it took part as a shot of its own. Match it rightly, or leave it out",
        )
        for view in np.flatnonzero(start.apart).tolist()
    ]


def _few(names: Sequence[str], lens: RigLens) -> list[RigFinding]:
    """Cameras whose strongest connection to the others is weak."""
    common = common_shots(lens, len(names))
    found = []
    for camera, name in enumerate(names):
        others = np.delete(np.arange(len(names)), camera)
        best = int(others[np.argmax(common[camera, others])])
        shared = int(common[camera, others].sum())
        if shared < _FEW:
            found.append(
                RigFinding(
                    code="few_common_shots",
                    level="care",
                    cameras=(name, names[best]),
                    figures={"shots": float(shared)},
                    line=f"camera {name} shares only {shared} shot{'s' * (shared != 1)} with the "
                    f"others: take {_FEW - shared} or more in which {name} and {names[best]} "
                    "both see boards of the target",
                )
            )
    return found
