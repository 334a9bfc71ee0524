"""The pose of one photo without knowing the lens, up to its depth.

For a lens with a centre c and any radial profile, (u − c) is parallel to the first two camera
coordinates: (u − cu)(r2·X + ty) − (v − cv)(r1·X + tx) = 0, linear in both rows of R and in
(tx, ty). This holds beyond 180°, where a homography on a normalised plane fails.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cubicfish.solve.poses import cross_matrix
from cubicfish.types import FloatArray

# Fewest points that determine the 8 (6 on a plane) homogeneous unknowns.
MIN_POINTS = 7
MIN_POINTS_ON_PLANE = 5
# Points with a smaller ratio of their third to their first extent count as lying on one plane.
_FLAT = 1e-6
# Points with a smaller one may be too nearly on a plane to be distinguished from one: a sheet that
# bends a little, or a target that was measured. Both kinds of poses are tried.
_THIN = 0.05
# A direction in which points extend by less than this share is not one of theirs.
_NOTHING = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialPose:
    """R and (tx, ty) of a photo; tz is unknown as long as the lens is.

    Attributes:
        rotation: (3, 3) camera_from_world.
        shift: (2,) tx, ty in the world's units; (3,) where tz is known, too.

    """

    rotation: FloatArray
    shift: FloatArray


def radial_poses(world: FloatArray, offset: FloatArray) -> list[RadialPose]:
    """Candidate poses of a photo from world points (N, 3) and pixels less the centre (N, 2).

    Points off one plane give one candidate, points on a plane two (the plane may lean either
    way), and points near one all three: what their depths say may be lost in noise. The list is
    empty when the points are too few or degenerate (collinear).
    """
    frame = _Frame.of(world)
    if frame is None or not offset.any():
        return []
    pixel = offset / np.sqrt(np.mean(np.square(offset)))
    poses = _solve_on_plane(frame.local, pixel) if frame.thin else []
    if not frame.flat and len(world) >= MIN_POINTS:
        poses += _solve_in_space(frame.local, pixel)
    return [frame.in_world(pose) for pose in poses]


def poses_of_rays(world: FloatArray, rays: FloatArray) -> list[RadialPose]:
    """Poses of a photo whose lens is known, from points and their unit rays, both (N, 3).

    Unlike the radial equations this uses how far pixels are from the centre, too, so few points
    are enough: with five on a plane those have no equation to spare, and any five fit.

    Returns:
        R and all three coordinates of t: as of points on a plane, off it, or both where they are
        near one; none where they are too few or degenerate.

    """
    frame = _Frame.of(world)
    if frame is None:
        return []
    sizes = [2] * frame.thin + [3] * (not frame.flat and len(world) >= MIN_POINTS)
    found = (_solve_rays(frame.local, rays, size) for size in sizes)
    return [frame.in_world(pose) for pose in found if pose is not None]


def _solve_rays(local: FloatArray, rays: FloatArray, size: int) -> RadialPose | None:
    """The pose by so many coordinates of the points: 2 for points on a plane."""
    homogeneous = np.column_stack([local[:, :size], np.ones(len(local))])
    # Each ray is parallel to its point: their cross product is zero.
    equations = np.einsum("nij,nk->nijk", cross_matrix(rays), homogeneous)
    solution = _find_null_vector(equations.reshape(3 * len(local), -1)).reshape(3, size + 1)
    solution *= _find_sign(homogeneous @ solution.T, rays)
    columns = solution[:, :size]
    if size == 2:
        columns = np.column_stack([columns, np.zeros(3)])
    left, extent, right = np.linalg.svd(columns)
    if extent[1] < _NOTHING * extent[0]:
        return None
    if size == 2:  # the third column follows from a rotation's first two
        left[:, 2] *= np.sign(np.linalg.det(left) * np.linalg.det(right))
    rotation = left @ right
    if np.linalg.det(rotation) < 0:
        return None
    return RadialPose(rotation=rotation, shift=solution[:, size] / extent[:size].mean())


@dataclass(frozen=True, kw_only=True, eq=False)
class _Frame:
    """World points about their middle, along their own axes, with lengths of order 1.

    This keeps linear systems well conditioned.
    """

    local: FloatArray
    middle: FloatArray
    axes: FloatArray
    scale: float
    flat: bool
    thin: bool

    @classmethod
    def of(cls, world: FloatArray) -> _Frame | None:
        """Normalise points (N, 3); None where they are too few for any pose, or on one line."""
        if len(world) < MIN_POINTS_ON_PLANE:
            return None
        middle = world.mean(axis=0)
        _, extent, axes = np.linalg.svd(world - middle, full_matrices=False)
        if extent[0] == 0 or extent[1] < _FLAT * extent[0]:
            return None
        scale = float(np.sqrt(len(world)) / extent[0])
        local = (world - middle) @ axes.T * scale
        if np.linalg.det(axes) < 0:
            local, axes = local * [1, 1, -1], axes * [[1], [1], [-1]]
        flat, thin = (bool(extent[2] < share * extent[0]) for share in (_FLAT, _THIN))
        return cls(local=local, middle=middle, axes=axes, scale=scale, flat=flat, thin=thin)

    def in_world(self, pose: RadialPose) -> RadialPose:
        """Convert a pose of the local points to one of the given points."""
        rotation = pose.rotation @ self.axes
        moved = rotation[: len(pose.shift)] @ self.middle
        return RadialPose(rotation=rotation, shift=pose.shift / self.scale - moved)


def _find_null_vector(equations: FloatArray) -> FloatArray:
    return np.linalg.svd(equations, full_matrices=False)[2][-1]


def _find_sign(found: FloatArray, pixel: FloatArray) -> float:
    """The sign that turns the linear solution's directions (N, 2) towards the pixels."""
    return 1.0 if np.sign(np.sum(found * pixel, axis=1)).sum() >= 0 else -1.0


def _solve_radial(points: FloatArray, pixel: FloatArray) -> FloatArray:
    """First two rows of (R | t) (2, K + 1), up to their scale, by so many coordinates of points."""
    homogeneous = np.column_stack([points, np.ones(len(points))])
    equations = np.column_stack([-pixel[:, 1:] * homogeneous, pixel[:, :1] * homogeneous])
    solution = _find_null_vector(equations).reshape(2, -1)
    return solution * _find_sign(homogeneous @ solution.T, pixel)


def _solve_in_space(local: FloatArray, pixel: FloatArray) -> list[RadialPose]:
    solution = _solve_radial(local, pixel)
    left, size, right = np.linalg.svd(solution[:, :3], full_matrices=False)
    if size[1] < _NOTHING * size[0]:
        return []
    rows = left @ right
    rotation = np.vstack([rows, np.cross(rows[0], rows[1])])
    return [RadialPose(rotation=rotation, shift=solution[:, 3] / size.mean())]


def _solve_on_plane(local: FloatArray, pixel: FloatArray) -> list[RadialPose]:
    solution = _solve_radial(local[:, :2], pixel)
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
