"""Turns of a target after which all of it, or what one photo shows of it, looks the same.

Everything is judged on the target as drawn, with the same rules that name corners in photos.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.geometry import Similarity, similarity
from cubicfish_cli.identification.placement import Placement, is_symmetry, placement_of, reach_of
from cubicfish_cli.target import Target
from cubicfish_cli.types import BoolArray, FloatArray, IntArray

# A turn after which boards lie this close to boards, in squares, is nearly a symmetry.
NEARLY = 0.1
# Boards that a turn brings this close to boards, in squares, look the same in a photo: corners
# are some hundredths of a square wrong, and as far as that can be, so is a lens from one photo.
ALIKE = 0.03
# Objects of more plain boards are not searched for groups of boards that look alike.
_MOST_BOARDS = 16
# Candidate motions times places that are compared at a time, to bound memory.
_AT_A_TIME = 100_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """A motion of the object after which some or all of its boards cover boards again.

    Attributes:
        boards: names of the boards that do.
        onto: for each of them, the name of the board that it then covers.
        angle_deg: by how much the object is turned, 0 to 180.
        axis: (3,) unit direction about which, by the right-hand rule.
        point: (3,) a point of the axis (of a screw's, where the motion also shifts along it),
            the nearest to the middle of what is turned.
        error: the largest distance that is left between corners, in squares.

    """

    boards: tuple[str, ...]
    onto: tuple[str, ...]
    angle_deg: float
    axis: FloatArray
    point: FloatArray
    error: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PlainBoards:
    """The plain boards, and where each board's pattern, whole, lies on the object.

    Attributes:
        sides: their sides; board b is upright at side 4 b.
        names: (B,) their names.
        outline: (B, 4, 3) world points of the outermost corners.
        side: for each board, (P,) the sides that its whole pattern covers, colours included.
        places: for each board, (P, 4, 3) its outline there.

    """

    sides: Placement
    names: tuple[str, ...]
    outline: FloatArray
    side: list[IntArray]
    places: list[FloatArray]

    @classmethod
    def of(cls, target: Target) -> PlainBoards:
        """Those of a target."""
        sides = placement_of(target)
        outline, covered, places = [], [], []
        for upright in range(0, len(sides.board), 4):
            last = sides.size[upright] - 1
            cells = np.array([[0, 0], [last[0], 0], last, [0, last[1]]])
            whole = Grid(
                cells=cells,
                pixel=cells.astype(float),
                parity=int(sides.colour[upright]),
                step=1.0,
                contrast=np.ones(4),
            )
            side, offset = reach_of(whole, sides).places()
            fills = (np.abs(sides.matrix[side]) @ (last + 1) == sides.size[side]).all(axis=1)
            side, offset = side[fills], offset[fills]
            homogeneous = np.column_stack([cells, np.ones(4)])
            there = homogeneous @ np.swapaxes(sides.world_from_grid(side, offset), -1, -2)
            covered.append(side)
            places.append(there)
            outline.append(there[np.flatnonzero(side == upright)[0]])
        return cls(
            sides=sides,
            names=tuple(target.boards[index].name for index in sides.board[::4]),
            outline=np.stack(outline),
            side=covered,
            places=places,
        )

    def motions(self, board: int) -> tuple[FloatArray, FloatArray]:
        """(P, 3, 3), (P, 3) matrices and shifts that carry a board onto each of its places."""
        frame = self.sides.frame[self.side[board]] @ self.sides.frame[4 * board].T
        scale = self.sides.square[self.side[board]] / self.sides.square[4 * board]
        matrix = scale[:, None, None] * frame
        middle = self.outline[board].mean(axis=0)
        return matrix, self.places[board].mean(axis=1) - matrix @ middle

    def landing(
        self, matrix: FloatArray, shift: FloatArray, board: int
    ) -> tuple[FloatArray, IntArray]:
        """How far a board, moved, is from the nearest of its places, in squares, and which.

        (C, 3, 3), (C, 3) -> (C,) the largest distance of an outermost corner, (C,) the place.
        """
        moved = self.outline[board] @ np.swapaxes(matrix, -1, -2) + shift[:, None]
        square = self.sides.square[self.side[board]]
        error, place = [], []
        step = max(1, _AT_A_TIME // len(square))
        for first in range(0, len(moved), step):
            apart = moved[first : first + step, None] - self.places[board]
            distance = np.linalg.norm(apart, axis=-1).max(axis=-1) / square
            nearest = distance.argmin(axis=1)
            place.append(nearest)
            error.append(distance[np.arange(len(nearest)), nearest])
        return np.concatenate(error), np.concatenate(place)


def symmetries(boards: PlainBoards) -> tuple[list[Turn], list[Turn]]:
    """Turns of the whole object that make no difference, and those that hardly do."""
    # The board with the fewest places has the fewest candidates.
    base = min(range(len(boards.names)), key=lambda b: len(boards.places[b]))
    matrix, shift = boards.motions(base)
    # A board that is off by NEARLY turns the motion that is based on it.
    slack = 10 * NEARLY
    landed = np.empty((len(matrix), 0), np.intp)
    for board in range(len(boards.names)):
        error, place = boards.landing(matrix, shift, board)
        kept = error < slack
        matrix, shift = matrix[kept], shift[kept]
        landed = np.column_stack([landed, place])[kept]
    exact: list[Turn] = []
    near: list[Turn] = []
    everything = list(range(len(boards.names)))
    for places in landed:
        motion, miss = _fitted(boards, everything, places)
        turn = _turn(boards, everything, places, motion, miss)
        if turn.angle_deg < 1 and turn.boards == turn.onto:
            continue
        if is_symmetry(motion, boards.sides):
            exact.append(turn)
        elif miss < NEARLY:
            near.append(turn)
    return exact, near


def look_alikes(boards: PlainBoards, faced: BoolArray) -> tuple[list[Turn] | None, int | None]:
    """The largest groups of boards that look like others, and how many boards are none."""
    count = len(boards.names)
    if count > _MOST_BOARDS:
        return None, None
    if count == 1:
        return [], 1
    groups: dict[frozenset[int], Turn] = {}
    looked: set[tuple[int, ...]] = set()
    views = np.unique(faced, axis=0)
    for base in range(count):
        matrix, shift = boards.motions(base)
        landings = [boards.landing(matrix, shift, board) for board in range(count)]
        error = np.stack([one for one, _ in landings], axis=1)
        place = np.stack([one for _, one in landings], axis=1)
        for own, places in zip(error < ALIKE, place, strict=True):
            # One and the same motion comes up with each board that it moves to a board.
            key = tuple(np.where(own, places, -1).tolist())
            if key in looked:
                continue
            looked.add(key)
            if own.all() and _makes_no_difference(boards, places):
                continue
            for group in _seen_at_once(own, views):
                if any(frozenset(group) < other for other in groups):
                    continue
                motion, miss = _fitted(boards, group, places[group])
                turn = _turn(boards, group, places[group], motion, miss)
                known = groups.get(frozenset(group))
                # A board that could be another one says more than one that could be turned.
                if known is None or set(known.boards) == set(known.onto):
                    groups[frozenset(group)] = turn
    largest = [group for group in groups if not any(group < other for other in groups)]
    maximal = [groups[group] for group in sorted(largest, key=lambda g: (-len(g), sorted(g)))]
    return maximal, 1 + max((len(turn.boards) for turn in maximal), default=0)


def _makes_no_difference(boards: PlainBoards, places: IntArray) -> bool:
    """Whether all boards, moved to these places, are a symmetry of the object, or nearly."""
    motion, error = _fitted(boards, range(len(boards.names)), places)
    return error < NEARLY or is_symmetry(motion, boards.sides)


def _seen_at_once(own: BoolArray, faced: BoolArray) -> list[list[int]]:
    """The largest groups of some boards (B,) that face one of the eyes (E, B) together."""
    together = {frozenset(np.flatnonzero(row).tolist()) for row in np.unique(faced & own, axis=0)}
    largest = [group for group in together if group and not any(group < o for o in together)]
    return sorted(sorted(group) for group in largest)


def _fitted(
    boards: PlainBoards, group: Sequence[int], places: IntArray
) -> tuple[Similarity, float]:
    """The motion of some boards onto their places that fits best, and its error in squares."""
    there = np.stack([boards.places[b][p] for b, p in zip(group, places, strict=True)])
    motion = similarity(boards.outline[list(group)].reshape(-1, 3), there.reshape(-1, 3))
    sides = [boards.side[b][p] for b, p in zip(group, places, strict=True)]
    return motion, motion.error / float(boards.sides.square[sides].min())


def _turn(
    boards: PlainBoards, group: Sequence[int], places: IntArray, motion: Similarity, error: float
) -> Turn:
    covered = [boards.side[b][p] // 4 for b, p in zip(group, places, strict=True)]
    angle, axis = _angle_axis(motion.rotation)
    middle = boards.outline[list(group)].reshape(-1, 3).mean(axis=0)
    # Of the points that the motion moves along its axis only, the one nearest to the middle.
    moves = motion.scale * motion.rotation - np.eye(3)
    across = np.eye(3) - np.outer(axis, axis)
    to_middle = np.linalg.pinv(moves @ across, rcond=1e-6) @ (motion.shift + moves @ middle)
    return Turn(
        boards=tuple(boards.names[b] for b in group),
        onto=tuple(boards.names[b] for b in covered),
        angle_deg=float(np.degrees(angle)),
        axis=axis,
        point=middle - to_middle,
        error=error,
    )


def _angle_axis(rotation: FloatArray) -> tuple[float, FloatArray]:
    """Angle, 0 to π, and unit axis of a rotation (3, 3); (0, 0, 1) where there is no turn.

    Of the two axes of a half turn the one whose first entry, that is not 0, is positive.
    """
    vector = Rotation.from_matrix(rotation).as_rotvec()
    angle = float(np.linalg.norm(vector))
    if angle < 1e-9:
        return 0.0, np.array([0.0, 0.0, 1.0])
    axis = vector / angle
    if angle > np.pi - 1e-6:
        axis *= np.sign(axis[np.abs(axis) > 1e-6][0])
    return angle, np.where(np.abs(axis) < 1e-12, 0.0, axis)
