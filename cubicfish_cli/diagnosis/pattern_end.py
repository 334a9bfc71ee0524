"""Whether a board's squares end where no more of its corners are found: a look at the photo.

Beyond the last line of corners lies one more line of squares, and then nothing of the pattern.
Where something covers the board, or corners were missed, either those squares are not to be seen
or they end somewhere else in every photo, or more of them follow.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.photos import Picture
from cubicfish_cli.types import FloatArray

# Where squares are looked at, in squares beyond the last line of corners: before it, and on to
# well beyond the line at which the pattern ends where its outermost squares are whole.
_BEFORE = -0.5
_BEYOND = np.arange(0.15, 1.46, 0.1)
# Contrast from square to square, as a share of the one before the line: of squares, and of none.
_SQUARES, _NONE = 0.5, 0.25
# A blurred edge is so wide.
_EDGE = 0.2
_FEWEST_SQUARES = 3
# Squares of fewer pixels are too small to tell a quarter of one.
_SMALLEST_PX = 6.0
# Levels are means over so much of a square about its middle.
_PATCH = np.array([-0.12, 0.0, 0.12])


def pattern_end(
    picture: Picture,
    camera: RadialCamera,
    camera_from_grid: FloatArray,
    grid: Grid,
    axis: Literal[0, 1],
    *,
    after: bool,
    in_view: bool,
) -> float | None:
    """Look beyond the last line of a grid's corners.

    Args:
        picture: (H, W) brightness of the photo.
        camera: the lens.
        camera_from_grid: (3, 3) (i, j, 1) to the camera frame.
        grid: the grid.
        axis: along i (0) or j (1).
        after: beyond the largest i or j, else before the smallest.
        in_view: whether what lies beyond is surely in the lens's field, so that darkness there
            is not its rim.

    Returns:
        How far beyond the line squares end, in squares: 1 on most boards, less where the
        outermost squares are cut; inf where squares go on; None where the photo does not tell.

    """
    last = grid.cells.max(axis=0)
    line, way = (int(last[axis]), 1) if after else (0, -1)
    middle = np.arange(int(last[1 - axis])) + 0.5
    if _side_px(camera, camera_from_grid, grid) < _SMALLEST_PX:
        return None

    distance = np.concatenate([[_BEFORE], _BEYOND])
    cell = np.empty((len(distance), len(middle), len(_PATCH), 2))
    cell[..., axis] = line + way * distance[:, None, None]
    cell[..., 1 - axis] = middle[:, None] + _PATCH
    points = np.concatenate([cell, np.ones((*cell.shape[:-1], 1))], axis=-1)
    level = _brightness(picture, camera.project(points @ camera_from_grid.T)).mean(axis=-1)
    known = np.isfinite(level).all(axis=0)
    if known.sum() < _FEWEST_SQUARES:
        return None
    # Bright and dark take turns along the line, and from line to line.
    sign = (-1.0) ** np.arange(len(middle))[known]
    contrast = level[:, known] @ (sign - sign.mean())
    if contrast[0] == 0:
        return None
    share = -contrast[1:] / contrast[0]
    if share[0] < _SQUARES:
        return None
    if share[_BEYOND > 1 + _EDGE].min() < -_SQUARES:
        return np.inf
    first = int(np.argmax(share < _SQUARES))
    if share[first] >= _SQUARES:
        return None
    fall = (share[first - 1] - _SQUARES) / (share[first - 1] - share[first])
    end = float(_BEYOND[first - 1] + fall * (_BEYOND[first] - _BEYOND[first - 1]))
    beyond = end + _EDGE < _BEYOND
    if not beyond.any() or np.abs(share[beyond]).max() > _NONE:
        return None
    squares, further = level[1, known], level[-1, known]
    return end if in_view or _is_light(squares, further) else None


def _is_light(squares: FloatArray, beyond: FloatArray) -> bool:
    """Whether what lies beyond is lighter than the middle between dark and bright squares."""
    bright, dark = np.maximum(squares[:-1], squares[1:]), np.minimum(squares[:-1], squares[1:])
    return bool(np.median(beyond) > np.median((bright + dark) / 2))


def _side_px(camera: RadialCamera, camera_from_grid: FloatArray, grid: Grid) -> float:
    """The shorter side of the smallest square of the grid's rim, pixels."""
    last = grid.cells.max(axis=0).astype(float)
    corner = np.array([[0, 0], [last[0], 0], [0, last[1]], last])
    steps = []
    for step in np.eye(2):
        ends = [np.column_stack([corner + half * step, np.ones(4)]) for half in (-0.5, 0.5)]
        first, second = (camera.project(end @ camera_from_grid.T) for end in ends)
        steps.append(np.linalg.norm(second - first, axis=1))
    return float(np.min(np.nan_to_num(steps)))


def _brightness(picture: Picture, pixel: FloatArray) -> FloatArray:
    """Brightness at pixels (..., 2), between the nearest four; NaN outside the picture."""
    height, width = picture.shape
    inside = np.asarray(((pixel >= 0) & (pixel <= (width - 1, height - 1))).all(axis=-1))
    at = np.where(inside[..., None], pixel, 0.0)
    first = np.minimum(at.astype(int), (width - 2, height - 2))
    x, y = first[..., 0], first[..., 1]
    right, down = (at - first)[..., 0], (at - first)[..., 1]
    top = picture[y, x] * (1 - right) + picture[y, x + 1] * right
    bottom = picture[y + 1, x] * (1 - right) + picture[y + 1, x + 1] * right
    return np.where(inside, top * (1 - down) + bottom * down, np.nan)
