"""What a fit would have been without some of its photos, to first order.

Near its optimum a fit without a few photos is one Gauss-Newton step away, and the equations of that
step are those of the whole fit less what these photos put in. So every photo can be left out for
the price of a small linear system, where a fit anew costs tens of iterations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from cubicfish_cli.fitting.adjustment import Adjustment, huber_weight, linearised, views_of
from cubicfish_cli.fitting.fit_lens import FitLens
from cubicfish_cli.fitting.normal_equations import (
    Eliminated,
    NormalEquations,
    runs_of_photos,
)
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.rig_lens import body_of
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import FloatArray, IntArray

# Of the diagonal: what no other photo touches stays where it is.
_DAMPING = 1e-9
_SMALLEST_WEIGHT = 1e-12
# Below this share of the largest, a singular value is rounding.
_RANK = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class _Part:
    """What one photo's n pairs put into the normal equations, all weighted."""

    shared: FloatArray  # (2n, K)
    pose: FloatArray  # (2n, 6)
    residual: FloatArray  # (2n,)
    root: FloatArray  # (n,) root of the weights
    corner: IntArray  # (n,) free corner of each pair; empty where there are none
    by_corner: FloatArray  # (n, 2, 3)

    def pull(self) -> FloatArray:
        """(n, 3) what each pair adds to the gradient of its free corner."""
        own = self.residual.reshape(-1, 2, 1)
        pulled: FloatArray = (self.by_corner.transpose(0, 2, 1) @ own)[:, :, 0]
        return pulled

    def rows(self, start: int, stop: int) -> _Part:
        """What pairs ``start`` to ``stop`` put in."""
        of_pairs, of_rows = slice(start, stop), slice(2 * start, 2 * stop)
        return _Part(
            shared=self.shared[of_rows],
            pose=self.pose[of_rows],
            residual=self.residual[of_rows],
            root=self.root[of_pairs],
            corner=self.corner[of_pairs],
            by_corner=self.by_corner[of_pairs],
        )

    @cached_property
    def _by_pose(self) -> FloatArray:
        """(2n, 6) orthonormal: what a pose can make of the residuals."""
        basis, size, _ = np.linalg.svd(self.pose, full_matrices=False)
        return np.asarray(basis[:, size > _RANK * size[:1]])

    def _without_pose(self, residual: FloatArray) -> FloatArray:
        """What a pose fitted anew leaves of residuals (2n, ...)."""
        left: FloatArray = residual - self._by_pose @ (self._by_pose.T @ residual)
        return left

    @cached_property
    def _left(self) -> tuple[FloatArray, FloatArray]:
        """(2n,) and (2n, K): residuals and their derivatives, the pose fitted anew."""
        return self._without_pose(self.residual), self._without_pose(self.shared)

    def after(self, shared: FloatArray, offset: FloatArray) -> FloatArray:
        """Residuals (n, 2, H) after steps of what is shared, the photo's pose fitted anew.

        Args:
            shared: (K, H).
            offset: (Q, 3, H).

        """
        residual, slope = self._left
        left = residual[:, None] + slope @ shared
        if len(self.corner):
            moved = (self.by_corner @ offset[self.corner]).reshape(left.shape)
            left += self._without_pose(moved)
        return left.reshape(len(self.root), 2, -1) / self.root[:, None, None]


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
        parts = _parts(fit, pairs, huber_px)
        self._fit = fit
        self._groups = [(photos, [parts[photo] for photo in photos]) for photos in groups]
        self._equations = [
            _without(fit.normal, photos, parts).eliminated(_DAMPING)
            for photos, parts in self._groups
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
        for (photos, parts), equations in zip(self._groups, self._equations, strict=True):
            step = equations.solve_changed(change)
            for photo, part in zip(photos, parts, strict=True):
                yield int(photo), part.after(*step)

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
        normal = self._fit.normal
        shared = np.zeros((len(self._groups), len(normal.shared)))
        corner = np.zeros((len(self._groups), *normal.corner_gradient.shape))
        for group, (_, parts) in enumerate(self._groups):
            for part in parts:
                shared[group] -= part.shared.T @ part.residual
                if len(part.corner):
                    np.subtract.at(corner[group], part.corner, part.pull())
        return self._equations_of_all.shared_steps(shared, corner)


def _parts(fit: Adjustment[Any], pairs: Observations, limit: float) -> list[_Part]:
    """What was seen from each pose; in one place, or one for each camera that saw the shot."""
    body, views = body_of(fit.lens), views_of(fit.lens, fit.poses)
    found: list[list[_Part]] = [[] for _ in range(len(fit.poses))]
    for photos, run in runs_of_photos(pairs.image, len(views), body.stops):
        if run.start == run.stop:
            continue
        whole = _run(fit, views, pairs, limit, run)
        numbers = np.arange(photos.start, photos.stop)
        bounds = np.searchsorted(pairs.image[run], np.append(numbers, photos.stop))
        for pose, (start, stop) in zip(body.shot_of(numbers), pairwise(bounds), strict=True):
            found[pose].append(whole.rows(start, stop))
    return [_joined(some or [whole.rows(0, 0)]) for some in found]


def _joined(some: Sequence[_Part]) -> _Part:
    if len(some) == 1:
        return some[0]
    names = [one.name for one in fields(_Part)]
    return _Part(**{name: np.concatenate([getattr(one, name) for one in some]) for name in names})


def _run(
    fit: Adjustment[Any], views: Poses, pairs: Observations, limit: float, run: slice
) -> _Part:
    terms = linearised(fit.lens, fit.poses, fit.world, pairs, run, views)
    length = np.hypot(terms.residual[:, 0], terms.residual[:, 1])
    root = np.sqrt(np.maximum(pairs.weight[run], _SMALLEST_WEIGHT) * huber_weight(length, limit))
    lens = len(fit.lens.parameters)
    boards = 0 if terms.d_board is None else terms.d_board.shape[2]
    shared = np.zeros((len(root), 2, lens + boards))
    shared[:, :, terms.columns] = terms.d_lens
    if terms.d_board is not None:
        shared[:, :, lens:] = terms.d_board
    shared *= root[:, None, None]
    pose = np.concatenate([terms.d_turn, terms.d_shift], axis=2) * root[:, None, None]
    free = len(fit.world.offsets) and terms.d_corner is not None
    return _Part(
        shared=shared.reshape(-1, shared.shape[2]),
        pose=pose.reshape(-1, 6),
        residual=(terms.residual * root[:, None]).reshape(-1),
        root=root,
        corner=fit.world.corner[run] if free else np.zeros(0, np.intp),
        by_corner=terms.d_corner * root[:, None, None] if free else np.zeros((0, 2, 3)),
    )


def _without(normal: NormalEquations, photos: IntArray, parts: Sequence[_Part]) -> NormalEquations:
    """The equations less what some photos put in; these photos' poses stay where they are."""
    count = len(normal.shared)
    columns = (6 * photos[:, None] + np.arange(6)).reshape(-1)
    shared, shared_gradient = normal.shared.copy(), normal.shared_gradient.copy()
    corner, corner_gradient = normal.corner.copy(), normal.corner_gradient.copy()
    shared_corner = normal.shared_corner.copy("K")
    pose, pose_gradient = normal.pose.copy(), normal.pose_gradient.copy()
    shared_pose, pose_corner = normal.shared_pose.copy(), normal.pose_corner.copy("K")
    pose[photos], pose_gradient[photos] = np.eye(6), 0
    shared_pose[:, columns] = 0
    pose_corner[columns] = 0
    for part in parts:
        shared -= part.shared.T @ part.shared
        shared_gradient -= part.shared.T @ part.residual
        if not len(part.corner):
            continue
        across = part.by_corner.transpose(0, 2, 1)
        np.subtract.at(corner, part.corner, across @ part.by_corner)
        np.subtract.at(corner_gradient, part.corner, part.pull())
        by_shared = across @ part.shared.reshape(-1, 2, count)  # (n, 3, K)
        places = 3 * part.corner[:, None] + np.arange(3)
        # Several cameras may see a corner in one shot.
        places = places.reshape(-1)
        rows = np.arange(len(places) + 1)
        summed = csr_array(
            (np.ones(len(places)), places, rows), shape=(len(places), shared_corner.shape[1])
        )
        shared_corner -= (summed.T @ by_shared.reshape(-1, count)).T
    return replace(
        normal,
        shared=shared,
        pose=pose,
        shared_pose=shared_pose,
        shared_gradient=shared_gradient,
        pose_gradient=pose_gradient,
        corner=corner,
        shared_corner=shared_corner,
        pose_corner=pose_corner,
        corner_gradient=corner_gradient,
    )
