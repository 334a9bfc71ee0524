"""Fitting the cubic camera and all poses jointly, from the radial reference, under a prior of P."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from cubicfish.errors import FitError
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.nearest_cubic import (
    MARGIN_DEG,
    cone_angle,
)
from cubicfish.fit.radial_reference import RadialReference
from cubicfish.models.cubic import pole_or_fold_deg
from cubicfish.solve.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish.solve.deformable_target import (
    TARGET_MODELS,
    DeformableTarget,
    NominalTarget,
    TargetModel,
)
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import huber_px, wide_px
from cubicfish.types import FloatArray

if TYPE_CHECKING:
    from cubicfish.fit.held_out import HeldOut
    from cubicfish.fit.prior import Prior

_STRONGEST = 1e4
NEAR_DECREASE = 1e-6
"""For fits that only lead to the next one."""
# Below this, pixels move by less than a hundredth of their uncertainty.
_LAST_DECREASE = 1e-8


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraFit(Adjustment[CubicFit]):
    """The cubic lens, all poses and, where it is free, the target, fitted together.

    Attributes:
        reference: the radial fit to which the prior ties P; its pairs have the world points of this
            fit.
        prior: the prior of P.
        max_angle_deg: half-angle of the cone over which P may be trusted.
        nominal: the nominal target; its pairs have this fit's names.
        runners_up: priors that other photos would choose, each with the probability that it is the
            best of all, 0 to 1; none where none was searched.
        held_out: the held-out error; None where it is not known, or photos are too few.
        other_levels: fits of the target at other levels whose held-out error was measured.

    """

    reference: RadialReference
    prior: Prior
    max_angle_deg: float
    nominal: NominalTarget
    runners_up: Mapping[Prior, float] = field(default_factory=dict)
    held_out: HeldOut | None = None
    other_levels: tuple[CameraFit, ...] = ()

    @property
    def level(self) -> TargetModel:
        """How much of the target was free."""
        if not self.world.free:
            return "off"
        return "points" if len(self.world.offsets) else "shape"

    @property
    def in_doubt(self) -> list[tuple[CubicFit, float]]:
        """The lens of the likeliest richer fit, and how likely it is the better one.

        A few photos may not show that a refined target predicts better, although boards are
        deformed.
        """
        mine, level = self.held_out, TARGET_MODELS.index(self.level)
        richer = [one for one in self.other_levels if TARGET_MODELS.index(one.level) > level]
        found = [(one.lens, mine.doubt(one.held_out)) for one in richer if mine and one.held_out]
        return sorted(found, key=lambda one: one[1])[-1:]

    def followed(self) -> CameraFit:
        """The same with the reference's pairs at the world points of this fit."""
        return replace(self, reference=self.reference.followed(self.world.points))


def fit_cubic(
    reference: RadialReference,
    prior: Prior,
    *,
    start: CameraFit | None = None,
    world: DeformableTarget | None = None,
    relative_decrease: float = _LAST_DECREASE,
) -> CameraFit:
    """Fit P and all poses (Eq. 10) from a reference's lens and poses.

    Args:
        reference: the radial fit to start from, to which the prior ties P.
        prior: the prior of P.
        start: a fit to the same photos from which to start, where there is one.
        world: the target, where it is free; its points are those of the reference's pairs. By
            default it is that of ``start``.
        relative_decrease: when to stop, as in :func:`~cubicfish.solve.adjustment.adjust`.

    Raises:
        FitError: no weight of the prior gives a camera without poles and folds.

    """
    max_angle_deg = float(np.rad2deg(cone_angle(reference.camera, reference.covered, MARGIN_DEG)))
    world = start.world if start and world is None else world
    points = reference.pairs.world if world is None else world.points
    nominal = start.nominal if start else NominalTarget(pairs=reference.pairs)
    errors, known = (reference.errors, None) if start is None else (start.errors, start)
    while True:
        lens, poses = _choose_start(reference, prior, known, errors, points, max_angle_deg)
        fit = adjust(
            lens,
            poses,
            reference.pairs,
            huber_px(errors) if start else wide_px(errors),
            world=world,
            relative_decrease=max(relative_decrease, NEAR_DECREASE),
            damping=WARM_DAMPING,
        )
        if relative_decrease < NEAR_DECREASE:  # to the optimum, the scale of the loss converged
            least = relative_decrease
            fit = fit.without_equations()
            fit = fit.again(relative_decrease=least, damping=WARM_DAMPING, limit=huber_px)
        fault_deg = pole_or_fold_deg(fit.lens.P, max_angle_deg)
        if fault_deg is None:
            return CameraFit(
                **vars(fit),
                reference=reference,
                prior=prior,
                max_angle_deg=max_angle_deg,
                nominal=nominal,
            )
        # A pole crept in: tie P more firmly to the reference, which has none.
        prior, known = replace(prior, weight=prior.weight * 10**0.5), None
        if prior.weight > _STRONGEST:
            raise FitError(
                f"the camera folds at {fault_deg:.0f}° from its axis while "
                f"corners reach {np.rad2deg(reference.covered):.0f}°: check that corners near "
                "the rim are named rightly, or take photos that cover the field more evenly"
            )


def _choose_start(
    reference: RadialReference,
    prior: Prior,
    known: CameraFit | None,
    errors: FloatArray,
    points: FloatArray,
    max_angle_deg: float,
) -> tuple[CubicFit, Poses]:
    """Choose the most exact start without a pole in sight; the safest one where all have one.

    A pole among the corners or beside them is no reason to give up, since photos and radial lens
    are right all the same.
    """
    for number, (lens, poses) in enumerate(prior.starts(reference, known, errors)):
        with np.errstate(over="ignore"):
            pixel = lens.project(poses.apply(reference.pairs.image, points))
        if not np.isfinite(pixel).all() or not np.isfinite(lens.pulls()).all():
            continue
        # A pole between corners and rays shows in neither, but a fit is known to have none.
        is_known = known is not None and number == 0
        if is_known or pole_or_fold_deg(lens.P, max_angle_deg) is None:
            break
    return lens, poses
