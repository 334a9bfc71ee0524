"""Turns of a target after which it looks the same, and what its corners are called then."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cubicfish_cli.observations import Observations
from cubicfish_cli.placement import SAME, placement_of
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray, IntArray

# Objects of more boards are not searched.
_MOST_BOARDS = 16
_SAME_SCALE = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class Symmetry:
    """A motion that carries all boards of a target onto boards, colours of squares included.

    Attributes:
        rotation, shift: (3, 3) and (3,), of points in the target's units.
        board: (B,) index of the board that each board covers then.
        turn: (B, 2, 2) and
        offset: (B, 2): column and row there are turn · (column, row) + offset.

    """

    rotation: FloatArray
    shift: FloatArray
    board: IntArray
    turn: IntArray
    offset: IntArray

    def named(self, seen: Observations, target: Target, scale: float = 1.0) -> Observations:
        """Corners by the names of those whose places they take, and their world points.

        Args:
            seen: corners of the target, which boards are indices into its.
            target: the target.
            scale: its units in one unit of world points.

        """
        cell = np.stack([seen.column, seen.row], axis=-1)[..., None]
        onto = (self.turn[seen.board] @ cell)[..., 0] + self.offset[seen.board]
        board, column, row = self.board[seen.board], onto[:, 0], onto[:, 1]
        world = target.world_points(board, column, row) / scale
        return replace(seen, board=board, column=column, row=row, world=world)


def symmetries(target: Target) -> tuple[Symmetry, ...]:
    """All that a target has, but for no motion at all.

    It is judged as drawn, without the shapes of its boards. Markers and lists of points have none.
    """
    boards = range(len(target.boards))
    plain = all(board.has_squares and board.markers is None for board in target.boards)
    if not plain or len(boards) > _MOST_BOARDS:
        return ()
    sides = placement_of(target.with_flat_boards())
    matrix, shift = sides.motions(0)
    landed = [sides.landing(matrix, shift, board) for board in boards]
    found = []
    for k in range(len(matrix)):
        same_size = abs(np.linalg.det(matrix[k]) - 1) < _SAME_SCALE
        if not same_size or max(error[k] for error, _ in landed) >= SAME:
            continue
        side = np.array(
            [sides.wholes[board][0][place[k]] for board, (_, place) in enumerate(landed)]
        )
        if (side == 4 * np.arange(len(boards))).all():
            continue
        turn = sides.matrix[side]
        last = (turn @ (sides.size[::4] - 1)[..., None])[..., 0]
        found.append(
            Symmetry(
                rotation=matrix[k],
                shift=shift[k],
                board=sides.board[side],
                turn=turn,
                offset=-np.minimum(last, 0),
            )
        )
    return tuple(found)


def renamed(seen: Observations, target: Target, motions: Mapping[str, Symmetry]) -> Observations:
    """The same corners, those of some photos by the names that a motion gives them.

    Args:
        seen: corners of a target.
        target: the target.
        motions: of the photos whose corners get other names, by the photos' names.

    """
    if not motions:
        return seen
    index = np.array([target.board_names.index(name) for name in seen.boards], np.intp)
    own = replace(seen, boards=target.board_names, board=index[seen.board])
    number = {photo: way for way, photo in enumerate(motions, 1)}
    return chosen(
        [own, *(motion.named(own, target) for motion in motions.values())],
        np.array([number.get(photo, 0) for photo in seen.images], np.intp),
    )


def best_named(
    seen: Observations, target: Target, squared: Callable[[Observations], FloatArray]
) -> Observations:
    """The same corners, those of each photo by the names under which they are off by least.

    Args:
        seen: corners of a target, their boards indices into its.
        target: the target.
        squared: (N,) squared errors of these corners by other names, with their world points.

    """
    namings = [seen, *(motion.named(seen, target) for motion in symmetries(target))]
    if len(namings) == 1:
        return seen
    photos = len(seen.images)
    sums = [
        np.bincount(seen.image, np.nan_to_num(squared(one), nan=np.inf), photos) for one in namings
    ]
    return chosen(namings, np.argmin(sums, axis=0))


def chosen(namings: Sequence[Observations], way: IntArray) -> Observations:
    """The same corners, those of each photo by the names of one of W namings, (M,) below W."""
    rows = way[namings[0].image]
    names: dict[str, Any] = {
        name: np.stack([getattr(one, name) for one in namings])[rows, np.arange(len(rows))]
        for name in ("board", "column", "row", "world")
    }
    return replace(namings[0], **names)
