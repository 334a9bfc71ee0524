"""What a fit hands over: the fitted camera, or what is known of why there is none."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cubicfish_cli.core.assess.fit_record import Departure, DroppedCorner
from cubicfish_cli.core.assess.uncertainty import UncertaintyGrid
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.cubic_fit import CameraFit, PriorChoice
from cubicfish_cli.core.fit.deformable_target import Level
from cubicfish_cli.core.fit.held_out import HeldOut
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.subset import select_photos, world_scale
from cubicfish_cli.core.io.camera_yaml import Calibrated, load_camera
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.placement import Symmetry, renamed
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Calibration(Calibrated):
    """A fitted camera and how well it fits.

    Attributes:
        camera: the camera.
        poses: camera_from_world of each of ``pairs.images``.
        pairs: the pairs that were used.
        residual: (N, 2) projection less pixel of those, pixels.
        held_out: cross-validated errors; None when the photos are too few.
        prior: how P was held to the reference.
        runners_up: how other photos would have it held, and how likely each is right; none where
            nothing was left out.
        unfit: photos left out, with the reason.
        target: the target as fitted (the given one where nothing was refined); None for pairs
            that came without one.
        renamed: photos that show the target the other way round than they said, as its print
            says, and the motion of the target that their corners were named anew by.

    """

    load = staticmethod(load_camera)

    camera: CubicCamera
    poses: Poses
    pairs: Observations
    residual: FloatArray
    held_out: HeldOut | None
    prior: PriorChoice
    runners_up: Mapping[PriorChoice, float]
    unfit: dict[str, Finding]
    target: Target | None
    renamed: Mapping[str, Symmetry]

    @property
    def refined(self) -> Level:
        """What of the target was fitted: ``off``, ``shape`` or ``points``."""
        return self.fit.refine_target or "off"

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is likely wrong with the set-up, with its evidence."""
        return self.fit.findings

    def named(self, corners: Observations) -> Observations:
        """Corners of the photos by the names that the fit gave them, of the target as fitted."""
        return renamed(corners, self.target, self.renamed) if self.target else corners


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What hypotheses are judged by: each kind has attributes of its own.

    Attributes:
        known: what was found before, and comes first.

    """

    known: Sequence[Finding] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class CornerEvidence(Evidence):
    """Named corners.

    Attributes:
        pairs: all pairs, in the target's units.
        target: the drawing; None for pairs that came without one.

    """

    pairs: Observations
    target: Target | None


@dataclass(frozen=True, kw_only=True, eq=False)
class FailedFit(CornerEvidence):
    """Corners of which there is no fit.

    Attributes:
        fits: whether they do fit one lens and the drawing, so that neither is to blame.

    """

    fits: bool = False

    @cached_property
    def scaled(self) -> tuple[Observations, float]:
        """The pairs in a unit in which the target is of order 1, and that in the target's."""
        scale = world_scale(self.pairs)
        pairs = self.pairs.with_world(self.pairs.world / scale)
        return select_photos(pairs, np.arange(len(pairs.images))), scale


@dataclass(frozen=True, kw_only=True, eq=False)
class FitEvidence(CornerEvidence):
    """Corners with their fit.

    Attributes:
        nominal_fit: the fit to the target as drawn.
        fit: the final fit.
        dropped: each corner that was left out as grossly wrong.
        departures: by how much boards depart from the drawing, where it was fitted too.
        uncertainty: what is stated of the camera.

    """

    nominal_fit: CameraFit
    fit: CameraFit
    dropped: Sequence[DroppedCorner]
    departures: Sequence[Departure]
    uncertainty: UncertaintyGrid


Diagnose = Callable[[Evidence], Sequence[Finding]]
"""Tells what is likely wrong with a set-up; the likeliest first where there is no fit."""
