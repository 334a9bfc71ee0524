"""Corners of several cameras on one body without pictures, and the truth behind them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from simulated import CornerErrors, Truth, simulated_corners
from synthetic_lenses import SyntheticLens

from cubicfish import Observations, Target, TargetError
from cubicfish.scene.truth import (
    Pose,
    pose_of_matrix,
    project_corners,
    rotation_matrix,
)

FloatArray = npt.NDArray[np.float64]

# A camera sees the target where it sees so many corners.
_FEWEST_CORNERS = 20


@dataclass(frozen=True, kw_only=True, eq=False)
class RigTruth:
    """What the corners of a rig were made from.

    Attributes:
        cameras: of each camera, the truth of its corners.
        camera_from_rig: of each camera.
        rig_from_world: of each shot.

    """

    cameras: tuple[Truth, ...]
    camera_from_rig: tuple[Pose, ...]
    rig_from_world: tuple[Pose, ...]


def corner_target() -> Target:
    """Three boards in a corner."""
    boards = [
        ("floor", [8, 6], [90, 390, 0], [1, 0, 0], [0, -1, 0]),
        ("left", [7, 6], [0, 90, 450], [0, 1, 0], [0, 0, -1]),
        ("right", [6, 5], [450, 0, 330], [-1, 0, 0], [0, 0, -1]),
    ]
    return Target.from_data(
        {
            "units": "mm",
            "boards": [
                {"name": name, "type": "checkerboard", "corners": corners, "square": 60.0,
                 "origin": origin, "x_axis": x_axis, "y_axis": y_axis}
                for name, corners, origin, x_axis, y_axis in boards
            ],
        }
    )  # fmt: skip


def simulated_rig(
    lenses: Sequence[SyntheticLens],
    camera_from_rig: Sequence[Pose],
    target: Target,
    n_shots: int,
    *,
    distances: tuple[float, float],
    middle: npt.ArrayLike | None = None,
    seed: int = 0,
    errors: CornerErrors | None = None,
    candidates: int = 25,
) -> tuple[list[Observations], RigTruth]:
    """Corners of the shots of a rig, called ``shot_001`` and so on in each camera.

    Shots are chosen so that all cameras get as many as can be, and two see the target at once.

    Args:
        lenses: one per camera.
        camera_from_rig: of each camera.
        target: the object.
        n_shots: how many shots.
        distances: how far the rig may be from ``middle``, in the target's units.
        middle: (3,) about which the rig is placed; by default the corners' middle.
        seed: of places and errors.
        errors: how corners miss.
        candidates: places to choose from, for each shot.

    Raises:
        TargetError: the target cannot be seen so often.

    """
    rng = np.random.default_rng((seed, 2))
    about = target.corners()[3].mean(axis=0) if middle is None else np.asarray(middle, float)
    places: list[tuple[Pose, list[int]]] = []
    for _ in range(40 * n_shots):
        pose = _random_pose(rng, about, distances)
        counts = []
        for lens, own in zip(lenses, camera_from_rig, strict=True):
            seen = project_corners(target, lens, combined(own, pose), lens.image_size)
            counts.append(int(seen.visible.sum()))
        if max(counts) >= _FEWEST_CORNERS:
            places.append((pose, counts))
        if len(places) >= candidates * min(n_shots, 40):
            break
    if len(places) < n_shots:
        raise TargetError(f"only {len(places)} shots of the target were found")
    chosen = _chosen(places, len(lenses), n_shots)
    corners, truths = [], []
    for number, (lens, own) in enumerate(zip(lenses, camera_from_rig, strict=True)):
        poses = tuple(combined(own, pose) for pose, _ in chosen)
        seeing = [shot for shot, (_, counts) in enumerate(chosen) if counts[number] >= 4]
        found, truth = simulated_corners(
            lens,
            target,
            len(seeing),
            seed=1000 * seed + number,
            errors=errors or CornerErrors(),
            poses=tuple(poses[shot] for shot in seeing),
        )
        names = tuple(f"shot_{shot + 1:03d}" for shot in seeing)
        corners.append(_renamed(found, names))
        truths.append(truth)
    return corners, RigTruth(
        cameras=tuple(truths),
        camera_from_rig=tuple(camera_from_rig),
        rig_from_world=tuple(pose for pose, _ in chosen),
    )


def combined(first: Pose, second: Pose) -> Pose:
    """One transform after another: first ∘ second."""
    turn = rotation_matrix(first[0])
    rotation = turn @ rotation_matrix(second[0])
    vector, _ = pose_of_matrix(rotation, np.zeros(3))
    return vector, turn @ np.asarray(second[1], float) + np.asarray(first[1], float)


def _renamed(corners: Observations, names: tuple[str, ...]) -> Observations:
    return replace(corners, images=names)


def _random_pose(
    rng: np.random.Generator, about: FloatArray, distances: tuple[float, float]
) -> Pose:
    """rig_from_world: somewhere about the target, turned anyhow."""
    way = rng.standard_normal(3)
    eye = about + way / np.linalg.norm(way) * rng.uniform(*distances)
    quaternion = rng.standard_normal(4)
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return pose_of_matrix(turn, eye)


def _chosen(
    candidates: list[tuple[Pose, list[int]]], cameras: int, count: int
) -> list[tuple[Pose, list[int]]]:
    """Greedy: every shot adds most to the cameras, and the pairs of cameras, that have least."""
    seen = np.array([np.array(counts) >= _FEWEST_CORNERS for _, counts in candidates])
    corners = np.array([counts for _, counts in candidates], float)
    own, both = np.zeros(cameras), np.zeros((cameras, cameras))
    left = np.ones(len(candidates), bool)
    chosen = []
    for _ in range(count):
        gain = (corners / (1 + own)).sum(axis=1) / 50
        pair = np.einsum("sa,sb,ab->s", seen, seen, 1 / (1 + both) * (1 - np.eye(cameras)))
        score = np.where(left, gain + pair, -np.inf)
        best = int(np.argmax(score))
        left[best] = False
        own += seen[best]
        both += np.outer(seen[best], seen[best])
        chosen.append(candidates[best])
    return chosen
