"""Where the boards really are, measured with no drawing but each board's own grid of squares.

Every board in every photo is taken as a flat thing of its own: a lens and a pose for each follow
from that. Where two boards are in one photo, their poses give one's place in the other's frame,
and that it is the same in all photos gives the ratio of their squares.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.fitting.poses import Poses
from cubicfish_cli.fitting.radial_reference import RadialReference, fit_radial
from cubicfish_cli.geometry import mean_rotation
from cubicfish_cli.observations import Observations
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray, IntArray

_FEWEST_CORNERS = 12
_FEWEST_LINES = 3
_FEWEST_LINKS = 3
_ROUNDS = 20
# Photos must agree on where a board is to this many squares, or it moved between them.
_AGREE = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredBoard:
    """Where a board is: points are ``origin + plane @ axes`` of plane coordinates in squares.

    Attributes:
        origin: (3,) in the first board's frame and squares.
        axes: (2, 3) steps of a square along x and y.

    """

    origin: FloatArray
    axes: FloatArray

    def points(self, plane: FloatArray) -> FloatArray:
        """Plane coordinates in squares (..., 2) -> (..., 3)."""
        return np.asarray(self.origin + plane @ self.axes)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredObject:
    """The boards that could be measured, by index, in one frame, and the lens that did it."""

    boards: dict[int, MeasuredBoard]
    lens: RadialReference


def plane_in_squares(board: Board, column: IntArray, row: IntArray) -> FloatArray:
    """(N, 2) place of corners on their board, in squares."""
    return np.asarray(board.plane_points(column, row) / board.square)


def measured_object(pairs: Observations, target: Target) -> MeasuredObject | None:
    """Measure the object.

    Returns:
        None where there are no boards, or they cannot be put together.

    Raises:
        FitError: the boards by themselves do not fit a lens.

    """
    views = _views(pairs, target)
    if views is None:
        return None
    lens = fit_radial(views)
    photo, board = np.array([name.split(":") for name in lens.pairs.images], np.intp).T
    boards = np.unique(board)
    seen = np.zeros((len(pairs.images), len(target.boards)), np.intp) - 1
    seen[photo, board] = np.arange(len(photo))
    first = int(boards[np.argmax([(board == one).sum() for one in boards])])
    identity = MeasuredBoard(origin=np.zeros(3), axes=np.eye(3)[:2])
    placed = {first: identity}
    while len(placed) < len(boards):
        links = {
            (known, new): int(((seen[:, known] >= 0) & (seen[:, new] >= 0)).sum())
            for known in placed
            for new in boards.tolist()
            if new not in placed
        }
        (known, new), most = max(links.items(), key=lambda link: link[1])
        if most < _FEWEST_LINKS:
            break
        both = (seen[:, known] >= 0) & (seen[:, new] >= 0)
        step = _relative(lens.poses, seen[both, known], seen[both, new])
        if step is None:
            break
        placed[new] = _after(placed[known], step)
    return MeasuredObject(boards=placed, lens=lens) if placed else None


def _views(pairs: Observations, target: Target) -> Observations | None:
    """Each board in each photo as a photo of one flat board, in squares; None without any."""
    world = np.zeros_like(pairs.world)
    usable = np.zeros(len(world), bool)
    for index, board in enumerate(target.boards):
        own = np.flatnonzero(pairs.board == index)
        if board.points is not None or not own.size:
            continue
        world[own, :2] = plane_in_squares(board, pairs.column[own], pairs.row[own])
        for photo in np.unique(pairs.image[own]):
            here = own[pairs.image[own] == photo]
            lines = min(len(np.unique(pairs.column[here])), len(np.unique(pairs.row[here])))
            usable[here] = len(here) >= _FEWEST_CORNERS and lines >= _FEWEST_LINES
    if not usable.any():
        return None
    views, image = np.unique(
        np.stack([pairs.image, pairs.board], axis=1)[usable], axis=0, return_inverse=True
    )
    seen = replace(
        pairs.select(usable).with_world(world[usable]),
        images=tuple(f"{photo}:{board}" for photo, board in views),
        image=image.reshape(-1).astype(np.intp),
        board=np.zeros(len(image), np.intp),
        boards=("board",),
    )
    return seen.by_photo()


def _relative(
    poses: Poses, one: IntArray, other: IntArray
) -> tuple[FloatArray, float, FloatArray] | None:
    """Rotation (3, 3), scale and shift (3,) from another board's frame to one's.

    Medians by reweighting: a board nearly square to the camera may lean the wrong way in a photo.
    """
    back = poses.rotation[one].transpose(0, 2, 1)
    turns = back @ poses.rotation[other]
    u = (back @ poses.translation[other][:, :, None])[:, :, 0]
    v = (back @ poses.translation[one][:, :, None])[:, :, 0]
    weight = np.ones(len(one))
    rotation = turns[0]
    for _ in range(_ROUNDS):
        rotation = mean_rotation(turns, weight)
        weight = 1 / np.maximum(np.linalg.norm(turns - rotation, axis=(1, 2)), 1e-6)
    weight = np.ones(len(one))
    system = np.zeros((len(one), 3, 4))
    system[:, :, 0] = u
    system[:, :, 1:] = -np.eye(3)
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)[:, None]
        solution = np.linalg.lstsq(
            (system * root[:, :, None]).reshape(-1, 4), (v * root).reshape(-1), rcond=None
        )[0]
        miss = np.linalg.norm(system @ solution - v, axis=1)
        weight = 1 / np.maximum(miss, 1e-6)
    if solution[0] <= 0 or np.median(miss) > _AGREE:
        return None
    return np.array(rotation, float), float(solution[0]), np.array(solution[1:], float)


def _after(known: MeasuredBoard, step: tuple[FloatArray, float, FloatArray]) -> MeasuredBoard:
    """A board that is placed in the frame of a known one, in the frame of that one's own."""
    rotation, scale, shift = step
    size = float(np.linalg.norm(known.axes[0]))
    frame = np.vstack([known.axes, np.cross(known.axes[0], known.axes[1]) / size])
    return MeasuredBoard(
        origin=known.origin + shift @ frame, axes=scale * rotation[:, :2].T @ frame
    )
