"""What a fit would have been without some of its photos, to first order.

Near its optimum a fit without a few photos is one Gauss-Newton step away, and the equations of that
step are those of the whole fit less what these photos put in. So every photo can be left out for
the price of a small linear system, where a fit anew costs tens of iterations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from cubicfish_cli.fitting.adjustment import Adjustment, runs_linearised
from cubicfish_cli.fitting.fit_lens import FitLens
from cubicfish_cli.fitting.normal_equations import Eliminated, summed_by_corner
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import FloatArray, IntArray

# Of the diagonal: what no other photo touches stays where it is.
_DAMPING = 1e-9
_SMALLEST_ROOT = 1e-6
# Below this share of the largest, a singular value is rounding.
_RANK = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """What n pairs put into the normal equations, all weighted by their roots."""

    rows: FloatArray  # (n, 2, K + 1) by what is shared; the residual is last
    pose: FloatArray  # (n, 2, 6)
    root: FloatArray  # (n,) root of the weights
    corner: IntArray  # (n,) free corner of each pair; empty where there are none
    by_corner: FloatArray  # (n, 2, 3)
    place: IntArray  # (n,) the pose that each is seen from

    @classmethod
    def of(cls, fit: Adjustment[Any], pairs: Observations, huber_px: float) -> Seen:
        """Of all pairs of a fit."""
        lens, count = len(fit.lens.parameters), len(pairs.image)
        shared = lens + len(fit.world.parameters)
        seen = cls(
            rows=np.zeros((count, 2, shared + 1)),
            pose=np.empty((count, 2, 6)),
            root=np.empty(count),
            corner=fit.world.corner,
            by_corner=np.empty((count, 2, 3)),
            place=np.empty(count, np.intp),
        )
        for _, run, terms, root in runs_linearised(fit.lens, fit.poses, fit.world, pairs, huber_px):
            seen.root[run] = root = np.maximum(root, _SMALLEST_ROOT)
            weight = root[:, None, None]
            rows = seen.rows[run]
            np.multiply(terms.d_lens, weight, out=rows[:, :, terms.columns])
            np.multiply(terms.d_board, weight, out=rows[:, :, lens:shared])
            np.multiply(terms.residual, root[:, None], out=rows[:, :, shared])
            np.multiply(terms.d_turn, weight, out=seen.pose[run, :, :3])
            np.multiply(terms.d_shift, weight, out=seen.pose[run, :, 3:])
            np.multiply(terms.d_corner, weight, out=seen.by_corner[run])
            seen.place[run] = terms.pose
        return seen

    def select(self, poses: IntArray) -> Seen:
        """What is seen from some poses."""
        own = np.isin(self.place, poses)
        names = [one.name for one in fields(Seen) if len(getattr(self, one.name))]
        return replace(self, **{name: getattr(self, name)[own] for name in names})

    def sums(self, corners: int) -> tuple[FloatArray, FloatArray]:
        """Summed up: (K + 1, K + 1), and (Q, 3, K + 4) by free corners, see ``without``."""
        rows = self.rows.reshape(2 * len(self.rows), -1)
        by_corner = np.zeros((0, 3, rows.shape[1] + 3))
        if corners:
            whole = np.concatenate([self.rows, self.by_corner], axis=2)
            by_corner = summed_by_corner(self.corner, corners, self.by_corner, whole)
        return rows.T @ rows, by_corner

    def after(self, pose: int, shared: FloatArray, offset: FloatArray) -> FloatArray:
        """Residuals (n, 2, H) of what is seen from a pose, which is fitted anew.

        Args:
            pose: the pose.
            shared: (K, H) steps of what is shared.
            offset: (Q, 3, H) those of free corners.

        """
        own = np.flatnonzero(self.place == pose)
        left = self.rows[own, :, -1:] + self.rows[own, :, :-1] @ shared
        if len(self.corner):
            left += self.by_corner[own] @ offset[self.corner[own]]
        basis, size, _ = np.linalg.svd(self.pose[own].reshape(-1, 6), full_matrices=False)
        basis = basis[:, size > _RANK * size[:1]]
        flat = left.reshape(len(basis), -1)
        flat = flat - basis @ (basis.T @ flat)
        return np.asarray(flat.reshape(left.shape) / self.root[own, None, None])


class Leaving:
    """A fit, ready to be taken apart into groups of photos and the others."""

    def __init__(
        self,
        fit: Adjustment[Any],
        pairs: Observations,
        huber_px: float,
        groups: Sequence[IntArray],
    ) -> None:
        """Work out what every group puts into the equations.

        Args:
            fit: the fit to all photos, at its optimum.
            pairs: its pairs, sorted by photo.
            huber_px: where its loss turns linear.
            groups: photos to be left out together.

        """
        self._fit = fit
        corners = len(fit.world.offsets)
        seen = Seen.of(fit, pairs, huber_px)
        parts = [(photos, seen.select(photos)) for photos in groups]
        self._groups = [(photos, own, *own.sums(corners)) for photos, own in parts]
        self._equations = [
            fit.normal.without(photos, gram, by_corner).eliminated(_DAMPING)
            for photos, _, gram, by_corner in self._groups
        ]

    def steps(self) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """Steps (K,), (M, 6) and (Q, 3) to the fit without each group; its own poses' are 0."""
        return [equations.solve() for equations in self._equations]

    def residuals(self, priors: FloatArray | None = None) -> Iterator[tuple[int, FloatArray]]:
        """Residuals of every photo under the fit without its group, its own pose fitted anew.

        All at once for H other priors of the lens, by default for its own alone.

        Args:
            priors: (H, L + 1, L + 1) the Gram matrix of each.

        Yields:
            The photo, and (n, 2, H) pixels.

        """
        own = self._fit.lens.prior()
        change = (own[None] if priors is None else priors) - own
        for (photos, seen, _, _), equations in zip(self._groups, self._equations, strict=True):
            step = equations.solve_changed(change)
            for photo in photos.tolist():
                yield photo, seen.after(photo, *step)

    def held_as(self, lens: FitLens) -> FloatArray:
        """Step (K,) of the shared unknowns with no photo left out, under another lens's prior."""
        change = lens.prior() - self._fit.lens.prior()
        return self._equations_of_all.solve_changed(change[None])[0][:, 0]

    @cached_property
    def _equations_of_all(self) -> Eliminated:
        return self._fit.normal.eliminated(_DAMPING)

    def influence(self) -> FloatArray:
        """Steps (G, K) of the shared unknowns with each group's pull gone, but not its weight.

        The empirical influence of a group (Jaeckel's infinitesimal jackknife): what it adds to the
        gradient counts, its share of the equations stays.
        """
        normal, groups = self._fit.normal, len(self._groups)
        shared = np.zeros((groups, *normal.shared_gradient.shape))
        corner = np.zeros((groups, *normal.corner_gradient.shape))
        for group, (_, _, gram, by_corner) in enumerate(self._groups):
            shared[group], corner[group] = -gram[:-1, -1], -by_corner[:, :, -4]
        return self._equations_of_all.shared_steps(shared, corner)
