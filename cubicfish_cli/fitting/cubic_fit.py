"""Fitting the cubic camera and all poses jointly, from the radial reference.

P is held to the reference, bent as real lenses are, by a weak prior on a cone
(pseudo-observations): it keeps poles out where no corner is, and fixes the rotation that P could
otherwise absorb. How symmetric the lens is that holds P, and how firmly it does, are two unknowns
of each camera: :class:`Hold`, chosen in hold.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.adjustment import WARM_DAMPING, Adjustment, adjust
from cubicfish_cli.fitting.lenses import WEIGHT_BEYOND, CubicFit, RayPrior
from cubicfish_cli.fitting.photo_noise import ALIKE
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.radial_reference import MARGIN_DEG, RadialReference
from cubicfish_cli.fitting.robust import huber_px, noise_px, wide_px
from cubicfish_cli.fitting.world import World
from cubicfish_cli.lenses.cubic import Validity, check_validity
from cubicfish_cli.lenses.sphere import cone_rays
from cubicfish_cli.types import FloatArray

_PRIOR_RAYS = 300
# The prior's cone reaches this far beyond the farthest corner: past the valid cone.
_PRIOR_MARGIN_DEG = 10.0
# Beyond half a turn less this, a ray's azimuth says nothing.
_LARGEST_ANGLE_DEG = 175.0
# Near its fold the reference's profile is flat; the prior stays short of that.
_FOLD_SHARE = 0.98
# In normalised pixels: Kannala–Brandt lenses of 10° to 150° are then met within 0.02 px by cubics
# without a pole; ten times more costs up to 0.08 px, and none at all lets poles in.
_DENOMINATOR_PULL = 1e-4
# Each is safer and less exact than the one before: P3Φ nears a constant.
_SAFER_PULLS = (1e-2, 1.0, 100.0)
# Expected relative departure of P3Φ from that of the reference's cubic.
_DENOMINATOR_SPREAD = 0.1
# Expected travel of the entrance pupil, as a share of the corners' distance: millimetres at arm's
# length.
_TRAVEL_SPREAD = 0.02
# Pixels that hold it where it is, whatever corners say.
_STILL = 1e7
_STRONGEST = 1e4
NEAR_DECREASE = 1e-6
"""For fits that only lead to the next one."""
# Beyond it pixels move by less than a hundredth of what they are uncertain by.
_LAST_DECREASE = 1e-8


@dataclass(frozen=True, kw_only=True)
class Hold:
    """What P is held to, and how firmly.

    Attributes:
        spread: expected asymmetry of the lens that holds P (see
            :class:`~cubicfish_cli.fitting.asymmetric.BentFit`); 0 for a symmetric one.
        weight: weight of the pseudo-observations.
        central: whether the entrance pupil stands still.

    """

    spread: float
    weight: float
    central: bool = False


@dataclass(frozen=True, kw_only=True)
class Rival:
    """Another hold that may be the better one.

    Attributes:
        hold: the hold.
        likely: how likely it is the best of all, 0 to 1.

    """

    hold: Hold
    likely: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CubicResult:
    """The cubic lens at the optimum.

    Attributes:
        fit: the adjustment.
        hold: how P was held to the reference.
        max_angle_deg: half-angle of the cone over which P may be trusted.
        validity: the check for poles and folds over that cone.
        rivals: holds that other photos would speak for; none where none was sought.

    """

    fit: Adjustment[CubicFit]
    hold: Hold
    max_angle_deg: float
    validity: Validity
    rivals: tuple[Rival, ...] = ()

    @property
    def lens(self) -> CubicFit:
        """The fitted lens; its P is (3, 20) in pixels."""
        return self.fit.lens

    @property
    def poses(self) -> Poses:
        """camera_from_world of each photo."""
        return self.fit.poses

    @property
    def residual(self) -> FloatArray:
        """(N, 2) projection less pixel, pixels."""
        return self.fit.residual

    @property
    def errors(self) -> FloatArray:
        """(K, 2) of the pairs whose error the fit can tell."""
        return self.fit.errors


def fit_cubic(
    reference: RadialReference,
    hold: Hold,
    *,
    world: World | None = None,
    start: CubicResult | None = None,
    relative_decrease: float = _LAST_DECREASE,
) -> CubicResult:
    """Fit P and all poses (Eq. 10) from a reference's lens and poses.

    Args:
        reference: the radial fit to start from and to lean on.
        hold: how P is held to it.
        world: the target, where it is free; its points are those of the reference's pairs.
        start: a fit to the same photos from which to start, where there is one.
        relative_decrease: when to stop, as in :func:`~cubicfish_cli.fitting.adjustment.adjust`.

    Raises:
        FitError: no weight of the prior gives a camera without poles and folds.

    """
    max_angle_deg = float(np.rad2deg(_cone(reference, MARGIN_DEG)))
    lens, poses = _first(reference, hold, start, world, max_angle_deg)
    while True:
        fit = adjust(
            lens,
            poses,
            reference.pairs,
            huber_px=huber_px(start.errors) if start else wide_px(reference.errors),
            world=world,
            relative_decrease=max(relative_decrease, NEAR_DECREASE),
            damping=WARM_DAMPING,
            known=None if start is None else start.fit,
        )
        if relative_decrease < NEAR_DECREASE:  # to the bottom, the loss's scale settled
            fit = fit.again(
                reference.pairs,
                relative_decrease=relative_decrease,
                damping=WARM_DAMPING,
                limit=huber_px,
            )
        validity = check_validity(fit.lens.P, max_angle_deg)
        if validity.valid:
            return CubicResult(fit=fit, hold=hold, max_angle_deg=max_angle_deg, validity=validity)
        # A pole crept in: hold P closer to the reference, which has none.
        hold = replace(hold, weight=hold.weight * 10**0.5)
        lens, poses = _first(reference, hold, None, world, max_angle_deg)
        if hold.weight > _STRONGEST:
            raise FitError(
                f"the camera folds at {validity.valid_to_deg:.0f}° from its axis while "
                f"corners reach {np.rad2deg(reference.covered):.0f}°: check that corners near "
                "the rim are named rightly, or take photos that cover the field more evenly"
            )


def _cone(reference: RadialReference, margin_deg: float) -> float:
    """Half-angle of the cone that reaches so far beyond the corners, short of a fold, radians."""
    covered = reference.covered
    return min(
        covered + np.deg2rad(margin_deg),
        max(_FOLD_SHARE * reference.camera.max_angle, covered),
        np.deg2rad(_LARGEST_ANGLE_DEG),
    )


def _first(
    reference: RadialReference,
    hold: Hold,
    start: CubicResult | None,
    world: World | None,
    max_angle_deg: float,
) -> tuple[CubicFit, Poses]:
    """The first of the starts, from the most exact to the safest, without a pole in sight.

    A start with a pole among the corners or beside them, on the prior's cone, is no reason to
    give up: photos and radial lens are right all the same.
    """
    pairs = reference.pairs
    points = pairs.world if world is None else world.points
    lens, poses = None, reference.poses
    for number, (lens, poses) in enumerate(_starts(reference, hold, start)):
        with np.errstate(over="ignore"):
            pixel = lens.project(poses.apply(pairs.image, points))
        if not np.isfinite(pixel).all() or not np.isfinite(lens.prior()).all():
            continue
        # A pole between corners and rays shows in neither; a fit is known to have none.
        known = start is not None and number == 0
        if known or check_validity(lens.P, max_angle_deg).valid:
            return lens, poses
    assert lens is not None
    return lens, poses


def _starts(
    reference: RadialReference, hold: Hold, start: CubicResult | None
) -> Iterator[tuple[CubicFit, Poses]]:
    if start is not None:
        yield held(start, reference, hold), start.poses
    yield start_lens(reference, hold), reference.bent(hold.spread)[1]
    for pull in (_DENOMINATOR_PULL, *_SAFER_PULLS):
        yield start_lens(reference, hold, denominator_pull=pull, symmetric=True), reference.poses


def held(fit: CubicResult, reference: RadialReference, hold: Hold) -> CubicFit:
    """The P of a fit, held otherwise."""
    lens = fit.lens.held_to(reference.bent(hold.spread)[0], hold.weight)
    return _with_pupil(lens, reference, hold, fit.errors)


def start_lens(
    reference: RadialReference,
    hold: Hold,
    *,
    denominator_pull: float = _DENOMINATOR_PULL,
    symmetric: bool = False,
) -> CubicFit:
    """The cubic that agrees with the lens that holds it on the prior's cone (Eq. 8–9, reweighted).

    A linear solution from the corners themselves is drawn by outliers and may have a pole just
    outside them, where Levenberg–Marquardt then stays.

    Args:
        reference: the radial fit.
        hold: how P is held to it.
        denominator_pull: how firmly P3Φ is kept near a constant.
        symmetric: start at the reference itself instead of the bent lens.

    """
    camera = reference.camera
    nearest, covered = reference.reached
    rays = cone_rays(_cone(reference, _PRIOR_MARGIN_DEG), _PRIOR_RAYS)
    bent, _ = reference.bent(hold.spread)
    pixel = (reference.bent(0.0)[0] if symmetric else bent).project(rays)
    within = (rays[:, 2] >= np.cos(covered)) & (rays[:, 2] <= np.cos(nearest))
    weights = np.where(within, 1.0, WEIGHT_BEYOND)
    lens = CubicFit.linear(rays, pixel, camera, denominator_pull=denominator_pull, weights=weights)
    prior = RayPrior(
        rays=rays,
        lens=bent,
        within=within,
        weight=hold.weight,
        coefficients=lens.coefficients[2],
        denominator_weight=_denominator_weight(reference),
    )
    return _with_pupil(replace(lens, ray_prior=prior), reference, hold, reference.errors)


def _with_pupil(
    lens: CubicFit, reference: RadialReference, hold: Hold, residual: FloatArray
) -> CubicFit:
    """With what a unit of its pupil's travel counts as among corners with these residuals."""
    if hold.central:
        return replace(lens, travel=0.0, travel_weight=_STILL)
    pairs = reference.pairs
    points = reference.poses.apply(pairs.image, pairs.world)
    distance = 1 / float(np.mean(1 / np.linalg.norm(points, axis=1)))
    sigma = max(noise_px(residual), 1e-3)
    weight = sigma * np.sqrt(ALIKE) / (_TRAVEL_SPREAD * distance)
    return replace(lens, travel_weight=float(weight))


def _denominator_weight(reference: RadialReference) -> float:
    """So that 16 independent relative changes of P3Φ by its spread count one noise each."""
    sigma = max(noise_px(reference.errors), 1e-3)
    return sigma / _DENOMINATOR_SPREAD * np.sqrt(16 / _PRIOR_RAYS)
