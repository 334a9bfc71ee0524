"""All cameras of a rig in one adjustment: places, shots and times first, then lenses and target."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish.fit.folds import FOLDS, MIN_PHOTOS, dealt_out
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.refinement import FIRST_SPREAD, estimate_spread
from cubicfish.models.cubic import CubicCamera, pole_or_fold_deg
from cubicfish.rigs.alone import Alone, CommonWorld
from cubicfish.rigs.rig_lens import RigLens
from cubicfish.rigs.start import RigStart
from cubicfish.rigs.times import Motion, Timing, on_time
from cubicfish.rigs.views import JoinedViews
from cubicfish.solve.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish.solve.deformable_target import NominalTarget, TargetModel
from cubicfish.solve.fit_lens import FitLens, FixedLens
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import huber_px, noise_px, weighed
from cubicfish.target.observations import Observations
from cubicfish.types import FloatArray, IntArray

# While cameras and shots are far off, the loss must still feel every corner.
_WIDE_HUBER_PX = 50.0
_ROUGH_DECREASE = 1e-5
_FINE_DECREASE = 1e-9
# How the target moves follows from its shots, whose poses follow from that.
_TIMED_ROUNDS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class RigProblem:
    """What is fitted together.

    Attributes:
        names: of the cameras.
        singly: each camera alone.
        common: the world in which all are fitted.
        nominal: the target, and the pairs of all views with its points.
        level: how much of the target is fitted.
        motion: when photos were taken, and how the target moves.
        start: where cameras and shots stand at first.

    """

    names: Sequence[str]
    singly: Sequence[Alone]
    common: CommonWorld
    nominal: NominalTarget
    level: TargetModel
    motion: Motion
    start: RigStart

    @property
    def pairs(self) -> Observations:
        """The pairs of all views, which count alike; ``error_known`` is set."""
        return self.nominal.pairs_at(self.level)

    @property
    def units(self) -> str | None:
        """The target's; None where they are not known."""
        return None if self.nominal.target is None else self.nominal.target.units


def fit_places(
    views: JoinedViews,
    poses: Poses,
    pairs: Observations,
    motion: Motion,
    relative_decrease: float,
) -> tuple[Adjustment[RigLens], Timing | None]:
    """Places, where they are free, shots, and the photos' times, the lenses and the target held.

    Args:
        views: the views.
        poses: rig_from_world of each shot, to start from.
        pairs: of the views.
        motion: when photos were taken, and how the target moves.
        relative_decrease: see :func:`adjust`.

    """
    fit = adjust(
        views.lens, poses, pairs, huber_px=_WIDE_HUBER_PX, relative_decrease=relative_decrease
    )
    fit = fit.again(pairs, relative_decrease=relative_decrease)
    return on_time(fit, motion, views)


def fit_jointly(
    problem: RigProblem, views: JoinedViews, poses: Poses
) -> tuple[Adjustment[RigLens], Timing | None]:
    """Places, shots and the photos' times first, the lenses held; then all at once.

    Args:
        problem: what is fitted.
        views: its views, with the shots that they are of.
        poses: rig_from_world of each shot, to start from.

    Returns:
        The fit, in which photos count by their noise, and how the photos' times were fitted.

    """
    held = [FixedLens(camera=one.as_camera(one.lens)) for one in problem.singly]
    views = replace(views, lens=views.lens.with_lenses(held))
    nominal = problem.nominal.pairs
    fit, timing = fit_places(views, poses, nominal, problem.motion, _ROUGH_DECREASE)
    if problem.level != "off":
        fit = _free_target(fit, problem)
    # Photos that are not quite of one moment, too, say less than others.
    pairs = weighed(problem.pairs, fit.residual)
    if problem.level != "off":
        fit = estimate_spread(fit, pairs)
    lenses = [one.lens for one in problem.singly]
    while any(isinstance(one, CubicFit) for one in lenses):
        joint = _free_lenses(fit, lenses, pairs, problem.pairs, timing)
        spoilt = [
            number
            for number, (own, one) in enumerate(zip(joint.lens.lenses, problem.singly, strict=True))
            if isinstance(own, CubicFit) and not _is_valid(one.as_camera(own))
        ]
        if not spoilt:
            return joint, timing
        for number in spoilt:  # these alone stay as their own photos have them
            lenses[number] = held[number]
    return _fit_finely(fit, pairs, timing), timing


def _free_target(fit: Adjustment[RigLens], problem: RigProblem) -> Adjustment[RigLens]:
    """The fit with the target free, too, as far as its level says."""
    spread = FIRST_SPREAD if problem.level == "points" else None
    world = problem.nominal.free(noise=noise_px(fit.errors), offset_spread=spread)
    fit = fit.again(problem.pairs, world=world, relative_decrease=1e-3)
    return estimate_spread(fit, problem.pairs)


def _free_lenses(
    fit: Adjustment[RigLens],
    lenses: Sequence[FitLens],
    pairs: Observations,
    alike: Observations,
    timing: Timing | None,
) -> Adjustment[RigLens]:
    """The fit with lenses of its cameras free, too; pairs are weighed and, then, ``alike``."""
    joint = adjust(
        fit.lens.with_lenses(lenses),
        fit.poses,
        pairs,
        huber_px=huber_px(fit.errors),
        world=fit.world,
        relative_decrease=_ROUGH_DECREASE,
    )
    return _fit_finely(joint, weighed(alike, joint.residual), timing)


def _is_valid(camera: CubicCamera) -> bool:
    return pole_or_fold_deg(camera.P, camera.max_angle_deg) is None


def _fit_finely(
    fit: Adjustment[RigLens], pairs: Observations, timing: Timing | None
) -> Adjustment[RigLens]:
    if timing is not None:
        for _ in range(_TIMED_ROUNDS):
            fit = timing.again(fit).again(pairs, relative_decrease=_ROUGH_DECREASE)
    return fit.again(pairs, relative_decrease=_FINE_DECREASE, damping=WARM_DAMPING, limit=huber_px)


def leave_shots_out(
    fit: Adjustment[RigLens], shots: Sequence[str], places: IntArray
) -> FloatArray | None:
    """(N, 2) residuals of each corner under a fit without its shot, to first order.

    None where shots are too few. Shots (S,) of one place, by number, are left out together.
    """
    count = int(places.max()) + 1
    if count < MIN_PHOTOS:
        return None
    if fit.lens.times is not None:
        # A photo's time is its own, as its pose is.
        known = replace(fit.lens, times=replace(fit.lens.times, known=True))
        fit = _fit_finely(replace(fit, lens=known), fit.pairs, None)
    groups = dealt_out(places, shots, min(FOLDS, count))
    shot = fit.lens.shot[fit.pairs.image]
    found = np.empty_like(fit.residual)
    for number, residual in LeaveOneOut(fit, groups).residuals():
        found[shot == number] = residual[:, :, 0]  # by view, as they are left out
    return found
