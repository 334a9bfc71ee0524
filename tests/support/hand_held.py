"""Corners of a board that a hand moves before cameras that run free, and the truth behind them.

The hand goes from place to place in strokes of least jerk (Flash & Hogan 1985), rests or begins
the next one early, and trembles: nothing that is fitted is built like that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from synthetic_lenses import SyntheticLens, synthetic_lens

from cubicfish import Observations, Target
from cubicfish.scene.truth import Pose, pose_of_matrix, rotation_matrix

FloatArray = npt.NDArray[np.float64]

RATE = 6.0
_AWAY = 100.0
_TURN, _SHIFT = 0.25, 12.0
_TREMBLE = 0.0005, 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class HandHeld:
    """A rig of narrow cameras before a board that is moved by hand.

    Attributes:
        corners: of each camera.
        times: by camera's number and photo, when it was taken by the camera's own clock, seconds.
        lenses: of each camera.
        camera_from_rig: of each camera.
        target: the board, in centimetres.

    """

    corners: tuple[Observations, ...]
    times: tuple[dict[str, float], ...]
    lenses: tuple[SyntheticLens, ...]
    camera_from_rig: tuple[Pose, ...]
    target: Target


def hand_held(
    seed: int = 0,
    *,
    moments: int = 40,
    scatter: float = 0.008,
    usual: Sequence[float] = (0.0, 0.0, 0.0),
    noise: float = 0.05,
    tempo: float = 1.0,
) -> HandHeld:
    """Photos ``moment_001`` and so on, six a second, of three cameras or more.

    Args:
        seed: of everything.
        moments: how many.
        scatter: standard deviation of when a photo is taken, seconds.
        usual: how late each camera is beyond that, seconds, of which its clock knows nothing.
        noise: of corners, pixels a coordinate.
        tempo: about so many seconds a stroke takes.

    """
    rng = np.random.default_rng((seed, 7))
    board = {"name": "board", "type": "checkerboard", "corners": [4, 3], "square": 5.4}
    target = Target.from_data({"units": "cm", "boards": [board]})
    number, column, row, world = target.corners()
    hand = Hand.moving(rng, moments / RATE + 2, tempo)
    middle = world.mean(axis=0)
    bodies = [_looking_in(yaw) for yaw in np.deg2rad(np.linspace(-35, 35, len(usual)))]
    back = bodies[0][0].T, -bodies[0][0].T @ bodies[0][1]
    corners, times, lenses, places = [], [], [], []
    for late, (turn, shift) in zip(usual, bodies, strict=True):
        lens = replace(
            synthetic_lens("equisolid", (1280, 720)),
            focal=(1000.0, 1001.0),
            max_angle_deg=45.0,
            units="cm",
        )
        worlds, pixels, taken = [], [], {}
        rows = []
        for moment in range(1, moments + 1):
            when = moment / RATE + late + scatter * rng.standard_normal()
            place = hand.at(when + 1.0)
            points = (world - middle) @ rotation_matrix(place[:3]).T + place[3:]
            pixel = lens.project(points @ turn.T + shift)
            pixel += noise * rng.standard_normal(pixel.shape)
            seen = ((pixel >= 0) & (pixel <= np.array(lens.image_size) - 1)).all(axis=1)
            if seen.all():
                worlds.append(world)
                pixels.append(pixel)
                rows.append(np.arange(len(world)))
                taken[f"moment_{moment:03d}"] = when - late
        kept = np.concatenate(rows)
        made = Observations.from_points(worlds, pixels, lens.image_size, images=list(taken))
        corners.append(
            replace(
                made,
                board=number[kept],
                column=column[kept],
                row=row[kept],
                boards=("board",),
            ).with_target(target)
        )
        times.append(taken)
        lenses.append(lens)
        vector, _ = pose_of_matrix(turn @ back[0], np.zeros(3))
        places.append((vector, turn @ back[1] + shift))
    return HandHeld(
        corners=tuple(corners),
        times=tuple(times),
        lenses=tuple(lenses),
        camera_from_rig=tuple(places),
        target=target,
    )


def _looking_in(yaw: float) -> tuple[FloatArray, FloatArray]:
    """Rotation and translation of a camera that looks at the middle from all about it."""
    forward = np.array([np.sin(yaw), 0.2 * yaw, np.cos(yaw)])
    forward /= np.linalg.norm(forward)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    turn = np.stack([right, np.cross(forward, right), forward])
    return turn, np.array([0.0, 0.0, _AWAY])


@dataclass(frozen=True, kw_only=True, eq=False)
class Hand:
    """How a hand moves: strokes (K,) from one place to the next, turn and shift (6,)."""

    begin: FloatArray
    lasts: FloatArray
    step: FloatArray
    waves: FloatArray

    @classmethod
    def moving(cls, rng: np.random.Generator, seconds: float, tempo: float = 1.0) -> Hand:
        """For so long, from one random place to another."""
        count = int(4 * seconds / tempo) + 4
        lasts = tempo * rng.uniform(0.5, 1.5, count)
        begin = np.cumsum(lasts * rng.uniform(0.7, 1.3, count)) - lasts[0]
        size = np.repeat([_TURN, _SHIFT], 3)
        places = size * rng.standard_normal((count + 1, 6))
        waves = np.stack([rng.uniform(7, 11, 6), rng.uniform(0, 6, 6)])
        return cls(begin=begin, lasts=lasts, step=np.diff(places, axis=0), waves=waves)

    def at(self, time: float) -> FloatArray:
        """(6,) turn and shift."""
        done = np.clip((time - self.begin) / self.lasts, 0, 1)
        share = done**3 * (10 - 15 * done + 6 * done**2)
        tremble = np.sin(2 * np.pi * self.waves[0] * time + self.waves[1])
        return share @ self.step + np.repeat(_TREMBLE, 3) * tremble
