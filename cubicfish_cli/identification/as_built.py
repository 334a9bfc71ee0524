"""Where the boards really are: a target is never quite as drawn.

A box glued by hand is off by millimetres. Then the right names fit badly, and a symmetry of the
drawing is none of the target: names that differ from photo to photo by such a symmetry would
blur it. Each named grid says where its board is in front of the camera, so the photos together
say how the boards lie to each other, and names that fit this target agree from photo to photo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cubicfish_cli.geometry import mean_rotation
from cubicfish_cli.identification.decide import Decided
from cubicfish_cli.identification.scene import Decisions, Scene, rigid
from cubicfish_cli.placement import Placement
from cubicfish_cli.types import FloatArray

# Grids that fit the target this much worse than planes of their own, and miss it by this share
# of the distance of neighbouring corners: it is not as drawn.
_OFF_RATIO, _OFF_STEPS = 1.5, 0.01
# One photo fits whatever it measures, so that several must show boards together.
_LEAST_PHOTOS_TO_MEASURE = 3


def decided_as_built(scene: Scene, decisions: Decisions) -> tuple[Placement, Decisions]:
    """Decide again with the boards where the photos have them, if they are not as drawn.

    The photo that shows most says how the boards lie first, so that all names agree with one
    photo's; all photos say it then. Kept only if it explains more, or the same better.
    """
    photos = range(len(decisions))
    together = sum(bool(rigid(decision)) for decision in decisions)
    if together < _LEAST_PHOTOS_TO_MEASURE or not _off_the_drawing(scene, decisions):
        return scene.sides, decisions
    built, trial = scene.sides, decisions
    reference = max(photos, key=lambda photo: _extent(scene, decisions, photo))
    for some in ([reference], photos):
        sightings = [one for photo in some for one in _sightings(scene, trial, photo)]
        built = built_sides(built, sightings)
        trial = scene.decide_all(built)
    others = [photo for photo in photos if photo != reference]
    if _merit(scene, trial, others) > _merit(scene, decisions, others):
        return built, trial
    return scene.sides, decisions


class Sighting(NamedTuple):
    """Where one photo has one board.

    Attributes:
        board: index into the target's boards.
        weight: the square of how many corners say so.
        turned: (3, 3) world directions of its columns, rows and depth.
        place: (2,) the middle of what is seen, on the board.
        point: (3,) that in the world.

    """

    board: int
    weight: float
    turned: FloatArray
    place: FloatArray
    point: FloatArray


def built_sides(sides: Placement, sightings: Sequence[Sighting]) -> Placement:
    """The sides with every board where the sightings have it on average.

    Boards without a sighting stay where they are.
    """
    origin, axes, frame = sides.origin.copy(), sides.axes.copy(), sides.frame.copy()
    for board in {one.board for one in sightings}:
        own = [one for one in sightings if one.board == board]
        _, weight, turned, place, point = map(np.array, zip(*own, strict=True))
        mean = mean_rotation(turned, weight)
        rows = np.flatnonzero(sides.board == board)
        origin[rows] = np.average(point - place @ mean[:, :2].T, axis=0, weights=weight)
        axes[rows] = mean[:, :2]
        ij = axes[rows] @ sides.matrix[rows]
        frame[rows] = np.concatenate([ij, np.cross(ij[..., 0], ij[..., 1])[..., None]], axis=-1)
    return replace(sides, origin=origin, axes=axes, frame=frame)


def _off_the_drawing(scene: Scene, decisions: Decisions) -> bool:
    """Whether named grids fit the target clearly worse than planes of their own."""
    ratio, share = [], []
    for own, decision in zip(scene.photos, decisions, strict=True):
        for n in rigid(decision):
            pose = scene.poses[own[n]]
            if pose is not None and decision is not None:
                ratio.append(decision.rms_px[n] / max(pose.rms_px, 1e-3))
                share.append(decision.rms_px[n] / scene.grids[own[n]].step)
    return bool(ratio) and bool(np.median(ratio) > _OFF_RATIO and np.median(share) > _OFF_STEPS)


def _extent(scene: Scene, decisions: Decisions, photo: int) -> tuple[int, int]:
    """Boards and corners that a photo shows together."""
    decision = decisions[photo]
    named = rigid(decision)
    if decision is None or not named:
        return 0, 0
    boards = len(np.unique(scene.sides.board[decision.side[named]]))
    return boards, sum(len(scene.grids[scene.photos[photo][n]]) for n in named)


def _sightings(scene: Scene, decisions: Decisions, photo: int) -> list[Sighting]:
    decision, sides, seen = decisions[photo], scene.sides, []
    for n in rigid(decision):
        index = scene.photos[photo][n]
        pose, cells = scene.poses[index], scene.grids[index].cells
        if pose is None or decision is None:
            continue
        side, middle = decision.side[n], cells.mean(axis=0)
        square, back = sides.square[side], np.eye(3)
        back[:2, :2] = sides.matrix[side].T
        in_camera = square * (pose.rotation[0][:, :2] @ middle + pose.translation[0])
        seen.append(
            Sighting(
                board=int(sides.board[side]),
                weight=float(len(cells) ** 2),
                turned=decision.rotation.T @ pose.rotation[0] @ back,
                place=square * (sides.matrix[side] @ middle + decision.offset[n]),
                point=decision.rotation.T @ (in_camera - decision.translation),
            )
        )
    return seen


def _merit(scene: Scene, decisions: Decisions, photos: Sequence[int]) -> tuple[int, float]:
    """Corners named exactly, then how well they fit, in some photos."""
    corners, square = 0, 0.0
    for photo in photos:
        decision = decisions[photo]
        for n, index in enumerate(scene.photos[photo]):
            if decision is not None and decision.verdict[n] is Decided.NAMED:
                corners += len(scene.grids[index])
                square += len(scene.grids[index]) * np.nan_to_num(decision.rms_px[n]) ** 2
    return corners, -float(square)
