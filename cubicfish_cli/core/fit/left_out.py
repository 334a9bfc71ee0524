"""What a fit would have been without some of its photos, to first order.

Near its optimum a fit without a few photos is one Gauss-Newton step away, and the equations of that
step are those of the whole fit less what these photos put in. So every photo can be left out for
the price of a small linear system, where a fit anew costs tens of iterations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cubicfish_cli.core.fit.adjustment import Adjustment
from cubicfish_cli.core.fit.deformable_target import DeformableTarget
from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.linearise import runs_linearised
from cubicfish_cli.core.fit.normal_equations import (
    Eliminated,
    Linearised,
    Nearly,
    NormalEquations,
    NormalSums,
)
from cubicfish_cli.core.fit.rig_lens import body_of
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray, IntArray

# As a share of the diagonal: unknowns that no remaining photo touches stay where they are.
_DAMPING = 1e-9
# Least square root of a weight, so that residuals can be divided by it.
_SMALLEST_ROOT = 1e-6
# Below this share of the largest, a singular value is rounding.
_RANK = 1e-12


class LeaveOneOut:
    """Leaves groups of photos out of a fit, to first order."""

    def __init__(
        self,
        fit: Adjustment[Any],
        pairs: Observations,
        huber_px: float,
        groups: Sequence[IntArray],
    ) -> None:
        """Note what is to be left out of which fit.

        Args:
            fit: the fit to all photos, at its optimum.
            pairs: its pairs, sorted by photo.
            huber_px: where its loss turns linear.
            groups: photos (of a rig: shots) that are left out together.

        """
        self._fit, self._pairs, self._huber_px, self._groups = fit, pairs, huber_px, groups
        self._shot = body_of(fit.lens, len(fit.poses)).shot_of(pairs.image)

    def steps(self) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
        """Steps (K,), (M, 6) and (Q, 3) to the fit without each group, whose own poses stay."""
        for group, put_in in zip(self._groups, self._put_in, strict=True):
            yield self._without(group, put_in).solve()

    def residuals(self, priors: FloatArray | None = None) -> Iterator[tuple[int, FloatArray]]:
        """Residuals of every photo under the fit without its group, its own pose fitted anew.

        All at once for H other priors of the lens, by default for its own alone.

        Args:
            priors: (H, L + 1, L + 1) the Gram matrix of each.

        Yields:
            The photo, and (n, 2, H) pixels; NaN of pairs that do not tell their error.

        """
        own = self._fit.lens.prior()
        change = (own[None] if priors is None else priors) - own
        for group in self._groups:
            seen = self._seen(group)
            equations = self._without(group, self._sums(seen))
            yield from seen.after(group, *equations.solve_changed(change))

    def held_as(self, lenses: Sequence[FitLens]) -> FloatArray:
        """Steps (H, K) of the shared unknowns with no photo left out, under others' priors."""
        change = np.array([lens.prior() for lens in lenses]) - self._fit.lens.prior()
        return self._equations_of_all.solve_changed(change)[0].T

    def influence(self) -> FloatArray:
        """Steps (G, K) of the shared unknowns without each group's gradient, its Hessian kept.

        The empirical influence of a group (Jaeckel's infinitesimal jackknife).
        """
        normal, groups = self._fit.normal, len(self._groups)
        shared = np.empty((groups, *normal.shared_gradient.shape))
        corner = np.empty((groups, *normal.corner_gradient.shape))
        for group, put_in in enumerate(self._put_in):
            shared[group], corner[group] = -put_in.shared_gradient, -put_in.corner_gradient
        return self._equations_of_all.shared_steps(shared, corner)

    def _without(self, group: IntArray, put_in: NormalEquations) -> Eliminated:
        """The equations less what was seen from some poses, which put this into them."""
        corners = np.flatnonzero(put_in.corner.any(axis=(1, 2)))
        known = Nearly(self._equations_of_all, group, corners)
        return self._fit.normal.without(group, put_in).eliminated(_DAMPING, known=known)

    @cached_property
    def _equations_of_all(self) -> Eliminated:
        return self._fit.normal.eliminated(_DAMPING)

    @cached_property
    def _put_in(self) -> list[NormalEquations]:
        return [self._sums(self._seen(group)) for group in self._groups]

    def _seen(self, group: IntArray) -> _Seen:
        """What is seen from some poses."""
        fit, own = self._fit, np.flatnonzero(np.isin(self._shot, group))
        pairs, world = self._pairs.select(own), fit.world.select(own)
        runs = runs_linearised(fit.lens, fit.poses, world, pairs, self._huber_px)
        return _Seen(pairs=pairs, world=world, runs=tuple(runs))

    def _sums(self, seen: _Seen) -> NormalEquations:
        """What it puts into the equations, of what all photos share."""
        lens, boards = len(self._fit.lens.parameters), len(seen.world.parameters)
        sums = NormalSums(lens, boards, len(self._fit.poses), seen.world)
        for photos, run, terms, root in seen.runs:
            sums.add(terms, root, photos, seen.pairs.image[run], run)
        return sums.equations().of_shared()


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """What is seen from some poses: pairs, their points, and runs as :func:`runs_linearised`'s."""

    pairs: Observations
    world: DeformableTarget
    runs: Sequence[tuple[slice, slice, Linearised, FloatArray]]

    def after(
        self, group: IntArray, shared: FloatArray, offset: FloatArray
    ) -> Iterator[tuple[int, FloatArray]]:
        """Residuals (n, 2, H) of what is seen from each pose, which is fitted anew.

        Args:
            group: the poses.
            shared: (K, H) steps of what is shared.
            offset: (Q, 3, H) those of free corners.

        """
        count, lens = len(self.pairs.image), len(shared) - len(self.world.parameters)
        left, by_pose = np.empty((count, 2, shared.shape[1])), np.empty((count, 2, 6))
        root, place = np.empty(count), np.empty(count, np.intp)
        for _, run, terms, roots in self.runs:
            root[run], place[run] = np.maximum(roots, _SMALLEST_ROOT), terms.pose
            left[run] = terms.residual[:, :, None] + terms.d_lens @ shared[terms.columns]
            left[run] += terms.d_board @ shared[lens:]
            if len(self.world.corner):
                left[run] += terms.d_corner @ offset[self.world.corner[run]]
            by_pose[run, :, :3], by_pose[run, :, 3:] = terms.d_turn, terms.d_shift
        order = np.argsort(place, kind="stable")
        bounds = np.searchsorted(place[order], [group, group + 1]).T
        for pose, (first, stop) in zip(group.tolist(), bounds.tolist(), strict=True):
            own = order[first:stop]
            weight = root[own, None, None]
            flat = (weight * left[own]).reshape(2 * len(own), -1)
            basis, size, _ = np.linalg.svd(
                (weight * by_pose[own]).reshape(-1, 6), full_matrices=False
            )
            basis = basis[:, size > _RANK * size[:1]]
            flat = flat - basis @ (basis.T @ flat)
            after = np.asarray(flat.reshape(left[own].shape) / weight)
            after[~self.pairs.tells_error[own]] = np.nan
            yield pose, after
