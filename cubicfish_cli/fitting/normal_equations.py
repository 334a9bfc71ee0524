"""Normal equations in the arrow's shape of calibration, and their damped solution.

Shared unknowns (the lens, the boards' shapes) touch every photo, a pose only its own, a corner's
offset only the photos that see it. The larger of the two families of small blocks is eliminated
by the Schur complement, so the work grows linearly with the photos.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from cubicfish_cli.fitting.world import World

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalEquations:
    """Blocks of the Gauss-Newton Hessian and of the gradient.

    K shared unknowns, M photos, Q free corners (0 where the corners stay as they are).

    Attributes:
        shared: (K, K), priors included.
        prior: (K, K), the priors' part of it.
        pose: (M, 6, 6).
        shared_pose: (K, 6M).
        shared_gradient: (K,).
        pose_gradient: (M, 6).
        corner: (Q, 3, 3), the pull to the drawn place included.
        shared_corner: (K, 3Q).
        pose_corner: (6M, 3Q).
        corner_gradient: (Q, 3).

    """

    shared: FloatArray
    prior: FloatArray
    pose: FloatArray
    shared_pose: FloatArray
    shared_gradient: FloatArray
    pose_gradient: FloatArray
    corner: FloatArray
    shared_corner: FloatArray
    pose_corner: FloatArray
    corner_gradient: FloatArray

    def solve(self, damping: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """One damped Gauss-Newton step: (K,), (M, 6) and (Q, 3)."""
        shared, pose, corner = (_damped(x, damping) for x in (self.shared, self.pose, self.corner))
        count = len(shared)
        kept = _Kept.of(self, shared, pose, corner)
        reduced, gradient, solved = kept.reduced()
        step = -_solve_scaled(reduced, gradient)
        other = -solved[..., -1] - solved[..., :-1] @ step
        first, second = step[:count], step[count:]
        if not len(corner):
            return first, other, self.corner_gradient
        if kept.keeps_poses:
            return first, second.reshape(-1, 6), other
        return first, other, second.reshape(-1, 3)

    def reduced_shared(self) -> FloatArray:
        """(K, K): the shared unknowns' Hessian with poses and corners eliminated, undamped."""
        floor = 1e-14
        shared = self.shared
        pose, corner = _damped(self.pose, floor), _damped(self.corner, floor)
        reduced, _, _ = _Kept.of(self, shared, pose, corner).reduced()
        count = len(shared)
        rest = reduced[count:, count:]
        if not len(rest):
            return reduced
        cross = reduced[count:, :count]
        return reduced[:count, :count] - cross.T @ np.linalg.solve(rest, cross)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Kept:
    """The system split into what is kept dense and the blocks that are eliminated."""

    dense: FloatArray
    cross: FloatArray
    blocks: FloatArray
    gradient: FloatArray
    block_gradient: FloatArray
    keeps_poses: bool

    @classmethod
    def of(
        cls, normal: NormalEquations, shared: FloatArray, pose: FloatArray, corner: FloatArray
    ) -> _Kept:
        if not len(corner):
            return cls(
                dense=shared,
                cross=normal.shared_pose,
                blocks=pose,
                gradient=normal.shared_gradient,
                block_gradient=normal.pose_gradient,
                keeps_poses=False,
            )
        if pose.size // 6 <= corner.size // 3:
            return cls(
                dense=_bordered(shared, normal.shared_pose, pose),
                cross=np.vstack([normal.shared_corner, normal.pose_corner]),
                blocks=corner,
                gradient=np.concatenate([normal.shared_gradient, normal.pose_gradient.ravel()]),
                block_gradient=normal.corner_gradient,
                keeps_poses=True,
            )
        return cls(
            dense=_bordered(shared, normal.shared_corner, corner),
            cross=np.vstack([normal.shared_pose, normal.pose_corner.T]),
            blocks=pose,
            gradient=np.concatenate([normal.shared_gradient, normal.corner_gradient.ravel()]),
            block_gradient=normal.pose_gradient,
            keeps_poses=False,
        )

    def reduced(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The Schur complement: (D, D), its gradient (D,), and blocks⁻¹ [cross | gradient]."""
        count, size = self.blocks.shape[:2]
        cross = self.cross.reshape(len(self.cross), count, size).transpose(1, 2, 0)
        right = np.concatenate([cross, self.block_gradient[:, :, None]], axis=2)
        solved = np.linalg.solve(self.blocks, right)
        product = self.cross @ solved.reshape(count * size, -1)
        return self.dense - product[:, :-1], self.gradient - product[:, -1], solved


def _bordered(shared: FloatArray, cross: FloatArray, blocks: FloatArray) -> FloatArray:
    """Dense (K + nb, K + nb) of the shared unknowns and n diagonal blocks of size b."""
    first = len(shared)
    count, size = blocks.shape[:2]
    dense = np.zeros((first + count * size,) * 2)
    dense[:first, :first] = shared
    dense[:first, first:] = cross
    dense[first:, :first] = cross.T
    places = first + np.arange(count * size).reshape(count, size)
    dense[places[:, :, None], places[:, None, :]] = blocks
    return dense


def _solve_scaled(matrix: FloatArray, gradient: FloatArray) -> FloatArray:
    """Solve a symmetric system after scaling its diagonal to 1."""
    if not len(gradient):
        return gradient
    scale = 1 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-300))
    scaled = matrix * scale * scale[:, None]
    try:
        return scale * np.linalg.solve(scaled, scale * gradient)
    except np.linalg.LinAlgError:
        return scale * np.linalg.lstsq(scaled, scale * gradient, rcond=None)[0]


def _damped(matrix: FloatArray, damping: float) -> FloatArray:
    """Marquardt's scaling: each unknown is damped in its own unit."""
    if not matrix.size:
        return matrix
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    # A direction that no observation touches still needs a pivot.
    floor = 1e-12 * np.max(diagonal, axis=-1, keepdims=True, initial=1e-300)
    damped = matrix.copy()
    index = np.arange(matrix.shape[-1])
    damped[..., index, index] += damping * np.maximum(diagonal, floor) + floor * 1e-3
    return damped


def shared_terms(
    d_shared: FloatArray,
    d_pose: FloatArray,
    residual: FloatArray,
    image: IntArray,
    photos: int,
    priors: tuple[FloatArray, FloatArray],
) -> NormalEquations:
    """Gather the blocks of shared unknowns and poses.

    Args:
        d_shared: (N, 2, K) weighted derivatives by the shared unknowns.
        d_pose: (N, 2, 6) weighted derivatives by the corner's own pose.
        residual: (N, 2) weighted residuals.
        image: (N,) photo of each corner, non-decreasing.
        photos: M.
        priors: residuals (L,) and derivatives (L, K) of the pseudo-observations.

    """
    count = d_shared.shape[2]
    jacobian = np.concatenate([d_shared, d_pose, residual[:, :, None]], axis=2)
    # One Gram matrix a photo holds every block, the gradient in its last column.
    gram = np.zeros((photos, count + 7, count + 7))
    bounds = np.searchsorted(image, np.arange(photos + 1))
    for photo in range(photos):
        rows = jacobian[bounds[photo] : bounds[photo + 1]].reshape(-1, count + 7)
        gram[photo] = rows.T @ rows
    total = gram[:, :count, :].sum(axis=0)
    prior, d_prior = priors
    return NormalEquations(
        shared=total[:, :count] + d_prior.T @ d_prior,
        prior=d_prior.T @ d_prior,
        pose=gram[:, count : count + 6, count : count + 6],
        shared_pose=gram[:, :count, count : count + 6]
        .transpose(1, 0, 2)
        .reshape(count, 6 * photos),
        shared_gradient=total[:, -1] + d_prior.T @ prior,
        pose_gradient=gram[:, count : count + 6, -1],
        corner=np.zeros((0, 3, 3)),
        shared_corner=np.zeros((count, 0)),
        pose_corner=np.zeros((6 * photos, 0)),
        corner_gradient=np.zeros((0, 3)),
    )


def corner_terms(
    normal: NormalEquations,
    d_shared: FloatArray,
    d_pose: FloatArray,
    d_world: FloatArray,
    residual: FloatArray,
    image: IntArray,
    world: World,
) -> NormalEquations:
    """Add the blocks of free corners; ``d_world`` is (N, 2, 3) by the corner's world point."""
    pairs, corners = len(d_world), len(world.offsets)
    row = np.arange(2 * pairs)
    shape = (2 * pairs, 3 * corners)
    columns = 3 * np.repeat(world.corner, 2)[:, None] + np.arange(3)
    by_corner = csr_array((d_world.reshape(-1), (np.repeat(row, 3), columns.ravel())), shape=shape)
    columns = 6 * np.repeat(image, 2)[:, None] + np.arange(6)
    by_pose = csr_array(
        (d_pose.reshape(-1), (np.repeat(row, 6), columns.ravel())),
        shape=(2 * pairs, 6 * len(normal.pose)),
    )
    products = np.zeros((corners, 3, 3))
    np.add.at(products, world.corner, d_world.transpose(0, 2, 1) @ d_world)
    pull = world.offset_weight**2
    gradient = np.asarray(by_corner.T @ residual.reshape(-1)).reshape(-1, 3)
    return replace(
        normal,
        corner=products + pull * np.eye(3),
        shared_corner=np.asarray(by_corner.T @ d_shared.reshape(2 * pairs, d_shared.shape[2])).T,
        pose_corner=(by_pose.T @ by_corner).toarray(),
        corner_gradient=gradient + pull * world.offsets,
    )
