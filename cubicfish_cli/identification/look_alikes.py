"""Turns of a target after which all of it, or what one photo shows of it, looks the same.

Everything is judged on the target as drawn, with the same rules that name corners in photos.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish_cli.geometry import Similarity, similarity
from cubicfish_cli.placement import Placement, placement_of
from cubicfish_cli.target import Target
from cubicfish_cli.types import BoolArray, FloatArray, IntArray

# A turn after which boards lie this close to boards, in squares, is nearly a symmetry.
NEARLY = 0.1
# Boards that a turn brings this close to boards, in squares, look the same in a photo: corners
# are some hundredths of a square wrong, and as far as that can be, so is a lens from one photo.
ALIKE = 0.03
# Targets of more plain boards are not searched for groups of boards that look alike.
_MOST_BOARDS = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """A motion of the target after which some or all of its boards cover boards again.

    Attributes:
        boards: names of the boards that do.
        onto: for each of them, the name of the board that it then covers.
        angle_deg: by how much the target is turned, 0 to 180.
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


def symmetries(target: Target) -> tuple[list[Turn], list[Turn]]:
    """Turns of the whole target that make no difference, and those that hardly do."""
    sides = placement_of(target)
    everything = list(range(len(sides.wholes)))
    # The board with the fewest places has the fewest candidates.
    base = min(everything, key=lambda board: len(sides.wholes[board][0]))
    exact: list[Turn] = []
    near: list[Turn] = []
    # A board that is off by NEARLY turns the motion that is based on it.
    for places in sides.carried(base, 10 * NEARLY)[2]:
        motion, miss = _fitted(sides, everything, places)
        turn = _turn(target, sides, everything, places, motion, miss)
        if turn.angle_deg < 1 and turn.boards == turn.onto:
            continue
        if sides.is_symmetry(motion):
            exact.append(turn)
        elif miss < NEARLY:
            near.append(turn)
    return exact, near


def look_alikes(target: Target, faced: BoolArray) -> tuple[list[Turn] | None, int | None]:
    """The largest groups of boards that look like others, and how many boards are none."""
    sides = placement_of(target)
    everything = list(range(len(sides.wholes)))
    if len(everything) > _MOST_BOARDS:
        return None, None
    if len(everything) == 1:
        return [], 1
    groups: dict[frozenset[int], Turn] = {}
    looked: set[tuple[int, ...]] = set()
    views = np.unique(faced, axis=0)
    for base in everything:
        matrix, shift = sides.motions(base)
        landings = [sides.landing(matrix, shift, board) for board in everything]
        error = np.stack([one for one, _ in landings], axis=1)
        place = np.stack([one for _, one in landings], axis=1)
        for own, places in zip(error < ALIKE, place, strict=True):
            # One and the same motion comes up with each board that it moves to a board.
            key = tuple(np.where(own, places, -1).tolist())
            if key in looked:
                continue
            looked.add(key)
            if own.all():
                motion, miss = _fitted(sides, everything, places)
                if miss < NEARLY or sides.is_symmetry(motion):
                    continue
            for group in _seen_at_once(own, views):
                if any(frozenset(group) < other for other in groups):
                    continue
                motion, miss = _fitted(sides, group, places[group])
                turn = _turn(target, sides, group, places[group], motion, miss)
                known = groups.get(frozenset(group))
                # A board that could be another one says more than one that could be turned.
                if known is None or set(known.boards) == set(known.onto):
                    groups[frozenset(group)] = turn
    largest = [group for group in groups if not any(group < other for other in groups)]
    maximal = [groups[group] for group in sorted(largest, key=lambda g: (-len(g), sorted(g)))]
    return maximal, 1 + max((len(turn.boards) for turn in maximal), default=0)


def _seen_at_once(own: BoolArray, faced: BoolArray) -> list[list[int]]:
    """The largest groups of some boards (B,) that face one of the eyes (E, B) together."""
    together = {frozenset(np.flatnonzero(row).tolist()) for row in np.unique(faced & own, axis=0)}
    largest = [group for group in together if group and not any(group < o for o in together)]
    return sorted(sorted(group) for group in largest)


def _fitted(sides: Placement, group: Sequence[int], places: IntArray) -> tuple[Similarity, float]:
    """The motion of some boards onto their places that fits best, and its error in squares."""
    chosen = [(*sides.wholes[board], place) for board, place in zip(group, places, strict=True)]
    here = np.concatenate([at[0] for _, at, _ in chosen])
    motion = similarity(here, np.concatenate([at[place] for _, at, place in chosen]))
    covered = [side[place] for side, _, place in chosen]
    return motion, motion.error / float(sides.square[covered].min())


def _turn(
    target: Target,
    sides: Placement,
    group: Sequence[int],
    places: IntArray,
    motion: Similarity,
    error: float,
) -> Turn:
    covered = [sides.wholes[b][0][p] // 4 for b, p in zip(group, places, strict=True)]
    names = [target.boards[index].name for index in sides.board[::4]]
    angle, axis = _angle_axis(motion.rotation)
    middle = np.concatenate([sides.wholes[board][1][0] for board in group]).mean(axis=0)
    # Of the points that the motion moves along its axis only, the one nearest to the middle.
    moves = motion.scale * motion.rotation - np.eye(3)
    across = np.eye(3) - np.outer(axis, axis)
    to_middle = np.linalg.pinv(moves @ across, rcond=1e-6) @ (motion.shift + moves @ middle)
    return Turn(
        boards=tuple(names[b] for b in group),
        onto=tuple(names[b] for b in covered),
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
