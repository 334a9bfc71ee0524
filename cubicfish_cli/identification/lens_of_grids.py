"""The lens that grids are named with: from planes without names, then from what is named."""

from __future__ import annotations

import numpy as np

from cubicfish_cli.errors import FitError
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.radial_reference import RadialReference, fit_radial, refit_radial
from cubicfish_cli.identification.decide import Decision
from cubicfish_cli.identification.grid_views import anonymous_pairs, on_plane, pairs_of_parts
from cubicfish_cli.identification.scene import Decisions, Scene, rigid
from cubicfish_cli.types import FloatArray


def nameless_lens(scene: Scene) -> RadialReference | None:
    """A lens from all grids as planes without names; None when they do not determine one."""
    if not scene.grids:
        return None
    try:
        return fit_radial(anonymous_pairs(scene.grids, scene.image_size))
    except FitError:
        return None


def named_lens(
    scene: Scene, reference: RadialReference, decisions: Decisions
) -> RadialReference | None:
    """The lens fitted to settled photos as whole objects and to all other grids as planes."""
    world: list[FloatArray] = []
    pixel: list[FloatArray] = []
    rotation, translation = [], []
    for own, decision in zip(scene.photos, decisions, strict=True):
        together = rigid(decision)
        if decision is not None and together:
            world.append(np.concatenate([_world(scene, own[n], decision, n) for n in together]))
            pixel.append(np.concatenate([scene.grids[own[n]].pixel for n in together]))
            rotation.append(decision.rotation)
            translation.append(decision.translation)
        for n, index in enumerate(own):
            pose = scene.poses[index]
            if n in together or pose is None:
                continue
            world.append(on_plane(scene.grids[index]))
            pixel.append(scene.grids[index].pixel)
            rotation.append(pose.rotation[0])
            translation.append(pose.translation[0])
    if not world:
        return None
    start = Poses(rotation=np.stack(rotation), translation=np.stack(translation))
    return refit_radial(reference, pairs_of_parts(world, pixel, scene.image_size), start)


def _world(scene: Scene, index: int, decision: Decision, n: int) -> FloatArray:
    board = scene.target.boards[scene.sides.board[decision.side[n]]]
    return board.world_points(*scene.cells(index, decision, n).T)
