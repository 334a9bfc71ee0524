"""Levenberg–Marquardt over a lens and the poses of all photos (Zhu & Yin 2010, Eq. 10).

The normal equations have an arrow's shape: the lens touches every photo, a pose only its own.
The poses are eliminated by the Schur complement, so the work grows linearly with the photos.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.poses import Poses, cross_matrix

FloatArray = npt.NDArray[np.float64]

_MAX_ITERATIONS = 100
_RELATIVE_DECREASE = 1e-10


class FitLens(Protocol):
    """A lens that least squares can adjust."""

    @property
    def parameters(self) -> FloatArray:
        """(K,) the free parameters; K may be 0."""

    def with_parameters(self, parameters: FloatArray) -> FitLens:
        """The same lens with other parameters."""

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Camera-frame points (N, 3) -> pixel (N, 2), d/d point (N, 2, 3), d/d param (N, 2, K)."""

    def project(self, points: FloatArray) -> FloatArray:
        """Camera-frame points (N, 3) -> pixel (N, 2), without derivatives."""

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """Pseudo-observations: residuals (M,) in pixels and d/d parameters (M, K)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Adjustment:
    """Where Levenberg–Marquardt stopped.

    Attributes:
        lens: the adjusted lens.
        poses: camera_from_world of every photo.
        residual: (N, 2) projection less pixel, unweighted, pixels.
        cost: robust cost at the end, prior included.
        iterations: how many steps were tried.
        hessian: (K, K) Gauss-Newton Hessian of the lens with the poses eliminated.

    """

    lens: FitLens
    poses: Poses
    residual: FloatArray
    cost: float
    iterations: int
    hessian: FloatArray


def huber_weight(distance: FloatArray, scale: float) -> FloatArray:
    """IRLS weight of the Huber loss: 1 within ``scale``, then falling as 1/distance."""
    return np.minimum(1.0, scale / np.maximum(distance, 1e-300))


def huber_cost(distance: FloatArray, scale: float) -> FloatArray:
    """Huber loss: d²/2 within ``scale``, linear beyond."""
    return np.where(distance <= scale, 0.5 * np.square(distance), scale * (distance - 0.5 * scale))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Normal:
    lens: FloatArray  # (K, K)
    cross: FloatArray  # (M, K, 6)
    pose: FloatArray  # (M, 6, 6)
    lens_gradient: FloatArray  # (K,)
    pose_gradient: FloatArray  # (M, 6)


def adjust(
    lens: FitLens,
    poses: Poses,
    pairs: Correspondences,
    *,
    huber_px: float,
    max_iterations: int = _MAX_ITERATIONS,
    relative_decrease: float = _RELATIVE_DECREASE,
) -> Adjustment:
    """Minimise the Huber loss of the reprojection error over lens and poses.

    Args:
        lens: the start; its prior is part of the cost.
        poses: the start, one for each of ``pairs.images``.
        pairs: 2D-3D pairs, sorted by photo.
        huber_px: distance in pixels from which a pair's pull stops growing.
        max_iterations: steps to try at most.
        relative_decrease: stop when a step lowers the cost by less than this share.

    Returns:
        The best lens and poses found. A step that does not lower the cost is never taken.

    Raises:
        FitError: the start itself sees a point at infinity.

    """
    damping = 1e-4
    cost, residual = _cost(lens, poses, pairs, huber_px)
    if not np.isfinite(cost):
        raise FitError(
            "the start of the fit sees corners at infinity: check that the corners are named "
            "rightly and that the camera belongs to these photos"
        )
    normal = _normal_equations(lens, poses, pairs, huber_px)
    iterations = 0
    while iterations < max_iterations:
        iterations += 1
        lens_step, pose_step = _solve(normal, damping)
        new_lens = lens.with_parameters(lens.parameters + lens_step)
        new_poses = poses.moved(pose_step)
        new_cost, new_residual = _cost(new_lens, new_poses, pairs, huber_px)
        if new_cost < cost:
            decrease = (cost - new_cost) / max(cost, 1e-300)
            lens, poses, cost, residual = new_lens, new_poses, new_cost, new_residual
            damping = max(damping / 10, 1e-12)
            normal = _normal_equations(lens, poses, pairs, huber_px)
            if decrease < relative_decrease:
                break
        else:
            damping *= 10
            if damping > 1e8:
                break
    inverse = np.linalg.pinv(normal.pose, hermitian=True)
    reduced = normal.lens - np.einsum("mik,mkl,mjl->ij", normal.cross, inverse, normal.cross)
    return Adjustment(
        lens=lens,
        poses=poses,
        residual=residual,
        cost=cost,
        iterations=iterations,
        hessian=reduced,
    )


def _cost(
    lens: FitLens, poses: Poses, pairs: Correspondences, huber_px: float
) -> tuple[float, FloatArray]:
    residual = lens.project(poses.apply(pairs.image, pairs.world)) - pairs.pixel
    prior, _ = lens.prior()
    distance = np.hypot(residual[:, 0], residual[:, 1])
    with np.errstate(over="ignore"):
        cost = float(
            np.sum(pairs.weight * huber_cost(distance, huber_px)) + 0.5 * np.sum(prior * prior)
        )
    return (cost if np.isfinite(cost) else np.inf), residual


def _normal_equations(
    lens: FitLens, poses: Poses, pairs: Correspondences, huber_px: float
) -> _Normal:
    rotated = (poses.rotation[pairs.image] @ pairs.world[:, :, None])[:, :, 0]
    points = rotated + poses.translation[pairs.image]
    pixel, d_point, d_lens = lens.project_jacobian(points)
    residual = pixel - pairs.pixel
    distance = np.hypot(residual[:, 0], residual[:, 1])
    root = np.sqrt(pairs.weight * huber_weight(distance, huber_px))[:, None]
    count = d_lens.shape[2]
    jacobian = np.empty((len(points), 2, count + 7))
    jacobian[:, :, :count] = d_lens
    jacobian[:, :, count : count + 3] = -d_point @ cross_matrix(rotated)
    jacobian[:, :, count + 3 : count + 6] = d_point
    jacobian[:, :, count + 6] = residual
    jacobian *= root[:, :, None]

    # One Gram matrix a photo holds every block, the gradient in its last column.
    photos = len(poses)
    gram = np.zeros((photos, count + 7, count + 7))
    bounds = np.searchsorted(pairs.image, np.arange(photos + 1))
    for photo in range(photos):
        rows = jacobian[bounds[photo] : bounds[photo + 1]].reshape(-1, count + 7)
        gram[photo] = rows.T @ rows
    prior, d_prior = lens.prior()
    total = gram.sum(axis=0)
    return _Normal(
        lens=total[:count, :count] + d_prior.T @ d_prior,
        cross=gram[:, :count, count : count + 6],
        pose=gram[:, count : count + 6, count : count + 6],
        lens_gradient=total[:count, -1] + d_prior.T @ prior,
        pose_gradient=gram[:, count : count + 6, -1],
    )


def _solve(normal: _Normal, damping: float) -> tuple[FloatArray, FloatArray]:
    """One damped Gauss-Newton step, by the Schur complement over the poses."""
    pose = _damped(normal.pose, damping)
    solved = np.linalg.solve(
        pose, np.concatenate([np.swapaxes(normal.cross, 1, 2), normal.pose_gradient[..., None]], 2)
    )
    reduced = _damped(normal.lens, damping) - np.einsum(
        "mkp,mpl->kl", normal.cross, solved[:, :, :-1]
    )
    gradient = normal.lens_gradient - np.einsum("mkp,mp->k", normal.cross, solved[:, :, -1])
    lens_step = -np.linalg.lstsq(reduced, gradient, rcond=None)[0] if len(gradient) else gradient
    pose_step = -solved[:, :, -1] - solved[:, :, :-1] @ lens_step
    return lens_step, pose_step


def _damped(matrix: FloatArray, damping: float) -> FloatArray:
    """Marquardt's scaling: each unknown is damped in its own unit."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    # A direction that no observation touches still needs a pivot.
    floor = 1e-12 * np.max(diagonal, axis=-1, keepdims=True, initial=1e-300)
    damped = matrix.copy()
    index = np.arange(matrix.shape[-1])
    damped[..., index, index] += damping * np.maximum(diagonal, floor) + floor * 1e-3
    return damped
