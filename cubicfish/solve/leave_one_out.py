"""What a fit would have been without some of its photos, to first order.

Near its optimum a fit without a few photos is one Gauss-Newton step away, and the equations of that
step are those of the whole fit less the contribution of these photos. So every photo can be left
out at the price of a small linear system, where a new fit costs tens of iterations.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from cubicfish.solve.adjustment import Adjustment, State, linearise
from cubicfish.solve.fit_lens import FitLens
from cubicfish.solve.normal_equations import Eliminated, Linearised, NormalEquations
from cubicfish.types import BoolArray, FloatArray, IntArray

Run = tuple[BoolArray, IntArray, Linearised]

# As a share of the diagonal: unknowns without any remaining photo stay where they are. No more: the
# directions that a narrow lens leaves weak are what photos move it along.
_DAMPING = 1e-13
# Least square root of a weight, so that residuals can be divided by it.
_SMALLEST_ROOT = 1e-6
# So many pairs' derivatives are kept in place of computing them twice: some megabytes.
_KEPT_PAIRS = 5000
# Steps of all poses for so many groups are held at once.
_AT_ONCE = 100
# Singular values below this share of the largest one are rounding.
_RANK = 1e-12


class LeaveOneOut:
    """Leaves groups of photos out of a fit, to first order."""

    def __init__(self, fit: Adjustment[Any], groups: Sequence[IntArray]) -> None:
        """Prepare to leave groups out of a fit.

        Args:
            fit: the fit to all photos, at its optimum.
            groups: photos (of a rig: shots) that are left out together.

        """
        self._fit, self._groups = fit, groups
        self._shot = fit.lens.shot_of(fit.pairs.image)
        self._gradients: dict[int, tuple[FloatArray, FloatArray]] = {}

    def steps(self) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
        """Steps (K,), (M, 6) and (Q, 3) to the fit without each group, whose own poses stay."""
        for number, group in enumerate(self._groups):
            own = self._sum_up(group)
            self._keep_gradient(number, own)
            yield self._fit.normal.without(group, own).solve(_DAMPING)

    def residuals(self, priors: FloatArray | None = None) -> Iterator[tuple[int, FloatArray]]:
        """Residuals of every photo under the fit without its group, its own pose fitted anew.

        They are computed at once for H other priors of the lens, by default for its own prior
        alone.

        Args:
            priors: (H, L + 1, L + 1) the Gram matrix of each.

        Yields:
            The photo, and (n, 2, H) pixels; NaN of pairs that do not tell their error.

        """
        own = self._fit.lens.pulls()
        change = (own[None] if priors is None else priors) - own
        for group in self._groups:
            terms = list(self._linearise(group)) if self._is_small(group) else None
            normal = self._fit.normal.without(group, self._sum_up(group, terms))
            steps = _resolve(normal, normal.eliminated(_DAMPING), change)
            yield from self._refit(group, *steps, terms)

    def steps_under(self, lenses: Sequence[FitLens]) -> FloatArray:
        """Steps (H, K) of the shared unknowns under other lenses' priors, no photo left out."""
        change = np.array([lens.pulls() for lens in lenses]) - self._fit.lens.pulls()
        return _resolve(self._fit.normal, self._equations_of_all, change)[0].T

    def influence(self) -> FloatArray:
        """Steps (G, K) of the shared unknowns without each group's gradient, its Hessian kept.

        The empirical influence of a group (Jaeckel's infinitesimal jackknife).
        """
        normal, count = self._fit.normal, len(self._groups)
        if not count:
            return np.empty((0, len(normal.shared)))
        for number, group in enumerate(self._groups):
            if number not in self._gradients:
                self._keep_gradient(number, self._sum_up(group))
        steps = np.empty((count, len(normal.shared)))
        for first in range(0, count, _AT_ONCE):
            some = [self._gradients[one] for one in range(first, min(first + _AT_ONCE, count))]
            shared = -np.stack([of_shared for of_shared, _ in some], axis=-1)
            corner = -np.stack([of_corner for _, of_corner in some], axis=-1)
            still = np.zeros((len(normal.pose), 6, len(some)))
            own, _, _ = self._equations_of_all.steps(shared, still, corner)
            steps[first : first + len(some)] = own.T
        return steps

    def _keep_gradient(self, number: int, own: NormalEquations) -> None:
        """Keep what a group's pairs add to the gradient of unknowns that others share."""
        shared, _, corner = own.gradient
        self._gradients[number] = shared.copy(), corner.copy()

    @cached_property
    def _equations_of_all(self) -> Eliminated:
        return self._fit.normal.eliminated(_DAMPING)

    @cached_property
    def _terms_of_all(self) -> list[tuple[slice, Linearised]]:
        return list(linearise(self._fit, self._fit.pairs, self._fit.huber_px))

    def _is_small(self, group: IntArray) -> bool:
        """Whether the derivatives of the pairs that are seen from some poses may be kept."""
        return int(np.isin(self._shot, group).sum()) <= _KEPT_PAIRS

    def _linearise(self, group: IntArray) -> Iterator[Run]:
        """Linearise the pairs that are seen from some poses, run by run.

        Yields:
            (n,) whether each pair of a run tells its error; (n,) the free corner of each, where any
            are free; and the derivatives.

        """
        own, fit = np.flatnonzero(np.isin(self._shot, group)), self._fit
        if len(self._shot) <= _KEPT_PAIRS:
            for run, terms in self._terms_of_all:
                rows = own[(own >= run.start) & (own < run.stop)]
                corner = fit.world.corner[rows] if len(fit.world.corner) else fit.world.corner
                if rows.size:
                    yield fit.pairs.error_known[rows], corner, terms.select(rows - run.start)
            return
        pairs, state = fit.pairs.select(own), State(fit.lens, fit.poses, fit.world.select(own))
        for run, terms in linearise(state, pairs, fit.huber_px):
            yield pairs.error_known[run], state.world.corner[run], terms

    def _sum_up(self, group: IntArray, known: Sequence[Run] | None = None) -> NormalEquations:
        """Sum up the contribution of the pairs that are seen from some poses to the equations.

        Only these poses are among its unknowns, in ascending order.

        Args:
            group: the poses.
            known: these pairs linearised, where they are already.

        """
        size = self._fit.normal
        normal = NormalEquations.zeros(len(size.shared), len(group), len(size.corner))
        own = np.sort(group)
        for _, corner, terms in self._linearise(group) if known is None else known:
            normal.add(replace(terms, pose=np.searchsorted(own, terms.pose)), corner)
        return normal

    def _refit(
        self,
        group: IntArray,
        shared: FloatArray,
        offset: FloatArray,
        known: Sequence[Run] | None,
    ) -> Iterator[tuple[int, FloatArray]]:
        """Yield the residuals (n, 2, H) of what is seen from each pose, which is fitted anew.

        Args:
            group: the poses.
            shared: (K, H) steps of the shared unknowns.
            offset: (Q, 3, H) steps of the free corners.
            known: as in :meth:`_sum_up`.

        """
        lefts, by_poses, roots, places, tells = [], [], [], [], []
        for told, corner, terms in self._linearise(group) if known is None else known:
            left = terms.miss[:, :, None] + terms.by_shared(shared)
            if len(offset):
                left += terms.by_corner @ offset[corner]
            lefts.append(left)
            by_poses.append(terms.by_pose.copy())
            roots.append(np.maximum(terms.root, _SMALLEST_ROOT))
            places.append(terms.pose)
            tells.append(told)
        left, by_pose, root, place, known_error = map(
            np.concatenate, (lefts, by_poses, roots, places, tells)
        )
        for pose in group.tolist():
            own = np.flatnonzero(place == pose)
            flat = left[own].reshape(2 * len(own), -1)
            basis, size, _ = np.linalg.svd(by_pose[own].reshape(-1, 6), full_matrices=False)
            basis = basis[:, size > _RANK * size[:1]]
            flat = flat - basis @ (basis.T @ flat)
            after = np.asarray(flat.reshape(left[own].shape) / root[own, None, None])
            after[~known_error[own]] = np.nan
            yield pose, after


def _resolve(
    normal: NormalEquations, equations: Eliminated, change: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Solve for steps (K, H) and (Q, 3, H) where the lens's prior (H, L + 1, L + 1) changes."""
    shared, pose, corner = (
        np.repeat(part[..., None], len(change), axis=-1) for part in normal.gradient
    )
    shared[: change.shape[1] - 1] += change[:, :-1, -1].T
    step, _, offset = equations.steps(shared, pose, corner, change[:, :-1, :-1])
    return step, offset
