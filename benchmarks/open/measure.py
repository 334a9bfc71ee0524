"""What every tool's lens is measured by: only a function from points to pixels is asked of it.

``project(points)`` is the tool's own code: (N, 3) points of the camera's frame (z forward, x right,
y down) to (N, 2) pixels, NaN where the tool cannot say.
"""

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

RAYS = 12000  # that are tried,
REACH_DEG = 125.0  # up to so far from the axis, as the start of a pose
REACHED = 1.0  # px, within which some ray must come to a corner for it to have a say
TIGHT = 3.0  # residuals beyond so many times their median count less (Huber's loss)


def refined(project, points, pixel, rotation, shift, moves=True):
    """Pose (R, t) of least robust error from a start; ``moves=False`` fits R alone.

    Corners that the lens has no pixel for at the start have no say.
    """
    scale = np.array([1, 1, 1, *[np.ptp(points, axis=0).max()] * 3])[: 6 if moves else 3]

    def placed(step):
        moved = step * scale
        turn = Rotation.from_rotvec(moved[:3]).as_matrix() @ rotation
        return turn, shift + moved[3:] if moves else shift

    def seen(steps):
        where = [points @ turn.T + place for turn, place in map(placed, steps)]
        return project(np.concatenate(where)).reshape(len(steps), -1, 2)

    start = np.zeros(len(scale))
    good = np.isfinite(seen([start])[0] + pixel).all(axis=1)
    if good.sum() < 4:
        return rotation, shift
    # Whatever has no pixel any more is as far away as a whole photo.
    far = float(np.ptp(pixel[good])) + 1.0

    def residual(step):
        miss = seen([step])[0][good] - pixel[good]
        return np.nan_to_num(miss, nan=far, posinf=far, neginf=far).ravel()

    def slope(step):
        near = seen([step, *(step + 1e-6 * np.eye(len(step)))])[:, good]
        slopes = np.nan_to_num((near[1:] - near[0]) / 1e-6, posinf=0.0, neginf=0.0)
        return slopes.reshape(len(step), -1).T

    for _ in range(2):
        miss = np.linalg.norm(residual(start).reshape(-1, 2), axis=1)
        tight = max(TIGHT * float(np.median(miss)), 1e-9)
        start = least_squares(residual, start, slope, loss="huber", f_scale=tight, max_nfev=40).x
    return placed(start)


def tangent(project, points):
    """Pixels (N, 2), two directions across each ray (N, 2, 3), and slopes (N, 2, 2) px/rad."""
    far = np.linalg.norm(points, axis=1, keepdims=True)
    rays = points / far
    first = np.cross(rays, np.where(np.abs(rays[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    sides = np.stack([first, np.cross(rays, first)], axis=1)
    step = 1e-5 * far
    ways = [points] + [points + step * s * sides[:, k] for k in (0, 1) for s in (1, -1)]
    seen = project(np.concatenate(ways)).reshape(5, -1, 2)
    return seen[0], sides, np.stack([seen[1] - seen[2], seen[3] - seen[4]], axis=-1) / 2e-5


def across(slope, miss):
    """Steps across the rays (N, 2), radians, that move their pixels so far; 0 where unknown."""
    zero = {"nan": 0.0, "posinf": 0.0, "neginf": 0.0}
    inverse = np.linalg.pinv(np.nan_to_num(slope, **zero))
    return np.einsum("nij,nj->ni", inverse, np.nan_to_num(miss, **zero))


def table_of(project, far):
    """What a lens does to a dense set of rays: (rays (K, 3) so long, pixels (K, 2), steps (K,))."""
    z = np.linspace(1, np.cos(np.deg2rad(REACH_DEG)), RAYS)
    round_, out = np.arange(RAYS) * np.pi * (3 - np.sqrt(5)), np.sqrt(1 - z**2)
    rays = far * np.stack([np.cos(round_) * out, np.sin(round_) * out, z], axis=-1)
    seen, _, slope = tangent(project, rays)
    # How far the next ray's pixel is, and half as much again.
    step = 1.5 * np.sqrt(2 * np.pi * (1 - z[-1]) / RAYS) * np.linalg.norm(slope, axis=(1, 2))
    good = np.isfinite(seen).all(axis=1) & np.isfinite(step)
    return rays[good], seen[good], step[good]


def rays_of(project, pixel, table):
    """(N, 3) unit rays that the lens sends to the pixels: the nearest of a table, refined."""
    rays, seen, step = table
    far, found = np.linalg.norm(rays[0]), []
    for one in pixel:
        away = np.linalg.norm(seen - one, axis=1)
        near = np.flatnonzero(away <= step)
        # Lenses that fold back send several rays to a pixel: the one nearest to the axis is meant.
        found.append(rays[near[0] if len(near) else away.argmin()])
    rays = np.array(found)
    for _ in range(6):
        first, sides, slope = tangent(project, rays)
        move = np.clip(across(slope, pixel - first), -0.05, 0.05)
        rays = rays + far * np.einsum("nk,nki->ni", move, sides)
        rays *= far / np.linalg.norm(rays, axis=1, keepdims=True)
    return rays / far


def start_of(rays, points):
    """The pose (R, t) that rays and points of one plane suggest, by a homography of rays."""
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle)[2]
    flat = (points - middle) @ axes[:2].T
    size = np.abs(flat).max()
    places = np.column_stack([flat / size, np.ones(len(flat))])
    rows = [
        np.kron(np.cross(np.eye(3), ray), place) for ray, place in zip(rays, places, strict=True)
    ]
    plane = np.linalg.svd(np.concatenate(rows))[2][-1].reshape(3, 3)
    plane *= np.sign(np.median(np.einsum("ni,ij,nj->n", rays, plane, places))) or 1.0
    long = np.sqrt(np.linalg.norm(plane[:, 0]) * np.linalg.norm(plane[:, 1]))
    if not long > 0:  # a lens that sees all pixels along one ray: before it, as good as anything
        return np.eye(3), np.array([0, 0, 2 * size]) - middle
    plane /= long
    u, _, v = np.linalg.svd(plane[:, :2], full_matrices=False)
    sides = np.column_stack([u @ v, np.cross(*(u @ v).T)])
    turn = sides @ np.vstack([axes[:2], np.cross(axes[0], axes[1])])
    return turn, plane[:, 2] * size - turn @ middle


def pose_of(project, points, pixel, group, table):
    """The pose of one photo: a start from each flat group of its points, the best one refined."""
    rays, best, least = rays_of(project, pixel, table), None, np.inf
    # A lens that ends before a corner would push the pose until that corner is inside.
    near = np.linalg.norm(project(rays * np.linalg.norm(table[0][0])) - pixel, axis=1) < REACHED
    if len(table[0]) < RAYS and np.bincount(group[near]).max(initial=0) >= 4:
        rays, points, pixel, group = rays[near], points[near], pixel[near], group[near]
    for one in np.unique(group):
        own = group == one
        if own.sum() < 4:
            continue
        pose = refined(project, points[own], pixel[own], *start_of(rays[own], points[own]))
        pose = pose if own.all() else refined(project, points, pixel, *pose)
        miss = np.linalg.norm(project(points @ pose[0].T + pose[1]) - pixel, axis=1)
        middle = np.median(np.nan_to_num(miss, nan=np.inf))
        if best is None or middle < least:
            best, least = pose, middle
    if best is None:
        raise ValueError("a photo with fewer than four corners on each board")
    return best


def evaluated(project, world, photos):
    """Errors of photos whose poses alone are fitted.

    ``photos`` are (points' numbers, pixels, boards). Of all corners, one after the other: error in
    pixels and arc minutes, angle from the axis in degrees, ray (N, 3); errors are infinite where
    the lens has no pixel.
    """
    found, table = [], table_of(project, 10 * np.ptp(world, axis=0).max())
    if not len(table[0]):
        raise ValueError("the lens has no pixel for any ray")
    for point, pixel, group in photos:
        turn, place = pose_of(project, world[point], pixel, group, table)
        seen = world[point] @ turn.T + place
        first, _, slope = tangent(project, seen)
        miss = np.linalg.norm(first - pixel, axis=1)
        minutes = np.rad2deg(np.linalg.norm(across(slope, pixel - first), axis=1)) * 60
        rays = seen / np.linalg.norm(seen, axis=1, keepdims=True)
        lost = ~np.isfinite(miss)
        miss[lost], minutes[lost] = np.inf, np.inf
        found.append((miss, minutes, np.rad2deg(np.arccos(np.clip(rays[:, 2], -1, 1))), rays))
    return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))


def apart(first, second, points):
    """Pixels (N,) between two lenses at far points, once one is turned so that they agree best."""
    seen = first(points)
    turn, _ = refined(second, points, seen, np.eye(3), np.zeros(3), moves=False)
    return np.nan_to_num(np.linalg.norm(second(points @ turn.T) - seen, axis=1), nan=np.inf)
