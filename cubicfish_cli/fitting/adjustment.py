"""Levenberg–Marquardt over a lens, the poses of all photos and the target (Zhu & Yin, Eq. 10)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np

from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting import robust
from cubicfish_cli.fitting.fit_lens import FitLens
from cubicfish_cli.fitting.normal_equations import (
    Linearised,
    NormalEquations,
    NormalSums,
    damped,
    runs_of_photos,
)
from cubicfish_cli.fitting.poses import Poses, cross, cross_matrix
from cubicfish_cli.fitting.rig_lens import RigLens, body_of
from cubicfish_cli.fitting.subset import select
from cubicfish_cli.fitting.world import World
from cubicfish_cli.observations import Observations
from cubicfish_cli.types import FloatArray, IntArray

L = TypeVar("L", bound=FitLens)

_MAX_ITERATIONS = 100
_RELATIVE_DECREASE = 1e-10
# Below this share, what is left to gain is lost in the rounding of the cost.
_ROUNDING = 1e-13
# Where a straight step leads up, and on from there the cost changes by less than this share, it is
# the bottom as far as many photos tell: there is always one whose pose rocks between two places.
_IMMATERIAL = 1e-8
# Steps of a photo that goes on by itself, each of which has to lower its cost by this share.
_POSE_ROUNDS = 20
_POSE_DECREASE = 1e-6
# What residuals say of their noise is less certain than this share.
_SAME_LIMIT = 0.02
# What an adjustment looks at of its pairs, beside their world points.
_OF_PAIRS = ("image", "pixel", "weight")
_POSE = 6
COLD_DAMPING = 1e-4
WARM_DAMPING = 1e-10
"""For a start at the optimum of nearly the same pairs."""


@dataclass(frozen=True, eq=False)
class State(Generic[L]):
    """All that an adjustment moves: lens, poses and target."""

    lens: L
    poses: Poses
    world: World

    def moved(self, shared: FloatArray, pose: FloatArray, corner: FloatArray) -> State[L]:
        """After a step (K,), (M, 6) and (Q, 3)."""
        count = len(self.lens.parameters)
        return State(
            self.lens.with_parameters(self.lens.parameters + shared[:count]),
            self.poses.moved(pose),
            self.world.moved(shared[count:], corner),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Adjustment(Generic[L]):
    """Where Levenberg–Marquardt stopped.

    Attributes:
        lens: the adjusted lens.
        poses: camera_from_world of every photo; of a rig, rig_from_world of every shot.
        world: the adjusted target.
        residual: (N, 2) projection less pixel, unweighted, pixels.
        cost: robust cost at the end, priors included.
        iterations: how many steps were tried.
        normal: the normal equations at the end.
        pairs: the pairs.
        huber_px: from where on the loss was linear.
        sums: what the pairs put into ``normal``; None where lens, poses and world are a step ahead.

    """

    lens: L
    poses: Poses
    world: World
    residual: FloatArray
    cost: float
    iterations: int
    normal: NormalEquations
    pairs: Observations
    huber_px: float
    sums: NormalSums | None

    @property
    def state(self) -> State[L]:
        """Where it stopped."""
        return State(self.lens, self.poses, self.world)

    def again(
        self,
        pairs: Observations,
        *,
        world: World | None = None,
        relative_decrease: float = _RELATIVE_DECREASE,
        damping: float = COLD_DAMPING,
        limit: Callable[[FloatArray], float] = robust.wide_px,
    ) -> Adjustment[L]:
        """Adjust on from here, with a loss that follows what residuals there are.

        The arguments are those of :func:`adjust`; the target is by default as free as it was, and
        ``limit`` says of residuals (N, 2) where the loss turns linear, pixels.
        """
        return adjust(
            self.lens,
            self.poses,
            pairs,
            huber_px=limit(self.residual),
            world=self.world if world is None else world,
            relative_decrease=relative_decrease,
            damping=damping,
            known=self,
        )


def huber_weight(distance: FloatArray, scale: float) -> FloatArray:
    """IRLS weight of the Huber loss: 1 within ``scale``, then falling as 1/distance."""
    return np.minimum(1.0, scale / np.maximum(distance, 1e-300))


def huber_cost(distance: FloatArray, scale: float) -> FloatArray:
    """Huber loss: d²/2 within ``scale``, linear beyond."""
    return np.where(distance <= scale, 0.5 * np.square(distance), scale * (distance - 0.5 * scale))


def adjust(
    lens: L,
    poses: Poses,
    pairs: Observations,
    *,
    huber_px: float,
    world: World | None = None,
    max_iterations: int = _MAX_ITERATIONS,
    relative_decrease: float = _RELATIVE_DECREASE,
    damping: float = COLD_DAMPING,
    trust_last: bool = False,
    known: Adjustment[Any] | None = None,
) -> Adjustment[L]:
    """Minimise the Huber loss of the reprojection error over lens, poses and target.

    Args:
        lens: the start; its prior is part of the cost.
        poses: the start, one for each of ``pairs.images``, or of a rig one for each shot.
        pairs: 2D-3D pairs, sorted by photo.
        huber_px: distance in pixels from which a pair's pull stops growing.
        world: the target's points and what of them is free; by default ``pairs.world``, fixed.
        max_iterations: steps to try at most.
        relative_decrease: stop when a step lowers the cost by less than this share.
        damping: of the first step; less near the optimum.
        trust_last: near the optimum, also take the step that is too small to be worth looking at.
            Lens, poses and target are then right to its square; what is said of residuals, cost
            and equations is of the state before.
        known: an adjustment that may have ended in this start, if perhaps under other priors: what
            it knows of the pairs is not worked out again. Its ``huber_px`` stays where this one is
            nearly the same.

    Returns:
        The best state found. A step that does not lower the cost is never taken.

    Raises:
        FitError: the start itself sees a point at infinity.

    """
    state = State(lens, poses, World(as_drawn=pairs.world) if world is None else world)
    if known is not None and abs(huber_px / known.huber_px - 1) < _SAME_LIMIT:
        huber_px = known.huber_px
    now = _known(known, state, pairs, huber_px) or _evaluated(state, pairs, huber_px)
    if now.normal is None:
        raise FitError(
            "the start of the fit sees corners at infinity: check that the corners are named "
            "rightly and that the camera belongs to these photos"
        )
    normal, sums = now.normal, now.sums
    near, iterations = damping < COLD_DAMPING, 0
    held = np.zeros((len(poses), 1))
    while iterations < max_iterations:
        step = normal.solve(damping, held)
        gain = normal.expected_decrease(step) / max(now.cost, 1e-300)
        # Far from the optimum, or damped, a step says too little of what is left to gain.
        if near and gain < relative_decrease and damping < COLD_DAMPING:
            if trust_last:
                state, sums = state.moved(*step), None
            break
        iterations += 1
        candidate = state.moved(*step)
        new = _evaluated(candidate, pairs, huber_px)
        stray = not new.cost < now.cost and gain > _ROUNDING and iterations < max_iterations
        if stray:
            iterations += 1
            raised = _raised(candidate, new.residual, now.residual, pairs, huber_px)
            if raised.size:
                # Of many photos there is always one that goes astray: it must not stop the others.
                candidate = _settled(candidate, state.poses, raised, pairs, huber_px, held)
            elif new.normal is not None:
                # A valley that bends: what went straight on is on its side, above its floor.
                candidate = candidate.moved(*new.normal.solve(damping))
            new = _evaluated(candidate, pairs, huber_px)
        least = max(relative_decrease, _IMMATERIAL) if stray else relative_decrease
        if new.normal is not None and new.cost < now.cost:
            decrease = (now.cost - new.cost) / max(now.cost, 1e-300)
            state, now, normal, sums = candidate, new, new.normal, new.sums
            damping = max(damping / 10, 1e-12)
            held *= 0.1
            if decrease < least:
                break
        else:
            damping *= 10
            if damping > 1e8 or gain < _ROUNDING or new.cost < (1 + least) * now.cost:
                break
    return Adjustment(
        lens=state.lens,
        poses=state.poses,
        world=state.world,
        residual=now.residual,
        cost=now.cost,
        iterations=iterations,
        normal=normal,
        pairs=pairs,
        huber_px=huber_px,
        sums=sums,
    )


@dataclass(frozen=True, eq=False)
class _Evaluation:
    """Cost, residuals and normal equations of a state; None where the cost is infinite."""

    cost: float
    residual: FloatArray
    normal: NormalEquations | None = None
    sums: NormalSums | None = None


def _evaluated(state: State[Any], pairs: Observations, huber_px: float) -> _Evaluation:
    """Evaluate a state with its derivatives at once: nearly every step that is tried is taken."""
    lens, world = state.lens, state.world
    sums = NormalSums(len(lens.parameters), len(world.parameters), len(state.poses), world)
    residual, finite = np.empty_like(pairs.pixel), True
    # A step may lead anywhere: what overflows there has an infinite cost and is turned down.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for photos, run, terms, root in runs_linearised(lens, state.poses, world, pairs, huber_px):
            residual[run] = terms.residual
            finite = finite and bool(np.isfinite(terms.residual).all())
            if finite:
                sums.add(terms, root, photos, pairs.image[run], run)
    if not finite:
        return _Evaluation(np.inf, residual)
    return _with_priors(state, pairs, huber_px, residual, sums)


def _raised(
    state: State[Any],
    residual: FloatArray,
    before: FloatArray,
    pairs: Observations,
    huber_px: float,
) -> IntArray:
    """Poses whose cost a step raised by far, where it lowers that of the others; else none."""
    count = len(state.poses)
    shot = body_of(state.lens, count).shot_of(pairs.image)
    rise = _by_pose(residual, pairs, huber_px, shot, count)
    rise -= _by_pose(before, pairs, huber_px, shot, count)
    known = np.isfinite(rise)
    raised = ~known | (rise > np.abs(rise[known]).sum() / count)
    return np.flatnonzero(raised) if rise[~raised].sum() < 0 else np.zeros(0, np.intp)


def _settled(
    candidate: State[L],
    before: Poses,
    raised: IntArray,
    pairs: Observations,
    huber_px: float,
    held: FloatArray,
) -> State[L]:
    """A candidate in which some poses are at an optimum of their own, each near where it was.

    How firmly they have to be held (M, 1) for their steps to lead down is written into the last
    argument.
    """
    body = body_of(candidate.lens, len(before))
    shot = body.shot_of(pairs.image)
    chosen = np.isin(shot, raised)
    own, views = select(pairs, chosen)
    world = World(as_drawn=candidate.world.points[chosen])
    seen_from = np.searchsorted(raised, body.shot[views])
    body = replace(body, camera=body.camera[views], shot=seen_from)
    poses = before[raised]
    damping = np.full((len(raised), 1), COLD_DAMPING)
    firm = damping.copy()
    cost, equations = _pose_equations(State(body, poses, world), own, huber_px)
    for _ in range(_POSE_ROUNDS):
        hessian = damped(equations[:, :, :6], damping)
        step = np.asarray(np.linalg.solve(hessian, -equations[:, :, 6:]), float)
        tried = poses.moved(step[:, :, 0])
        less, by_tried = _pose_equations(State(body, tried, world), own, huber_px)
        better = less < cost
        more_to_gain = np.where(better, less < (1 - _POSE_DECREASE) * cost, damping[:, 0] < 1e8)
        lower = np.flatnonzero(better)
        poses = poses.with_photos(lower, tried[lower])
        equations[lower], cost[lower] = by_tried[lower], less[lower]
        firm = np.where(better[:, None], damping, firm)
        damping *= np.where(better, 0.1, 10.0)[:, None]
        if not more_to_gain.any():
            break
    held[raised] = np.maximum(100 * held[raised], 10 * firm)
    return replace(candidate, poses=candidate.poses.with_photos(raised, poses))


def _pose_equations(
    state: State[RigLens], pairs: Observations, huber_px: float
) -> tuple[FloatArray, FloatArray]:
    """Cost (M,) of each pose's pairs, and their normal equations for it (M, 6, 7)."""
    count = len(state.poses)
    residual, equations = np.empty_like(pairs.pixel), np.zeros((count, 6, 7))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        runs = runs_linearised(state.lens, state.poses, state.world, pairs, huber_px)
        for _, run, terms, root in runs:
            residual[run] = terms.residual
            rows = np.concatenate([terms.d_turn, terms.d_shift, terms.residual[:, :, None]], axis=2)
            rows *= root[:, None, None]
            np.add.at(equations, terms.pose, rows[:, :, :6].transpose(0, 2, 1) @ rows)
        shot = state.lens.shot_of(pairs.image)
        return _by_pose(residual, pairs, huber_px, shot, count), equations


def _by_pose(
    residual: FloatArray, pairs: Observations, huber_px: float, shot: IntArray, count: int
) -> FloatArray:
    """(M,) what each pose's pairs put into the cost."""
    distance = np.hypot(residual[:, 0], residual[:, 1])
    return np.bincount(shot, pairs.weight * huber_cost(distance, huber_px), count).astype(float)


def _known(
    fit: Adjustment[Any] | None, state: State[Any], pairs: Observations, huber_px: float
) -> _Evaluation | None:
    """A state that another adjustment ended in; None where its sums are not those of this one."""
    if fit is None or fit.sums is None or fit.poses is not state.poses:
        return None
    same = (
        all(getattr(fit.pairs, name) is getattr(pairs, name) for name in _OF_PAIRS)
        and type(fit.lens) is type(state.lens)
        and np.array_equal(fit.lens.parameters, state.lens.parameters)
        and fit.world.offsets.shape == state.world.offsets.shape
        and fit.world.parameters.shape == state.world.parameters.shape
        and np.array_equal(fit.world.points, state.world.points)
    )
    longest = np.hypot(fit.residual[:, 0], fit.residual[:, 1]).max()
    if not same or (longest > min(huber_px, fit.huber_px) and huber_px != fit.huber_px):
        return None
    return _with_priors(state, pairs, huber_px, fit.residual, fit.sums)


def _with_priors(
    state: State[Any],
    pairs: Observations,
    huber_px: float,
    residual: FloatArray,
    sums: NormalSums,
) -> _Evaluation:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        priors = state.lens.prior(), state.world.prior()
        cost = _cost(residual, pairs, huber_px, priors, state.world)
    if not np.isfinite(cost):
        return _Evaluation(np.inf, residual)
    return _Evaluation(cost, residual, sums.equations(priors[0], state.world), sums)


def _cost(
    residual: FloatArray,
    pairs: Observations,
    huber_px: float,
    priors: Sequence[FloatArray],
    world: World,
) -> float:
    distance = np.hypot(residual[:, 0], residual[:, 1])
    offset = (world.offset_weight * world.offsets).reshape(-1)
    pulls = sum(float(prior[-1, -1]) for prior in priors) + offset @ offset
    return float(pairs.weight @ huber_cost(distance, huber_px) + 0.5 * pulls)


def runs_linearised(
    lens: FitLens, poses: Poses, world: World, pairs: Observations, huber_px: float
) -> Iterator[tuple[slice, slice, Linearised, FloatArray]]:
    """All pairs in runs of whole photos: photos, pairs, derivatives, and roots of the weights.

    The arguments are those of :func:`adjust`.
    """
    body = body_of(lens, len(poses))
    views = body.views(poses)
    unknowns = len(lens.parameters) + len(world.parameters) + _POSE
    for photos, run in runs_of_photos(pairs.image, len(views), body.stops, unknowns):
        if run.start < run.stop:
            terms = linearised(body, poses, world, pairs, run, views)
            length = np.hypot(terms.residual[:, 0], terms.residual[:, 1])
            yield photos, run, terms, np.sqrt(pairs.weight[run] * huber_weight(length, huber_px))


def views_of(lens: FitLens, poses: Poses) -> Poses:
    """camera_from_world of every photo: of a rig, what each camera saw of each shot."""
    return body_of(lens, len(poses)).views(poses)


def linearised(
    lens: FitLens,
    poses: Poses,
    world: World,
    pairs: Observations,
    run: slice,
    views: Poses | None = None,
) -> Linearised:
    """Residuals of a run of one camera's pairs and their derivatives by everything that is free.

    Args:
        lens: the lens, or those of a rig.
        poses: one per photo, or per shot of a rig.
        world: the target.
        pairs: all pairs.
        run: which of them.
        views: of all photos, where they are known already.

    """
    body = body_of(lens, len(poses))
    views = body.views(poses) if views is None else views
    image = pairs.image[run]
    # One coordinate of all points after the other is the quickest to work on.
    rotation = views.rotation.transpose(1, 2, 0)[:, :, image]
    rotated = np.einsum("ijn,jn->in", rotation, world.points[run].T)
    points = (rotated + views.translation.T[:, image]).T
    through = body.through(int(image[0]))
    pixel, d_point, d_lens = through.lens.project_jacobian(points)
    by_point = d_point.transpose(1, 2, 0)
    d_corner = np.zeros((len(image), 2, 3))
    if world.free:
        d_corner = np.einsum("ain,ijn->ajn", by_point, rotation).transpose(2, 0, 1)
    d_turn, d_shift = cross(rotated, by_point).transpose(2, 0, 1), d_point
    if through.place is not None:
        turned, shift = through.place
        if through.free:
            # A turn of the camera on the body swings the whole way from the body's origin with it.
            arm = cross_matrix(views.translation[image] - shift)
            d_lens = np.concatenate([d_lens, d_turn - d_shift @ arm, d_shift], axis=2)
        d_turn, d_shift = d_turn @ turned, d_shift @ turned
    return Linearised(
        residual=pixel - pairs.pixel[run],
        d_lens=d_lens,
        columns=through.columns,
        d_board=world.chain(d_corner, run),
        d_turn=d_turn,
        d_shift=d_shift,
        d_corner=d_corner,
        pose=body.shot_of(image),
    )
