"""Known truth for tests: a lens, objects, poses that see them, and corners with known noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import numpy.typing as npt
from asymmetric_lens import AsymmetricLens
from looking import look_at

from cubicfish import Observations, Target
from cubicfish.scene.truth import (
    AnyLens,
    Pose,
    TrueCorners,
    camera_points,
    project_corners,
)
from cubicfish.target import Board
from cubicfish.target.boards.types import BOARD_TYPES, Checkerboard

IMAGE_SIZE = (960, 720)
TRUE_LENS = AsymmetricLens(
    image_size=IMAGE_SIZE,
    fx=262.0,
    fy=262.6,
    cx=485.3,
    cy=352.8,
    k=(-0.021, -0.0042, 0.0011, -0.00012),
    p=(0.00045, -0.0006),
    tilt=(0.0016, -0.0011),
    max_angle_deg=95.0,
)


def lens_of_size(scale: float) -> AsymmetricLens:
    """The same lens on a sensor with ``scale`` times as many pixels per side."""
    width, height = (round(side * scale) for side in IMAGE_SIZE)
    return replace(
        TRUE_LENS,
        image_size=(width, height),
        fx=TRUE_LENS.fx * scale,
        fy=TRUE_LENS.fy * scale,
        cx=(TRUE_LENS.cx + 0.5) * scale - 0.5,
        cy=(TRUE_LENS.cy + 0.5) * scale - 0.5,
    )


def checkerboard(
    name: str,
    columns: int,
    rows: int,
    square: float,
    origin: Sequence[float] = (0, 0, 0),
    x_axis: Sequence[float] = (1, 0, 0),
    y_axis: Sequence[float] = (0, 1, 0),
) -> Board:
    """A checkerboard with ``columns`` x ``rows`` inner corners."""
    return Checkerboard(
        name=name,
        columns=columns,
        rows=rows,
        square=square,
        origin=np.array(origin, float),
        x_axis=np.array(x_axis, float),
        y_axis=np.array(y_axis, float),
    )


def corner_of_three() -> Target:
    """Three boards of different sizes on the planes z = 0, x = 0 and y = 0, seen from inside.

    The camera belongs where all three coordinates are positive.
    """
    square, gap = 25.0, 1.5 * 25.0  # from the object's edges to the nearest inner corners
    return Target(
        units="mm",
        boards=(
            checkerboard("floor", 9, 6, square, (gap, gap + 5 * square, 0), (1, 0, 0), (0, -1, 0)),
            checkerboard("left", 8, 7, square, (0, gap, gap + 6 * square), (0, 1, 0), (0, 0, -1)),
            checkerboard(
                "right",
                7,
                5,
                square,
                (gap + 6 * square, 0, gap + 4 * square),
                (-1, 0, 0),
                (0, 0, -1),
            ),
        ),
    )


def box_of_four(n: int = 12) -> Target:
    """A box whose floor and three walls are equal boards of n x n corners, seen from inside.

    The box is 600 mm wide, z is up, and the wall at large y is missing. However many corners a
    board has, they go as far; of 12x12, squares are of 40 mm.
    """
    gap, side, far = 80.0, 600.0, 520.0
    square = (far - gap) / (n - 1)
    return Target(
        units="mm",
        boards=(
            checkerboard("floor", n, n, square, (gap, far, 0), (1, 0, 0), (0, -1, 0)),
            checkerboard("left", n, n, square, (0, gap, far), (0, 1, 0), (0, 0, -1)),
            checkerboard("back", n, n, square, (far, 0, far), (-1, 0, 0), (0, 0, -1)),
            checkerboard("right", n, n, square, (side, far, far), (0, -1, 0), (0, 0, -1)),
        ),
    )


def flat_board() -> Target:
    """One board of 11x8 inner corners, 30 mm, in the plane z = 0; the camera is at z < 0."""
    return Target(units="mm", boards=(checkerboard("board", 11, 8, 30.0),))


def object_middle(target: Target) -> npt.NDArray[np.float64]:
    """The middle of the object's corners (3,)."""
    world = target.corners()[3]
    return (world.min(axis=0) + world.max(axis=0)) / 2


def poses_around(
    target: Target,
    count: int,
    *,
    distance: tuple[float, float] = (0.35, 0.9),
    off_axis_deg: float = 60.0,
    slant_deg: float = 50.0,
    seed: int = 0,
) -> list[Pose]:
    """Poses in front of all boards that look roughly at the object, with any roll.

    Args:
        target: the object.
        count: how many poses.
        distance: range of the distance from the object's middle, in object diagonals.
        off_axis_deg: largest angle between the lens's axis and the object's middle.
        slant_deg: largest angle between the way to the object and the boards' mean normal.
        seed: the same seed gives the same poses.

    """
    rng = np.random.default_rng(seed)
    world = target.corners()[3]
    diagonal = float(np.linalg.norm(np.ptp(world, axis=0)))
    middle = object_middle(target)
    outward = np.sum([np.cross(b.y_axis, b.x_axis) for b in target.boards], axis=0)
    outward /= np.linalg.norm(outward)
    poses: list[Pose] = []
    while len(poses) < count:
        way = _turned(outward, np.radians(slant_deg) * np.sqrt(rng.uniform()), rng)
        eye = middle + way * diagonal * rng.uniform(*distance)
        heading = _turned(-way, np.radians(off_axis_deg) * np.sqrt(rng.uniform()), rng)
        up = np.array([0.31, 0.17, 0.94])
        pose = look_at(eye, eye + heading, up=up, roll=rng.uniform(-np.pi, np.pi))
        if all(
            (eye - b.origin) @ np.cross(b.y_axis, b.x_axis) > 0.15 * diagonal for b in target.boards
        ):
            poses.append(pose)
    return poses


def synthetic_corners(
    target: Target,
    poses: Sequence[Pose],
    *,
    lens: AnyLens = TRUE_LENS,
    image_size: tuple[int, int] = IMAGE_SIZE,
    noise: float = 0.0,
    seed: int = 0,
    neighbourhood: float = 0.5,
) -> Observations:
    """The visible corners of each photo with Gaussian noise of ``noise`` px along x and y."""
    rng = np.random.default_rng(seed)
    seen = [
        project_corners(target, lens, pose, image_size, neighbourhood=neighbourhood)
        for pose in poses
    ]
    image = np.repeat(np.arange(len(poses)), [part.visible.sum() for part in seen])
    pixel = _visible(seen, "pixel")
    return Observations(
        image_size=image_size,
        images=tuple(f"{i:02d}.png" for i in range(len(poses))),
        boards=tuple(board.name for board in target.boards),
        image=image,
        board=_visible(seen, "board"),
        column=_visible(seen, "column"),
        row=_visible(seen, "row"),
        pixel=pixel + noise * rng.standard_normal(pixel.shape),
    )


def synthetic_correspondences(
    target: Target,
    poses: Sequence[Pose],
    *,
    lens: AnyLens = TRUE_LENS,
    image_size: tuple[int, int] = IMAGE_SIZE,
    noise: float = 0.0,
    seed: int = 0,
    neighbourhood: float = 0.5,
) -> Observations:
    """:func:`synthetic_corners` with their true world points."""
    corners = synthetic_corners(
        target,
        poses,
        lens=lens,
        image_size=image_size,
        noise=noise,
        seed=seed,
        neighbourhood=neighbourhood,
    )
    return corners.with_target(target)


def true_pixels(
    pairs: Observations, poses: Sequence[Pose], lens: AnyLens = TRUE_LENS
) -> npt.NDArray[np.float64]:
    """Exact pixels (N, 2) of the pairs' world points under the true lens and poses."""
    pixel = np.empty((len(pairs.world), 2))
    for index, pose in enumerate(poses):
        here = pairs.image == index
        pixel[here] = lens.project(camera_points(pose, pairs.world[here]))
    return pixel


def rays_in_cone(max_angle_deg: float, count: int, *, seed: int = 0) -> npt.NDArray[np.float64]:
    """Unit rays (count, 3) spread evenly over the cone about the axis, in random order."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(np.cos(np.radians(max_angle_deg)), 1.0, count)
    turn = rng.uniform(-np.pi, np.pi, count)
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1)


def _visible(seen: Sequence[TrueCorners], name: str) -> npt.NDArray[np.float64]:
    return np.concatenate([getattr(part, name)[part.visible] for part in seen])


def _turned(
    direction: npt.NDArray[np.float64], angle: float, rng: np.random.Generator
) -> npt.NDArray[np.float64]:
    """``direction`` (3,) tilted by ``angle`` radians towards a random side."""
    side = np.cross(direction, rng.standard_normal(3))
    side /= np.linalg.norm(side)
    return np.cos(angle) * direction + np.sin(angle) * side


def as_type(board, kind, **changes):
    """The board as one of another type, with other fields."""
    own = {field.name: getattr(board, field.name) for field in fields(board)}
    return BOARD_TYPES[kind](**{**own, **changes})


def plain_background(directions: np.ndarray) -> np.ndarray:
    """An even grey all around: world directions (N, 3) -> brightness (N,)."""
    return np.full(len(directions), 0.4)
