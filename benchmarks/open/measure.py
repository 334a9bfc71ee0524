"""What every tool's lens is measured by: only numpy, and a function from points to pixels.

``project(points)`` is the tool's own code: (N, 3) points of the camera's frame (z forward, x right,
y down) to (N, 2) pixels, NaN where the tool cannot say. Nothing else is asked of a lens.
"""

import numpy as np

STEPS = 40  # of a pose's refinement, at most
RAYS = 12000  # that are tried,
REACH_DEG = 125.0  # up to so far from the axis, as the start of a pose
TIGHT = 3.0  # residuals beyond so many times their median count less (Huber)


def turned(vector):
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3)."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(np.asarray(vector, float), -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
    near = np.where(angle < 1e-8, 1.0, angle)
    return (
        np.eye(3)
        + np.where(angle < 1e-8, 1.0, np.sin(near) / near) * cross
        + np.where(angle < 1e-8, 0.5, (1 - np.cos(near)) / near**2) * cross @ cross
    )


def refined(project, points, pixel, rotation, shift, moves=True):
    """Pose (R, t) of least robust error from a start: Levenberg–Marquardt, numeric derivatives.

    Corners that the lens cannot say anything about (NaN) have no say. ``moves=False`` fits R alone.
    """
    size = max(float(np.ptp(points, axis=0).max()), 1e-12)
    free = 6 if moves else 3
    scale = np.array([1, 1, 1, size, size, size])[:free]
    steps = np.vstack([np.zeros(free), 1e-6 * np.eye(free)])

    def residuals(rotation, shift):  # at the pose, and a small step along each of its numbers
        moved = steps * scale
        turns = turned(moved[:, :3]) @ rotation
        shifts = shift + (moved[:, 3:] if moves else 0)
        where = np.einsum("kij,nj->kni", turns, points) + np.reshape(shifts, (-1, 1, 3))
        seen = project(where.reshape(-1, 3)).reshape(len(steps), len(points), 2)
        return seen - pixel

    def cost_of(miss):
        length = np.linalg.norm(miss, axis=-1)
        good = np.isfinite(length)
        if good.sum() < 4:
            return np.inf, None, None
        tight = max(TIGHT * float(np.median(length[good])), 1e-9)
        return tight, good, np.where(good, np.minimum(1.0, tight / np.maximum(length, 1e-12)), 0.0)

    now = residuals(rotation, shift)
    damp = 1e-3
    for _ in range(STEPS):
        tight, good, weight = cost_of(now[0])
        if good is None:
            break
        slope = np.nan_to_num((now[1:] - now[0]) / 1e-6)  # (free, N, 2)
        slope = slope.reshape(free, -1)
        both = np.repeat(weight, 2)
        miss = np.nan_to_num(now[0]).reshape(-1)
        normal, gradient = (slope * both) @ slope.T, (slope * both) @ miss
        before = huber(now[0], tight, good)
        while damp < 1e9:
            try:
                move = -np.linalg.solve(normal + damp * np.diag(np.diag(normal) + 1e-12), gradient)
            except np.linalg.LinAlgError:
                damp *= 10
                continue
            step = move * scale
            turn = turned(step[:3]) @ rotation
            place = shift + step[3:] if moves else shift
            then = residuals(turn, place)
            # A corner must not leave the fit by leaving what the lens can say.
            if huber(then[0], tight, good) < before:
                break
            damp *= 10
        else:
            break
        rotation, shift, now, damp = turn, place, then, max(damp / 10, 1e-9)
        if np.abs(move).max() < 1e-10 or huber(now[0], tight, good) > before * (1 - 1e-12):
            break
    return rotation, shift


def huber(miss, tight, good):
    """The robust cost; infinite if a corner that had a residual has none now."""
    length = np.linalg.norm(miss, axis=-1)[good]
    if not np.isfinite(length).all():
        return np.inf
    return float(np.where(length < tight, length**2, tight * (2 * length - tight)).sum())


def table_of(project, far):
    """What a lens does to a dense set of rays: (rays (K, 3) so long, pixels (K, 2), steps (K,))."""
    z = np.linspace(1, np.cos(np.deg2rad(REACH_DEG)), RAYS)
    round_ = np.arange(RAYS) * np.pi * (3 - np.sqrt(5))  # a spiral: equal areas
    out = np.sqrt(1 - z**2)
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
        with np.errstate(all="ignore"):
            move = solve2(slope, pixel - first)
        move = np.where(np.isfinite(move), np.clip(move, -0.05, 0.05), 0.0)
        rays = rays + far * np.einsum("nk,nki->ni", move, sides)
        rays *= far / np.linalg.norm(rays, axis=1, keepdims=True)
    return rays / far


def tangent(project, points):
    """Pixels (N, 2), two directions across each ray (N, 2, 3), and slopes (N, 2, 2) px/rad."""
    far = np.linalg.norm(points, axis=1, keepdims=True)
    rays = points / far
    other = np.where(np.abs(rays[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]])
    first = np.cross(rays, other)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    sides = np.stack([first, np.cross(rays, first)], axis=1)
    tiny = 1e-5
    ways = [points] + [points + far * tiny * s * sides[:, k] for k in (0, 1) for s in (1, -1)]
    seen = project(np.concatenate(ways)).reshape(5, -1, 2)
    slope = np.stack([seen[1] - seen[2], seen[3] - seen[4]], axis=-1) / (2 * tiny)
    return seen[0], sides, slope


def solve2(slope, miss):
    """Solutions (N, 2) of N systems of two; NaN or infinite where there is none."""
    (a, b), (c, d) = np.moveaxis(slope[:, 0], -1, 0), np.moveaxis(slope[:, 1], -1, 0)
    x, y = miss.T
    return np.stack([d * x - b * y, a * y - c * x], axis=-1) / (a * d - b * c)[:, None]


def starts_of(rays, points):
    """Poses (R, t) that rays and points of one plane suggest, by a homography of rays."""
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle)[2]
    flat = (points - middle) @ axes[:2].T
    size = np.abs(flat).max()
    places = np.column_stack([flat / size, np.ones(len(flat))])
    rows = []
    for ray, place in zip(rays, places, strict=True):
        x, y, z = ray
        rows += [np.kron([0, -z, y], place), np.kron([z, 0, -x], place), np.kron([-y, x, 0], place)]
    plane = np.linalg.svd(np.array(rows))[2][-1].reshape(3, 3)
    plane *= np.sign(np.median(np.einsum("ni,ij,nj->n", rays, plane, places)) or 1.0)
    plane /= np.sqrt(np.linalg.norm(plane[:, 0]) * np.linalg.norm(plane[:, 1]))
    u, _, v = np.linalg.svd(np.column_stack([plane[:, 0], plane[:, 1]]), full_matrices=False)
    two = u @ v
    normal = np.cross(two[:, 0], two[:, 1])
    frame = np.column_stack([two, normal]) @ np.vstack([axes[:2], np.cross(axes[0], axes[1])])
    return frame, plane[:, 2] * size - frame @ middle


def pose_of(project, points, pixel, group, table):
    """The pose of one photo: a start from each flat group of its points, the best one refined."""
    rays = rays_of(project, pixel, table)
    best, least = None, np.inf
    for one in np.unique(group):
        chosen = group == one
        if chosen.sum() < 4:
            continue
        rotation, shift = starts_of(rays[chosen], points[chosen])
        rotation, shift = refined(project, points[chosen], pixel[chosen], rotation, shift)
        rotation, shift = refined(project, points, pixel, rotation, shift)
        miss = np.linalg.norm(project(points @ rotation.T + shift) - pixel, axis=1)
        middle = np.median(np.where(np.isfinite(miss), miss, np.inf))
        if middle < least or best is None:
            best, least = (rotation, shift), middle
    if best is None:
        raise ValueError("a photo with fewer than four corners on each board")
    return best


def evaluated(project, world, photos):
    """Errors of photos whose poses alone are fitted.

    ``photos`` are (points' numbers, pixels, boards). Of all corners, one after the other: error in
    pixels and arc minutes, angle from the axis in degrees, ray (N, 3); infinite or NaN where the lens
    cannot say.
    """
    found, table = [], table_of(project, 10 * np.ptp(world, axis=0).max())
    if not len(table[0]):
        raise ValueError("the lens has no pixel for any ray")
    for point, pixel, group in photos:
        rotation, shift = pose_of(project, world[point], pixel, group, table)
        seen = world[point] @ rotation.T + shift
        first, _, slope = tangent(project, seen)
        miss = np.linalg.norm(first - pixel, axis=1)
        with np.errstate(all="ignore"):
            minutes = np.rad2deg(np.linalg.norm(solve2(slope, pixel - first), axis=1)) * 60
        rays = seen / np.linalg.norm(seen, axis=1, keepdims=True)
        angle = np.rad2deg(np.arccos(np.clip(rays[:, 2], -1, 1)))
        lost = ~np.isfinite(miss)
        miss[lost], minutes[~np.isfinite(minutes) | lost] = np.inf, np.inf
        found.append((miss, minutes, angle, rays))
    return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))


def apart(first, second, rays):
    """Pixels (N,) between two lenses at far points, once one is turned so that they agree best."""
    seen = first(rays)
    turn, _ = refined(second, rays, seen, np.eye(3), np.zeros(3), moves=False)
    between = np.linalg.norm(second(rays @ turn.T) - seen, axis=1)
    return np.where(np.isfinite(between), between, np.inf)
