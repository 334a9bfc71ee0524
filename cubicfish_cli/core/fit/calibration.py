"""A fitted camera and how well it fits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from cubicfish_cli.core.assess.fit_record import FitRecord
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.cubic_fit import PriorChoice, RunnerUp
from cubicfish_cli.core.fit.held_out import HeldOut
from cubicfish_cli.core.fit.poses import Poses
from cubicfish_cli.core.fit.refinement import Level
from cubicfish_cli.core.io.calibrated import Calibrated
from cubicfish_cli.core.io.camera_yaml import load_camera
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
        fit: how well it fits, as camera.yaml keeps it.
        held_out: cross-validated errors; None when the photos are too few.
        prior: how P was held to the reference.
        runners_up: how other photos would have it held, and how likely each is right; none where
            nothing was left out.
        unfit: photos left out, with the reason.
        target: the target as fitted (the given one where nothing was refined); None for pairs
            that came without one.
        renamed: photos that show the target the other way round than they said, as its print
            says, and the motion of the target that their corners were named anew by.
        notes: what a person should know beyond the figures.
        made_by: where it comes from, plain data.

    """

    load = staticmethod(load_camera)

    camera: CubicCamera
    poses: Poses
    pairs: Observations
    residual: FloatArray
    fit: FitRecord
    held_out: HeldOut | None
    prior: PriorChoice
    runners_up: tuple[RunnerUp, ...]
    unfit: dict[str, Finding]
    target: Target | None
    renamed: Mapping[str, Symmetry]
    notes: tuple[Finding, ...]
    made_by: Mapping[str, Any] = field(default_factory=dict)

    @property
    def refined(self) -> Level:
        """What of the target was fitted: ``off``, ``shape`` or ``points``."""
        return self.fit.refine_target or "off"

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is likely wrong with the set-up, with its evidence."""
        return self.fit.findings

    @property
    def remarks(self) -> tuple[Finding, ...]:
        """What is told beside the findings: notes, photos that were left out, doubts."""
        unfit = (replace(why, images=(photo,)) for photo, why in self.unfit.items())
        doubts = (doubt for one in self.fit.departures for doubt in one.doubted)
        return (*self.notes, *unfit, *doubts)

    def named(self, corners: Observations) -> Observations:
        """Corners of the photos by the names that the fit gave them, of the target as fitted."""
        return renamed(corners, self.target, self.renamed) if self.target else corners
