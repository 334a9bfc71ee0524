"""Films of two cameras on one body that moves about a target, rendered, of known truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from filming import write_film
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline
from simulated_rig import combined

from cubicfish_cli.rendering.outside import OutsideLens, outside_lens
from cubicfish_cli.rendering.pose import Pose, pose_of_matrix
from cubicfish_cli.rendering.render import render
from cubicfish_cli.target import Target

SIZE = (480, 360)
MIDDLE = np.array([250.0, 250.0, 220.0])


def lens_of(number: int) -> OutsideLens:
    lens = outside_lens(("equisolid", "orthographic")[number % 2], SIZE)
    return replace(lens, seed=number) if hasattr(lens, "seed") else lens


def way(seconds: float, seed: int = 0):
    """rig_from_world at any time: looks at the target's middle from changing sides."""
    rng = np.random.default_rng(seed)
    knots = np.arange(-1.0, seconds + 2.0, 0.8)
    eyes = MIDDLE + rng.uniform([20, 20, 20], [330, 330, 330], (len(knots), 3))
    aims = rng.uniform(0, 260, (len(knots), 3))
    turns = []
    for eye, aim in zip(eyes, aims, strict=True):
        forward = (aim - eye) / np.linalg.norm(aim - eye)
        right = np.cross(forward, [0.2, 0.1, 1.0] + 0.4 * rng.standard_normal(3))
        right /= np.linalg.norm(right)
        turns.append(np.stack([right, np.cross(forward, right), forward]))
    turn, eye = RotationSpline(knots, Rotation.from_matrix(turns)), CubicSpline(knots, eyes)

    def at(time: float) -> Pose:
        return pose_of_matrix(turn(time).as_matrix(), eye(time))

    return at


def write_rig_films(
    folder: Path,
    target: Target,
    camera_from_rig: list[Pose],
    *,
    seconds: float,
    rate: float,
    late: list[float],
    begins: list[float] | None = None,
    seed: int = 0,
) -> list[Path]:
    """One film a camera.

    Args:
        late: how much later each camera's frames are than it says, seconds.
        begins: when each film begins, which it does not say.

    """
    at = way(seconds, seed)
    paths = []
    for number, place in enumerate(camera_from_rig):
        lens = lens_of(number)
        begin = 0.0 if begins is None else begins[number]
        times = np.arange(0.0, seconds - begin, 1 / rate)
        frames = [
            render(
                target,
                lens.unproject,
                combined(place, at(time + begin + late[number])),
                SIZE,
                supersample=2,
                edges_only=True,
                noise=1.0,
                seed=(seed, number, index),
            )
            for index, time in enumerate(times)
        ]
        path = folder / f"cam{number}.mp4"
        ms = [round(1000 * time) for time in times]
        paths.append(write_film(path, frames, times_ms=ms))
    return paths
