"""Where a board ends: corners that a place promises and the photo does not show.

A plane of squares may be slid along itself without any change in the photo, as long as its end
is not seen. An end is seen where the next lines of corners would lie well inside the picture
and inside the part of the field in which corners were found, and there are none. How many
promised corners are missing depends on a place only through the room it leaves on the grid's
four sides, so one small table a grid answers for all places.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.placement import Placement
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.corners.detection.grids import Grid, nearest

# Lines beyond the grid's box that are looked at. What lies further is no better known.
_LINES = 2
# A corner is expected only where its squares are in the picture, hardly smaller than nearly all
# squares that were found, and no farther out than nearly all corners of all photos.
_MARGIN_STEPS = 0.6
_SMALLEST_PERCENTILE, _SMALLEST_SHARE = 10, 0.8
_FARTHEST_PERCENTILE = 98
_SAME_CORNER_STEPS = 0.4
# A place promises clearly more than another with this factor and this many corners more.
_FACTOR, _MORE = 2, 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Ends:
    """Corners that should be seen around a grid if the board went on there.

    Attributes:
        table: (3, 3, 3, 3) how many are missing with 0, 1, or 2 and more lines of room before
            the first i, after the last i, before the first j, after the last j.
        last: (2,) largest i and j of the grid.

    """

    table: IntArray
    last: IntArray

    def missing(self, sides: Placement, side: IntArray, offset: IntArray) -> IntArray:
        """Promised corners that are not seen: (K,) sides, (K, 2) offsets -> (K,)."""
        back = np.swapaxes(sides.matrix[side], -1, -2)
        ends = np.stack([-offset, sides.size[side] - 1 - offset], axis=1)
        ends = (back[:, None] @ ends[..., None])[..., 0]
        before = np.clip(-ends.min(axis=1), 0, _LINES)
        after = np.clip(ends.max(axis=1) - self.last, 0, _LINES)
        return self.table[before[:, 0], after[:, 0], before[:, 1], after[:, 1]]


def clearly_more(rival: IntArray, own: int) -> BoolArray:
    """Whether so many missing corners speak against a place that misses only ``own``."""
    return np.asarray(rival) >= _FACTOR * own + _MORE


def farthest_radius(camera: RadialCamera, pixel: FloatArray) -> float:
    """Normalised radius within which nearly all corners (N, 2) of all photos lie."""
    offset = (pixel - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    return float(np.percentile(np.hypot(offset[:, 0], offset[:, 1]), _FARTHEST_PERCENTILE))


def ends_of(
    camera: RadialCamera,
    grid: Grid,
    camera_from_grid: FloatArray,
    other_pixel: FloatArray,
    farthest: float,
) -> Ends:
    """Look for the ends of one grid.

    Args:
        camera: the lens.
        grid: the grid.
        camera_from_grid: (3, 3) (i, j, 1) to the camera frame.
        other_pixel: (N, 2) the corners of the photo's other grids: what one of them holds is
            not missing.
        farthest: see :func:`farthest_radius`.

    """
    last = grid.cells.max(axis=0)
    found = np.zeros(last + 1 + 2 * _LINES, bool)
    found[tuple((grid.cells + _LINES).T)] = True
    cell = np.moveaxis(np.indices(found.shape), 0, -1) - _LINES
    form = camera_from_grid.T
    pixel = camera.project(np.concatenate([cell, np.ones((*found.shape, 1))], axis=-1) @ form)
    spacing = _spacing(pixel)
    missing = _near(found) & ~found & _visible(camera, pixel, spacing, farthest)
    smallest = np.percentile(spacing[found], _SMALLEST_PERCENTILE)
    missing &= spacing >= _SMALLEST_SHARE * smallest
    if len(other_pixel) and missing.any():
        distance, _ = nearest(pixel[missing], other_pixel, 1)
        taken = distance[:, 0] < _SAME_CORNER_STEPS * spacing[missing]
        missing[tuple(np.argwhere(missing)[taken].T)] = False
    return Ends(table=_table(missing), last=last)


def _spacing(pixel: FloatArray) -> FloatArray:
    """Distance to the nearest of the four neighbours, px; NaN where no side is known."""
    spacing = np.full(pixel.shape[:2], np.inf)
    for axis in (0, 1):
        step = np.linalg.norm(np.diff(pixel, axis=axis), axis=-1)
        step = np.where(np.isfinite(step), step, np.inf)
        first: list[slice] = [slice(None), slice(None)]
        second = first.copy()
        first[axis], second[axis] = slice(1, None), slice(None, -1)
        spacing[tuple(first)] = np.minimum(spacing[tuple(first)], step)
        spacing[tuple(second)] = np.minimum(spacing[tuple(second)], step)
    return np.where(np.isfinite(spacing), spacing, np.nan)


def _near(found: BoolArray) -> BoolArray:
    """Cells within :data:`_LINES` of a found one."""
    near = np.pad(found, _LINES)
    width, height = found.shape
    reach = range(2 * _LINES + 1)
    return np.any([near[i : i + width, j : j + height] for i in reach for j in reach], axis=0)


def _visible(
    camera: RadialCamera, pixel: FloatArray, spacing: FloatArray, farthest: float
) -> BoolArray:
    margin = _MARGIN_STEPS * spacing[..., None]
    size = np.array(camera.image_size)
    offset = (pixel - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    with np.errstate(invalid="ignore"):
        inside = ((pixel >= margin) & (pixel <= size - 1 - margin)).all(axis=-1)
        inside &= np.hypot(offset[..., 0], offset[..., 1]) <= farthest
    return inside


def _table(missing: BoolArray) -> IntArray:
    width, height = missing.shape
    table = [
        missing[_LINES - a : width - _LINES + b, _LINES - c : height - _LINES + d].sum()
        for a, b, c, d in product(range(_LINES + 1), repeat=4)
    ]
    return np.array(table, np.intp).reshape((_LINES + 1,) * 4)
