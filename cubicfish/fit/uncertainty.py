"""How uncertain the camera is: the corners' noise, propagated through the fit to pixels.

The question is mrcal's ("projection uncertainty"): how far would the pixel of a distant point move
if the same photos were taken again with other noise, and lens, target and poses fitted anew? The
point stays fixed in the world, so a turn that poses and lens share does not count.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from cubicfish.angles import angle_from_axis
from cubicfish.fit.cubic_fit import CameraFit
from cubicfish.fit.lenses import CubicFit
from cubicfish.fit.radial_reference import RadialReference
from cubicfish.judge.uncertainty import UncertaintyGrid, summed
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.radial import RadialCamera, project_jacobian
from cubicfish.solve.adjustment import Adjustment
from cubicfish.solve.fit_lens import FreeLens
from cubicfish.solve.poses import cross_matrix
from cubicfish.types import FloatArray

if TYPE_CHECKING:
    from cubicfish.fit.photo_spread import PhotoSpread

GRID = (13, 9)  # columns and rows over the photo
_STEP = 1e-3  # step of a difference that stands for a derivative, radians
# More corners hardly change the turn that is taken out.
_MOST_CORNERS = 5000
_FEW_RAYS = 11  # a radial lens and its turn have so many unknowns


@dataclass(frozen=True, kw_only=True, eq=False)
class FarSlopes:
    """Derivatives of the pixels of N distant points, computed once for all that asks for them.

    Attributes:
        by_turn: (2N, 3) by the camera's turn.
        by_lens: (2N, K) by the lens's parameters.

    """

    by_turn: FloatArray
    by_lens: FloatArray

    @classmethod
    def of(cls, lens: CubicFit | FreeLens[RadialCamera], points: FloatArray) -> FarSlopes:
        """Differentiate a lens at points (N, 3) in its frame."""
        far = lens.far_jacobian if isinstance(lens, CubicFit) else lens.pixel_and_slopes
        _, by_point, by_lens = far(points)
        turned = (-by_point @ cross_matrix(points)).reshape(-1, 3)
        return cls(by_turn=turned, by_lens=by_lens.reshape(len(turned), -1))


@dataclass(frozen=True, kw_only=True, eq=False)
class Gauge:
    """A lens, and the turn that it shares with poses, which is taken out.

    A turn of the lens and the opposite turn of all poses leave every pixel where it is. So lenses
    are turned to agree as well as they can at corners. The rest depends neither on the frame of the
    target nor on how well single poses are known: no corner's weight counts. Several sets of
    corners may stand along axes before the others.

    Attributes:
        lens: the lens.
        by_turn: (3, 3) the normal equations of a turn, summed over corners.
        by_both: (3, K) their right side for each of the lens's parameters.

    """

    lens: CubicFit | FreeLens[RadialCamera]
    by_turn: FloatArray
    by_both: FloatArray

    @classmethod
    def over(
        cls,
        lens: CubicFit | FreeLens[RadialCamera],
        points: FloatArray | FarSlopes,
        times: float = 1.0,
    ) -> Gauge:
        """Take the turn out over corners (N, 3), camera frame; each counts ``times`` times."""
        slopes = points if isinstance(points, FarSlopes) else FarSlopes.of(lens, points)
        turned = times * slopes.by_turn.T
        return cls(lens=lens, by_turn=turned @ slopes.by_turn, by_both=turned @ slopes.by_lens)

    def __add__(self, other: Gauge) -> Gauge:
        """Take the turn out over the corners of both."""
        return replace(
            self, by_turn=self.by_turn + other.by_turn, by_both=self.by_both + other.by_both
        )

    def by_lens(self, rays: FloatArray | FarSlopes) -> FloatArray:
        """(2N, K) derivatives of distant points' pixels (N, 3) by the lens, without the turn."""
        slopes = rays if isinstance(rays, FarSlopes) else FarSlopes.of(self.lens, rays)
        return np.asarray(slopes.by_lens - slopes.by_turn @ self.turn)

    @cached_property
    def turn(self) -> FloatArray:
        """(3, K) derivatives of the turn by the lens's parameters."""
        return np.asarray(np.linalg.pinv(self.by_turn, hermitian=True) @ self.by_both)


@dataclass(frozen=True, kw_only=True, eq=False)
class Uncertainty:
    """Covariance of the lens, without the turn that poses and lens share.

    Attributes:
        gauge: what takes the turn out.
        lens: (K, K) covariance of the lens's parameters.
        noise_px: standard deviation of a corner's coordinate, pixels.

    """

    gauge: Gauge
    lens: FloatArray
    noise_px: float

    def sigma_px(self, rays: FloatArray | FarSlopes) -> FloatArray:
        """sqrt(var x + var y) of the pixels of distant points: (N, 3) -> (..., N), pixels."""
        by_lens = self.gauge.by_lens(rays)
        variance = np.sum((by_lens @ self.lens) * by_lens, axis=-1)
        variance = variance[..., ::2] + variance[..., 1::2]
        # Rounding may leave nothing of it where photos hardly say anything: then it is not known.
        return np.sqrt(np.where(variance >= 0, variance, np.nan))

    def variance(self, rays: FloatArray, weights: FloatArray) -> FloatArray:
        """Variance (F,) of weighted sums of pixels, weights (F, 2N), of unit rays (N, 3)."""
        by_lens = weights @ self.gauge.by_lens(rays)
        return np.diagonal(by_lens @ self.lens @ by_lens.T).copy()


def covariance(gauge: Gauge, hessian: FloatArray, noise_px: float) -> Uncertainty:
    """σ² H⁻¹ of a lens, whose parameters stand first among those of H (..., K, K)."""
    diagonal = np.diagonal(hessian, axis1=-2, axis2=-1)
    scale = 1 / np.sqrt(np.maximum(diagonal, 1e-300))[..., None]
    square = scale * np.swapaxes(scale, -1, -2)
    inverse = square * np.linalg.inv(hessian * square)
    count = len(gauge.lens.parameters)
    lens = noise_px**2 * inverse[..., :count, :count]
    return Uncertainty(gauge=gauge, lens=lens, noise_px=noise_px)


def corner_noise_px(fit: Adjustment[Any]) -> float:
    """Standard deviation per coordinate of a corner of weight 1, as residuals show it, pixels.

    Corners count by their weights, and as far as the loss lets them pull: a noisy photo and a few
    slips hardly influence the fit, and are no measure of its uncertainty.
    """
    own = fit.pairs.error_known
    length = np.minimum(np.hypot(fit.errors[:, 0], fit.errors[:, 1]), fit.huber_px)
    freedom = max(2 * len(length) - _count_unknowns(fit), 1.0)
    return float(np.sqrt(np.sum(fit.pairs.weight[own] * np.square(length)) / freedom))


def _count_unknowns(fit: Adjustment[Any]) -> float:
    """Number of unknowns that residuals determine: one with a firm prior counts for less.

    It is the trace of what data say over what data and priors say (the degrees of freedom of ridge
    regression); for corners' offsets as if all else were known, which is a little too many.
    """
    normal, world, own = fit.normal, fit.world, fit.pairs.error_known
    hessian, lens = normal.reduced_shared(), len(fit.lens.parameters)
    prior = np.zeros_like(hessian)
    prior[:lens, :lens] = fit.lens.pulls()[:-1, :-1]
    prior[lens:, lens:] = world.pulls()[:-1, :-1]
    scale = 1 / np.sqrt(np.maximum(np.diagonal(hessian), 1e-300))
    square = scale * scale[:, None]
    inverse = np.linalg.pinv(hessian * square, hermitian=True)
    shared = len(hessian) - np.sum(inverse * prior * square)
    poses = min(len(np.unique(fit.pairs.image[own])), len(normal.pose))
    corner = normal.corner[np.unique(world.corner[own])] if len(world.corner) else normal.corner[:0]
    by_prior = np.trace(np.linalg.inv(corner), axis1=1, axis2=2).sum() * world.offset_weight**2
    return float(shared + 6 * poses + 3 * len(corner) - by_prior)


def common_gauge(fit: CameraFit) -> Gauge:
    """What takes out the turn that a fit's lens shares with poses, over the fit's corners."""
    pairs = fit.reference.pairs
    count = len(pairs.image)
    some = np.arange(count)
    if count > _MOST_CORNERS:  # at random: every n-th could be one column of a board
        some = np.random.default_rng(0).choice(count, _MOST_CORNERS, replace=False)
    points = fit.poses.apply(pairs.image[some], pairs.world[some])
    return Gauge.over(fit.lens, points, count / len(some))


def radial_uncertainty(reference: RadialReference) -> Uncertainty:
    """Covariance of a radial lens, for a camera that is nothing but this lens."""
    points = reference.poses.apply(reference.pairs.image, reference.pairs.world)
    gauge, hessian = Gauge.over(reference.lens, points), reference.normal.reduced_shared()
    return covariance(gauge, hessian, corner_noise_px(reference))


def camera_uncertainty(fit: CameraFit) -> Uncertainty:
    """Covariance of a fit's lens, from its normal equations at the optimum."""
    fit = unanchored(fit)
    return covariance(common_gauge(fit), fit.normal.reduced_shared(), corner_noise_px(fit))


def unanchored(fit: CameraFit) -> CameraFit:
    """The fit, which stays where it is, with equations in which no anchor counts as knowledge.

    The prior's lens has its principal point near where the radial reference has it. These very
    corners put it there, and others would put it elsewhere: on a narrow lens by far more than the
    anchor lets it move.
    """
    tie = fit.lens.tie
    assert tie is not None
    lens = replace(fit.lens, tie=replace(tie, lens=replace(tie.lens, anchor_px=np.inf)))
    change = (lens.pulls() - fit.lens.pulls())[:-1, :-1]
    shared = fit.normal.shared.copy()
    shared[: len(change), : len(change)] += change
    return replace(fit, lens=lens, normal=replace(fit.normal, shared=shared))


def field_grid(
    camera: CubicCamera, blind: float = 0.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The grid on which uncertainty over the field is counted.

    Returns:
        x (C,) and y (R,) of a grid over the photo, and its rays (R, C, 3), NaN outside the valid
        field and within ``blind`` radians of the axis.

    """
    width, height = camera.image_size
    x = np.linspace(0, width - 1, GRID[0])
    y = np.linspace(0, height - 1, GRID[1])
    rays = camera.unproject(np.stack(np.meshgrid(x, y), axis=-1))
    return x, y, np.where((angle_from_axis(rays) >= blind)[..., None], rays, np.nan)


def _measure_focal_sigma_px(uncertainty: Uncertainty | PhotoSpread) -> FloatArray:
    """One standard deviation of the focal lengths on the axis: (2,) pixels per radian."""
    variance = []
    for k in range(2):
        side = _STEP * np.eye(3)[k]
        rays = np.stack([side, -side]) + np.array([0.0, 0.0, 1.0])
        weights = np.zeros((1, 2, 2))
        weights[0, :, k] = np.array([1, -1]) / (2 * np.arctan(_STEP))
        unit = rays / np.linalg.norm(rays, axis=1)[:, None]
        variance.append(uncertainty.variance(unit, weights.reshape(1, 4))[0])
    return np.sqrt(variance)


def _measure_centre_sigma_px(
    uncertainty: Uncertainty | PhotoSpread, radial: FloatArray, rays: FloatArray
) -> FloatArray:
    """One standard deviation of the centre of symmetry: (2,) pixels.

    It shows how the centre of the nearest radial lens, free to turn, moves with the pixels of the
    field.

    Args:
        uncertainty: of the camera.
        radial: (8,) parameters of the reference.
        rays: (N, 3) unit rays over the field.

    """
    _, d_ray, d_radial = project_jacobian(radial, rays)
    unknowns = np.concatenate([d_radial, -d_ray @ cross_matrix(rays)], axis=2)
    scale = np.linalg.norm(unknowns, axis=(0, 1)) + 1e-300
    centre = (np.linalg.pinv((unknowns / scale).reshape(2 * len(rays), -1)).T / scale).T[2:4]
    return np.sqrt(uncertainty.variance(rays, centre))


def uncertainty_grid(
    uncertainty: Uncertainty | PhotoSpread, camera: CubicCamera, blind: float = 0.0
) -> UncertaintyGrid:
    """Uncertainty on a grid over the photo, for the fit's record.

    It is NaN outside the valid field and within ``blind`` radians of the axis.
    """
    x, y, rays = field_grid(camera, blind)
    seen = np.isfinite(rays[..., 0])
    sigma = np.full(seen.shape, np.nan)
    sigma[seen] = uncertainty.sigma_px(rays[seen])
    whole = summed(sigma[seen]) if seen.any() else None
    centre = np.full(2, np.nan)
    if seen.sum() > _FEW_RAYS:
        centre = _measure_centre_sigma_px(uncertainty, camera.radial.parameters, rays[seen])
    return UncertaintyGrid(
        noise_px=uncertainty.noise_px,
        median_px=whole.median_px if whole else np.nan,
        p95_px=whole.p95_px if whole else np.nan,
        max_px=float(np.max(sigma[seen])) if seen.any() else np.nan,
        focal_px=tuple(_measure_focal_sigma_px(uncertainty).tolist()),
        principal_point_px=tuple(centre.tolist()),
        x=tuple(x.tolist()),
        y=tuple(y.tolist()),
        sigma_px=tuple(tuple(round(value, 5) for value in row) for row in sigma.tolist()),
    )
