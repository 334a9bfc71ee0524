"""How well a posed, labelled grid agrees with its pixels, for very many hypotheses at once.

To first order the reprojection error of a point X (camera frame) seen along the unit ray d is
J X / |X|, with J = d pixel / d ray, since J d = 0. With the distance taken from the grid's own
pose, the sum of its squares over a grid is a quadratic form in the 3x3 matrix H that takes
(i, j, 1) to the camera frame: vec(H)ᵀ M vec(H). M is computed once a grid, so that a
hypothesis costs a few small matrix products however many corners the grid has.
"""

from __future__ import annotations

import numpy as np

from cubicfish_cli.fitting.poses import rotation_from_vector
from cubicfish_cli.lenses.radial import RadialCamera, project_jacobian
from cubicfish_cli.types import FloatArray, IntArray


def grid_moments(
    lens: RadialCamera, cells: IntArray, pixel: FloatArray, camera_from_grid: FloatArray
) -> FloatArray:
    """M (9, 9) of a grid, in px² for H in squares; index = 3 · camera axis + grid axis.

    Args:
        lens: the lens.
        cells: (N, 2) i, j.
        pixel: (N, 2).
        camera_from_grid: (3, 3) the grid's own pose: (i, j, 1) to the camera frame, in squares.

    """
    rays = lens.unproject(pixel)
    seen = np.isfinite(rays).all(axis=-1)
    rays = rays[seen]
    grid = np.column_stack([cells[seen], np.ones(len(rays))])
    distance = np.linalg.norm(grid @ camera_from_grid.T, axis=-1)
    slope = project_jacobian(lens.parameters, rays)[1] / distance[:, None, None]
    rows = (slope[:, :, :, None] * grid[:, None, None, :]).reshape(-1, 9)
    return rows.T @ rows


def form_cost(moments: FloatArray, form: FloatArray) -> FloatArray:
    """Squared error, px²: M (9, 9) and H (..., 3, 3), in squares -> (...,)."""
    flat = form.reshape(*form.shape[:-2], 9)
    return np.einsum("...i,...i->...", flat @ moments, flat)


def normal_equations(
    moments: FloatArray, form: FloatArray, pivot: FloatArray, square: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cost, half its gradient and its Gauss-Newton Hessian by small moves of the object.

    Args:
        moments: (9, 9) M of a grid.
        form: (K, 3, 3) H in world units.
        pivot: (K, 3) the point of the camera frame that rotations leave in place.
        square: (K,) the board's square, world units.

    Returns:
        (K,), (K, 6), (K, 6, 6); a move is a rotation vector about the pivot, then a shift.

    """
    arm = form.copy()
    arm[:, :, 2] -= pivot
    jacobian = np.zeros((len(form), 6, 3, 3))
    jacobian[:, 0, 1], jacobian[:, 0, 2] = -arm[:, 2], arm[:, 1]
    jacobian[:, 1, 0], jacobian[:, 1, 2] = arm[:, 2], -arm[:, 0]
    jacobian[:, 2, 0], jacobian[:, 2, 1] = -arm[:, 1], arm[:, 0]
    for axis in range(3):
        jacobian[:, 3 + axis, axis, 2] = 1
    flat = jacobian.reshape(-1, 6, 9) / square[:, None, None]
    value = form.reshape(-1, 9) / square[:, None]
    weighted = (flat.reshape(-1, 9) @ moments).reshape(-1, 6, 9)
    cost = np.einsum("ki,ki->k", value @ moments, value)
    return cost, np.einsum("kmi,ki->km", weighted, value), weighted @ np.swapaxes(flat, 1, 2)


def gauss_newton(gradient: FloatArray, hessian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Steps (K, 6) and the decrease of the cost that each promises (K,)."""
    scale = np.sqrt(np.maximum(np.diagonal(hessian, axis1=1, axis2=2), 1e-300))
    scaled = hessian / (scale[:, :, None] * scale[:, None, :]) + 1e-9 * np.eye(6)
    step = -np.linalg.solve(scaled, (gradient / scale)[:, :, None])[:, :, 0] / scale
    return step, -np.einsum("km,km->k", step, gradient)


def moved(
    rotation: FloatArray, translation: FloatArray, pivot: FloatArray, step: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Poses (K, 3, 3) and (K, 3) after steps (K, 6) about their pivots (K, 3)."""
    turn = rotation_from_vector(step[:, :3])
    arm = (turn @ (translation - pivot)[:, :, None])[:, :, 0]
    return turn @ rotation, arm + pivot + step[:, 3:]
