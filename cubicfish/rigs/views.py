"""Photos of several cameras as the views of one body: each camera alone first, then together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish.diagnosis.diagnose import find_faults
from cubicfish.errors import FitError
from cubicfish.fit.calibrate import calibrate
from cubicfish.fit.cubic_fit import fit_cubic
from cubicfish.fit.evaluate import Evaluation, evaluate
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.model_selection import RefineTarget
from cubicfish.fit.radial_reference import radial_near
from cubicfish.io.camera_yaml import Calibrated
from cubicfish.judge.finding import Finding, FindingText
from cubicfish.judge.fit_record import FitRecord
from cubicfish.models.cubic import CubicCamera
from cubicfish.rigs.rig import half_field_deg
from cubicfish.rigs.rig_lens import RigLens
from cubicfish.rigs.shots import Shots
from cubicfish.solve.deformable_target import Level
from cubicfish.solve.fit_lens import FitLens, FixedLens
from cubicfish.solve.poses import Poses, rotation_from_vector
from cubicfish.solve.subset import select, with_mean_weight_one
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import FloatArray, IntArray

_ROUGH_DECREASE = 1e-5
# P3 is held so much more firmly than in a fit of one camera, whose corners leave it nearly free.
# Hardly anything depends on by how much: with 1, 30, 100 and 300 times, errors of places in 16
# simulated rigs (triggered, and running free) differ by 2 %.
_FIRM = 100.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Alone:
    """One camera calibrated alone, in the common scale of all.

    Attributes:
        lens: its lens, free or fixed.
        pairs: of its photos that are placed.
        poses: camera_from_world of each.
        camera: its lens, as a camera of points in the common scale.
        runners_up: the lens with the other priors, and how likely each is the best one.
        record: of its fit.
        level: what of the target was fitted.
        findings: what is likely wrong with it.
        seen: all its corners, by the names that it gives them.

    """

    lens: FitLens
    pairs: Observations
    poses: Poses
    camera: CubicCamera
    runners_up: Sequence[tuple[FitLens, float]]
    record: FitRecord
    level: Level
    findings: Sequence[Finding]
    seen: Observations

    def as_camera(self, lens: FitLens) -> CubicCamera:
        """The camera with a lens that its own was adjusted to, in the adjustment's frame."""
        if isinstance(lens, CubicFit):
            return replace(self.camera, P=lens.P, pupil_travel=lens.travel)
        return self.camera

    @property
    def covered(self) -> float:
        """How far from the axis corners reach, radians."""
        return float(np.deg2rad(half_field_deg(self.record, self.camera)))


def calibrate_alone(
    name: str,
    pairs: Observations,
    known: Calibrated | None,
    target: Target | None,
    refine_target: RefineTarget,
    origin: FloatArray,
    scale: float,
    *,
    keep_lens: bool,
) -> Alone:
    """Calibrate a camera, or take it as it was calibrated; then its fit in the common scale.

    Args:
        name: of the camera.
        pairs: its pairs, in the target's units.
        known: the camera, where it is calibrated already and is left as it is.
        target: the target.
        refine_target: what of it is fitted.
        origin: (3,) of the common world, in the target's units.
        scale: the target's units in one unit of it.
        keep_lens: leave the lens as it is then.

    Raises:
        FitError: it cannot be calibrated, or its photos not be placed; the text names it.

    """
    found, seen = None, pairs
    try:
        if known is not None:
            placed = evaluate(known.camera, pairs)
            own, record, pairs, poses = known.camera, known.fit, placed.pairs, placed.poses
        else:
            found = calibrate(
                pairs, target=target, refine_target=refine_target, diagnose=find_faults
            )
            own, record, pairs, poses = found.camera, found.fit, found.pairs, found.poses
    except FitError as error:
        raise FitError(f"camera {name}: {error}") from error
    pairs = with_mean_weight_one(pairs.with_world((pairs.world - origin) / scale))
    poses = poses.of_world(-origin).scaled(1 / scale)
    own = (own if target is None else own.in_units(target.units)).scaled(1 / scale)
    runners_up: list[tuple[FitLens, float]] = []
    lens: FitLens = FixedLens(camera=own)
    if found is not None and not keep_lens:
        reference = radial_near(own.radial, pairs, poses)
        result = fit_cubic(reference, found.prior, relative_decrease=_ROUGH_DECREASE)
        lens, poses = _fix_denominators(result.lens), result.poses
        runners_up = [
            (
                _fix_denominators(prior.apply(result.lens, reference, result.errors)),
                likely,
            )
            for prior, likely in found.runners_up.items()
        ]
    return Alone(
        lens=lens,
        pairs=pairs,
        poses=poses,
        camera=own,
        runners_up=runners_up,
        record=record,
        level="off" if found is None else found.refined,
        findings=[] if found is None else [_report_camera(name, one) for one in found.findings],
        seen=seen if found is None else found.named(seen),
    )


def _report_camera(name: str, finding: Finding) -> Finding:
    """What is found of one camera alone, as a finding of several together."""
    text = FindingText(
        f"camera {name}: {finding.what}", finding.evidence, finding.do, finding.remedy
    )
    return replace(finding, case="", because="", recorded=text, cameras=(name,))


def _fix_denominators(lens: CubicFit) -> CubicFit:
    """The lens, held to the denominators P3Φ that its own photos gave it.

    Many cubics of different P3 see nearly the same. What is wrong between cameras is many times
    their corners' noise, and would pay for a pole beside a corner (see :meth:`CubicFit.priors`).
    """
    prior = lens.ray_prior
    if prior is None:
        return lens
    firm = _FIRM * prior.denominator_weight
    near = replace(prior.near, lens=lens)
    return replace(lens, ray_prior=replace(prior, near=near, denominator_weight=firm))


@dataclass(frozen=True, kw_only=True, eq=False)
class JoinedViews:
    """All cameras' photos as the views of one rig, sorted by camera.

    Attributes:
        lens: lenses and places, and which view is whose.
        poses: camera_from_world of each view, as its camera found it alone.
        pairs: of all views.
        photos: of each view, its camera's photo.
        shots: of each shot, its name.

    """

    lens: RigLens
    poses: Poses
    pairs: Observations
    photos: tuple[str, ...]
    shots: tuple[str, ...]

    @classmethod
    def of_cameras(
        cls,
        lenses: Sequence[FitLens],
        alone: Sequence[Alone | Evaluation],
        shots: Shots,
        places: Poses | None = None,
    ) -> JoinedViews:
        """The views of cameras that are placed alone, in one scale.

        Args:
            lenses: of each camera.
            alone: each camera's pairs and poses.
            shots: which photos are of one shot.
            places: camera_from_rig of each camera, where they are known and held; else all are in
                one place.

        """
        parts, views = [], []
        camera: list[int] = []
        shot: list[int] = []
        for number, (one, of_shot) in enumerate(zip(alone, shots.photos, strict=True)):
            listed = np.array([name in of_shot for name in one.pairs.images])
            own, kept = select(one.pairs, listed[one.pairs.image])
            parts.append(own)
            camera += [number] * len(kept)
            shot += [of_shot[name] for name in own.images]
            views.append(one.poses[kept])
        used, index = np.unique(shot, return_inverse=True)
        nowhere = np.zeros((len(lenses), 3))
        size = np.max([part.image_size for part in parts], axis=0).tolist()
        return cls(
            lens=RigLens(
                lenses=tuple(lenses),
                places=places or Poses(rotation=rotation_from_vector(nowhere), translation=nowhere),
                camera=np.array(camera, np.intp),
                shot=index.astype(np.intp),
                places_fixed=places is not None,
            ),
            poses=Poses.joined(views),
            pairs=replace(Observations.joined(parts), image_size=tuple(size)),
            photos=tuple(name for part in parts for name in part.images),
            shots=tuple(shots.names[number] for number in used),
        )

    def set_apart(self, shots: Poses, apart: IntArray) -> tuple[JoinedViews, Poses]:
        """Views that do not go with their shots get shots of their own: they say nothing of places.

        Args:
            shots: rig_from_world of each shot.
            apart: (A,) which views.

        Returns:
            The same of the new shots, and rig_from_world of these.

        """
        lens, shot = self.lens, self.lens.shot.copy()
        shot[apart] = len(shots) + np.arange(len(apart))
        own = lens.places[lens.camera[apart]].inverse() @ self.poses[apart]
        new = (f"{self.shots[lens.shot[view]]} ({self.photos[view]})" for view in apart)
        names = (*self.shots, *new)
        # A shot may be left without any view.
        used, shot = np.unique(shot, return_inverse=True)
        lens = replace(lens, shot=shot.astype(np.intp))
        named = tuple(names[number] for number in used)
        return replace(self, lens=lens, shots=named), Poses.joined([shots, own])[used]
