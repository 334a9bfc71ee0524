"""How P is held: by how symmetric a lens, and how firmly. Two unknowns of each camera.

Asymmetry is real on some lenses and absent on others, and what corners can tell of it depends on
how many there are and on what errors they share. So both are chosen by what photos that are left
out say, from the plain radial lens at one end to a nearly free P at the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from cubicfish_cli.core.fit.cubic_fit import (
    NEAR_DECREASE,
    CubicResult,
    PriorChoice,
    RunnerUp,
    fit_cubic,
)
from cubicfish_cli.core.fit.deformable_target import DeformableTarget
from cubicfish_cli.core.fit.left_out import LeaveOneOut
from cubicfish_cli.core.fit.lenses import CubicFit
from cubicfish_cli.core.fit.radial_reference import RadialReference
from cubicfish_cli.core.types import FloatArray, IntArray

# From the most symmetric and the firmest on. An asymmetry of 0.01 is far more than any lens on sale
# has; at a weight of 0.01 P is practically free.
SPREADS = (0.0, 1e-4, 1e-3, 1e-2)
WEIGHTS = tuple(10.0 ** (1.5 - step / 2) for step in range(8))
FIRMEST = PriorChoice(spread=SPREADS[0], weight=WEIGHTS[0])
RADIAL = PriorChoice(spread=0.0, weight=100.0, central=True)
"""Leaves P nothing but to be the cubic nearest to a radial lens."""
# What is expected before any photo speaks: most lenses that are sold are better held by less
# asymmetry than the most that is found in some, and few corners better by a firm prior.
EXPECTED = PriorChoice(spread=1e-4, weight=WEIGHTS[2])
# What only leads to a choice need not be known to the last digit.
_SCAN_DECREASE = 1e-4
# A sum of squared errors, pixels², that is rounding.
_NO_ERROR = 1e-16
# How often photos are drawn anew: how likely a prior is, is known to 0.02 then.
_DRAWS = 500

_Place = tuple[int, int]  # indices into SPREADS and WEIGHTS
_EVERY_PLACE = [
    (spread, weight) for spread in range(len(SPREADS)) for weight in range(len(WEIGHTS))
]


def choose_prior(
    reference: RadialReference,
    groups: Sequence[IntArray],
    *,
    world: DeformableTarget | None = None,
    start: CubicResult | None = None,
    everywhere: bool = False,
) -> CubicResult:
    """Fit the cubic under the prior that photos left out speak for.

    Other priors, and fits without some photos, are one Gauss-Newton step from a fit under one;
    the best is then fitted in full.

    Args:
        reference: the radial fit.
        groups: photos to be left out together; with fewer than two the prior of ``start``, or the
            expected one, is kept.
        world: the target, where it is free.
        start: a fit to the same photos whose prior is where to begin.
        everywhere: look at all priors from there, as without a start; else at those around.

    Returns:
        A fit that is good to compare and to go on from, not yet to the last digit.

    Raises:
        FitError: the prior begun with, or the one chosen, gives no sound camera.

    """
    prior = EXPECTED if start is None else start.prior
    if len(groups) < 2:
        return fit_cubic(
            reference, prior, world=world, start=start, relative_decrease=NEAR_DECREASE
        )
    place = _place_of(prior)
    places = _EVERY_PLACE if everywhere or start is None else _around(place)
    start = fit_cubic(
        reference, _prior_at(place), world=world, start=start, relative_decrease=_SCAN_DECREASE
    )
    leave_one_out = LeaveOneOut(start.fit, groups)
    squares = _squares(leave_one_out, start.lens, reference, places)
    chosen, runners_up = _likeliest(squares)
    # A prior that was made firmer stays so.
    prior = start.prior if chosen == place else _prior_at(chosen)
    fitted = fit_cubic(
        reference, prior, world=start.fit.world, start=start, relative_decrease=NEAR_DECREASE
    )
    return replace(fitted, runners_up=runners_up)


def _prior_at(place: _Place) -> PriorChoice:
    return PriorChoice(spread=SPREADS[place[0]], weight=WEIGHTS[place[1]])


def _place_of(prior: PriorChoice) -> _Place:
    weight = np.abs(np.log(WEIGHTS) - np.log(prior.weight)).argmin()
    return int(np.abs(np.array(SPREADS) - prior.spread).argmin()), int(weight)


def _around(place: _Place) -> list[_Place]:
    return [other for other in _EVERY_PLACE if np.abs(np.subtract(place, other)).sum() <= 1]


def _squares(
    leave_one_out: LeaveOneOut, lens: CubicFit, reference: RadialReference, places: Sequence[_Place]
) -> dict[_Place, FloatArray]:
    """Squared errors of each photo under a fit without it, summed over its corners.

    Under some priors, to first order from a fit under one of them, whose lens is given.

    Args:
        leave_one_out: that fit.
        lens: its lens.
        reference: what P is held to.
        places: the priors, those of one spread together: the order is relied on.

    Returns:
        By prior, the (M,) squared errors.

    """
    priors = []
    for spread in dict.fromkeys(spread for spread, _ in places):
        weights = [WEIGHTS[weight] for own, weight in places if own == spread]
        to_another = lens.held_to(reference.bent(SPREADS[spread])[0])
        priors.append(to_another.priors(np.array(weights)))
    photos = leave_one_out.residuals(np.concatenate(priors))
    squares = {photo: np.nansum(np.square(residual), axis=(0, 1)) for photo, residual in photos}
    of_places = np.array([squares[photo] for photo in range(len(squares))]).T
    return dict(zip(places, of_places, strict=True))


def _likeliest(squares: Mapping[_Place, FloatArray]) -> tuple[_Place, tuple[RunnerUp, ...]]:
    """The prior that is taken, and those that would be if other photos had been taken.

    How likely these are: as often as they are taken when as many photos are drawn from these with
    repetition (the bootstrap, as Buckland, Burnham & Augustin 1997 weigh models by it).
    """
    places, expected = list(squares), np.array(list(_expected(squares).values()))
    told = np.array(list(_told(squares).values()))
    chosen = int((told.sum(axis=1) + expected).argmax())
    photos = told.shape[1]
    drawn = np.random.default_rng(0).multinomial(photos, np.full(photos, 1 / photos), _DRAWS)
    taken = (drawn @ told.T + expected).argmax(axis=1)
    likely = np.bincount(taken, minlength=len(places)) / _DRAWS
    runners_up = tuple(
        RunnerUp(prior=_prior_at(places[other]), likely=float(likely[other]))
        for other in np.flatnonzero(likely).tolist()
        if other != chosen
    )
    return places[chosen], runners_up


def _told(squares: Mapping[_Place, FloatArray]) -> dict[_Place, FloatArray]:
    """Log likelihood (M,) of each prior by each of the photos left out.

    Corners of one photo share their errors: together they count as one corner, whose noise is of
    that photo alone and unknown: integrated over noise with the prior 1/σ, the likelihood is
    1 / squared error. So no photo outweighs the others.
    """
    return {
        place: -np.log(np.maximum(of_photos, _NO_ERROR)) for place, of_photos in squares.items()
    }


def _expected(places: Iterable[_Place]) -> dict[_Place, float]:
    """Log prior of each choice, up to a constant: a step in either list is a standard deviation."""
    middle = _place_of(EXPECTED)
    return {place: -float(np.square(np.subtract(place, middle)).sum()) / 2 for place in places}
