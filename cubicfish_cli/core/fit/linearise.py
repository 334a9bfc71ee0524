"""All that an adjustment moves, and its residuals with their derivatives (Eq. 10)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from cubicfish_cli.core.fit.deformable_target import DeformableTarget
from cubicfish_cli.core.fit.fit_lens import FitLens
from cubicfish_cli.core.fit.normal_equations import Linearised, runs_of_photos
from cubicfish_cli.core.fit.poses import Poses, cross, cross_matrix
from cubicfish_cli.core.fit.rig_lens import body_of
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.types import FloatArray

L = TypeVar("L", bound=FitLens)

_POSE = 6


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


def huber_weight(distance: FloatArray, scale: float) -> FloatArray:
    """IRLS weight of the Huber loss: 1 within ``scale``, then falling as 1/distance."""
    return np.minimum(1.0, scale / np.maximum(distance, 1e-300))


def huber_cost(distance: FloatArray, scale: float) -> FloatArray:
    """Huber loss: d²/2 within ``scale``, linear beyond."""
    return np.where(distance <= scale, 0.5 * np.square(distance), scale * (distance - 0.5 * scale))


def runs_linearised(
    lens: FitLens, poses: Poses, world: DeformableTarget, pairs: Observations, huber_px: float
) -> Iterator[tuple[slice, slice, Linearised, FloatArray]]:
    """All pairs in runs of whole photos: photos, pairs, derivatives, and roots of the weights.

    The arguments are those of :func:`~cubicfish_cli.core.fit.adjustment.adjust`.
    """
    body = body_of(lens, len(poses))
    views = body.views(poses)
    unknowns = len(lens.parameters) + len(world.parameters) + _POSE
    for photos, run in runs_of_photos(pairs.image, len(views), body.starts, unknowns):
        if run.start < run.stop:
            terms = linearised(body, poses, world, pairs, run, views)
            length = np.hypot(terms.residual[:, 0], terms.residual[:, 1])
            yield photos, run, terms, np.sqrt(pairs.weight[run] * huber_weight(length, huber_px))


def linearised(
    lens: FitLens,
    poses: Poses,
    world: DeformableTarget,
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
