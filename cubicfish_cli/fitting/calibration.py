"""A fitted camera and how well it fits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from cubicfish_cli.assess.pupil import PupilEffect
from cubicfish_cli.fitting.cubic_fit import Hold, Rival
from cubicfish_cli.fitting.deformation import Deformation
from cubicfish_cli.fitting.held_out import HeldOut
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.reach import Reach
from cubicfish_cli.fitting.refinement import Level
from cubicfish_cli.fitting.rejection import DroppedCorner
from cubicfish_cli.fitting.statistics import ErrorStatistics, photo_records
from cubicfish_cli.fitting.subset import flatness
from cubicfish_cli.formats.calibrated import Calibrated
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.placement import Symmetry, renamed
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray
from cubicfish_cli.words.finding import Finding

# A sheet that is fitted too is bent a little; a target of two boards leaves a plane by far more.
_NEARLY_FLAT = 0.02


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Calibration(Calibrated):
    """A fitted camera and how well it fits.

    Attributes:
        camera: the camera.
        poses: camera_from_world of each of ``pairs.images``.
        pairs: the pairs that were used.
        residual: (N, 2) projection less pixel of those, pixels.
        errors: reprojection errors over the used pairs.
        companion_rms_px: RMS of the radial reference on the same pairs.
        held_out: cross-validated errors; None when the photos are too few.
        held_out_by_level: held-out RMS of every level of ``refine_target`` that was tried.
        rank: numerical rank of Φ over the used rays (16 on the sphere).
        covered_deg: angle from the axis of the farthest used corner.
        reach: what corners say of the field's rim.
        pupil: what it matters that the entrance pupil wanders.
        hold: how P was held to the reference.
        rivals: how other photos would have it held, and how likely each is right; none where
            nothing was left out.
        dropped: corners left out because they were grossly off.
        unfit: photos left out, with the reason.
        refined: what of the target was fitted: ``off``, ``shape`` or ``points``.
        target: the target as fitted (the given one where nothing was refined); None for pairs
            that came without one.
        renamed: photos that show the target the other way round than they said, as its print
            says, and the motion of the target that their corners were named anew by.
        departures: by how much the target departs from its drawing, a board each.
        uncertainty_grid: how far the pixels of distant points may be off, on a grid over the photo,
            as ``uncertainty_record`` of fitting/uncertainty.py has it.
        coverage: share of the valid field that corners cover, 0 to 1.
        notes: what a person should know beyond the figures.
        findings: what is likely wrong with the set-up, with its evidence.
        made_by: where it comes from, plain data.

    """

    load = staticmethod(load_camera)

    camera: CubicCamera
    poses: Poses
    pairs: Observations
    residual: FloatArray
    errors: ErrorStatistics
    companion_rms_px: float
    held_out: HeldOut | None
    held_out_by_level: dict[Level, float]
    rank: int
    covered_deg: float
    reach: Reach
    pupil: PupilEffect
    hold: Hold
    rivals: tuple[Rival, ...]
    dropped: tuple[DroppedCorner, ...]
    unfit: dict[str, Finding]
    refined: Level
    target: Target | None
    renamed: Mapping[str, Symmetry]
    departures: tuple[Deformation, ...]
    uncertainty_grid: dict[str, Any]
    coverage: float
    notes: tuple[Finding, ...]
    findings: tuple[Finding, ...]
    made_by: Mapping[str, Any] = field(default_factory=dict)

    @property
    def remarks(self) -> tuple[Finding, ...]:
        """What is told beside the findings: notes, photos that were left out, doubts."""
        unfit = (replace(why, images=(photo,)) for photo, why in self.unfit.items())
        doubts = (doubt for one in self.departures for doubt in one.doubts)
        return (*self.notes, *unfit, *doubts)

    def named(self, corners: Observations) -> Observations:
        """Corners of the photos by the names that the fit gave them, of the target as fitted."""
        return renamed(corners, self.target, self.renamed) if self.target else corners

    def as_record(self) -> dict[str, Any]:
        """Plain data: ``fit`` of camera.yaml and the command's JSON."""
        held_out = self.held_out
        return {
            **self.errors.as_record(),
            "images": len(self.pairs.images),
            "held_out_rms_px": held_out.rms_px if held_out else None,
            "held_out_folds": held_out.folds if held_out else 0,
            "companion_rms_px": self.companion_rms_px,
            "companion_held_out_rms_px": held_out.companion_rms_px if held_out else None,
            "refine_target": self.refined,
            "held_out_by_level": dict(self.held_out_by_level),
            "renamed_images": list(self.renamed),
            "departures": [departure.as_record() for departure in self.departures],
            "rank": self.rank,
            "covered_deg": self.covered_deg,
            "reach": self.reach.as_record(),
            "pupil": self.pupil.as_record(),
            "flat": flatness(self.pairs.world) < _NEARLY_FLAT,
            "prior_weight": self.hold.weight,
            "prior_spread": self.hold.spread,
            "coverage": self.coverage,
            "notes": [note.line for note in self.notes],
            "findings": [finding.as_record() for finding in self.findings],
            "uncertainty": self.uncertainty_grid,
            "dropped": len(self.dropped),
            "dropped_corners": [corner.as_record() for corner in self.dropped],
            "unfit_images": {photo: why.line for photo, why in self.unfit.items()},
            "per_image": photo_records(
                self.pairs.images,
                self.pairs.image,
                self.residual,
                self.poses,
                self.pairs.tells_error,
            ),
        }
