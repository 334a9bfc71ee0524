"""The result of a fit: the fitted camera, or the evidence of why there is none."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.fit.held_out import HeldOut
from cubicfish.fit.prior import Prior
from cubicfish.io.camera_yaml import Calibrated, load_camera
from cubicfish.judge.finding import Finding
from cubicfish.judge.fit_record import Departure, DroppedCorner
from cubicfish.judge.uncertainty import UncertaintyGrid
from cubicfish.models.cubic import CubicCamera
from cubicfish.solve.deformable_target import TargetModel
from cubicfish.solve.poses import Poses
from cubicfish.solve.subset import select_photos, world_scale
from cubicfish.target.observations import Observations
from cubicfish.target.placement import Symmetry, renamed
from cubicfish.target.target import Target
from cubicfish.types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Calibration(Calibrated):
    """A fitted camera and how well it fits.

    Attributes:
        camera: the camera.
        poses: camera_from_world of each of ``pairs.images``.
        pairs: the pairs that were used.
        residual: (N, 2) projection less pixel of those, pixels.
        held_out: cross-validated errors; None when the photos are too few.
        prior: the prior that ties P to the reference.
        runners_up: priors that other photos would choose, with their probabilities; none where no
            photo was left out.
        target: the target as fitted (the given one where nothing was refined); None for pairs
            without one.
        renamed: photos whose corners were renamed since the print shows the target the other way
            round, and the motion of the target that renames them.

    """

    load = staticmethod(load_camera)

    camera: CubicCamera
    poses: Poses
    pairs: Observations
    residual: FloatArray
    held_out: HeldOut | None
    prior: Prior
    runners_up: Mapping[Prior, float]
    target: Target | None
    renamed: Mapping[str, Symmetry]

    @property
    def unfit(self) -> Mapping[str, Finding]:
        """Photos that were left out, with the reason."""
        return self.fit.unfit_images

    @property
    def refined(self) -> TargetModel:
        """How much of the target was fitted: ``off``, ``shape`` or ``points``."""
        return self.fit.refine_target or "off"

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is likely wrong with the set-up, with the evidence."""
        return self.fit.findings

    def named(self, corners: Observations) -> Observations:
        """The given corners of the photos, under the names of the fit and with its target."""
        return renamed(corners, self.target, self.renamed) if self.target else corners


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """The evidence by which hypotheses are judged; each kind has its own attributes.

    Attributes:
        known: earlier findings, which come first.

    """

    known: Sequence[Finding] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class CornerEvidence(Evidence):
    """The evidence of named corners.

    Attributes:
        pairs: all pairs, in the target's units.
        target: the nominal target; None for pairs without one.

    """

    pairs: Observations
    target: Target | None


@dataclass(frozen=True, kw_only=True, eq=False)
class FailedFit(CornerEvidence):
    """The evidence of corners to which no camera could be fitted.

    Attributes:
        fits: whether they do fit one lens and the nominal target, so that neither is to blame.

    """

    fits: bool = False

    @cached_property
    def scaled(self) -> tuple[Observations, float]:
        """The pairs in a unit in which the target is of order 1, and that in the target's units."""
        scale = world_scale(self.pairs)
        pairs = self.pairs.with_world(self.pairs.world / scale)
        return select_photos(pairs, np.arange(len(pairs.images))), scale


@dataclass(frozen=True, kw_only=True, eq=False)
class FitEvidence(CornerEvidence):
    """The evidence of corners with their fit.

    Attributes:
        nominal_fit: the fit to the nominal target.
        fit: the final fit.
        dropped: the outliers, each a corner that was left out as grossly wrong.
        departures: how far boards depart from the nominal ones, where the target was fitted too.
        uncertainty: the stated uncertainty of the camera.

    """

    nominal_fit: CameraFit
    fit: CameraFit
    dropped: Sequence[DroppedCorner]
    departures: Sequence[Departure]
    uncertainty: UncertaintyGrid


Diagnose = Callable[[Evidence], Sequence[Finding]]
"""Finds what is likely wrong with a set-up; the likeliest comes first where there is no fit."""
