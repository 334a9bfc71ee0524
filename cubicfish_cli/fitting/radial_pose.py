"""The pose of one photo without knowing the lens, up to its depth.

For a lens with a centre c and any radial profile, (u − c) is parallel to the first two camera
coordinates: (u − cu)(r2·X + ty) − (v − cv)(r1·X + tx) = 0, linear in both rows of R and in
(tx, ty). This holds beyond 180°, where a homography on a normalised plane fails.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cubicfish_cli.types import FloatArray

# Fewest points that determine the 8 (6 on a plane) homogeneous unknowns.
MIN_POINTS = 7
MIN_POINTS_ON_PLANE = 5
# Below this ratio of their third to their first extent, points count as lying on one plane.
_FLAT = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialPose:
    """R and (tx, ty) of a photo; tz is still unknown.

    Attributes:
        rotation: (3, 3) camera_from_world.
        shift: (2,) tx, ty in the world's units.

    """

    rotation: FloatArray
    shift: FloatArray


def radial_poses(world: FloatArray, offset: FloatArray) -> list[RadialPose]:
    """Candidate poses of a photo from world points (N, 3) and pixels less the centre (N, 2).

    Points off one plane give one candidate, points on a plane two (the plane may lean either
    way). The list is empty when the points are too few or degenerate (collinear).
    """
    if len(world) < MIN_POINTS_ON_PLANE:
        return []
    middle = world.mean(axis=0)
    _, extent, axes = np.linalg.svd(world - middle, full_matrices=False)
    if extent[0] == 0 or extent[1] < _FLAT * extent[0] or not offset.any():
        return []
    # Lengths of order 1 and pixels of order 1 keep the linear system well conditioned.
    scale = np.sqrt(len(world)) / extent[0]
    local = (world - middle) @ axes.T * scale
    if np.linalg.det(axes) < 0:
        local, axes = local * [1, 1, -1], axes * [[1], [1], [-1]]
    pixel = offset / np.sqrt(np.mean(np.square(offset)))
    if extent[2] < _FLAT * extent[0]:
        poses = _on_a_plane(local, pixel)
    elif len(world) >= MIN_POINTS:
        poses = _in_space(local, pixel)
    else:
        poses = []
    return [_in_world(pose, middle, axes, float(scale)) for pose in poses]


def _in_world(pose: RadialPose, middle: FloatArray, axes: FloatArray, scale: float) -> RadialPose:
    rotation = pose.rotation @ axes
    return RadialPose(rotation=rotation, shift=pose.shift / scale - rotation[:2] @ middle)


def _null_vector(equations: FloatArray) -> FloatArray:
    return np.linalg.svd(equations, full_matrices=False)[2][-1]


def _same_way(found: FloatArray, pixel: FloatArray) -> float:
    """The sign that turns the linear solution's directions (N, 2) towards the pixels."""
    return 1.0 if np.sign(np.sum(found * pixel, axis=1)).sum() >= 0 else -1.0


def _in_space(local: FloatArray, pixel: FloatArray) -> list[RadialPose]:
    homogeneous = np.column_stack([local, np.ones(len(local))])
    solution = _null_vector(
        np.column_stack([-pixel[:, 1:] * homogeneous, pixel[:, :1] * homogeneous])
    ).reshape(2, 4)
    solution *= _same_way(homogeneous @ solution.T, pixel)
    left, size, right = np.linalg.svd(solution[:, :3], full_matrices=False)
    if size[1] < 1e-9 * size[0]:
        return []
    rows = left @ right
    rotation = np.vstack([rows, np.cross(rows[0], rows[1])])
    return [RadialPose(rotation=rotation, shift=solution[:, 3] / size.mean())]


def _on_a_plane(local: FloatArray, pixel: FloatArray) -> list[RadialPose]:
    homogeneous = np.column_stack([local[:, :2], np.ones(len(local))])
    solution = _null_vector(
        np.column_stack([-pixel[:, 1:] * homogeneous, pixel[:, :1] * homogeneous])
    ).reshape(2, 3)
    solution *= _same_way(homogeneous @ solution.T, pixel)
    first, second = solution[:, 0], solution[:, 1]
    # The third row (a, b) makes both columns equally long and orthogonal:
    # a b = −first·second and a² − b² = |second|² − |first|².
    product = float(-first @ second)
    gap = float(second @ second - first @ first)
    a = np.sqrt(max(0.0, (gap + np.hypot(gap, 2 * product)) / 2))
    b = np.sqrt(max(0.0, (-gap + np.hypot(gap, 2 * product)) / 2))
    b = -b if product < 0 else b
    length = float(np.sqrt(first @ first + a * a))
    if length < 1e-12:
        return []
    poses = []
    for sign in (1.0, -1.0):
        columns = np.array([[*first, sign * a], [*second, sign * b]]).T / length
        left, _, right = np.linalg.svd(columns, full_matrices=False)
        columns = left @ right
        rotation = np.column_stack([columns, np.cross(columns[:, 0], columns[:, 1])])
        poses.append(RadialPose(rotation=rotation, shift=solution[:, 2] / length))
    return poses


def depth_shift(
    pose: RadialPose, world: FloatArray, angle: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The depth tz and the angles it gives, when each point's angle from the axis is known.

    z = ρ cot θ for each point, so its median less r3·X is tz, whatever its sign.

    Args:
        pose: R, tx and ty.
        world: (N, 3).
        angle: (..., N) θ of each point by its pixel's radius, radians, under a lens or several.

    Returns:
        tz (...,) and the points' angles from the axis under it (..., N).

    """
    camera = world @ pose.rotation.T
    rho = np.hypot(camera[:, 0] + pose.shift[0], camera[:, 1] + pose.shift[1])
    sine = np.maximum(np.sin(angle), 1e-9)
    shift = np.median(rho * np.cos(angle) / sine - camera[:, 2], axis=-1)
    return shift, np.arctan2(rho, camera[:, 2] + shift[..., None])
