"""What the fit of a rig knows of its set-up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from cubicfish_cli.core.fit.adjustment import Adjustment
from cubicfish_cli.core.fit.evidence import Evidence
from cubicfish_cli.core.fit.linearise import linearise
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

if TYPE_CHECKING:  # one camera alone is diagnosed without them
    from cubicfish_cli.core.fit.rig_lens import RigLens
    from cubicfish_cli.extensions.rigs.fit.clocks import Clocks
    from cubicfish_cli.extensions.rigs.fit.start import RigStart


@dataclass(frozen=True, kw_only=True, eq=False)
class Moved:
    """A camera that stood elsewhere from some shot on.

    Attributes:
        camera: which.
        shot: name of the first shot after it moved.
        step: (6,) turn in the camera's frame, radians, and shift.
        effect_px: RMS of what that does to the camera's corners.
        chance: of as much by chance, over all cameras and shots.
        share: of what shots have against the camera's one place, what two places explain.
        apart: (A,) its views on the side with fewer shots.
        before: whether that is the side before it moved.

    """

    camera: int
    shot: str
    step: FloatArray
    effect_px: float
    chance: float
    share: float
    apart: IntArray
    before: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class RigEvidence(Evidence):
    """A fitted rig.

    Attributes:
        names: of the cameras.
        fit: of the rig.
        pairs: its pairs.
        moved: cameras that were found to have moved, as far as that was taken out.
        clocks: by how much cameras were late, which was taken out; None where it is not known.
        start: where it started from.
        photos: of each view, its photo's name.
        shots: the shots' names, in the order in which they were taken.
        scale: the target's units in one unit of the pairs.

    """

    names: Sequence[str]
    fit: Adjustment[RigLens]
    pairs: Observations
    moved: Sequence[Moved]
    clocks: Clocks | None
    start: RigStart
    photos: Sequence[str]
    shots: Sequence[str]
    scale: float

    @property
    def lens(self) -> RigLens:
        """The lenses and places of the rig."""
        return self.fit.lens

    @cached_property
    def of_views(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """Of each view's shot's pose: Hessian (V, 6, 6), gradient (V, 6), and (V,) its corners."""
        fit, pairs, views = self.fit, self.pairs, len(self.lens.shot)
        hessian, gradient = np.zeros((views, 6, 6)), np.zeros((views, 6))
        for run, terms in linearise(fit.state, pairs, fit.huber_px):
            across = terms.by_pose.transpose(0, 2, 1)
            np.add.at(hessian, pairs.image[run], across @ terms.by_pose)
            np.add.at(gradient, pairs.image[run], (across @ terms.miss[:, :, None])[:, :, 0])
        return hessian, gradient, np.bincount(pairs.image, minlength=views)
