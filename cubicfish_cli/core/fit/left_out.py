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

from cubicfish_cli.core.fit.adjustment import Adjustment, State, linearise
from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.normal_equations import Eliminated, NormalEquations
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

# As a share of the diagonal: unknowns without any remaining photo stay where they are.
_DAMPING = 1e-9
# Least square root of a weight, so that residuals can be divided by it.
_SMALLEST_ROOT = 1e-6
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

    def steps(self) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
        """Steps (K,), (M, 6) and (Q, 3) to the fit without each group, whose own poses stay."""
        for group in self._groups:
            yield self._subtract(group).solve(_DAMPING)

    def residuals(self, priors: FloatArray | None = None) -> Iterator[tuple[int, FloatArray]]:
        """Residuals of every photo under the fit without its group, its own pose fitted anew.

        They are computed at once for H other priors of the lens, by default for its own prior
        alone.

        Args:
            priors: (H, L + 1, L + 1) the Gram matrix of each.

        Yields:
            The photo, and (n, 2, H) pixels; NaN of pairs that do not tell their error.

        """
        own = self._fit.lens.prior()
        change = (own[None] if priors is None else priors) - own
        for group in self._groups:
            normal = self._subtract(group)
            yield from self._refit(group, *_resolve(normal, normal.eliminated(_DAMPING), change))

    def steps_under(self, lenses: Sequence[FitLens]) -> FloatArray:
        """Steps (H, K) of the shared unknowns under other lenses' priors, no photo left out."""
        change = np.array([lens.prior() for lens in lenses]) - self._fit.lens.prior()
        return _resolve(self._fit.normal, self._equations_of_all, change)[0].T

    def influence(self) -> FloatArray:
        """Steps (G, K) of the shared unknowns without each group's gradient, its Hessian kept.

        The empirical influence of a group (Jaeckel's infinitesimal jackknife).
        """
        still = np.zeros((len(self._fit.poses), 6, 1))
        steps = np.empty((len(self._groups), len(self._fit.normal.shared)))
        for step, group in zip(steps, self._groups, strict=True):
            shared, _, corner = (part[..., None] for part in self._sum_up(group).gradient)
            step[:] = self._equations_of_all.steps(-shared, still, -corner)[0][:, 0]
        return steps

    def _subtract(self, group: IntArray) -> NormalEquations:
        return self._fit.normal.without(group, self._sum_up(group))

    @cached_property
    def _equations_of_all(self) -> Eliminated:
        return self._fit.normal.eliminated(_DAMPING)

    def _select(self, group: IntArray) -> tuple[Observations, State[Any]]:
        """Select the pairs that are seen from some poses, and all unknowns that these depend on."""
        own, fit = np.flatnonzero(np.isin(self._shot, group)), self._fit
        return fit.pairs.select(own), State(fit.lens, fit.poses, fit.world.select(own))

    def _sum_up(self, group: IntArray) -> NormalEquations:
        """Sum up the contribution of the pairs that are seen from some poses to the equations.

        Only these poses are among its unknowns, in ascending order.
        """
        pairs, state = self._select(group)
        shared, _, corners = state.size
        normal, own = NormalEquations.zeros(shared, len(group), corners), np.sort(group)
        for run, terms in linearise(state, pairs, self._fit.huber_px):
            among = replace(terms, pose=np.searchsorted(own, terms.pose))
            normal.add(among, state.world.corner[run])
        return normal

    def _refit(
        self, group: IntArray, shared: FloatArray, offset: FloatArray
    ) -> Iterator[tuple[int, FloatArray]]:
        """Yield the residuals (n, 2, H) of what is seen from each pose, which is fitted anew.

        Args:
            group: the poses.
            shared: (K, H) steps of the shared unknowns.
            offset: (Q, 3, H) steps of the free corners.

        """
        pairs, state = self._select(group)
        count = len(pairs.image)
        left, by_pose = np.empty((count, 2, shared.shape[1])), np.empty((count, 2, 6))
        root, place = np.empty(count), np.empty(count, np.intp)
        for run, terms in linearise(state, pairs, self._fit.huber_px):
            left[run] = terms.miss[:, :, None] + terms.by_shared @ shared[terms.columns]
            if len(offset):
                left[run] += terms.by_corner @ offset[state.world.corner[run]]
            by_pose[run], place[run] = terms.by_pose, terms.pose
            root[run] = np.maximum(terms.root, _SMALLEST_ROOT)
        for pose in group.tolist():
            own = np.flatnonzero(place == pose)
            flat = left[own].reshape(2 * len(own), -1)
            basis, size, _ = np.linalg.svd(by_pose[own].reshape(-1, 6), full_matrices=False)
            basis = basis[:, size > _RANK * size[:1]]
            flat = flat - basis @ (basis.T @ flat)
            after = np.asarray(flat.reshape(left[own].shape) / root[own, None, None])
            after[~pairs.error_known[own]] = np.nan
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
