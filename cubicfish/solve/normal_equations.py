"""Normal equations, arrow-shaped as calibration has them, and their damped solution.

Shared unknowns (the lens, the boards' shapes) touch every photo, a pose only its own, a corner's
offset only the photos that see it. The larger of the two families of small blocks is eliminated
by the Schur complement, so the work grows linearly with the photos.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from cubicfish.types import FloatArray, IntArray

if TYPE_CHECKING:
    from cubicfish.solve.deformable_target import DeformableTarget

# Numbers of a pose and of a corner's place.
_POSE, _CORNER = 6, 3
# Shares of the diagonal: the damping that stands for none, and the least pivot.
_UNDAMPED, _LEAST_PIVOT = 1e-14, 1e-12
# Numbers at once of the coupling of eliminated blocks to the rest, which is a large array.
_NUMBERS_AT_ONCE = 600_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearised:
    """Residuals of n pairs and their derivatives; all but ``residual`` times ``root``.

    Attributes:
        residual: (n, 2) pixels.
        root: (n,) root of each pair's weight, which falls where the loss is linear.
        rows: (2, 6 + k + 4, n) ``by_pose``, those by the shared unknowns, ``miss`` and
            ``by_corner``, one below the other: products of all of them are formed at once. First
            those of all x, then those of all y, which need not depend on the same unknowns.
        columns: (2, k) the indices of the shared unknowns on which x and y of these pairs depend,
            among all.
        pose: (n,) index of the pose of each pair.

    """

    residual: FloatArray
    root: FloatArray
    rows: FloatArray
    columns: IntArray
    pose: IntArray

    @property
    def by_pose(self) -> FloatArray:
        """(n, 2, 6) by the turn and the shift of the pair's pose."""
        return self.rows[:, :_POSE].transpose(2, 0, 1)

    def by_shared(self, step: FloatArray) -> FloatArray:
        """(n, 2, H) how the misses change by steps (K, H) of all shared unknowns."""
        own = zip(self.rows[:, _POSE : -1 - _CORNER], self.columns, strict=True)
        return np.stack([rows.T @ step[columns] for rows, columns in own], axis=1)

    @property
    def miss(self) -> FloatArray:
        """(n, 2) the residuals."""
        return self.rows[:, -1 - _CORNER].T

    @property
    def by_corner(self) -> FloatArray:
        """(n, 2, 3) by the pair's world point; 0 where the target is not free."""
        return self.rows[:, -_CORNER:].transpose(2, 0, 1)

    def select(self, pairs: IntArray) -> Linearised:
        """Those of some pairs, by their indices."""
        return replace(
            self,
            residual=self.residual[pairs],
            root=self.root[pairs],
            rows=self.rows[:, :, pairs],
            pose=self.pose[pairs],
        )

    @classmethod
    def of(
        cls,
        residual: FloatArray,
        root: FloatArray,
        by_pose: FloatArray,
        by_shared: Sequence[FloatArray],
        by_corner: FloatArray | None,
        columns: IntArray,
        pose: IntArray,
    ) -> Linearised:
        """Put together what is not yet times ``root``.

        Derivatives of x and y are (2, ., n), or (1, ., n) where they are the same for both.
        """
        rows, first = np.empty((2, _POSE + columns.shape[1] + 1 + _CORNER, len(root))), 0
        if by_corner is None:
            rows[:, -_CORNER:] = 0
        parts = [by_pose, *by_shared, residual.T[:, None]]
        for part in parts if by_corner is None else [*parts, by_corner]:
            stop = first + part.shape[1]
            np.multiply(part, root, out=rows[:, first:stop])
            first = stop
        return cls(residual=residual, root=root, rows=rows, columns=columns, pose=pose)


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalEquations:
    """Blocks of the Gauss-Newton Hessian, with the gradient as one more column.

    K shared unknowns, M poses (photos, or a rig's shots), Q free corners (0 where the corners stay
    as they are).

    Attributes:
        shared: (K, K + 1).
        pose: (M, 6, 6).
        pose_shared: (M, 6, K + 1).
        corner: (Q, 3, 3).
        corner_shared: (Q, 3, K + 1).
        pose_corner: (M, 6, Q, 3).

    """

    shared: FloatArray
    pose: FloatArray
    pose_shared: FloatArray
    corner: FloatArray
    corner_shared: FloatArray
    pose_corner: FloatArray

    @classmethod
    def zeros(cls, shared: int, poses: int, corners: int) -> NormalEquations:
        """The equations of no pairs, for so many unknowns."""
        return cls(
            shared=np.zeros((shared, shared + 1)),
            pose=np.zeros((poses, 6, 6)),
            pose_shared=np.zeros((poses, 6, shared + 1)),
            corner=np.zeros((corners, 3, 3)),
            corner_shared=np.zeros((corners, 3, shared + 1)),
            pose_corner=np.zeros((poses, 6, corners, 3)),
        )

    def add(self, terms: Linearised, corner: IntArray) -> None:
        """Add pairs; ``corner`` (n,) is the index of the free corner of each, where any are free.

        A photo sees each corner once, so among the pairs of one camera no place comes twice.
        """
        # Pairs of one photo stand together: dense products are faster than sparse sums.
        cuts = np.flatnonzero(np.diff(terms.pose, prepend=-1, append=-1))
        poses = terms.pose[cuts[:-1]]
        for rows, columns in zip(terms.rows, terms.columns, strict=True):
            right, own_columns = rows[_POSE:-_CORNER], tuple(columns.tolist())
            every = _cut_pieces((*own_columns, len(self.shared)))
            product = right @ right.T
            for above, own in _cut_pieces(own_columns):
                for beside, place in every:
                    self.shared[own, place] += product[above, beside]
            by_photo = _multiply_by_photo(rows[:-_CORNER], cuts)
            self.pose[poses] += by_photo[:, :, :_POSE]
            for beside, place in every:
                self.pose_shared[poses, :, place] += by_photo[:, :, _POSE:][:, :, beside]
        if len(self.corner):
            self._add_corners(terms, corner)

    def _add_corners(self, terms: Linearised, corner: IntArray) -> None:
        """Add what pairs say of free corners, and of these together with all else."""
        groups = list(_group_by(corner, len(self.corner)))
        for rows, columns in zip(terms.rows, terms.columns, strict=True):
            every = _cut_pieces((*columns.tolist(), len(self.shared)))
            for alike, own in groups:
                seen = rows[_POSE:, own]
                product = seen[-_CORNER:].transpose(1, 0, 2) @ seen.transpose(1, 2, 0)
                self.corner[alike] += product[:, :, -_CORNER:]
                for beside, place in every:
                    self.corner_shared[alike, :, place] += product[:, :, beside]
        both = np.einsum("apn,acn->npc", terms.rows[:, :_POSE], terms.rows[:, -_CORNER:])
        self.pose_corner[terms.pose, :, corner] += both

    def with_pulls(self, priors: Sequence[FloatArray], world: DeformableTarget) -> NormalEquations:
        """Add the priors of the shared unknowns, those of the lens first, and of free corners."""
        shared, corner_shared = self.shared.copy(), self.corner_shared.copy()
        first = 0
        for prior in priors:
            stop = first + len(prior) - 1
            shared[first:stop, first:stop] += prior[:-1, :-1]
            shared[first:stop, -1] += prior[:-1, -1]
            first = stop
        if not len(corner_shared):
            return replace(self, shared=shared)
        pull = world.offset_weight**2
        corner_shared[:, :, -1] += pull * world.offsets
        corner = self.corner + pull * np.eye(3)
        return replace(self, shared=shared, corner=corner, corner_shared=corner_shared)

    def without(self, poses: IntArray, put_in: NormalEquations) -> NormalEquations:
        """Subtract the contribution of the pairs of some poses, which stay where they are.

        Args:
            poses: the poses.
            put_in: the contribution of the pairs that are seen from these.

        """
        left = NormalEquations(
            shared=self.shared - put_in.shared,
            pose=self.pose.copy(),
            pose_shared=self.pose_shared.copy(),
            corner=self.corner - put_in.corner,
            corner_shared=self.corner_shared - put_in.corner_shared,
            pose_corner=self.pose_corner.copy(),
        )
        left.pose[poses] = np.eye(6)
        left.pose_shared[poses] = 0
        left.pose_corner[poses] = 0
        return left

    @property
    def gradient(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The gradient: (K,), (M, 6) and (Q, 3)."""
        return self.shared[:, -1], self.pose_shared[:, :, -1], self.corner_shared[:, :, -1]

    def solve(
        self, damping: float, of_pose: FloatArray | float = 0.0
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """One damped Gauss-Newton step: (K,), (M, 6) and (Q, 3); see :meth:`eliminated`."""
        gradient = (part[..., None] for part in self.gradient)
        shared, pose, corner = self.eliminated(damping, of_pose).steps(*gradient)
        return shared[..., 0], pose[..., 0], corner[..., 0]

    def expected_decrease(self, step: tuple[FloatArray, FloatArray, FloatArray]) -> float:
        """By how much a lightly damped Gauss-Newton step lowers the cost of the linear problem."""
        return -0.5 * float(sum(np.sum(a * b) for a, b in zip(self.gradient, step, strict=True)))

    def reduced_shared(self) -> FloatArray:
        """(K, K): the shared unknowns' Hessian with poses and corners eliminated, undamped."""
        matrix, count = self.eliminated(_UNDAMPED).matrix, len(self.shared)
        cross = matrix[count:, :count]
        return matrix[:count, :count] - cross.T @ solve_scaled(matrix[count:, count:], cross)

    def eliminated(self, damping: float, of_pose: FloatArray | float = 0.0) -> Eliminated:
        """Eliminate the larger family of small blocks from the damped equations.

        Args:
            damping: damping of all unknowns.
            of_pose: (M, 1) the least damping of each pose.

        """
        pose = damped(self.pose, np.maximum(damping, of_pose)), self.pose_shared[:, :, :-1]
        corner = damped(self.corner, damping), self.corner_shared[:, :, :-1]
        across = self.pose_corner.reshape(6 * len(self.pose), 3 * len(self.corner))
        keeps_poses = 0 < across.shape[0] <= across.shape[1]
        if keeps_poses:
            (kept, kept_shared), (gone, gone_shared), across = pose, corner, across.T
        else:
            (kept, kept_shared), (gone, gone_shared) = corner, pose
        count, shared = len(self.shared), damped(self.shared[:, :-1], damping)
        matrix = np.zeros((count + kept.size // kept.shape[1],) * 2)
        matrix[:count, :count] = shared
        matrix[count:, :count] = kept_shared.reshape(len(matrix) - count, count)
        matrix[:count, count:] = matrix[count:, :count].T
        places = count + np.arange(len(matrix) - count).reshape(kept.shape[:2])
        matrix[places[:, :, None], places[:, None, :]] = kept
        equations = Eliminated(
            matrix=matrix,
            inverse=np.asarray(np.linalg.inv(gone), float),
            gone_shared=gone_shared,
            across=across,
            keeps_poses=keeps_poses,
        )
        root = _find_root(equations.inverse)
        for some, _, coupling in equations.couplings():
            if root is None:
                matrix -= coupling.T @ _times(equations.inverse[some], coupling)
            else:  # a product of one array with itself costs half
                half = _times(root[some], coupling)
                matrix -= half.T @ half
        return equations


@dataclass(frozen=True, kw_only=True, eq=False)
class Eliminated:
    """The normal equations that remain when one family of small blocks is eliminated.

    Attributes:
        matrix: (D, D), the K shared unknowns first.
        inverse: (n, b, b) of each block that was eliminated.
        gone_shared: (n, b, K) the coupling of these blocks to the shared unknowns.
        across: (nb, D - K) their coupling to the blocks that remain.
        keeps_poses: whether the corners were eliminated, not the poses.

    """

    matrix: FloatArray
    inverse: FloatArray
    gone_shared: FloatArray
    across: FloatArray
    keeps_poses: bool

    def couplings(self) -> Iterator[tuple[slice, slice, FloatArray]]:
        """The coupling of the eliminated blocks to the rest, some blocks after the others.

        Yields:
            These blocks among all that were eliminated, their rows, and (r, D) their coupling.

        """
        blocks, size, count = self.gone_shared.shape
        at_once = max(1, _NUMBERS_AT_ONCE // max(size * len(self.matrix), 1))
        for first in range(0, blocks, at_once):
            some = slice(first, min(first + at_once, blocks))
            rows = slice(size * some.start, size * some.stop)
            across = self.across[rows]
            coupling = np.hstack([self.gone_shared[some].reshape(len(across), count), across])
            yield some, rows, coupling

    def steps(
        self,
        shared: FloatArray,
        pose: FloatArray,
        corner: FloatArray,
        changes: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The steps under H gradients, all at once.

        Args:
            shared: (K, H).
            pose: (M, 6, H).
            corner: (Q, 3, H).
            changes: (H, L, L) what is added to the Hessian of the first L shared unknowns.

        """
        kept, gone = (pose, corner) if self.keeps_poses else (corner, pose)
        right = np.vstack([shared, kept.reshape(-1, shared.shape[1])])
        alone = _times(self.inverse, gone.reshape(-1, shared.shape[1]))
        count, other = len(shared), -alone
        of_shared = self.gone_shared.reshape(len(other), count)
        right[:count] -= of_shared.T @ alone
        right[count:] -= self.across.T @ alone
        if changes is None:
            step = -solve_scaled(self.matrix, right)
        else:  # the unchanged part is eliminated once
            own = slice(0, changes.shape[1])
            rest = slice(own.stop, None)
            cross = self.matrix[rest, own]
            both = solve_scaled(self.matrix[rest, rest], np.hstack([cross, right[rest]]))
            followed, left = np.hsplit(both, [own.stop])
            slope = (right[own] - cross.T @ left).T[:, :, None]
            whole = self.matrix[own, own] - cross.T @ followed + changes
            first = -solve_scaled(whole, slope)[:, :, 0].T
            step = np.vstack([first, -followed @ first - left])
        moved = of_shared @ step[:count] + self.across @ step[count:]
        other -= _times(self.inverse, moved)
        kept, gone = step[count:].reshape(kept.shape), other.reshape(gone.shape)
        return step[:count], *((kept, gone) if self.keeps_poses else (gone, kept))


def _times(blocks: FloatArray, rows: FloatArray) -> FloatArray:
    """Blocks (n, b, b), each times its own of rows (nb, C): (nb, C)."""
    return np.asarray((blocks @ rows.reshape(*blocks.shape[:2], -1)).reshape(rows.shape))


def _find_root(inverse: FloatArray) -> FloatArray | None:
    """(n, b, b) roots R of matrices RᵀR; None where rounding left one that has none."""
    try:
        return np.swapaxes(np.linalg.cholesky(inverse), 1, 2)
    except np.linalg.LinAlgError:
        return None


def solve_scaled(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve symmetric systems (..., D, D) for (..., D, H) after scaling their diagonals to 1."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    # Diagonals that rounding left tiny or negative are not scaled up without bound.
    least = np.maximum(1e-300, 1e-40 * diagonal.max(axis=-1, keepdims=True, initial=0.0))
    scale = (1 / np.sqrt(np.maximum(diagonal, least)))[..., None]
    scaled = matrix * scale * np.swapaxes(scale, -1, -2)
    try:
        return scale * np.linalg.solve(scaled, scale * right)
    except np.linalg.LinAlgError:
        return scale * (np.linalg.pinv(scaled, hermitian=True) @ (scale * right))


def damped(matrix: FloatArray, damping: float | FloatArray) -> FloatArray:
    """Marquardt's scaling: each unknown is damped in its own unit; blocks (n, b, b) by (n, 1)."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    # A direction without any observation still needs a pivot.
    floor = _LEAST_PIVOT * np.max(diagonal, axis=-1, keepdims=True, initial=1e-18)
    damped = matrix.copy()
    index = np.arange(matrix.shape[-1])
    damped[..., index, index] += damping * np.maximum(diagonal, floor) + floor * 1e-3
    return damped


def _multiply_by_photo(rows: FloatArray, cuts: IntArray) -> FloatArray:
    """(M, 6, C) products of the first six of rows (C, n) with all of them, photo by photo.

    Photo m has the pairs from ``cuts[m]`` on, up to ``cuts[m + 1]``.
    """
    sizes = np.diff(cuts)
    if (sizes == sizes[0]).all():
        alike = rows.reshape(len(rows), len(sizes), -1)
        return np.asarray(alike[:_POSE].transpose(1, 0, 2) @ alike.transpose(1, 2, 0))
    photos = [rows[:, first:stop] for first, stop in pairwise(cuts.tolist())]
    return np.stack([photo[:_POSE] @ photo.T for photo in photos])


@lru_cache(maxsize=64)
def _cut_pieces(index: tuple[int, ...]) -> list[tuple[slice, slice]]:
    """Cut an index where it leaps: the slices of each piece, in it and where it leads.

    Slices need no copy, which an index does.
    """
    cuts = [0, *(np.flatnonzero(np.diff(index) != 1) + 1).tolist(), len(index)]
    ends = [(first, stop, index[first]) for first, stop in pairwise(cuts) if first < stop]
    return [(slice(first, stop), slice(to, to + stop - first)) for first, stop, to in ends]


def _group_by(index: IntArray, count: int) -> Iterator[tuple[IntArray, IntArray]]:
    """Group the places of an index (n,) below ``count``: those that come equally often together.

    Yields:
        (g,) some places, and (g, times) the pairs of each.

    """
    order, often = np.argsort(index, kind="stable"), np.bincount(index, minlength=count)
    first = np.cumsum(often) - often
    for times in np.unique(often[often > 0]).tolist():
        alike = np.flatnonzero(often == times)
        yield alike, order[first[alike, None] + np.arange(times)]


def gram(slope: FloatArray, residual: FloatArray) -> FloatArray:
    """(K + 1, K + 1) products of derivatives (L, K) and, last, of residuals (L,)."""
    rows = np.column_stack([slope, residual])
    return np.asarray(rows.T @ rows)
