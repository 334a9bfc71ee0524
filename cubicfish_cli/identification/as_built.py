"""Where the boards really are: an object is never quite as drawn.

A box glued by hand is off by millimetres. Then the right names fit badly, and a symmetry of the
drawing is none of the object: names that differ from photo to photo by such a symmetry would
blur it. Each named grid says where its board is in front of the camera, so the photos together
say how the boards lie to each other, and names that fit this object agree from photo to photo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cubicfish_cli.geometry import mean_rotation
from cubicfish_cli.identification.decide import Decided
from cubicfish_cli.identification.placement import Placement
from cubicfish_cli.identification.scene import Decisions, Scene, rigid
from cubicfish_cli.types import FloatArray, IntArray

# Grids that fit the object this much worse than planes of their own, and miss it by this share
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Sighting:
    """One named grid in one photo.

    Attributes:
        side, offset: its place.
        middle: (2,) mean cell.
        rotation: (3, 3) camera_from_grid.
        camera_middle: (3,) the mean cell in the camera frame, squares.
        camera_from_world: the photo's rotation (3, 3) and translation (3,).
        corners: how many corners it has.

    """

    side: int
    offset: IntArray
    middle: FloatArray
    rotation: FloatArray
    camera_middle: FloatArray
    camera_from_world: tuple[FloatArray, FloatArray]
    corners: int


def built_sides(sides: Placement, sightings: Sequence[Sighting]) -> Placement:
    """The sides with every board where the sightings have it on average.

    Boards without a sighting stay where they are.
    """
    origin, axes, frame = sides.origin.copy(), sides.axes.copy(), sides.frame.copy()
    for board in np.unique(sides.board):
        own = [one for one in sightings if sides.board[one.side] == board]
        if not own:
            continue
        rows = np.flatnonzero(sides.board == board)
        turned, corner = _placed(sides, own)
        origin[rows] = corner
        axes[rows] = turned[:, :2]
        ij = axes[rows] @ sides.matrix[rows]
        frame[rows] = np.concatenate([ij, np.cross(ij[..., 0], ij[..., 1])[..., None]], axis=-1)
    return replace(sides, origin=origin, axes=axes, frame=frame)


def _placed(sides: Placement, own: Sequence[Sighting]) -> tuple[FloatArray, FloatArray]:
    """World directions of a board's columns, rows and depth (3, 3), and its corner (0, 0)."""
    weight = np.array([one.corners**2 for one in own], float)
    turns, points, cells = [], [], []
    for one in own:
        rotation, translation = one.camera_from_world
        back = np.eye(3)
        back[:2, :2] = sides.matrix[one.side].T
        turns.append(rotation.T @ one.rotation @ back)
        seen = sides.square[one.side] * one.camera_middle
        points.append(rotation.T @ (seen - translation))
        cells.append(sides.matrix[one.side] @ one.middle + one.offset)
    turned = mean_rotation(np.stack(turns), weight)
    square = sides.square[own[0].side]
    corner = np.stack(points) - square * np.stack(cells) @ turned[:, :2].T
    return turned, np.average(corner, axis=0, weights=weight)


def _off_the_drawing(scene: Scene, decisions: Decisions) -> bool:
    """Whether named grids fit the object clearly worse than planes of their own."""
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
    decision, seen = decisions[photo], []
    for n in rigid(decision):
        index = scene.photos[photo][n]
        pose = scene.poses[index]
        if pose is None or decision is None:
            continue
        middle = scene.grids[index].cells.mean(axis=0)
        rotation = pose.rotation[0]
        seen.append(
            Sighting(
                side=int(decision.side[n]),
                offset=decision.offset[n],
                middle=middle,
                rotation=rotation,
                camera_middle=rotation[:, :2] @ middle + pose.translation[0],
                camera_from_world=(decision.rotation, decision.translation),
                corners=len(scene.grids[index]),
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
