"""Where on a target a grid can lie: which board, turned how, and moved by how many squares.

A grid counts its corners (i, j) from its own first cell. On the board the same corner is
(column, row) = turn · (i, j) + offset, with one of four quarter turns: photos are not mirrored.
A board in one of its four turns is called a *side* here; a place is a side and an offset.

Two labelings of the same grids are congruent when a similarity of space (turn, shift, scale)
carries every named corner's place under the one onto its place under the other: the same photo
is then explained equally well from another camera position. Some come from a symmetry of the
whole target, such as half a turn of a board with even sides, and are harmless: the turned target
is the same target. The others are slides along something that shows no end.

The module also finds the turns of a target after which it looks the same, and the names that its
corners then have.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import BoolArray, FloatArray, IntArray

TURNS = np.array(
    [[[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]], np.intp
)
# Places that agree this well, in squares, are the same place.
SAME = 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class Placement:
    """All boards of a target in all four turns: S of them.

    Attributes:
        board: (S,) index into the target's boards.
        turn: (S,) index into :data:`TURNS`.
        size: (S, 2) columns and rows of the board.
        square: (S,) side of its squares, in the target's units.
        origin: (S, 3) world position of its corner (0, 0).
        axes: (S, 3, 2) world directions of growing column and growing row.
        colour: (S,) +1 when the square down-right of corner (0, 0) is light, else -1.

    """

    board: IntArray
    turn: IntArray
    size: IntArray
    square: FloatArray
    origin: FloatArray
    axes: FloatArray
    colour: IntArray

    @cached_property
    def matrix(self) -> IntArray:
        """(S, 2, 2) the turn of each."""
        return TURNS[self.turn]

    @cached_property
    def frame(self) -> FloatArray:
        """(S, 3, 3) world directions of the grid's i, j and of i x j."""
        ij = self.axes @ self.matrix
        return np.concatenate([ij, np.cross(ij[..., 0], ij[..., 1])[..., None]], axis=-1)

    @property
    def sizes_seen(self) -> IntArray:
        """(S, 2) corners of the board along the grid's i and j."""
        return np.abs(np.swapaxes(self.matrix, -1, -2) @ self.size[..., None])[..., 0]

    def world_from_grid(self, side: IntArray, offset: IntArray) -> FloatArray:
        """(K,) sides and (K, 2) offsets -> (K, 3, 3): (i, j, 1) to world points."""
        square = self.square[side][:, None]
        shift = (self.axes[side] @ offset[:, :, None].astype(float))[:, :, 0]
        return np.stack(
            [
                square * self.frame[side][:, :, 0],
                square * self.frame[side][:, :, 1],
                self.origin[side] + square * shift,
            ],
            axis=-1,
        )

    @cached_property
    def wholes(self) -> list[tuple[IntArray, FloatArray]]:
        """Find where each board's whole pattern lies on the target.

        For each board, (P,) the sides that it covers, colours included, the first of them its own
        upright one, and (P, 4, 3) world points of its outermost corners there.
        """
        found = []
        for upright in range(0, len(self.board), 4):
            last = self.size[upright] - 1
            offset = -np.minimum(self.matrix @ last, 0)
            fits = (np.abs(self.matrix) @ (last + 1) == self.size).all(axis=1)
            fits &= offset.sum(axis=1) % 2 == self.flips(int(self.colour[upright]))
            side = np.flatnonzero(fits)
            side = side[np.argsort(side != upright, kind="stable")]
            cells = np.array([[0, 0, 1], [last[0], 0, 1], [*last, 1], [0, last[1], 1]], float)
            form = self.world_from_grid(side, offset[side])
            found.append((side, cells @ np.swapaxes(form, -1, -2)))
        return found

    def flips(self, parity: int) -> BoolArray:
        """(S,) whether a grid's colours differ from a side's own where their cells (0, 0) meet.

        ``parity`` is +1 when the square down-right of the grid's cell (0, 0) is light, else -1.
        """
        # A quarter turn swaps the two colours that meet at a corner.
        return np.asarray((self.colour * parity < 0) ^ (self.turn % 2 == 1))

    def motions(self, board: int) -> tuple[FloatArray, FloatArray]:
        """(P, 3, 3), (P, 3) matrices and shifts that carry a board onto each of its places."""
        side, places = self.wholes[board]
        scale = self.square[side] / self.square[4 * board]
        matrix = scale[:, None, None] * (self.frame[side] @ self.frame[4 * board].T)
        return matrix, places.mean(axis=1) - matrix @ places[0].mean(axis=0)

    def landing(self, matrix: FloatArray, shift: FloatArray) -> IntArray | None:
        """The sides (B,) that boards cover after a motion; None where one board covers none.

        Args:
            matrix: (3, 3) a turn, times a scale.
            shift: (3,).

        """
        landed = []
        for side, places in self.wholes:
            apart = np.linalg.norm(places[0] @ matrix.T + shift - places, axis=-1)
            off = apart.max(axis=-1) / self.square[side]
            if off.min() >= SAME:
                return None
            landed.append(side[off.argmin()])
        return np.array(landed)

    def board_cells(self, side: int, offset: IntArray, cells: IntArray) -> IntArray:
        """(N, 2) columns and rows of the grid's cells at one place."""
        return cells @ self.matrix[side].T + offset


def placement_of(target: Target) -> Placement:
    """All sides of the boards that carry a plain grid of squares (with or without markers)."""
    boards = [index for index, board in enumerate(target.boards) if board.has_squares]
    board = np.repeat(np.array(boards, np.intp), 4)
    each = [target.boards[index] for index in board]
    return Placement(
        board=board,
        turn=np.tile(np.arange(4), len(boards)),
        size=np.array([(one.columns, one.rows) for one in each], np.intp).reshape(-1, 2),
        square=np.array([one.square for one in each]),
        origin=np.array([one.origin for one in each]).reshape(-1, 3),
        axes=np.array([np.column_stack([o.x_axis, o.y_axis]) for o in each]).reshape(-1, 3, 2),
        # The squares up-left and down-right of a corner have one colour.
        colour=np.array([1 if one.first_square == "light" else -1 for one in each], np.intp),
    )


# Objects of more boards are not searched.
_MOST_BOARDS = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class Symmetry:
    """A motion that carries all boards of a target onto boards, colours of squares included.

    Attributes:
        rotation, shift: (3, 3) and (3,), of points in the target's units.
        board: (B,) index of the board that each board then covers.
        turn: (B, 2, 2) and
        offset: (B, 2): column and row there are turn · (column, row) + offset.

    """

    rotation: FloatArray
    shift: FloatArray
    board: IntArray
    turn: IntArray
    offset: IntArray

    def named(self, seen: Observations, target: Target, scale: float = 1.0) -> Observations:
        """Name each corner after the one whose place it takes, with that corner's world point.

        Args:
            seen: corners of the target; ``board`` is an index into the target's boards.
            target: the target.
            scale: the target's units in one unit of world points.

        """
        cell = np.stack([seen.column, seen.row], axis=-1)[..., None]
        onto = (self.turn[seen.board] @ cell)[..., 0] + self.offset[seen.board]
        board, column, row = self.board[seen.board], onto[:, 0], onto[:, 1]
        world = target.world_points(board, column, row) / scale
        return replace(seen, board=board, column=column, row=row, world=world)


def symmetries(target: Target) -> tuple[Symmetry, ...]:
    """All symmetries that a target has, except the identity.

    They are those of the nominal target, without the shapes of its boards. Markers and lists of
    points have none.
    """
    boards = target.boards
    plain = all(board.has_squares and board.markers is None for board in boards)
    if not plain or len(boards) > _MOST_BOARDS:
        return ()
    sides = placement_of(target.with_flat_boards())
    found = []
    for matrix, shift in zip(*sides.motions(0), strict=True):
        side = sides.landing(matrix, shift)
        if side is None or (side == 4 * np.arange(len(boards))).all():
            continue
        turn = sides.matrix[side]
        last = (turn @ (sides.size[::4] - 1)[..., None])[..., 0]
        found.append(
            Symmetry(
                rotation=matrix,
                shift=shift,
                board=sides.board[side],
                turn=turn,
                offset=-np.minimum(last, 0),
            )
        )
    return tuple(found)


def renamed(seen: Observations, target: Target, motions: Mapping[str, Symmetry]) -> Observations:
    """The same corners; in some photos, a motion of the target gives them other names.

    Args:
        seen: corners of a target.
        target: the target.
        motions: the motions for photos whose corners get other names, by the photos' names.

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
    """The same corners, named in each photo as gives the smallest errors.

    Args:
        seen: corners of a target; ``board`` is an index into the target's boards.
        target: the target.
        squared: gives (N,) squared errors of these corners under other names, with their world
            points.

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
    """The same corners; each photo has its names from one of W namings, (M,) below W."""
    rows = way[namings[0].image]
    names: dict[str, Any] = {
        name: np.stack([getattr(one, name) for one in namings])[rows, np.arange(len(rows))]
        for name in ("board", "column", "row", "world")
    }
    return replace(namings[0], **names)
