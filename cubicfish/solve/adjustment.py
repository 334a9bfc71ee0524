"""Levenberg–Marquardt over a lens, the poses of all photos and the target (Zhu & Yin, Eq. 10).

The unknowns of an adjustment are a :class:`State`; :func:`linearise` computes its residuals and
their derivatives, run by run, and :class:`~cubicfish.solve.normal_equations.NormalEquations`
sums them up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, pairwise
from typing import Generic, Self, TypeVar

import numpy as np

from cubicfish.errors import FitError
from cubicfish.solve.deformable_target import DeformableTarget
from cubicfish.solve.descent import COLD_DAMPING
from cubicfish.solve.fit_lens import FitLens
from cubicfish.solve.normal_equations import Linearised, NormalEquations
from cubicfish.solve.poses import Poses, cross
from cubicfish.solve.statistics import wide_px
from cubicfish.target.observations import Observations
from cubicfish.types import BoolArray, FloatArray

L = TypeVar("L", bound=FitLens)

_MAX_ITERATIONS = 100
_RELATIVE_DECREASE = 1e-10
# Below this share of the cost, a decrease is lost in the rounding of the cost.
_ROUNDING = 1e-13
# Where a straight step raises the cost and the next one changes it by less than this share, this is
# the optimum as far as many photos show: there is always one whose pose rocks between two places.
_IMMATERIAL = 1e-8
# A step that should have been shorter than the first share has overshot; the least that is taken.
_OVERSHOT, _SHORTEST = 0.7, 0.25
# The last steps are those that are expected to lower the cost by no more than this share.
_LAST = 1e-2
# Least damping of poses that went astray.
_FIRM = 1.0
WARM_DAMPING = 1e-13
"""First damping for a start at the optimum of nearly the same pairs."""

# Derivatives of so many pairs by so many unknowns fit into a core's cache; larger arrays wait for
# memory.
_RUN_PAIRS, _RUN_UNKNOWNS = 1500, 60


@dataclass(frozen=True, eq=False)
class State(Generic[L]):
    """The unknowns of an adjustment.

    Attributes:
        lens: the lens.
        poses: camera_from_world of every photo; of a rig, rig_from_world of every shot.
        world: the target.

    """

    lens: L
    poses: Poses
    world: DeformableTarget

    def moved(self, shared: FloatArray, pose: FloatArray, corner: FloatArray) -> State[L]:
        """The state after a step (K,), (M, 6) and (Q, 3)."""
        count = len(self.lens.parameters)
        return State(
            self.lens.with_parameters(self.lens.parameters + shared[:count]),
            self.poses.moved(pose),
            self.world.moved(shared[count:], corner),
        )

    @property
    def size(self) -> tuple[int, int, int]:
        """The numbers of shared unknowns, poses and free corners."""
        shared = len(self.lens.parameters) + len(self.world.parameters)
        return shared, len(self.poses), len(self.world.offsets)


def huber_weight(distance: FloatArray, scale: float) -> FloatArray:
    """IRLS weight of the Huber loss: 1 within ``scale``, then falling as 1/distance."""
    return np.minimum(1.0, scale / np.maximum(distance, 1e-300))


def huber_cost(distance: FloatArray, scale: float) -> FloatArray:
    """Huber loss: d²/2 within ``scale``, linear beyond."""
    return np.where(distance <= scale, 0.5 * np.square(distance), scale * (distance - 0.5 * scale))


def linearise(
    state: State[L], pairs: Observations, huber_px: float
) -> Iterator[tuple[slice, Linearised]]:
    """Linearise all pairs by everything that is free, in runs of one camera's pairs each.

    Yields the pairs of a run and their derivatives, one run after the other.

    ``pairs`` and ``huber_px`` are those of :func:`~cubicfish.solve.adjustment.adjust`.
    """
    runs = _cut_runs(state, pairs)
    one = partial(_linearise_run, state.lens.views(state.poses), state, pairs, huber_px)
    return zip(runs, map(one, runs), strict=True)


def _cut_runs(state: State[L], pairs: Observations) -> list[slice]:
    """Cut the pairs into runs of one camera each, whose derivatives are not too large.

    They are cut between photos, whose products are then formed all at once if they are alike.
    """
    camera, count = state.lens.camera_of(pairs.image), len(pairs.image)
    size = max(_RUN_PAIRS, _RUN_PAIRS * _RUN_UNKNOWNS // (state.size[0] + 6))
    if count <= size and camera[0] == camera[-1]:
        return [slice(0, count)]
    photos = np.flatnonzero(np.diff(pairs.image)) + 1
    cuts = photos[np.diff(photos // size, prepend=0) > 0].tolist()
    ends = sorted({0, count, *cuts, *(np.flatnonzero(np.diff(camera)) + 1).tolist()})
    # A photo of very many pairs is cut too.
    parts = [
        range(first, stop, size if stop - first > 2 * size else stop - first)
        for first, stop in pairwise(ends)
    ]
    return [slice(*run) for run in pairwise([*chain.from_iterable(parts), count])]


def _linearise_run(
    views: Poses, state: State[L], pairs: Observations, huber_px: float, run: slice
) -> Linearised:
    """Linearise a run of one camera's pairs by everything that is free."""
    body, world = state.lens, state.world
    image = pairs.image[run]
    # Working on one coordinate of all points after the other is fastest.
    rotation = views.rotation.transpose(1, 2, 0)[:, :, image]
    rotated = np.einsum("ijn,jn->in", rotation, world.points[run].T)
    points = (rotated + views.translation.T[:, image]).T
    pixel, d_point, d_lens, columns = body.lens_of(int(image[0])).separate_slopes(points)
    by_point = d_point.transpose(1, 2, 0)
    d_corner, d_shape = None, []
    if world.free:
        d_corner = np.einsum("ain,ijn->ajn", by_point, rotation)
        d_shape = [world.chain(d_corner.transpose(2, 0, 1), run).transpose(1, 2, 0)]
    d_view = np.concatenate([cross(rotated, by_point), by_point], axis=1).transpose(2, 0, 1)
    own, d_body, d_pose = body.by_body(image, state.poses, d_view)
    # What the body's photos share beside the lens, and the target's parameters.
    target = np.arange(len(body.parameters), state.size[0])
    more = np.append(own[len(own) - d_body.shape[2] :], target)
    residual = pixel - pairs.pixel[run]
    length = np.hypot(residual[:, 0], residual[:, 1])
    root = np.sqrt(pairs.weight[run] * huber_weight(length, huber_px))
    return Linearised.of(
        residual,
        root,
        d_pose.transpose(1, 2, 0),
        [*d_lens, d_body.transpose(1, 2, 0), *d_shape],
        d_corner,
        np.hstack([own[columns], np.tile(more, (2, 1))]),
        body.shot_of(image),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Adjustment(State[L]):
    """The result of Levenberg–Marquardt.

    Attributes:
        residual: (N, 2) projection less pixel, unweighted, pixels.
        cost: robust cost at the end, priors included.
        iterations: how many steps were tried.
        normal: the normal equations at the end; empty after :meth:`without_equations`.
        pairs: the pairs.
        huber_px: the distance from which on the loss was linear.

    """

    residual: FloatArray
    cost: float
    iterations: int
    normal: NormalEquations
    pairs: Observations
    huber_px: float

    @property
    def errors(self) -> FloatArray:
        """(K, 2) residuals of the pairs whose error the fit can tell."""
        return self.residual[self.pairs.error_known]

    def without_equations(self) -> Self:
        """The same without the normal equations, most of its memory, to be continued from."""
        return replace(self, normal=NormalEquations.zeros(0, 0, 0))

    def again(
        self,
        pairs: Observations | None = None,
        *,
        world: DeformableTarget | None = None,
        relative_decrease: float = _RELATIVE_DECREASE,
        damping: float = COLD_DAMPING,
        limit: Callable[[FloatArray], float] = wide_px,
    ) -> Adjustment[L]:
        """Continue the adjustment, with a loss that follows the present residuals.

        The arguments are those of :func:`adjust`. By default the pairs are the same and the target
        is as free as it was; ``limit`` says of residuals (N, 2) where the loss turns linear,
        pixels.
        """
        return adjust(
            self.lens,
            self.poses,
            self.pairs if pairs is None else pairs,
            limit(self.errors),
            world=self.world if world is None else world,
            relative_decrease=relative_decrease,
            damping=damping,
        )


def adjust(
    lens: L,
    poses: Poses,
    pairs: Observations,
    huber_px: float,
    *,
    world: DeformableTarget | None = None,
    max_iterations: int = _MAX_ITERATIONS,
    relative_decrease: float = _RELATIVE_DECREASE,
    damping: float = COLD_DAMPING,
    trust_last: bool = False,
    cost_before: float = 0.0,
) -> Adjustment[L]:
    """Minimise the Huber loss of the reprojection error over lens, poses and target.

    Args:
        lens: the start; its prior is part of the cost.
        poses: the start, one for each of ``pairs.images``, or of a rig one for each shot.
        pairs: 2D-3D pairs, sorted by photo.
        huber_px: distance in pixels from which on a pair's pull stops growing.
        world: the target's points and what of them is free; by default ``pairs.world``, fixed.
        max_iterations: steps to try at most.
        relative_decrease: stop when a step lowers the cost by less than this share.
        damping: damping of the first step; less near the optimum.
        trust_last: near the optimum, take the last step without evaluating it: the one behind which
            another would lower the cost by less than that share, as steps have become smaller.
            Residuals, cost and equations are then those of the state before.
        cost_before: cost of the state from which a step led to the start; 0 where none did.

    Returns:
        The best state found. A step that does not lower the cost is never taken, unless it is
        trusted.

    Raises:
        FitError: the start itself sees a point at infinity.

    """
    now = _begin(lens, poses, world, pairs, huber_px)
    near, iterations, reach = damping < COLD_DAMPING, 0, 1.0
    before = cost_before / max(now.cost, 1e-300) - 1
    pose_damping = np.zeros((len(poses), 1))
    while iterations < max_iterations:
        step = now.normal.solve(damping, pose_damping)
        gain = now.normal.expected_decrease(step) / max(now.cost, 1e-300)
        # A step from far away, or a damped one, says too little about what is left to gain.
        left = _left_to_gain(gain, before) if trust_last else gain
        if near and left < relative_decrease and damping < COLD_DAMPING:
            if trust_last:
                now = replace(now, **vars(now.moved(*step)))
            break
        before = gain
        iterations += 1
        new = _evaluate(now.moved(*(reach * part for part in step)), pairs, huber_px)
        least = relative_decrease
        if not new.cost < now.cost and gain > _ROUNDING and iterations < max_iterations:
            iterations += 1
            least, reach = max(relative_decrease, _IMMATERIAL), 1.0
            new = _try_again(now, new, damping, pose_damping)
        if new.cost < now.cost:
            decrease = (now.cost - new.cost) / max(now.cost, 1e-300)
            reach = _find_reach(reach, gain, decrease)
            now = new
            damping = max(damping / 10, 1e-14)
            pose_damping *= 0.1
            if decrease < least:
                break
        else:
            damping *= 10
            if damping > 1e8 or _is_bottom(now.cost, new.cost, gain, least):
                break
    return replace(now, iterations=iterations)


def _begin(
    lens: L,
    poses: Poses,
    world: DeformableTarget | None,
    pairs: Observations,
    huber_px: float,
) -> Adjustment[L]:
    world = DeformableTarget(nominal=pairs.world) if world is None else world
    start = _evaluate(State(lens, poses, world), pairs, huber_px)
    if not np.isfinite(start.cost):
        raise FitError(
            "the start of the fit sees corners at infinity: check that the corners are named "
            "rightly and that the camera belongs to these photos"
        )
    return start


def _left_to_gain(gain: float, before: float) -> float:
    """The share that the step behind the next lowers the cost by, as steps have become smaller."""
    return gain * gain / before if gain < before else gain


def _is_bottom(now: float, new: float, gain: float, least: float) -> bool:
    """Whether a step failed because there is nothing to gain: by its equations, or by its cost."""
    return gain < _ROUNDING or new < (1 + least) * now


def _find_reach(reach: float, gain: float, decrease: float) -> float:
    """How much of the next step is taken, by what this one gained and what its equations said.

    Where the cost bends more than these say, the last steps lead from one side of a valley to the
    other: the next goes as far as this one should have gone.
    """
    bend = 2 * reach * gain - decrease
    wanted = reach**2 * gain / bend if gain < _LAST and bend > 0 else 1.0
    return max(wanted, _SHORTEST) if wanted < _OVERSHOT else 1.0


def _evaluate(state: State[L], pairs: Observations, huber_px: float) -> Adjustment[L]:
    """Evaluate a state and its derivatives at once: nearly every step that is tried is taken.

    Its normal equations are incomplete where the cost is infinite.
    """
    normal, world = NormalEquations.zeros(*state.size), state.world
    residual, cost = np.empty_like(pairs.pixel), 0.0
    # A step may lead anywhere: an overflow has an infinite cost, and the step is rejected.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for run, terms in linearise(state, pairs, huber_px):
            residual[run] = terms.residual
            length = np.hypot(terms.residual[:, 0], terms.residual[:, 1])
            cost += float(pairs.weight[run] @ huber_cost(length, huber_px))
            if np.isfinite(cost):
                normal.add(terms, world.corner[run])
        priors = state.lens.pulls(), world.pulls()
        offset = (world.offset_weight * world.offsets).reshape(-1)
        cost += 0.5 * float(sum(prior[-1, -1] for prior in priors) + offset @ offset)
        if np.isfinite(cost):
            normal = normal.with_pulls(priors, world)
    return Adjustment(
        **vars(state),
        residual=residual,
        cost=cost if np.isfinite(cost) else np.inf,
        iterations=0,
        normal=normal,
        pairs=pairs,
        huber_px=huber_px,
    )


def _try_again(
    now: Adjustment[L], new: Adjustment[L], damping: float, pose_damping: FloatArray
) -> Adjustment[L]:
    """Try another step where one to ``new`` raised the cost, for the commonest reasons of that.

    ``pose_damping`` (M, 1) grows where poses went astray: these alone are damped firmly, and stop
    no others.
    """
    astray = _find_astray(now, new)
    if astray.any():
        pose_damping[astray] = np.maximum(10 * pose_damping[astray], _FIRM)
        state = now.moved(*now.normal.solve(damping, pose_damping))
    elif np.isfinite(new.cost):
        # A bent valley: the straight step ended on its side, above its floor.
        state = new.moved(*new.normal.solve(damping))
    else:
        return new
    return _evaluate(state, now.pairs, now.huber_px)


def _find_astray(now: Adjustment[L], new: Adjustment[L]) -> BoolArray:
    """Find poses (M,) whose cost a step raised by far while it lowered the others'; else none.

    Among many photos there is always one whose pose goes astray.
    """
    count = len(now.poses)
    shot = now.lens.shot_of(now.pairs.image)
    rise = np.zeros(count)
    for sign, of in ((1, new), (-1, now)):
        cost = huber_cost(np.hypot(of.residual[:, 0], of.residual[:, 1]), now.huber_px)
        rise += sign * np.bincount(shot, now.pairs.weight * cost, count)
    known = np.isfinite(rise)
    risen = ~known | (rise > np.abs(rise[known]).sum() / count)
    return risen & bool(rise[~risen].sum() < 0)
