"""Fitting the cubic camera and all poses jointly, from the radial companion.

P is held to the companion, bent as real lenses are, by a weak prior on a cone
(pseudo-observations): it keeps poles out where no corner is, and fixes the rotation that P could
otherwise absorb. How weak follows the
data, by the evidence (marginal likelihood) of each weight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.adjustment import Adjustment, adjust
from cubicfish_cli.fitting.companion import MARGIN_DEG, Companion
from cubicfish_cli.fitting.lenses import CubicFit, RayPrior
from cubicfish_cli.fitting.linear import linear_coefficients
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.robust import huber_px, noise_px
from cubicfish_cli.fitting.world import World
from cubicfish_cli.model.lift import lift, sphere_basis
from cubicfish_cli.model.radial import RadialCamera
from cubicfish_cli.model.soundness import Soundness, check_soundness, cone_rays

FloatArray = npt.NDArray[np.float64]

_PRIOR_RAYS = 300
# The prior's cone reaches this far beyond the farthest corner: past the valid cone.
_PRIOR_MARGIN_DEG = 10.0
# Beyond half a turn less this, a ray's azimuth says nothing.
_LARGEST_ANGLE_DEG = 175.0
# Near its fold the companion's profile is flat; the prior stays short of that.
_FOLD_SHARE = 0.98
_WEIGHTS = tuple(10.0 ** (1 - step / 2) for step in range(9))
# Neighbouring corners share the paper's bend and the detector's bias, so N corners say less
# than N independent ones: the evidence counts each as a quarter.
_EVIDENCE_SHARE = 0.25
# In normalised pixels: Kannala–Brandt lenses of 10° to 150° are then met within 0.02 px by cubics
# without a pole; ten times more costs up to 0.08 px, and none at all lets poles in.
_DENOMINATOR_PULL = 1e-4
# Expected relative departure of P3Φ from that of the companion's cubic.
_DENOMINATOR_SPREAD = 0.1
_SCAN_ITERATIONS = 30
# The bottom of the evidence over weights is flat: it need not be known to the last digit.
_SCAN_DECREASE = 1e-4
_STRONGEST = 1e4
# For fits that only lead to the next one.
_ROUGH_DECREASE = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class CubicResult:
    """The cubic lens at the optimum.

    Attributes:
        lens: the fitted lens; ``lens.P`` is (3, 20) in pixels.
        fit: the whole adjustment.
        poses: camera_from_world of each photo.
        residual: (N, 2) projection less pixel, pixels.
        prior_weight: weight of the pseudo-observations.
        max_angle_deg: half-angle of the cone over which P may be trusted.
        soundness: the check for poles and folds over that cone.

    """

    lens: CubicFit
    fit: Adjustment
    poses: Poses
    residual: FloatArray
    prior_weight: float
    max_angle_deg: float
    soundness: Soundness


def fit_cubic(
    companion: Companion,
    *,
    weight: float | None = None,
    world: World | None = None,
    relative_decrease: float = 1e-10,
) -> CubicResult:
    """Fit P and all poses (Eq. 10) from a companion's lens and poses.

    Args:
        companion: the radial fit to start from and to lean on.
        weight: weight of the prior; by default the one with the best evidence.
        world: the object, where it is free; its points are those of the companion's pairs.
        relative_decrease: when to stop, as in :func:`~cubicfish_cli.fitting.adjustment.adjust`.

    Raises:
        FitError: no weight of the prior gives a camera without poles and folds.

    """
    pairs = companion.pairs
    max_angle_deg = float(np.rad2deg(_valid_angle(companion)))
    first = start = _start_lens(companion)
    if weight is None:
        weight, start, poses = _best_weight(start, companion)
    else:
        poses = companion.bent[1]
    while True:
        lens = _with_weight(start, weight)
        fit = adjust(
            lens,
            poses,
            pairs,
            huber_px=huber_px(companion.residual),
            world=world,
            relative_decrease=max(relative_decrease, _ROUGH_DECREASE),
        )
        if relative_decrease < _ROUGH_DECREASE:  # to the bottom, the loss's scale settled
            fit = adjust(
                fit.lens,
                fit.poses,
                pairs,
                huber_px=huber_px(fit.residual),
                world=fit.world,
                relative_decrease=relative_decrease,
            )
        result = _result(fit, weight, max_angle_deg)
        if result.soundness.sound:
            return result
        # A pole crept in: hold P closer to the companion, which has none.
        weight *= 10**0.5
        start, poses = first, companion.bent[1]
        if weight > _STRONGEST:
            raise FitError(
                f"the camera folds at {result.soundness.sound_to_deg:.0f}° from its axis while "
                f"corners reach {np.rad2deg(companion.covered):.0f}°: check that corners near "
                "the rim are named rightly, or take photos that cover the field more evenly"
            )


def _result(fit: Adjustment, weight: float, max_angle_deg: float) -> CubicResult:
    lens = _cubic(fit)
    return CubicResult(
        lens=lens,
        fit=fit,
        poses=fit.poses,
        residual=fit.residual,
        prior_weight=weight,
        max_angle_deg=max_angle_deg,
        soundness=check_soundness(lens.P, max_angle_deg),
    )


def _cubic(fit: Adjustment) -> CubicFit:
    if not isinstance(fit.lens, CubicFit):
        raise TypeError("the adjustment must be of a cubic lens")
    return fit.lens


def _valid_angle(companion: Companion) -> float:
    """Half-angle of the cone over which P is to be trusted, radians."""
    covered = companion.covered
    return min(
        covered + np.deg2rad(MARGIN_DEG),
        max(_FOLD_SHARE * companion.camera.max_angle, covered),
        np.deg2rad(_LARGEST_ANGLE_DEG),
    )


def prior_cone(camera: RadialCamera, covered: float) -> float:
    """Half-angle of the prior's cone, radians."""
    return min(
        covered + np.deg2rad(_PRIOR_MARGIN_DEG),
        max(_FOLD_SHARE * camera.max_angle, covered),
        np.deg2rad(_LARGEST_ANGLE_DEG),
    )


def _start_lens(companion: Companion) -> CubicFit:
    """The cubic that agrees with the bent companion on the prior's cone (Eq. 8–9, reweighted).

    A linear solution from the corners themselves is drawn by outliers and may have a pole just
    outside them, where Levenberg–Marquardt then stays.
    """
    camera = companion.camera
    rays = cone_rays(prior_cone(camera, companion.covered), _PRIOR_RAYS)
    bent, _ = companion.bent
    pixel = bent.project(rays)
    centre = np.array([camera.cx, camera.cy])
    scale = (camera.fx + camera.fy) / 2
    coefficients = linear_coefficients(
        rays, (pixel - centre) / scale, denominator_pull=_DENOMINATOR_PULL
    )
    values = lift(rays) @ sphere_basis()
    mean_values = values.mean(axis=0)
    _, _, right = np.linalg.svd(mean_values[None, :])
    return CubicFit(
        coefficients=coefficients,
        denominator_basis=right[1:].T,
        centre=centre,
        scale=scale,
        ray_prior=RayPrior(
            rays=rays,
            lens=bent,
            weight=1.0,
            denominator=values @ coefficients[2],
            denominator_weight=_denominator_weight(companion),
        ),
    )


def _denominator_weight(companion: Companion) -> float:
    """So that 16 independent relative changes of P3Φ by its spread count one noise each."""
    sigma = max(noise_px(companion.residual), 1e-3)
    return sigma / _DENOMINATOR_SPREAD * np.sqrt(16 / _PRIOR_RAYS)


def _with_weight(lens: CubicFit, weight: float) -> CubicFit:
    return replace(lens, ray_prior=replace(lens.ray_prior, weight=weight))


def _best_weight(start: CubicFit, companion: Companion) -> tuple[float, CubicFit, Poses]:
    """The weight with the best evidence, from strong to weak, each fit starting at the last.

    Returns:
        The weight and the lens and poses of the nearest fit that was tried.

    """
    lens, poses = start, companion.bent[1]
    tried: list[tuple[float, float, CubicFit, Poses]] = []
    limit = huber_px(companion.residual)
    for weight in _WEIGHTS:
        fit = adjust(
            _with_weight(lens, weight),
            poses,
            companion.pairs,
            huber_px=limit,
            max_iterations=_SCAN_ITERATIONS,
            relative_decrease=_SCAN_DECREASE,
        )
        lens, poses = _cubic(fit), fit.poses
        tried.append((_negative_log_evidence(fit, companion.pairs), weight, lens, poses))
        if len(tried) > 2 and tried[-1][0] > tried[-2][0] > tried[-3][0]:
            break
    best = min(range(len(tried)), key=lambda index: tried[index][0])
    # Two digits of it say all there is to say, and are the same for the same corners in other
    # units or in another order.
    weight = float(f"{_between(tried, best):.1e}")
    return weight, tried[best][2], tried[best][3]


def _between(tried: list[tuple[float, float, CubicFit, Poses]], best: int) -> float:
    """The bottom of the parabola through the best weight and its neighbours, in log weight."""
    if not 0 < best < len(tried) - 1:
        return tried[best][1]
    left, middle, right = (tried[best + step][0] for step in (-1, 0, 1))
    curvature = left - 2 * middle + right
    if curvature <= 0:
        return tried[best][1]
    step = np.clip(0.5 * (left - right) / curvature, -0.5, 0.5)
    return float(tried[best][1] * (tried[best + 1][1] / tried[best][1]) ** step)


def _negative_log_evidence(fit: Adjustment, pairs: Correspondences) -> float:
    """Laplace's approximation to the marginal likelihood of a prior weight, noise profiled out.

    MacKay (1992), "Bayesian interpolation", with the robust cost in place of the square.
    """
    freedom = _EVIDENCE_SHARE * max(2 * len(pairs.pixel) - 6 * len(pairs.images), 1)
    _, posterior = np.linalg.slogdet(fit.normal.reduced_shared())
    prior = _cubic(fit).prior_log_determinant()
    return float(0.5 * (freedom * np.log(max(fit.cost, 1e-300)) + posterior - prior))
