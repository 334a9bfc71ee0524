"""One camera of a rig by itself: calibrated without any guess, or as it was calibrated before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cubicfish_cli.core.assess.fit_record import FitRecord
from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.finding import RigFinding, of_camera
from cubicfish_cli.core.fit.adjustment import adjust
from cubicfish_cli.core.fit.calibrate import calibrate
from cubicfish_cli.core.fit.cubic_fit import fit_cubic, held
from cubicfish_cli.core.fit.evidence import Diagnose
from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.known_lens import fit_poses
from cubicfish_cli.core.fit.lenses import CubicFit, FixedLens
from cubicfish_cli.core.fit.model_selection import RefineTarget
from cubicfish_cli.core.fit.radial_reference import radial_near
from cubicfish_cli.core.fit.refinement import Level
from cubicfish_cli.core.fit.subset import with_mean_weight_one
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.extensions.rigs.fit.clocks import Moving
from cubicfish_cli.extensions.rigs.fit.gather import Placed, unplaced

# While photos are far off, the loss must still feel every corner.
_WIDE_HUBER_PX = 50.0
_ROUGH_DECREASE = 1e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class RigCamera:
    """What is known of one camera before the rig is fitted.

    Attributes:
        name: of the camera.
        pairs: its 2D-3D pairs, in the target's units.
        camera: its lens, where it is calibrated already, and is left as it is; None to calibrate
            it from its pairs.
        fit: the record of that calibration, where there is one.
        moving: how its corners move, where that is known: photos of a shot then need not be of
            one moment.

    """

    name: str
    pairs: Observations
    camera: CubicCamera | None = None
    fit: FitRecord = field(default_factory=FitRecord)
    moving: Moving | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Alone(Placed):
    """One camera calibrated alone, in the common scale of all; its lens is free or fixed.

    Attributes:
        camera: its lens, as a camera of points in the common scale.
        runners_up: the lens with the other priors, and how likely each is the best one.
        record: of its fit.
        level: what of the target was fitted.
        told: what is likely wrong with it.
        seen: all its corners, by the names that it gives them.

    """

    camera: CubicCamera
    runners_up: Sequence[tuple[FitLens, float]]
    record: FitRecord
    level: Level
    told: tuple[RigFinding, ...]
    seen: Observations

    def as_camera(self, lens: FitLens) -> CubicCamera:
        """The camera with a lens that its own was adjusted to, in the adjustment's frame."""
        if isinstance(lens, CubicFit):
            return replace(self.camera, P=lens.P, pupil_travel=lens.travel)
        return self.camera

    @property
    def covered(self) -> float:
        """How far from the axis corners reach, radians."""
        covered = self.record.covered_deg
        if not 0 < covered < 180:
            covered = self.camera.max_angle_deg
        return float(np.deg2rad(covered))


def alone(
    camera: RigCamera,
    target: Target | None,
    refine_target: RefineTarget,
    origin: FloatArray,
    scale: float,
    *,
    hold: bool,
    diagnose: Diagnose | None,
) -> Alone:
    """Calibrate a camera, or take it as it was calibrated; then its fit in the common scale.

    Args:
        camera: the camera.
        target: the target.
        refine_target: what of it is fitted.
        origin: (3,) of the common world, in the target's units.
        scale: the target's units in one unit of it.
        hold: leave the lens as it is then.
        diagnose: tells what is likely wrong with it.

    Raises:
        FitError: it cannot be calibrated, or its photos not be placed; the text names it.

    """
    level: Level = "off"
    told: tuple[RigFinding, ...] = ()
    found = None
    if camera.camera is None:
        try:
            found = calibrate(
                camera.pairs, target=target, refine_target=refine_target, diagnose=diagnose
            )
        except FitError as error:
            raise FitError(f"camera {camera.name}: {error}") from error
        own, record, pairs, poses = found.camera, found.fit, found.pairs, found.poses
        level, told = found.refined, tuple(of_camera(camera.name, one) for one in found.findings)
    else:
        own, record = camera.camera, camera.fit
        placed, pairs, _ = fit_poses(own.radial, camera.pairs)
        if placed is None:
            raise unplaced(camera.name)
        poses = placed.poses
    pairs = with_mean_weight_one(pairs.with_world((pairs.world - origin) / scale))
    poses = poses.of_world(-origin).scaled(1 / scale)
    own = (own if target is None else own.in_units(target.units)).scaled(1 / scale)
    runners_up: list[tuple[FitLens, float]] = []
    lens: FitLens = FixedLens(camera=own)
    if found is None or hold:
        fit = adjust(lens, poses, pairs, huber_px=_WIDE_HUBER_PX, relative_decrease=_ROUGH_DECREASE)
        poses = fit.again(pairs).poses
    else:
        reference = radial_near(own.radial, pairs, poses)
        result = fit_cubic(reference, found.prior, relative_decrease=_ROUGH_DECREASE)
        lens, poses = result.lens, result.poses
        runners_up = [
            (held(result.lens, reference, one.prior, result.errors), one.likely)
            for one in found.runners_up
        ]
    return Alone(
        lens=lens,
        pairs=pairs,
        poses=poses,
        camera=own,
        runners_up=runners_up,
        record=record,
        level=level,
        told=told,
        seen=camera.pairs if found is None else found.named(camera.pairs),
    )
