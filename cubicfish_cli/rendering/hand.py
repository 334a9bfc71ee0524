"""Hand motion for rendered films: from place to place, with pauses and tremor.

A hand goes from rest to rest along the smoothest way, which is least jerk (Flash and Hogan, 1985).
It sways slowly and trembles at some hertz all the while.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from cubicfish_cli.rendering.pose import Pose, rotation_matrix
from cubicfish_cli.types import FloatArray, IntArray

# Degrees a second of a move in the mean, the way through the picture and the turn added up.
_SPEED_DEG = 70.0
_SHORTEST_MOVE, _LONGEST_PAUSE = 0.4, 0.7  # seconds, before all times are scaled to the film's
# Sway and tremor: hertz, and degrees of the way to the target and of its turn.
_WAVES = ((0.4, 0.5, 1.0), (1.1, 0.2, 0.5), (4.0, 0.02, 0.06), (8.5, 0.008, 0.025))


@dataclass(frozen=True, kw_only=True, eq=False)
class HandPath:
    """Where the target is at every moment.

    Attributes:
        middle: (3,) the world point that is carried.
        begin, end: (M,) seconds of each move; between two moves is a pause.
        turn: (M + 1, 3, 3) camera_from_world rotations at the places between.
        way: (M + 1, 3) unit vectors to the target's middle, camera frame.
        distance: (M + 1,) of the middle.
        phase: (waves, 5) of sway and tremor.

    """

    middle: FloatArray
    begin: FloatArray
    end: FloatArray
    turn: FloatArray
    way: FloatArray
    distance: FloatArray
    phase: FloatArray

    @classmethod
    def through(
        cls, poses: Sequence[Pose], middle: FloatArray, seconds: float, *, seed: int = 0
    ) -> HandPath:
        """A way through all of the poses, each to one near it, in so many seconds.

        Args:
            poses: camera_from_world, at least two.
            middle: (3,) the target's middle, world.
            seconds: how long it takes.
            seed: of pauses, sway and tremor.

        """
        turn = np.stack([rotation_matrix(rotation) for rotation, _ in poses])
        place = turn @ middle + np.stack([np.asarray(moved, float) for _, moved in poses])
        distance = np.linalg.norm(place, axis=1)
        way = place / distance[:, None]
        apart = _angles(way @ way.T) + _angles((np.einsum("aij,bij->ab", turn, turn) - 1) / 2)
        order = _near_ones_first(apart)
        turn, way, distance = turn[order], way[order], distance[order]
        random = np.random.default_rng(seed)
        moving = np.maximum(
            _SHORTEST_MOVE, np.degrees(apart[order[:-1], order[1:]]) / _SPEED_DEG
        ) * random.uniform(0.7, 1.4, len(order) - 1)
        pause = random.uniform(0.05, _LONGEST_PAUSE, len(order) - 1)
        scale = seconds / float(moving.sum() + pause.sum())
        end = scale * np.cumsum(moving + pause)
        return cls(
            middle=np.asarray(middle, float),
            begin=end - scale * moving,
            end=end,
            turn=turn,
            way=way,
            distance=distance,
            phase=random.uniform(0, 2 * np.pi, (len(_WAVES), 5)),
        )

    def at(self, seconds: float) -> tuple[FloatArray, FloatArray]:
        """camera_from_world at a moment: rotation (3, 3) and translation (3,)."""
        move = min(int(np.searchsorted(self.end, seconds)), len(self.end) - 1)
        begin, end = self.begin[move], self.end[move]
        gone = float(np.clip((seconds - begin) / (end - begin), 0.0, 1.0))
        share = gone**3 * (10 - 15 * gone + 6 * gone**2)
        swing = np.zeros(5)
        for (hertz, of_way, of_turn), phase in zip(_WAVES, self.phase, strict=True):
            wave = np.radians([of_way, of_way, of_turn, of_turn, of_turn])
            swing += wave * np.sin(2 * np.pi * hertz * seconds + phase)
        first, last = self.turn[move], self.turn[move + 1]
        turn = rotation_matrix(share * _vector(last @ first.T)) @ first
        across = np.cross(self.way[move], self.way[move + 1])
        length = float(np.linalg.norm(across))
        angle = float(np.arctan2(length, self.way[move] @ self.way[move + 1]))
        axis = across / length if length > 1e-9 else np.zeros(3)
        way = rotation_matrix([*swing[:2], 0.0]) @ rotation_matrix(share * angle * axis)
        away = self.distance[move] ** (1 - share) * self.distance[move + 1] ** share
        turn = rotation_matrix(swing[2:]) @ turn
        return turn, away * (way @ self.way[move]) - turn @ self.middle


def _angles(cosine: FloatArray) -> FloatArray:
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _vector(rotation: FloatArray) -> FloatArray:
    """The rotation vector of a matrix; of half a turn one of both."""
    return np.asarray(cv2.Rodrigues(rotation)[0], float).ravel()


def _near_ones_first(apart: FloatArray) -> IntArray:
    """An order in which each is followed by the nearest of those that are left."""
    order = [0]
    left = set(range(1, len(apart)))
    while left:
        order.append(min(left, key=lambda other: (apart[order[-1], other], other)))
        left.remove(order[-1])
    return np.array(order)
