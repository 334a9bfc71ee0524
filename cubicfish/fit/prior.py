"""The prior of P: what it is, how it is chosen, and how it is applied to a lens.

A weak prior on a cone (pseudo-observations) ties P to the reference, decentred and tilted as real
lenses are: it keeps poles out where there are no corners, and fixes the rotation that P could
otherwise absorb. How symmetric the prior's lens is, and how firmly the prior ties P to it, are two
unknowns of each camera.

Asymmetry is real on some lenses and absent on others, and how much of it corners can show depends
on how many there are and on the errors that they share. So photos that are left out choose both,
from the plain radial lens at one end to a nearly free P at the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish.fit.cubic_fit import NEAR_DECREASE, CameraFit, fit_cubic
from cubicfish.fit.decentred import DecentredFit
from cubicfish.fit.lenses import CubicFit, Tie
from cubicfish.fit.nearest_cubic import (
    MARGIN_DEG,
    SAFER_PULLS,
    cone_angle,
    linear_cubic,
    nearest_decentred_cubic,
)
from cubicfish.fit.radial_reference import RadialReference
from cubicfish.solve.adjustment import WARM_DAMPING, adjust
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.solve.poses import Poses
from cubicfish.solve.statistics import ALIKE, noise_px, wide_px
from cubicfish.types import FloatArray, IntArray

# Expected travel of the entrance pupil, as a share of the corners' distance: millimetres at arm's
# length.
_TRAVEL_SPREAD = 0.02
# Pixels that a unit of travel counts as where the pupil shall not move, whatever corners say.
_STILL = 1e7
# For a lens that is only the prior's, and starts the search for the nearest one.
_DECENTRED_DECREASE = 1e-4
# A turn of the camera with decentring and tilt does what a shift of the principal point does, to
# well below any noise. So that the frame is not left to chance, the prior's lens stays within about
# this share of the focal length of the principal point that the corners gave.
_CENTRE_SPREAD = 0.01
# Expected relative departure of P3Φ from that of the cubic nearest to the prior's lens: so loose
# that the optimum hardly depends on it, and far from a pole.
_DENOMINATOR_SPREAD = 0.3


@dataclass(frozen=True, kw_only=True)
class Prior:
    """The prior of P: the lens to which it ties P, and how firmly.

    Attributes:
        spread: expected asymmetry of the prior's lens (see
            :class:`~cubicfish.fit.decentred.DecentredFit`); 0 for a symmetric one.
        weight: weight of the pseudo-observations.
        central: whether the entrance pupil does not move.

    """

    spread: float
    weight: float
    central: bool = False

    def starts(
        self, reference: RadialReference, known: CameraFit | None, errors: FloatArray
    ) -> Iterator[tuple[CubicFit, Poses]]:
        """Lenses and poses from which to start: a known fit, the nearest cubic, and safer ones.

        A solution from the corners themselves is biased by outliers and may have a pole just
        outside them, where Levenberg–Marquardt then stays.

        Args:
            reference: the radial fit.
            known: the known fit, if there is one.
            errors: (N, 2) of the corners, as far as they are known, pixels.

        """
        if known is not None:
            yield self.apply(known.lens, reference, errors), known.poses
        near, camera = reference.cubic, reference.camera
        _, poses = decentred_lens(reference, self.spread)
        decentred = tie_to(reference, self.spread).near.lens
        yield self.apply(decentred, reference, errors), poses
        pixel = camera.project(near.rays)
        for pull in SAFER_PULLS:
            safer = linear_cubic(
                near.rays, pixel, camera, denominator_pull=pull, weights=near.weights
            )
            yield self.apply(safer, reference, errors), reference.poses

    def apply(self, lens: CubicFit, reference: RadialReference, errors: FloatArray) -> CubicFit:
        """The same P with this prior, for a reference.

        A prior that is left from an earlier fit is for other corners and another noise.

        Args:
            lens: the lens.
            reference: the radial fit.
            errors: (N, 2) of the corners, pixels.

        """
        pairs, old, new = reference.pairs, lens.tie, tie_to(reference, self.spread)
        rays = new.near.rays
        if old is None or old.near.rays is not rays:
            lens = replace(
                reference.cubic.lens.with_pixels_of(lens, rays), pupil_travel=lens.pupil_travel
            )
        lens = replace(lens, tie=replace(new, weight=self.weight))
        if self.central:
            return replace(lens, pupil_travel=0.0, travel_weight=_STILL)
        # What a unit of the pupil's travel counts as, among corners with these residuals.
        points = reference.poses.apply(pairs.image, pairs.world)
        distance = 1 / float(np.mean(1 / np.linalg.norm(points, axis=1)))
        weight = max(noise_px(errors), 1e-3) * np.sqrt(ALIKE) / (_TRAVEL_SPREAD * distance)
        return replace(lens, travel_weight=float(weight))


def decentred_lens(reference: RadialReference, spread: float) -> tuple[DecentredFit, Poses]:
    """The decentred lens nearest to a reference's corners, anchored there, and the poses with it.

    Args:
        reference: the radial fit.
        spread: the expected asymmetry, see :class:`DecentredFit`.

    """

    def find() -> tuple[DecentredFit, Poses]:
        poses = reference.poses
        lens = DecentredFit(
            values=np.append(reference.camera.parameters, np.zeros(5)),
            terms=reference.terms,
            noise_px=max(noise_px(reference.errors), 1e-3),
            spread=spread,
        )
        if spread:
            # A lens that is known under another spread is nearer.
            near = [reference.known(("decentred", other)) for other in SPREADS[1:]]
            for known_lens, known_poses in filter(None, near):
                lens, poses = replace(lens, values=known_lens.values), known_poses
            fit = adjust(
                lens,
                poses,
                reference.pairs,
                wide_px(reference.errors),
                relative_decrease=_DECENTRED_DECREASE,
                damping=WARM_DAMPING,
                trust_last=True,
            )
            lens, poses = fit.lens, fit.poses
        about = _CENTRE_SPREAD * float(lens.values[:2].mean())
        return replace(lens, anchor=lens.values[2:4], anchor_px=about), poses

    return reference.once(("decentred", spread), find)


def tie_to(reference: RadialReference, spread: float) -> Tie:
    """The pseudo-observations of weight 1 that tie P to the decentred lens, and P3Φ to its cubic's.

    Not to that of the cubic nearest to the radial lens: where a mirror is not centred on its camera
    that lens is off by pixels, and its P3Φ by its own size.

    Args:
        reference: the radial fit.
        spread: the expected asymmetry, see :class:`DecentredFit`.

    """

    def find() -> Tie:
        (lens, poses), near, pairs = (
            decentred_lens(reference, spread),
            reference.cubic,
            reference.pairs,
        )
        seen = lens.project(poses.apply(pairs.image, pairs.world))
        errors = (seen - pairs.pixel)[pairs.error_known]
        sigma = max(noise_px(errors[np.isfinite(errors).all(axis=1)]), 1e-3)
        # So that 16 independent relative changes of P3Φ by its spread count as one noise each.
        firm = float(sigma / _DENOMINATOR_SPREAD * np.sqrt(16 / len(near.rays)))
        if spread:
            cone = cone_angle(reference.camera, reference.covered, MARGIN_DEG)
            pixel, valid_deg = lens.project(near.rays), float(np.rad2deg(cone))
            near = nearest_decentred_cubic(near, pixel, firm, valid_deg)
        return Tie(near=near, lens=lens, weight=1.0, denominator_weight=firm)

    return reference.once(("rays", spread), find)


# From the most symmetric and the firmest prior on. An asymmetry of 0.01 is far more than any lens
# on sale has; at a weight of 0.01 P is practically free.
SPREADS = (0.0, 1e-4, 1e-3, 1e-2)
WEIGHTS = tuple(10.0 ** (1.5 - step / 2) for step in range(8))
FIRMEST = Prior(spread=SPREADS[0], weight=WEIGHTS[0])
RADIAL = Prior(spread=0.0, weight=100.0, central=True)
"""The prior that leaves P no choice but the cubic nearest to a radial lens."""
# The prior that is expected before any photo is used: most lenses on sale have less asymmetry than
# the largest that was found, and few corners need a firm prior.
EXPECTED = Prior(spread=1e-4, weight=WEIGHTS[2])
# What one Gauss-Newton step says of a prior so many steps of the two lists away is rough.
_FAR = 3
# Fits that only lead to a choice need not be exact to the last digit.
_SCAN_DECREASE = 1e-4
# A sum of squared errors, pixels², that is nothing but rounding.
_NO_ERROR = 1e-16
# Number of bootstrap samples: they give the probability of a prior to 0.02.
_DRAWS = 500

_PRIORS = [Prior(spread=spread, weight=weight) for spread in SPREADS for weight in WEIGHTS]


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


def _find_place(prior: Prior) -> tuple[int, int]:
    """Indices of the nearest entries of SPREADS and WEIGHTS."""
    weight = np.abs(np.log(WEIGHTS) - np.log(prior.weight)).argmin()
    return int(np.abs(np.array(SPREADS) - prior.spread).argmin()), int(weight)


def _predict_squares(
    start: CameraFit,
    reference: RadialReference,
    groups: Sequence[IntArray],
    priors: Sequence[Prior],
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
        grams.append(replace(start.lens, tie=tie_to(reference, spread)).pulls_under(weights))
    photos = LeaveOneOut(start, groups).residuals(np.concatenate(grams))
    squares = {photo: np.nansum(np.square(residual), axis=(0, 1)) for photo, residual in photos}
    return np.array([squares[photo] for photo in range(len(squares))]).T


def _choose_likeliest(
    priors: Sequence[Prior], squares: FloatArray
) -> tuple[Prior, dict[Prior, float]]:
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
