"""Rays spread over the sphere, and the numerical inverse of any lens."""

from collections.abc import Callable

import numpy as np

from cubicfish.types import FloatArray

PixelAndSlope = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Unit rays (N, 3) -> pixels (N, 2), and d pixel / d ray (N, 2, 3)."""

_NEWTON_ITERATIONS = 30


def ray_at(theta: FloatArray, around: FloatArray) -> FloatArray:
    """Unit rays (..., 3) of angles (...,) from the axis and about it, from x to y, radians."""
    sine = np.sin(theta)
    return np.stack([sine * np.cos(around), sine * np.sin(around), np.cos(theta)], axis=-1)


def cone_rays(angle: float, count: int) -> FloatArray:
    """``count`` unit rays spread evenly over a cone about +z: half-angle radians -> (count, 3).

    A Fibonacci lattice on the spherical cap, its last ray on the rim.
    """
    z = 1 - (1 - np.cos(angle)) * (np.arange(count) + 0.5) / count
    z[-1] = np.cos(angle)
    return _along_spiral(z)


def all_around(count: int) -> FloatArray:
    """``count`` unit vectors spread evenly over the whole sphere (count, 3), from z downwards."""
    return _along_spiral(1 - (2 * np.arange(count) + 1) / count)


def _along_spiral(z: FloatArray) -> FloatArray:
    """Unit vectors of these z, each turned by the golden angle from the one before: (N, 3)."""
    turn = np.arange(len(z)) * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(np.maximum(0, 1 - z * z))
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1)


def tangent_basis(rays: FloatArray) -> FloatArray:
    """Two unit vectors orthogonal to each unit ray, as columns: (N, 3) -> (N, 3, 2)."""
    helper = np.where(np.abs(rays[:, :1]) < 0.6, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    first = np.cross(rays, helper)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(rays, first)], axis=-1)


def rays_of_pixels(
    pixel: FloatArray, starts: FloatArray, pixel_and_slope: PixelAndSlope, tolerance_px: float
) -> FloatArray:
    """The rays that a lens sees at pixels, by Newton's method on the sphere.

    Args:
        pixel: (N, 2) finite pixels.
        starts: (N, 3) unit rays to start from, roughly the right ones.
        pixel_and_slope: the lens.
        tolerance_px: a ray counts if it is seen this near to its pixel.

    Returns:
        (N, 3) unit rays, NaN where none was found.

    """
    rays = starts.copy()
    best = np.full((len(pixel), 3), np.nan)
    active = np.arange(len(pixel))
    for _ in range(_NEWTON_ITERATIONS):
        with np.errstate(all="ignore"):
            value, slope = pixel_and_slope(rays[active])
            miss = pixel[active] - value
            error = np.hypot(miss[:, 0], miss[:, 1])
        near = error <= tolerance_px
        best[active[near]] = rays[active[near]]
        # One more step than the tolerance asks for takes the answer to rounding.
        going = error > 1e-3 * tolerance_px
        active, miss, slope = active[going], miss[going], slope[going]
        if not active.size:
            break
        rays[active] = _step_on_sphere(rays[active], slope, miss)
    return best


def _step_on_sphere(rays: FloatArray, slope: FloatArray, miss: FloatArray) -> FloatArray:
    basis = tangent_basis(rays)
    jacobian = slope @ basis
    a, b = jacobian[:, 0, 0], jacobian[:, 0, 1]
    c, d = jacobian[:, 1, 0], jacobian[:, 1, 1]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        step = np.stack([d * miss[:, 0] - b * miss[:, 1], a * miss[:, 1] - c * miss[:, 0]], -1)
        step /= (a * d - b * c)[:, None]
        length = np.hypot(step[:, 0], step[:, 1])
        # 0.3 rad per step keeps Newton from jumping across the sphere when it starts far away.
        step *= np.minimum(1, 0.3 / np.maximum(length, 1e-300))[:, None]
        moved = rays + (basis @ step[:, :, None])[:, :, 0]
        return moved / np.linalg.norm(moved, axis=-1, keepdims=True)
