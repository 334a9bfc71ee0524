"""How far the camera itself may be off: corners' noise carried through the fit to pixels.

The question is mrcal's ("projection uncertainty"): how far would the pixel of a distant point move
if the same photos were taken again with other noise, and lens, target and poses fitted anew? The
point stays fixed in the world, so a turn that poses and lens share does not count.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from cubicfish_cli.angles import angle_from_axis
from cubicfish_cli.assess.uncertainty import summed
from cubicfish_cli.fitting.adjustment import Adjustment
from cubicfish_cli.fitting.cubic_fit import CubicResult
from cubicfish_cli.fitting.poses import cross_matrix
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.radial import project_jacobian
from cubicfish_cli.types import FloatArray

GRID = (13, 9)  # columns and rows over the photo
_STEP = 1e-3  # of a difference that stands for a derivative, radians
_FEW_RAYS = 11  # a radial lens and its turn have so many unknowns


@dataclass(frozen=True, kw_only=True, eq=False)
class Uncertainty:
    """Covariance of the shared unknowns and of the turn that all poses have in common.

    Attributes:
        result: the fit that this is of.
        shared: (K, K) covariance of lens and target parameters.
        turn_by_shared: (3, K) the photos' mean turn (radians, camera frame) by each of them.
        turn: (3, 3) covariance of the mean turn that does not come from them.
        noise_px: standard deviation of a corner's coordinate, pixels.

    """

    result: CubicResult
    shared: FloatArray
    turn_by_shared: FloatArray
    turn: FloatArray
    noise_px: float

    def _by_unknowns(self, rays: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels of distant points by the shared unknowns (N, 2, K) and by the turn (N, 2, 3)."""
        _, d_ray, d_lens = self.result.lens.far_jacobian(rays)
        by_turn = -d_ray @ cross_matrix(rays)
        by_shared = by_turn @ self.turn_by_shared
        by_shared[:, :, : d_lens.shape[2]] += d_lens
        return by_shared, by_turn

    def sigma_px(self, rays: FloatArray) -> FloatArray:
        """sqrt(var x + var y) of the pixels of distant points: (N, 3) -> (N,), pixels."""
        by_shared, by_turn = self._by_unknowns(rays)
        variance = np.zeros(len(rays))
        for by, spread in ((by_shared, self.shared), (by_turn, self.turn)):
            flat = by.reshape(2 * len(rays), -1)
            variance += np.sum((flat @ spread) * flat, axis=1).reshape(-1, 2).sum(axis=1)
        # Rounding may leave nothing of it where photos hardly say anything: that is not known.
        return np.sqrt(np.where(variance >= 0, variance, np.nan))

    def variance(self, rays: FloatArray, weights: FloatArray) -> FloatArray:
        """Variance (F,) of weighted sums of pixels, weights (F, 2N), of unit rays (N, 3)."""
        by_shared, by_turn = (
            weights @ part.reshape(2 * len(rays), -1) for part in self._by_unknowns(rays)
        )
        spread = by_shared @ self.shared @ by_shared.T + by_turn @ self.turn @ by_turn.T
        return np.diagonal(spread).copy()


@dataclass(frozen=True, kw_only=True, eq=False)
class Information:
    """What a fit's photos say of the shared unknowns: it adds up, photo by photo.

    Attributes:
        result: the fit.
        hessian: (K, K) of lens and target parameters, priors included and poses, corners and the
            lens that P is held to eliminated; for corners whose noise is one pixel.
        turn_by_shared: (3, K) the photos' turns by each of them, summed over photos.
        turn: (3, 3) covariance of the turns that does not come from them, likewise summed.
        photos: how many there are.
        noise_px: standard deviation of a corner's coordinate, pixels.

    """

    result: CubicResult
    hessian: FloatArray
    turn_by_shared: FloatArray
    turn: FloatArray
    photos: int
    noise_px: float

    def with_photo(self, points: FloatArray) -> Information:
        """The same with a photo more, of known corners of the target.

        The photo's own pose is unknown and eliminated. The target counts as known there, which is
        not quite right of a fit that refines it, by a few percent.

        Args:
            points: (N, 3) the corners in the camera frame, in the fit's unit; six or more numbers
                must fix the pose.

        """
        _, d_point, d_lens = self.result.lens.project_jacobian(points)
        by_lens = d_lens.reshape(-1, d_lens.shape[2])
        length = np.median(np.linalg.norm(points, axis=-1))  # so that shifts are like turns
        moved = np.concatenate([-d_point @ cross_matrix(points), length * d_point], axis=2)
        by_pose = moved.reshape(-1, 6)
        inverse = np.linalg.inv(by_pose.T @ by_pose)
        cross = by_lens.T @ by_pose
        lens = slice(0, by_lens.shape[1])
        hessian, turn_by_shared = self.hessian.copy(), self.turn_by_shared.copy()
        hessian[lens, lens] += by_lens.T @ by_lens - cross @ inverse @ cross.T
        turn_by_shared[:, lens] -= (inverse @ cross.T)[:3]
        return replace(
            self,
            hessian=hessian,
            turn_by_shared=turn_by_shared,
            turn=self.turn + inverse[:3, :3],
            photos=self.photos + 1,
        )

    def uncertainty(self) -> Uncertainty:
        """The covariance σ² H⁻¹."""
        scale = 1 / np.sqrt(np.maximum(np.diagonal(self.hessian), 1e-300))
        inverse = scale * scale[:, None] * np.linalg.inv(self.hessian * scale * scale[:, None])
        variance = self.noise_px**2
        return Uncertainty(
            result=self.result,
            shared=variance * inverse,
            turn_by_shared=self.turn_by_shared / self.photos,
            turn=variance * self.turn / self.photos**2,
            noise_px=self.noise_px,
        )


def corner_noise_px(fit: Adjustment[Any]) -> float:
    """Standard deviation of a corner's coordinate, as the residuals of a fit show it, pixels."""
    residual, normal = fit.residual, fit.normal
    unknowns = len(normal.shared) + 6 * len(normal.pose) + normal.corner.size // 3
    # Offsets are held by their pull and count for less than a whole unknown each.
    freedom = max(residual.size - unknowns, residual.size // 2)
    return float(np.sqrt(np.sum(residual**2) / freedom))


def information(result: CubicResult, *, noise_px: float | None = None) -> Information:
    """What the photos of a cubic fit say, from its normal equations at the optimum.

    Args:
        result: the fit.
        noise_px: standard deviation of a corner's coordinate; by default what the residuals show.

    """
    normal = result.fit.normal
    hessian = normal.reduced_shared()
    photos = len(normal.pose)
    if noise_px is None:
        noise_px = corner_noise_px(result.fit)
    pose_inverse = np.linalg.inv(normal.pose)
    cross = normal.shared_pose.reshape(len(hessian), photos, 6).transpose(1, 2, 0)
    return Information(
        result=result,
        hessian=hessian,
        turn_by_shared=-(pose_inverse @ cross)[:, :3].sum(axis=0),
        turn=pose_inverse[:, :3, :3].sum(axis=0),
        photos=photos,
        noise_px=noise_px,
    )


def camera_uncertainty(result: CubicResult) -> Uncertainty:
    """Covariance at the optimum of a cubic fit, from its normal equations."""
    return information(result).uncertainty()


def field_grid(
    camera: CubicCamera, blind: float = 0.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where uncertainty over the field is counted.

    Returns:
        x (C,) and y (R,) of a grid over the photo, and its rays (R, C, 3), NaN outside the valid
        field and within ``blind`` radians of the axis.

    """
    width, height = camera.image_size
    x = np.linspace(0, width - 1, GRID[0])
    y = np.linspace(0, height - 1, GRID[1])
    rays = camera.unproject(np.stack(np.meshgrid(x, y), axis=-1))
    return x, y, np.where((angle_from_axis(rays) >= blind)[..., None], rays, np.nan)


class Sigma(Protocol):
    """What tells how far a camera's pixels may be off."""

    @property
    def noise_px(self) -> float:
        """Standard deviation of a corner's coordinate, pixels."""

    def sigma_px(self, rays: FloatArray) -> FloatArray:
        """sqrt(var x + var y) of the pixels of distant points: (N, 3) -> (N,), pixels."""

    def variance(self, rays: FloatArray, weights: FloatArray) -> FloatArray:
        """Variance (F,) of weighted sums of pixels, weights (F, 2N), of unit rays (N, 3)."""


def _focal_sigma_px(uncertainty: Sigma) -> FloatArray:
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


def _centre_sigma_px(uncertainty: Sigma, radial: FloatArray, rays: FloatArray) -> FloatArray:
    """One standard deviation of the centre of symmetry: (2,) pixels.

    How the centre of the nearest radial lens, free to turn, moves with the pixels of the field.

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


def uncertainty_record(
    uncertainty: Sigma, camera: CubicCamera, blind: float = 0.0
) -> dict[str, Any]:
    """Uncertainty on a grid over the photo, plain data for camera.yaml and JSON.

    ``sigma_px`` holds a row for each of ``y`` with a number for each of ``x``, null outside the
    valid field and within ``blind`` radians of the axis. ``median_px``, ``p95_px`` and ``max_px``
    are of these numbers; ``focal_px`` and ``principal_point_px`` are one standard deviation each
    of x and y, on the axis and of the centre of symmetry.
    """
    x, y, rays = field_grid(camera, blind)
    seen = np.isfinite(rays[..., 0])
    sigma = np.full(seen.shape, np.nan)
    sigma[seen] = uncertainty.sigma_px(rays[seen])
    whole = summed(sigma[seen]) if seen.any() else None
    centre = np.full(2, np.nan)
    if seen.sum() > _FEW_RAYS:
        centre = _centre_sigma_px(uncertainty, camera.radial.parameters, rays[seen])
    return {
        "noise_px": uncertainty.noise_px,
        "median_px": whole.median_px if whole else None,
        "p95_px": whole.p95_px if whole else None,
        "max_px": float(np.max(sigma[seen])) if seen.any() else None,
        "focal_px": _focal_sigma_px(uncertainty).tolist(),
        "principal_point_px": [float(x) if np.isfinite(x) else None for x in centre],
        "x": x.tolist(),
        "y": y.tolist(),
        "sigma_px": [
            [round(float(value), 5) if np.isfinite(value) else None for value in row]
            for row in sigma
        ],
    }
