"""Fitting the cubic camera and all poses jointly, from the radial reference.

A weak prior on a cone (pseudo-observations) ties P to the reference, bent as real lenses are: it
keeps poles out where there are no corners, and fixes the rotation that P could otherwise absorb.
How symmetric the prior's lens is, and how firmly the prior ties P to it, are two unknowns of each
camera: :class:`PriorChoice`.

Asymmetry is real on some lenses and absent on others, and how much of it corners can show depends
on how many there are and on the errors that they share. So photos that are left out choose both,
from the plain radial lens at one end to a nearly free P at the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from cubicfish.errors import FitError
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.nearest_cubic import (
    MARGIN_DEG,
    SAFER_PULLS,
    cone_angle,
    linear_cubic,
)
from cubicfish.fit.radial_reference import RadialReference
from cubicfish.models.cubic import pole_or_fold_deg
from cubicfish.solve.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish.solve.deformable_target import (
    LEVELS,
    DeformableTarget,
    Level,
    NominalTarget,
)
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import ALIKE, huber_px, noise_px, wide_px
from cubicfish.types import FloatArray, IntArray

if TYPE_CHECKING:
    from cubicfish.fit.held_out import HeldOut

# Expected travel of the entrance pupil, as a share of the corners' distance: millimetres at arm's
# length.
_TRAVEL_SPREAD = 0.02
# Pixels that a unit of travel counts as where the pupil shall not move, whatever corners say.
_STILL = 1e7
_STRONGEST = 1e4
NEAR_DECREASE = 1e-6
"""For fits that only lead to the next one."""
# Below this, pixels move by less than a hundredth of their uncertainty.
_LAST_DECREASE = 1e-8


@dataclass(frozen=True, kw_only=True)
class PriorChoice:
    """The prior of P: the lens to which it ties P, and how firmly.

    Attributes:
        spread: expected asymmetry of the prior's lens (see
            :class:`~cubicfish.fit.asymmetric.BentFit`); 0 for a symmetric one.
        weight: weight of the pseudo-observations.
        central: whether the entrance pupil does not move.

    """

    spread: float
    weight: float
    central: bool = False


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
    prior: PriorChoice
    max_angle_deg: float
    nominal: NominalTarget
    runners_up: Mapping[PriorChoice, float] = field(default_factory=dict)
    held_out: HeldOut | None = None
    other_levels: tuple[CameraFit, ...] = ()

    @property
    def level(self) -> Level:
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
        mine, level = self.held_out, LEVELS.index(self.level)
        richer = [one for one in self.other_levels if LEVELS.index(one.level) > level]
        found = [(one.lens, mine.doubt(one.held_out)) for one in richer if mine and one.held_out]
        return sorted(found, key=lambda one: one[1])[-1:]

    def followed(self) -> CameraFit:
        """The same with the reference's pairs at the world points of this fit."""
        return replace(self, reference=self.reference.followed(self.world.points))


# From the most symmetric and the firmest prior on. An asymmetry of 0.01 is far more than any lens
# on sale has; at a weight of 0.01 P is practically free.
SPREADS = (0.0, 1e-4, 1e-3, 1e-2)
WEIGHTS = tuple(10.0 ** (1.5 - step / 2) for step in range(8))
FIRMEST = PriorChoice(spread=SPREADS[0], weight=WEIGHTS[0])
RADIAL = PriorChoice(spread=0.0, weight=100.0, central=True)
"""The prior that leaves P no choice but the cubic nearest to a radial lens."""
# The prior that is expected before any photo is used: most lenses on sale have less asymmetry than
# the largest that was found, and few corners need a firm prior.
EXPECTED = PriorChoice(spread=1e-4, weight=WEIGHTS[2])
# What one Gauss-Newton step says of a prior so many steps of the two lists away is rough.
_FAR = 3
# Fits that only lead to a choice need not be exact to the last digit.
_SCAN_DECREASE = 1e-4
# A sum of squared errors, pixels², that is nothing but rounding.
_NO_ERROR = 1e-16
# Number of bootstrap samples: they give the probability of a prior to 0.02.
_DRAWS = 500

_PRIORS = [PriorChoice(spread=spread, weight=weight) for spread in SPREADS for weight in WEIGHTS]


def fit_cubic(
    reference: RadialReference,
    prior: PriorChoice,
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
        # The most exact start without a pole in sight. A pole among the corners or beside them is
        # no reason to give up, since photos and radial lens are right all the same.
        for number, (lens, poses) in enumerate(starts(reference, prior, known, errors)):
            with np.errstate(over="ignore"):
                pixel = lens.project(poses.apply(reference.pairs.image, points))
            if not np.isfinite(pixel).all() or not np.isfinite(lens.prior()).all():
                continue
            # A pole between corners and rays shows in neither, but a fit is known to have none.
            is_known = known is not None and number == 0
            if is_known or pole_or_fold_deg(lens.P, max_angle_deg) is None:
                break
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


def starts(
    reference: RadialReference, prior: PriorChoice, start: CameraFit | None, errors: FloatArray
) -> Iterator[tuple[CubicFit, Poses]]:
    """Lenses and poses from which to start: a known fit, the nearest cubic, and safer ones.

    A solution from the corners themselves is biased by outliers and may have a pole just outside
    them, where Levenberg–Marquardt then stays.

    Args:
        reference: the radial fit.
        prior: the prior of P.
        start: the known fit, if there is one.
        errors: (N, 2) of the corners, as far as they are known, pixels.

    """
    if start is not None:
        yield with_prior(start.lens, reference, prior, errors), start.poses
    near, camera, (_, poses) = reference.cubic, reference.camera, reference.bent(prior.spread)
    bent = reference.ray_prior(prior.spread).near.lens
    yield with_prior(bent, reference, prior, errors), poses
    pixel = camera.project(near.rays)
    for pull in SAFER_PULLS:
        safer = linear_cubic(near.rays, pixel, camera, denominator_pull=pull, weights=near.weights)
        yield with_prior(safer, reference, prior, errors), reference.poses


def with_prior(
    lens: CubicFit, reference: RadialReference, prior: PriorChoice, errors: FloatArray
) -> CubicFit:
    """The same P with the prior for this reference.

    A prior that is left from an earlier fit is for other corners and another noise.

    Args:
        lens: the lens.
        reference: the radial fit.
        prior: the choice of the prior.
        errors: (N, 2) of the corners, pixels.

    """
    pairs, old, new = reference.pairs, lens.ray_prior, reference.ray_prior(prior.spread)
    rays = new.near.rays
    if old is None or old.near.rays is not rays:
        lens = replace(reference.cubic.lens.with_pixels_of(lens, rays), travel=lens.travel)
    lens = replace(lens, ray_prior=replace(new, weight=prior.weight))
    if prior.central:
        return replace(lens, travel=0.0, travel_weight=_STILL)
    # What a unit of the pupil's travel counts as, among corners with these residuals.
    points = reference.poses.apply(pairs.image, pairs.world)
    distance = 1 / float(np.mean(1 / np.linalg.norm(points, axis=1)))
    weight = max(noise_px(errors), 1e-3) * np.sqrt(ALIKE) / (_TRAVEL_SPREAD * distance)
    return replace(lens, travel_weight=float(weight))


def choose_prior(
    reference: RadialReference,
    groups: Sequence[IntArray],
    *,
    start: CameraFit | None = None,
    everywhere: bool = False,
) -> CameraFit:
    """Fit the cubic under the prior that predicts photos left out best.

    Fits under other priors, and without some photos, are one Gauss-Newton step away from a fit
    under one prior; the best is then fitted in full.

    Args:
        reference: the radial fit.
        groups: photos that are left out together; with fewer than two groups, the prior of
            ``start``, or the expected one, is kept.
        start: a fit to the same photos, whose target stays as free as it is, and whose prior is
            where the search begins.
        everywhere: compare all priors, as without a start; else only those around.

    Returns:
        A fit that is good to compare and to continue from, but not exact to the last digit.

    Raises:
        FitError: the first prior, or the chosen one, gives no sound camera.

    """
    prior = EXPECTED if start is None else start.prior
    if len(groups) < 2:
        return fit_cubic(reference, prior, start=start, relative_decrease=_SCAN_DECREASE)
    away = np.abs(np.subtract([_find_place(one) for one in _PRIORS], _find_place(prior)))
    steps = away.sum(axis=1)
    farthest = np.inf if everywhere or start is None else 1
    begun = _PRIORS[int(steps.argmin())]
    priors = [_PRIORS[near] for near in np.flatnonzero(steps <= farthest)]
    start = fit_cubic(reference, begun, start=start, relative_decrease=_SCAN_DECREASE)
    squares = _predict_squares(start, reference, groups, priors)
    start = start.without_equations()
    chosen, runners_up = _choose_likeliest(priors, squares)
    # A prior that was made firmer stays so.
    prior = start.prior if chosen == begun else chosen
    fitted = fit_cubic(reference, prior, start=start, relative_decrease=NEAR_DECREASE)
    if everywhere and steps[_PRIORS.index(chosen)] >= _FAR:  # those around it again, from there
        return choose_prior(reference, groups, start=fitted)
    return replace(fitted, runners_up=runners_up)


def _find_place(prior: PriorChoice) -> tuple[int, int]:
    """Indices of the nearest entries of SPREADS and WEIGHTS."""
    weight = np.abs(np.log(WEIGHTS) - np.log(prior.weight)).argmin()
    return int(np.abs(np.array(SPREADS) - prior.spread).argmin()), int(weight)


def _predict_squares(
    start: CameraFit,
    reference: RadialReference,
    groups: Sequence[IntArray],
    priors: Sequence[PriorChoice],
) -> FloatArray:
    """Predict squared errors (priors, M) of each photo under a fit without it, over its corners.

    The fits are under some priors, to first order from a fit under one of them.

    Args:
        start: that fit.
        reference: the radial fit to which the priors tie P.
        groups: photos that are left out together.
        priors: the priors; those of one spread stand together.

    """
    grams = []
    for spread in dict.fromkeys(one.spread for one in priors):
        weights = np.array([one.weight for one in priors if one.spread == spread])
        grams.append(replace(start.lens, ray_prior=reference.ray_prior(spread)).priors(weights))
    photos = LeaveOneOut(start, groups).residuals(np.concatenate(grams))
    squares = {photo: np.nansum(np.square(residual), axis=(0, 1)) for photo, residual in photos}
    return np.array([squares[photo] for photo in range(len(squares))]).T


def _choose_likeliest(
    priors: Sequence[PriorChoice], squares: FloatArray
) -> tuple[PriorChoice, dict[PriorChoice, float]]:
    """Choose the prior that is taken, and those that would be taken for other photos.

    Corners of one photo share their errors: together they count as one corner, whose noise belongs
    to that photo alone and is unknown. Integrated over this noise with the prior 1/σ, the
    likelihood is 1 / squared error. So no photo outweighs the others.

    The probability of a prior is how often it is taken when as many photos are drawn from these
    with repetition (the bootstrap, by which Buckland, Burnham & Augustin 1997 weigh models).

    Args:
        priors: the priors.
        squares: the squared errors of each photo under them, see :func:`_predict_squares`.

    """
    evidence = np.ascontiguousarray(-np.log(np.maximum(squares, _NO_ERROR)))
    # Log prior of each, up to a constant: a step in either list is one standard deviation.
    away = np.subtract([_find_place(one) for one in priors], _find_place(EXPECTED))
    expected = -np.square(away).sum(axis=1) / 2
    chosen, photos = int((evidence.sum(axis=1) + expected).argmax()), evidence.shape[1]
    sampled = np.random.default_rng(0).multinomial(photos, np.full(photos, 1 / photos), _DRAWS)
    taken = (sampled @ evidence.T + expected).argmax(axis=1)
    likely = np.bincount(taken, minlength=len(priors)) / _DRAWS
    others = [other for other in np.flatnonzero(likely).tolist() if other != chosen]
    return priors[chosen], {priors[one]: float(likely[one]) for one in others}
