"""Each camera of a rig calibrated alone, in a world that all of them have in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish.diagnosis.diagnose import find_faults
from cubicfish.errors import FitError
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.calibration import Calibration
from cubicfish.fit.cubic_fit import fit_cubic
from cubicfish.fit.evaluate import Evaluation, evaluate
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.model_selection import RefineTarget
from cubicfish.fit.radial_reference import radial_near
from cubicfish.io.camera_yaml import Calibrated
from cubicfish.judge.finding import Finding
from cubicfish.judge.fit_record import FitRecord
from cubicfish.models.cubic import CubicCamera
from cubicfish.rigs.rig import half_field_deg
from cubicfish.solve.deformable_target import TargetModel
from cubicfish.solve.fit_lens import FitLens, FixedLens
from cubicfish.solve.poses import Poses
from cubicfish.solve.subset import with_mean_weight_one, world_scale
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import FloatArray

_ROUGH_DECREASE = 1e-5
# P3 is held so much more firmly than in a fit of one camera, whose corners leave it nearly free.
# Hardly anything depends on by how much: with 1, 30, 100 and 300 times, errors of places in 16
# simulated rigs (triggered, and running free) differ by 2 %.
_FIRM = 100.0


@dataclass(frozen=True, kw_only=True, eq=False)
class CommonWorld:
    """The world of all cameras: about the middle of what they see, in lengths of about its size.

    Attributes:
        origin: (3,) of it, in the target's units.
        scale: the target's units in one unit of it.

    """

    origin: FloatArray
    scale: float

    @classmethod
    def of(cls, seen: Sequence[Observations]) -> CommonWorld:
        """The world of what each camera saw."""
        everything = np.concatenate([own.world for own in seen])
        scale = world_scale(seen[0].with_world(everything))
        return cls(origin=everything.mean(axis=0), scale=scale)

    def points(self, world: FloatArray) -> FloatArray:
        """Points (N, 3) in the target's units -> in this world."""
        return (world - self.origin) / self.scale

    def poses(self, poses: Poses) -> Poses:
        """Poses in the target's units -> in this world."""
        return poses.of_world(-self.origin).scaled(1 / self.scale)

    def poses_of_target(self, poses: Poses) -> Poses:
        """Poses in this world -> in the target's units."""
        return poses.scaled(self.scale).of_world(self.origin)

    def target(self, target: Target) -> Target:
        """The target about this world's origin, in its own units."""
        return target.moved(-self.origin)


@dataclass(frozen=True, kw_only=True, eq=False)
class Alone:
    """One camera calibrated alone.

    Attributes:
        lens: its lens, free or fixed.
        pairs: of its photos that are placed.
        poses: camera_from_world of each.
        camera: its lens, as a camera of points.
        record: of its fit.
        seen: all its corners, by the names that it gives them.
        runners_up: the lens with the other priors, and how likely each is the best one.
        level: what of the target was fitted.
        findings: what is likely wrong with it.

    """

    lens: FitLens
    pairs: Observations
    poses: Poses
    camera: CubicCamera
    record: FitRecord
    seen: Observations
    runners_up: Sequence[tuple[FitLens, float]] = ()
    level: TargetModel = "off"
    findings: Sequence[Finding] = ()

    def within(self, common: CommonWorld, units: str | None) -> Alone:
        """The same in the world of all cameras, the lens fixed; the target is in ``units``."""
        camera = self.camera if units is None else self.camera.in_units(units)
        camera = camera.scaled(1 / common.scale)
        pairs = with_mean_weight_one(self.pairs.with_world(common.points(self.pairs.world)))
        poses, lens = common.poses(self.poses), FixedLens(camera=camera)
        return replace(self, lens=lens, pairs=pairs, poses=poses, camera=camera)

    def as_camera(self, lens: FitLens) -> CubicCamera:
        """The camera with a lens that its own was adjusted to, in the adjustment's frame."""
        if isinstance(lens, CubicFit):
            return replace(self.camera, P=lens.P, pupil_travel=lens.pupil_travel)
        return self.camera

    @property
    def covered(self) -> float:
        """How far from the axis corners reach, radians."""
        return float(np.deg2rad(half_field_deg(self.record, self.camera)))


def calibrate_alone(
    name: str,
    seen: Observations,
    known: Calibrated | None,
    target: Target | None,
    refine_target: RefineTarget,
    common: CommonWorld,
    *,
    keep_lens: bool,
) -> Alone:
    """Calibrate a camera, or take it as it was calibrated; then its fit in the common world.

    Args:
        name: of the camera.
        seen: all its corners, in the target's units.
        known: the camera, where it is calibrated already and is left as it is.
        target: the target.
        refine_target: what of it is fitted.
        common: the world of all cameras.
        keep_lens: leave the lens as it is then.

    Raises:
        FitError: it cannot be calibrated, or its photos not be placed; the text names it.

    """
    units = None if target is None else target.units
    if known is not None:
        placed = place_alone(name, known.camera, seen)
        held = Alone(
            lens=FixedLens(camera=known.camera),
            pairs=placed.pairs,
            poses=placed.poses,
            camera=known.camera,
            record=known.fit,
            seen=seen,
        )
        return held.within(common, units)
    try:
        found = calibrate(seen, target=target, refine_target=refine_target, diagnose=find_faults)
    except FitError as error:
        raise error.amid(f"camera {name}: ") from error
    own = Alone(
        lens=FixedLens(camera=found.camera),
        pairs=found.pairs,
        poses=found.poses,
        camera=found.camera,
        record=found.fit,
        level=found.refined,
        findings=[_report_camera(name, one) for one in found.findings],
        seen=found.named(seen),
    ).within(common, units)
    return own if keep_lens else _free_lens(own, found)


def _free_lens(alone: Alone, found: Calibration) -> Alone:
    """The camera with the lens of its own fit free, fitted again in the common world."""
    reference = radial_near(alone.camera.radial, alone.pairs, alone.poses)
    result = fit_cubic(reference, found.prior, relative_decrease=_ROUGH_DECREASE)
    runners_up = [
        (prior.apply(result.lens, reference, result.errors), likely)
        for prior, likely in found.runners_up.items()
    ]
    return replace(
        alone,
        lens=_fix_denominators(result.lens),
        poses=result.poses,
        runners_up=[(_fix_denominators(lens), likely) for lens, likely in runners_up],
    )


def place_alone(name: str, camera: CubicCamera, seen: Observations) -> Evaluation:
    """Place the photos of a camera that is known.

    Raises:
        FitError: they cannot be placed; the text names the camera.

    """
    try:
        return evaluate(camera, seen)
    except FitError as error:
        raise error.amid(f"camera {name}: ") from error


def _report_camera(name: str, finding: Finding) -> Finding:
    """What is found of one camera alone, as a finding of several together."""
    return replace(finding, cameras=(name,))


def _fix_denominators(lens: CubicFit) -> CubicFit:
    """The lens, held to the denominators P3Φ that its own photos gave it.

    Many cubics of different P3 see nearly the same. What is wrong between cameras is many times
    their corners' noise, and would pay for a pole beside a corner (see :meth:`CubicFit.priors`).
    """
    prior = lens.tie
    if prior is None:
        return lens
    firm = _FIRM * prior.denominator_weight
    near = replace(prior.near, lens=lens)
    return replace(lens, tie=replace(prior, near=near, denominator_weight=firm))
