"""Normal equations, arrow-shaped as calibration has them, and their damped solution.

Shared unknowns (the lens, the boards' shapes) touch every photo, a pose only its own, a corner's
offset only the photos that see it. The larger of the two families of small blocks is eliminated
by the Schur complement, so the work grows linearly with the photos.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dposv
from scipy.sparse import csr_array

from cubicfish_cli.core.fit.deformable_target import DeformableTarget
from cubicfish_cli.core.types import FloatArray, IntArray

# Derivatives of so many pairs by so many unknowns fit into a core's cache; larger arrays wait for
# memory.
_RUN_PAIRS, _RUN_UNKNOWNS = 1000, 60
_NO_STARTS: IntArray = np.zeros(0, np.intp)
COLD_DAMPING = 1e-4
"""First damping for a start that may be far from the optimum."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalEquations:
    """Blocks of the Gauss-Newton Hessian and of the gradient.

    K shared unknowns, M poses (photos, or a rig's shots), Q free corners (0 where the corners stay
    as they are).

    Attributes:
        shared: (K, K), priors included.
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
    pose: FloatArray
    shared_pose: FloatArray
    shared_gradient: FloatArray
    pose_gradient: FloatArray
    corner: FloatArray
    shared_corner: FloatArray
    pose_corner: FloatArray
    corner_gradient: FloatArray

    def solve(
        self, damping: float, of_pose: FloatArray | float = 0.0
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """One damped Gauss-Newton step: (K,), (M, 6) and (Q, 3); see :meth:`eliminated`."""
        return self.eliminated(damping, of_pose).solve()

    def expected_decrease(self, step: tuple[FloatArray, FloatArray, FloatArray]) -> float:
        """By how much a lightly damped Gauss-Newton step lowers the cost of the linear problem."""
        shared, pose, corner = step
        slope = (
            self.shared_gradient @ shared
            + np.sum(self.pose_gradient * pose)
            + np.sum(self.corner_gradient * corner)
        )
        return -0.5 * float(slope)

    def of_shared(self) -> NormalEquations:
        """The same without the poses' blocks."""
        return replace(
            self,
            pose=self.pose[:0],
            shared_pose=self.shared_pose[:, :0],
            pose_gradient=self.pose_gradient[:0],
            pose_corner=self.pose_corner[:0],
        )

    def without(self, poses: IntArray, put_in: NormalEquations) -> NormalEquations:
        """The equations less what was seen from some poses, which stay where they are.

        Args:
            poses: the poses.
            put_in: those poses' own sums, as :meth:`of_shared` gives them.

        """
        columns = (6 * poses[:, None] + np.arange(6)).reshape(-1)
        pose, pose_gradient = self.pose.copy(), self.pose_gradient.copy()
        shared_pose, pose_corner = self.shared_pose.copy(), self.pose_corner.copy("K")
        pose[poses], pose_gradient[poses] = np.eye(6), 0
        shared_pose[:, columns] = 0
        pose_corner[columns] = 0
        return NormalEquations(
            shared=self.shared - put_in.shared,
            pose=pose,
            shared_pose=shared_pose,
            shared_gradient=self.shared_gradient - put_in.shared_gradient,
            pose_gradient=pose_gradient,
            corner=self.corner - put_in.corner,
            shared_corner=self.shared_corner - put_in.shared_corner,
            pose_corner=pose_corner,
            corner_gradient=self.corner_gradient - put_in.corner_gradient,
        )

    def eliminated(
        self,
        damping: float,
        of_pose: FloatArray | float = 0.0,
        known: Nearly | None = None,
    ) -> Eliminated:
        """The damped equations with the larger family of small blocks eliminated.

        Args:
            damping: of all unknowns.
            of_pose: (M, 1) the least damping of each pose.
            known: equations from which these differ little, eliminated with the same damping.

        """
        pose = damped(self.pose, np.maximum(damping, of_pose))
        shared, corner = damped(self.shared, damping), damped(self.corner, damping)
        return self._eliminated(shared, pose, corner, known)

    def reduced_shared(self) -> FloatArray:
        """(K, K): the shared unknowns' Hessian with poses and corners eliminated, undamped."""
        floor = 1e-14
        shared = self.shared
        pose, corner = damped(self.pose, floor), damped(self.corner, floor)
        reduced = self._eliminated(shared, pose, corner).matrix
        count = len(shared)
        rest = reduced[count:, count:]
        if not len(rest):
            return reduced
        cross = reduced[count:, :count]
        return reduced[:count, :count] - cross.T @ np.linalg.solve(rest, cross)

    def _eliminated(
        self,
        shared: FloatArray,
        pose: FloatArray,
        corner: FloatArray,
        known: Nearly | None = None,
    ) -> Eliminated:
        """By the Schur complement of poses or corners, with these diagonal blocks."""
        keeps_poses = 0 < pose.size // 6 <= corner.size // 3
        if keeps_poses:
            blocks, block_gradient = corner, self.corner_gradient
            dense = _bordered(shared, self.shared_pose, pose)
            cross = [self.shared_corner, self.pose_corner]
            gradient = np.concatenate([self.shared_gradient, self.pose_gradient.ravel()])
        else:
            blocks, block_gradient = pose, self.pose_gradient
            dense = _bordered(shared, self.shared_corner, corner)
            cross = [self.shared_pose, self.pose_corner.T]
            gradient = np.concatenate([self.shared_gradient, self.corner_gradient.ravel()])
        parts = [*cross, block_gradient.reshape(1, -1)]
        if known is None:
            inverse_root, half = _halved(blocks, parts)
            product = _products(half)
        else:
            own = known.corners if keeps_poses else known.poses
            columns = (blocks.shape[1] * own[:, None] + np.arange(blocks.shape[1])).reshape(-1)
            inverse_root, half = known.whole.inverse_root.copy(), known.whole.half.copy()
            product = known.whole.product - _products(half[own])
            inverse_root[own], half[own] = _halved(
                blocks[own], [part[:, columns] for part in parts]
            )
            product += _products(half[own])
        return Eliminated(
            matrix=dense - product[:-1, :-1],
            gradient=gradient - product[:-1, -1],
            inverse_root=inverse_root,
            half=half,
            product=product,
            shared=len(shared),
            corners=len(corner),
            keeps_poses=keeps_poses,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Eliminated:
    """Normal equations of what is left when one family of small blocks is eliminated.

    Attributes:
        matrix: (D, D), the K shared unknowns first.
        gradient: (D,).
        inverse_root: (n, b, b) R of each block that was eliminated, with RᵀR its inverse.
        half: (n, b, D + 1) R [cross | gradient] of each.
        product: (D + 1, D + 1) what these squares add up to.
        shared: K.
        corners: Q.
        keeps_poses: whether it was the corners that were eliminated.

    """

    matrix: FloatArray
    gradient: FloatArray
    inverse_root: FloatArray
    half: FloatArray
    product: FloatArray
    shared: int
    corners: int
    keeps_poses: bool

    def solve(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The step: (K,), (M, 6) and (Q, 3)."""
        step = -solve_scaled(self.matrix, self.gradient[:, None])
        other = self._followed(step)[..., 0]
        first, second = step[: self.shared, 0], step[self.shared :, 0]
        if not self.corners:
            return first, other, np.zeros((0, 3))
        if self.keeps_poses:
            return first, second.reshape(-1, 6), other
        return first, other, second.reshape(-1, 3)

    def solve_changed(self, priors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The steps under H changes of the first L shared unknowns' prior, all at once.

        Args:
            priors: (H, L + 1, L + 1) what is to be added to its Gram matrix.

        Returns:
            (K, H) and (Q, 3, H).

        """
        hessian, gradient = priors[:, :-1, :-1], priors[:, :-1, -1]
        lens = gradient.shape[1]
        cross = self.matrix[lens:, :lens]
        # What is not changed is eliminated once.
        rest = solve_scaled(
            self.matrix[lens:, lens:], np.column_stack([cross, self.gradient[lens:]])
        )
        own = self.matrix[:lens, :lens] - cross.T @ rest[:, :-1]
        slope = self.gradient[:lens] - cross.T @ rest[:, -1]
        first = -solve_scaled(own + hessian, (slope + gradient)[..., None])[..., 0].T
        step = np.vstack([first, -rest[:, :-1] @ first - rest[:, -1:]])
        shared, second = step[: self.shared], step[self.shared :]
        if self.keeps_poses:
            return shared, self._followed(step)
        return shared, second.reshape(self.corners, 3, len(gradient))

    def _followed(self, step: FloatArray) -> FloatArray:
        """(n, b, H) steps of what was eliminated, of those of the rest (D, H)."""
        count, size, columns = self.half.shape
        seen = self.half.reshape(-1, columns) @ np.vstack([step, np.ones((1, step.shape[1]))])
        return -self.inverse_root.transpose(0, 2, 1) @ seen.reshape(count, size, -1)

    def shared_steps(self, shared: FloatArray, corner: FloatArray) -> FloatArray:
        """Steps (G, K) of the shared unknowns under other gradients, of no pose.

        Args:
            shared: (G, K).
            corner: (G, Q, 3).

        """
        right = np.zeros((len(shared), len(self.gradient)))
        right[:, : self.shared] = shared
        if self.keeps_poses:
            half = np.einsum("nij,gnj->gni", self.inverse_root, corner)
            right -= np.tensordot(half, self.half[..., :-1], 2)
        elif self.corners:
            right[:, self.shared :] = corner.reshape(len(corner), -1)
        return -solve_scaled(self.matrix, right.T)[: self.shared].T


@dataclass(frozen=True, eq=False)
class Nearly:
    """What some equations have been eliminated to, from which others differ in a few blocks.

    Attributes:
        whole: the equations, eliminated.
        poses: of which poses the others' blocks differ.
        corners: of which corners.

    """

    whole: Eliminated
    poses: IntArray
    corners: IntArray


def _halved(blocks: FloatArray, parts: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """R (n, b, b) of blocks, and R times their columns (n, b, D) of parts (·, nb)."""
    root = _inverse_root(blocks)
    right = np.concatenate([part.T for part in parts], axis=1)
    return root, root @ right.reshape(*blocks.shape[:2], -1)


def _inverse_root(blocks: FloatArray) -> FloatArray:
    """R with RᵀR = block⁻¹ of many small symmetric blocks (n, b, b)."""
    try:
        return np.linalg.inv(np.linalg.cholesky(blocks))
    except np.linalg.LinAlgError:  # rounding left a block not positive definite
        size, axes = np.linalg.eigh(blocks)
        least = np.finfo(float).eps * np.abs(size).max(axis=1, keepdims=True) + 1e-300
        return np.asarray(axes.transpose(0, 2, 1) / np.sqrt(np.maximum(size, least))[..., None])


def _products(half: FloatArray) -> FloatArray:
    """(D, D) the sum of halfᵀhalf over many blocks (n, b, D)."""
    flat = half.reshape(-1, half.shape[2])
    return np.asarray(flat.T @ flat)


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


def solve_scaled(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve symmetric systems (..., D, D) for (..., D, H) after scaling their diagonals to 1."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    # Diagonals that rounding left tiny or negative are not scaled up without bound.
    least = np.maximum(1e-300, 1e-40 * diagonal.max(axis=-1, keepdims=True, initial=0.0))
    scale = (1 / np.sqrt(np.maximum(diagonal, least)))[..., None]
    scaled = matrix * scale * np.swapaxes(scale, -1, -2)
    if scaled.ndim == 2 and right.size:
        # By Cholesky's factor, at a third of the cost, where rounding left it positive definite.
        _, solved, failed = dposv(scaled.T, scale * right, lower=1)
        if not failed:
            return np.asarray(scale * solved)
    try:
        return scale * np.linalg.solve(scaled, scale * right)
    except np.linalg.LinAlgError:
        return scale * (np.linalg.pinv(scaled, hermitian=True) @ (scale * right))


def damped(matrix: FloatArray, damping: float | FloatArray) -> FloatArray:
    """Marquardt's scaling: each unknown is damped in its own unit; blocks (n, b, b) by (n, 1)."""
    if not matrix.size:
        return matrix
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    # A direction that no observation touches still needs a pivot.
    floor = 1e-12 * np.max(diagonal, axis=-1, keepdims=True, initial=1e-300)
    damped = matrix.copy()
    index = np.arange(matrix.shape[-1])
    damped[..., index, index] += damping * np.maximum(diagonal, floor) + floor * 1e-3
    return damped


def runs_of_photos(
    image: IntArray, photos: int, starts: IntArray = _NO_STARTS, unknowns: int = _RUN_UNKNOWNS
) -> Iterator[tuple[slice, slice]]:
    """Whole photos in runs whose derivatives stay in the processor's cache.

    Args:
        image: (N,) photo of each pair, non-decreasing.
        photos: M.
        starts: photos with which a run has to begin, increasing.
        unknowns: by how many unknowns each pair is differentiated, roughly.

    Yields:
        The photos of each run and their pairs.

    """
    bounds = np.searchsorted(image, np.arange(photos + 1))
    pairs = max(_RUN_PAIRS, _RUN_PAIRS * _RUN_UNKNOWNS // max(unknowns, 1))
    first = 0
    while first < photos:
        stop = int(np.searchsorted(bounds, bounds[first] + pairs, side="right")) - 1
        stop = min([max(stop, first + 1), photos, *starts[starts > first]])
        yield slice(first, stop), slice(int(bounds[first]), int(bounds[stop]))
        first = stop


def summed_by_corner(
    corner: IntArray, corners: int, by_corner: FloatArray, rows: FloatArray
) -> FloatArray:
    """(Q, 3, C) of each free corner, the sum over its pairs of (derivative by its place)ᵀ rows.

    Args:
        corner: (n,) which corner each pair is of.
        corners: Q.
        by_corner: (n, 2, 3) the pairs' derivatives by its place.
        rows: (n, 2, C).

    """
    places = np.repeat(3 * corner, 2)[:, None] + np.arange(3)
    # A sparse matrix, whose product sums as it multiplies.
    sparse = csr_array(
        (by_corner.ravel(), places.ravel(), np.arange(0, places.size + 1, 3)),
        shape=(len(places), 3 * corners),
    )
    return np.asarray(sparse.T @ rows.reshape(len(places), -1)).reshape(corners, 3, -1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearised:
    """Residuals of n pairs and their derivatives, unweighted.

    Attributes:
        residual: (n, 2) pixels.
        d_lens: (n, 2, l) by those parameters of the lens that these pairs depend on.
        columns: where the l stand among all the lens's.
        d_board: (n, 2, S) by the boards' shapes and places.
        d_turn: (n, 2, 3) by the rotation of the pair's pose.
        d_shift: (n, 2, 3) by its translation.
        d_corner: (n, 2, 3) by the pair's world point; 0 where the target is not free.
        pose: (n,) which pose that is.

    """

    residual: FloatArray
    d_lens: FloatArray
    columns: slice
    d_board: FloatArray
    d_turn: FloatArray
    d_shift: FloatArray
    d_corner: FloatArray
    pose: IntArray


class NormalSums:
    """The blocks of the normal equations, summed up over runs of photos.

    Shared unknowns are the lens's, then the boards'. With several lenses a photo touches only its
    own lens's unknowns, so the work does not grow with their number.
    """

    def __init__(self, lens: int, boards: int, poses: int, world: DeformableTarget) -> None:
        """Zeros for so many parameters of lens and boards and so many poses."""
        self._corner = world.corner
        self._lens = lens
        self._boards = boards
        count = self._shared = lens + boards
        self._corners = len(world.offsets)
        # By the columns of the lens that photos touch: what these photos' Gram matrices add up to.
        self._total: dict[tuple[int, int], FloatArray] = {}
        self._pose = np.zeros((poses, 6, 6))
        self._shared_pose = np.zeros((count, poses, 6))
        self._pose_gradient = np.zeros((poses, 6))
        # By each corner's coordinates: what is shared, the residual, its own place.
        self._by_corner = np.zeros((self._corners, 3, count + 4))
        self._corner_pose = np.zeros((self._corners, poses, 3, 6))

    def _own(self, columns: slice) -> IntArray | slice:
        """Which of the shared unknowns photos touch."""
        if columns == slice(0, self._lens):
            return slice(None)
        return np.r_[columns, self._lens : self._shared]

    def add(
        self, terms: Linearised, root: FloatArray, photos: slice, image: IntArray, pairs: slice
    ) -> None:
        """Add a run of whole photos.

        Args:
            terms: of the run's n pairs.
            root: (n,) square root of each pair's weight.
            photos: the run's photos.
            image: (n,) photo of each pair, non-decreasing.
            pairs: the run's place among all pairs.

        """
        lens = terms.d_lens.shape[2]
        count = lens + self._boards
        own = self._own(terms.columns)
        key = terms.columns.start, terms.columns.stop
        if key not in self._total:
            self._total[key] = np.zeros((count, count + 1))
        # The pose, what is shared, the residual; the corner's own place where it is free.
        free = self._corners > 0
        whole = np.empty((len(root), 2, count + (10 if free else 7)))
        whole[:, :, :3] = terms.d_turn
        whole[:, :, 3:6] = terms.d_shift
        whole[:, :, 6 : 6 + lens] = terms.d_lens
        whole[:, :, 6 + lens : 6 + count] = terms.d_board
        whole[:, :, 6 + count] = terms.residual
        if free:
            whole[:, :, 7 + count :] = terms.d_corner
        whole *= root[:, None, None]
        rows = whole[:, :, : count + 7]
        bounds = np.searchsorted(image, np.arange(photos.start, photos.stop + 1))
        each = np.diff(bounds)
        # Of small boards there are many photos: those with equally many pairs are one product.
        for size in np.unique(each[each > 0]).tolist():
            alike = bounds[:-1][each == size]
            own_rows = rows if len(alike) == len(each) else rows[alike[:, None] + np.arange(size)]
            photos_rows = own_rows.reshape(len(alike), 2 * size, count + 7)
            self._add_photos(photos_rows, own, terms.pose[alike])
        shared = rows.reshape(-1, count + 7)[:, 6:]
        self._total[key] += (shared.T @ shared)[:-1]
        if free:
            self._add_corners(whole, own, terms.pose, self._corner[pairs])

    def _add_photos(self, rows: FloatArray, own: IntArray | slice, pose: IntArray) -> None:
        """The poses' blocks of some photos (P, 2n, k + 7) of equally many pairs."""
        # The gradient is in the last column.
        gram = rows[:, :, :6].transpose(0, 2, 1) @ rows
        self._pose[pose] += gram[:, :, :6]
        self._pose_gradient[pose] += gram[:, :, -1]
        across = gram[:, :, 6:-1].transpose(2, 0, 1)
        if isinstance(own, slice):
            self._shared_pose[:, pose] += across
        else:
            self._shared_pose[np.ix_(own, pose)] += across

    def _add_corners(
        self,
        whole: FloatArray,
        own: IntArray | slice,
        pose: IntArray,
        corner: IntArray,
    ) -> None:
        """The blocks of free corners: (n, 2, k + 10) with derivatives by them last, weighted."""
        by_corner = whole[:, :, -3:]
        # A photo sees each corner once, so no place comes twice.
        self._corner_pose[corner, pose] += by_corner.transpose(0, 2, 1) @ whole[:, :, :6]
        columns = own
        if not isinstance(own, slice):
            columns = np.r_[own, self._shared : self._shared + 4]
        summed = summed_by_corner(corner, self._corners, by_corner, whole)
        self._by_corner[:, :, columns] += summed[:, :, 6:]

    def _totals(self) -> tuple[FloatArray, FloatArray]:
        """Hessian (K, K) and gradient (K,) of the shared unknowns."""
        hessian, gradient = np.zeros((self._shared,) * 2), np.zeros(self._shared)
        for (first, stop), total in self._total.items():
            own = self._own(slice(first, stop))
            if isinstance(own, slice):
                hessian += total[:, :-1]
            else:
                hessian[np.ix_(own, own)] += total[:, :-1]
            gradient[own] += total[:, -1]
        return hessian, gradient

    def equations(
        self, lens_prior: FloatArray | None = None, world: DeformableTarget | None = None
    ) -> NormalEquations:
        """The sums, with the lens's prior and the world's where both are given."""
        count = self._shared
        hessian, gradient = self._totals()
        pull, offsets = 0.0, np.zeros((self._corners, 3))
        if lens_prior is not None and world is not None:
            for own, prior in (
                (slice(0, self._lens), lens_prior),
                (slice(self._lens, count), world.prior()),
            ):
                hessian[own, own] += prior[:-1, :-1]
                gradient[own] += prior[:-1, -1]
            pull, offsets = world.offset_weight**2, world.offsets
        rows, columns = 3 * self._corners, 6 * len(self._pose)
        corner_pose = self._corner_pose.transpose(0, 2, 1, 3).reshape(rows, columns)
        return NormalEquations(
            shared=hessian,
            pose=self._pose,
            shared_pose=self._shared_pose.reshape(count, 6 * len(self._pose)),
            shared_gradient=gradient,
            pose_gradient=self._pose_gradient,
            corner=self._by_corner[:, :, -3:] + pull * np.eye(3),
            shared_corner=self._by_corner.reshape(rows, count + 4)[:, :count].T,
            pose_corner=corner_pose.T,
            corner_gradient=self._by_corner[:, :, count] + pull * offsets,
        )
