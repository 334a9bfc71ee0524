"""Levenberg–Marquardt over a lens, the poses of all photos and the object (Zhu & Yin, Eq. 10)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cubicfish_cli.correspondences import Correspondences
from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.normal_equations import NormalEquations, corner_terms, shared_terms
from cubicfish_cli.fitting.poses import Poses, cross_matrix
from cubicfish_cli.fitting.world import DrawnWorld, World

FloatArray = npt.NDArray[np.float64]

_MAX_ITERATIONS = 100
_RELATIVE_DECREASE = 1e-10


class FitLens(Protocol):
    """A lens that least squares can adjust."""

    @property
    def parameters(self) -> FloatArray:
        """(K,) the free parameters; K may be 0."""

    def with_parameters(self, parameters: FloatArray) -> FitLens:
        """The same lens with other parameters."""

    def project_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Camera-frame points (N, 3) -> pixel (N, 2), d/d point (N, 2, 3), d/d param (N, 2, K)."""

    def project(self, points: FloatArray) -> FloatArray:
        """Camera-frame points (N, 3) -> pixel (N, 2), without derivatives."""

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """Pseudo-observations: residuals (M,) in pixels and d/d parameters (M, K)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Adjustment:
    """Where Levenberg–Marquardt stopped.

    Attributes:
        lens: the adjusted lens.
        poses: camera_from_world of every photo.
        world: the adjusted object.
        residual: (N, 2) projection less pixel, unweighted, pixels.
        cost: robust cost at the end, priors included.
        iterations: how many steps were tried.
        normal: the normal equations at the end.

    """

    lens: FitLens
    poses: Poses
    world: World
    residual: FloatArray
    cost: float
    iterations: int
    normal: NormalEquations


def huber_weight(distance: FloatArray, scale: float) -> FloatArray:
    """IRLS weight of the Huber loss: 1 within ``scale``, then falling as 1/distance."""
    return np.minimum(1.0, scale / np.maximum(distance, 1e-300))


def huber_cost(distance: FloatArray, scale: float) -> FloatArray:
    """Huber loss: d²/2 within ``scale``, linear beyond."""
    return np.where(distance <= scale, 0.5 * np.square(distance), scale * (distance - 0.5 * scale))


@dataclass(frozen=True, eq=False)
class _State:
    lens: FitLens
    poses: Poses
    world: World

    def moved(self, shared: FloatArray, pose: FloatArray, corner: FloatArray) -> _State:
        count = len(self.lens.parameters)
        return _State(
            self.lens.with_parameters(self.lens.parameters + shared[:count]),
            self.poses.moved(pose),
            self.world.moved(shared[count:], corner),
        )


def adjust(
    lens: FitLens,
    poses: Poses,
    pairs: Correspondences,
    *,
    huber_px: float,
    world: World | None = None,
    max_iterations: int = _MAX_ITERATIONS,
    relative_decrease: float = _RELATIVE_DECREASE,
) -> Adjustment:
    """Minimise the Huber loss of the reprojection error over lens, poses and object.

    Args:
        lens: the start; its prior is part of the cost.
        poses: the start, one for each of ``pairs.images``.
        pairs: 2D-3D pairs, sorted by photo.
        huber_px: distance in pixels from which a pair's pull stops growing.
        world: the object's points and what of them is free; by default ``pairs.world``, fixed.
        max_iterations: steps to try at most.
        relative_decrease: stop when a step lowers the cost by less than this share.

    Returns:
        The best state found. A step that does not lower the cost is never taken.

    Raises:
        FitError: the start itself sees a point at infinity.

    """
    state = _State(lens, poses, DrawnWorld(pairs.world) if world is None else world)
    damping = 1e-4
    cost, residual = _cost(state, pairs, huber_px)
    if not np.isfinite(cost):
        raise FitError(
            "the start of the fit sees corners at infinity: check that the corners are named "
            "rightly and that the camera belongs to these photos"
        )
    normal = _normal_equations(state, pairs, huber_px)
    iterations = 0
    while iterations < max_iterations:
        iterations += 1
        candidate = state.moved(*normal.solve(damping))
        new_cost, new_residual = _cost(candidate, pairs, huber_px)
        if new_cost < cost:
            decrease = (cost - new_cost) / max(cost, 1e-300)
            state, cost, residual = candidate, new_cost, new_residual
            damping = max(damping / 10, 1e-12)
            normal = _normal_equations(state, pairs, huber_px)
            if decrease < relative_decrease:
                break
        else:
            damping *= 10
            if damping > 1e8:
                break
    return Adjustment(
        lens=state.lens,
        poses=state.poses,
        world=state.world,
        residual=residual,
        cost=cost,
        iterations=iterations,
        normal=normal,
    )


def _cost(state: _State, pairs: Correspondences, huber_px: float) -> tuple[float, FloatArray]:
    points = state.poses.apply(pairs.image, state.world.points)
    residual = state.lens.project(points) - pairs.pixel
    distance = np.hypot(residual[:, 0], residual[:, 1])
    prior = np.concatenate([state.lens.prior()[0], state.world.prior()[0]])
    offset = state.world.offset_weight * state.world.offsets
    with np.errstate(over="ignore"):
        cost = float(
            np.sum(pairs.weight * huber_cost(distance, huber_px))
            + 0.5 * np.sum(prior * prior)
            + 0.5 * np.sum(offset * offset)
        )
    return (cost if np.isfinite(cost) else np.inf), residual


def _normal_equations(state: _State, pairs: Correspondences, huber_px: float) -> NormalEquations:
    rotation = state.poses.rotation[pairs.image]
    rotated = (rotation @ state.world.points[:, :, None])[:, :, 0]
    points = rotated + state.poses.translation[pairs.image]
    pixel, d_point, d_lens = state.lens.project_jacobian(points)
    residual = pixel - pairs.pixel
    distance = np.hypot(residual[:, 0], residual[:, 1])
    root = np.sqrt(pairs.weight * huber_weight(distance, huber_px))[:, None, None]
    d_point = d_point * root
    d_pose = np.concatenate([-d_point @ cross_matrix(rotated), d_point], axis=2)
    d_shared = d_lens * root
    world = state.world
    free_world = len(world.parameters) > 0 or len(world.offsets) > 0
    d_world = d_point @ rotation if free_world else d_point
    if len(world.parameters):
        d_shared = np.concatenate([d_shared, world.chain(d_world)], axis=2)
    residual = residual * root[:, :, 0]
    normal = shared_terms(
        d_shared, d_pose, residual, pairs.image, len(state.poses), _priors(state.lens, world)
    )
    if len(world.offsets):
        normal = corner_terms(normal, d_shared, d_pose, d_world, residual, pairs.image, world)
    return normal


def _priors(lens: FitLens, world: World) -> tuple[FloatArray, FloatArray]:
    """The priors of lens and object as one block-diagonal set of pseudo-observations."""
    lens_prior, d_lens = lens.prior()
    world_prior, d_world = world.prior()
    jacobian = np.zeros((len(lens_prior) + len(world_prior), d_lens.shape[1] + d_world.shape[1]))
    jacobian[: len(lens_prior), : d_lens.shape[1]] = d_lens
    jacobian[len(lens_prior) :, d_lens.shape[1] :] = d_world
    return np.concatenate([lens_prior, world_prior]), jacobian
