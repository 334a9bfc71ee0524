"""Turns of a target after which it looks the same, and what its corners are called then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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

    def names(
        self, board: IntArray, column: IntArray, row: IntArray
    ) -> tuple[IntArray, IntArray, IntArray]:
        """Board, column and row (N,) of the corners whose places corners (N,) take."""
        cell = np.stack([column, row], axis=-1)[..., None]
        onto = (self.turn[board] @ cell)[..., 0] + self.offset[board]
        return self.board[board], onto[:, 0], onto[:, 1]


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
        side = np.array([sides.wholes[board][0][place[k]] for board, (_, place) in enumerate(landed)])
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
