"""All that an adjustment moves, and its residuals with their derivatives (Eq. 10)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Generic, TypeVar

import numpy as np

from cubicfish_cli.core.fit.deformable_target import DeformableTarget
from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.normal_equations import Linearised
from cubicfish_cli.core.fit.poses import Poses, cross, cross_matrix
from cubicfish_cli.core.fit.rig_lens import RigLens, body_of
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray

L = TypeVar("L", bound=FitLens)

# Derivatives of so many pairs by so many unknowns fit into a core's cache; larger arrays wait for
# memory.
_RUN_PAIRS, _RUN_UNKNOWNS = 1000, 60


@dataclass(frozen=True, eq=False)
class State(Generic[L]):
    """All that an adjustment moves: lens, poses and target."""

    lens: L
    poses: Poses
    world: DeformableTarget

    def moved(self, shared: FloatArray, pose: FloatArray, corner: FloatArray) -> State[L]:
        """After a step (K,), (M, 6) and (Q, 3)."""
        count = len(self.lens.parameters)
        return State(
            self.lens.with_parameters(self.lens.parameters + shared[:count]),
            self.poses.moved(pose),
            self.world.moved(shared[count:], corner),
        )

    @property
    def size(self) -> tuple[int, int, int]:
        """How many shared unknowns, poses and free corners."""
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
    """All pairs with their derivatives, in runs of one camera's: which pairs, and these.

    ``pairs`` and ``huber_px`` are those of :func:`~cubicfish_cli.core.fit.adjustment.adjust`.
    """
    body = body_of(state.lens, len(state.poses))
    views, camera = body.views(state.poses), body.camera[pairs.image]
    size = max(_RUN_PAIRS, _RUN_PAIRS * _RUN_UNKNOWNS // (state.size[0] + 6))
    cuts = np.union1d(np.arange(0, len(camera), size), np.flatnonzero(np.diff(camera)) + 1)
    for first, stop in pairwise([*cuts.tolist(), len(camera)]):
        run = slice(first, stop)
        yield run, _linearised(body, views, state, pairs, run, huber_px)


def _linearised(
    body: RigLens,
    views: Poses,
    state: State[L],
    pairs: Observations,
    run: slice,
    huber_px: float,
) -> Linearised:
    """A run of one camera's pairs, by everything that is free."""
    image, world = pairs.image[run], state.world
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
    d_pose = np.concatenate([cross(rotated, by_point).transpose(2, 0, 1), d_point], axis=2)
    parts = [d_lens]
    if through.place is not None:
        turned, shift = through.place
        if through.free:
            # A turn of the camera on the body swings the whole way from the body's origin with it.
            arm = cross_matrix(views.translation[image] - shift)
            parts += [d_pose[:, :, :3] - d_point @ arm, d_point]
        d_pose = np.concatenate([d_pose[:, :, :3] @ turned, d_pose[:, :, 3:] @ turned], axis=2)
    residual = pixel - pairs.pixel[run]
    length = np.hypot(residual[:, 0], residual[:, 1])
    root = np.sqrt(pairs.weight[run] * huber_weight(length, huber_px))
    d_shared = np.concatenate([*parts, world.chain(d_corner, run)], axis=2)
    weight = root[:, None, None]
    return Linearised(
        residual=residual,
        root=root,
        miss=residual * root[:, None],
        by_shared=d_shared * weight,
        columns=np.r_[through.columns, body.columns[-1].stop : state.size[0]],
        by_pose=d_pose * weight,
        by_corner=d_corner * weight,
        pose=body.shot_of(image),
    )
