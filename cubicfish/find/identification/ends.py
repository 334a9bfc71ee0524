"""Where a board ends: corners that a place promises and the photo does not show, and strays.

A plane of squares may be slid along itself without any change in the photo, as long as its end
is not seen. An end is seen where the next lines of corners would lie well inside the picture
and inside the part of the field in which corners were found, and there are none. How many
promised corners are missing depends on a place only through the room it leaves on the grid's
four sides, so one small table a grid answers for all places.

Behind a board's margin something dark may look like one more corner or like a whole cell of
them. Such strays make lines at the grid's rim that hold hardly any corner. They must not hide the
board, so they are cut off, at a cost: only as many lines as must go, the weakest first, and never
one that may be part of a larger board. A line that need not go may be a stray as well, of a board
that is cut on its other side.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from cubicfish.find.detection.accept import MOST_MISS
from cubicfish.find.detection.grids import Grid
from cubicfish.find.detection.lattice import Lattice
from cubicfish.find.detection.nearby import nearest
from cubicfish.models.radial import RadialCamera
from cubicfish.target.placement import Placement
from cubicfish.types import BoolArray, FloatArray, IntArray

# A line at the rim is weak with at most so many corners, or with so small a share of what the
# fullest line beside it has; with more than the other share it is none.
_WEAK, _WEAK_SHARE, _STRONG_SHARE = 2, 0.25, 0.5
# Corners that may be cut off: a few in any case, else a share of all; and never too many.
_FEW, _FEW_SHARE, _MOST_SHARE = 4, 0.125, 0.25
# A corner vouches for its line at the rim where it lies as near to what the rest of the grid
# predicts as corners of boards do, and where its squares differ by no smaller share of what those
# of the corners around do: light falls off by less from one line to the next.
_SAME_CONTRAST = 0.4
# Lines beyond the grid's box that are searched. What lies further is no better known.
_LINES = 2
# A corner is expected only where its squares are in the picture, hardly smaller than nearly all
# squares that were found, and no farther out than nearly all corners of all photos.
_MARGIN_STEPS = 0.6
_SMALLEST_PERCENTILE, _SMALLEST_SHARE = 10, 0.8
_FARTHEST_PERCENTILE = 98
_SAME_CORNER_STEPS = 0.4
# A place promises clearly more than another with this factor and this many corners more.
_FACTOR, _MORE = 2, 4


def solid(grid: Grid) -> Grid:
    """The grid without any weak line at its rim."""
    return without_strays(grid) or grid


def doubtful_rims(grid: Grid) -> list[BoolArray]:
    """The lines at the rim for which hardly any corner vouches: for each, its cells (N,)."""
    lattice = Lattice.from_cells(grid.cells, grid.pixel, grid.contrast, grid.parity)
    place = grid.cells + (lattice.cells().min(axis=0) - grid.cells.min(axis=0))
    found = []
    for axis in (0, 1):
        along = grid.cells[:, axis]
        fullest = int(np.bincount(along).max())
        for rim in (along == along.min(), along == along.max()):
            lattice.drop(place[rim])
            fit = lattice.fit(place[rim])
            around = lattice.contrast_around(place[rim])
            away = fit.cells_away(grid.pixel[rim]) / (1 + np.sqrt(fit.leverage))
            vouched = (away < MOST_MISS) | ~fit.sound  # where nothing is predicted nothing speaks
            vouched &= grid.contrast[rim] >= _SAME_CONTRAST * around
            if vouched.sum() <= max(_WEAK, _WEAK_SHARE * fullest):
                found.append(rim)
            lattice.put(place[rim], grid.pixel[rim], grid.contrast[rim])
    return found


def without_strays(grid: Grid, sizes: IntArray | None = None) -> Grid | None:
    """The grid, cut as little as makes it fit a box; None where no few corners are in the way.

    Args:
        grid: the grid.
        sizes: (S, 2) boxes along the grid's i and j that it may fill; None cuts all weak lines.

    """
    keep = np.ones(len(grid), bool)
    while True:
        cells = grid.cells[keep]
        extent = np.ptp(cells, axis=0) + 1
        if sizes is not None and (extent <= sizes).all(axis=1).any():
            break
        axes = [0, 1] if sizes is None else _find_long_axes(extent, sizes)
        weakest = _find_weakest_lines(cells, axes)
        if weakest is None:
            if sizes is not None:
                return None
            break
        keep[keep] = ~weakest
        cut = int((~keep).sum())
        if cut > max(_FEW, _FEW_SHARE * len(grid)) or cut > _MOST_SHARE * len(grid):
            return None
    cells = grid.cells[keep]
    first = cells.min(axis=0)
    return replace(
        grid,
        cells=cells - first,
        pixel=grid.pixel[keep],
        # Every step along i or j flips the colours.
        parity=grid.parity * (-1) ** int(first.sum()),
        contrast=grid.contrast[keep],
    )


def _find_long_axes(extent: IntArray, sizes: IntArray) -> list[int]:
    """The axes along which the grid must be shorter to come nearer to a box."""
    over = np.maximum(extent - sizes, 0)
    nearest = over[over.sum(axis=1) == over.sum(axis=1).min()]
    return [axis for axis in (0, 1) if nearest[:, axis].any()]


def _find_weakest_lines(cells: IntArray, axes: list[int]) -> BoolArray | None:
    """Which cells (N,) are on the weakest lines at the rim; None where no line is weak.

    Where two are equally weak, nothing tells which of them is of the board: both go.
    """
    fewest, lines = np.inf, np.zeros(len(cells), bool)
    for axis in axes:
        along = cells[:, axis]
        count = np.bincount(along - along.min())
        for end in (0, -1):
            own = int(count[end])
            weak = own <= max(_WEAK, _WEAK_SHARE * count.max())
            if not weak or own > _STRONG_SHARE * count.max() or own > fewest:
                continue
            here: BoolArray = along == (along.min() if end == 0 else along.max())
            lines = here if own < fewest else lines | here
            fewest = own
    return lines if np.isfinite(fewest) else None


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


def clearly_more(other: IntArray, own: int) -> BoolArray:
    """Whether so many missing corners speak against a place that misses only ``own``."""
    return np.asarray(other) >= _FACTOR * own + _MORE


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
    spacing = _measure_spacing(pixel)
    missing = _find_near(found) & ~found & _find_visible(camera, pixel, spacing, farthest)
    smallest = np.percentile(spacing[found], _SMALLEST_PERCENTILE)
    missing &= spacing >= _SMALLEST_SHARE * smallest
    if len(other_pixel) and missing.any():
        distance, _ = nearest(pixel[missing], other_pixel, 1)
        taken = distance[:, 0] < _SAME_CORNER_STEPS * spacing[missing]
        missing[tuple(np.argwhere(missing)[taken].T)] = False
    return Ends(table=_tabulate(missing), last=last)


def _measure_spacing(pixel: FloatArray) -> FloatArray:
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


def _find_near(found: BoolArray) -> BoolArray:
    """Cells within :data:`_LINES` of a found one."""
    near = np.pad(found, _LINES)
    width, height = found.shape
    lines = range(2 * _LINES + 1)
    return np.any([near[i : i + width, j : j + height] for i in lines for j in lines], axis=0)


def _find_visible(
    camera: RadialCamera, pixel: FloatArray, spacing: FloatArray, farthest: float
) -> BoolArray:
    margin = _MARGIN_STEPS * spacing[..., None]
    size = np.array(camera.image_size)
    offset = (pixel - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    with np.errstate(invalid="ignore"):
        inside = ((pixel >= margin) & (pixel <= size - 1 - margin)).all(axis=-1)
        inside &= np.hypot(offset[..., 0], offset[..., 1]) <= farthest
    return inside


def _tabulate(missing: BoolArray) -> IntArray:
    width, height = missing.shape
    table = [
        missing[_LINES - a : width - _LINES + b, _LINES - c : height - _LINES + d].sum()
        for a, b, c, d in product(range(_LINES + 1), repeat=4)
    ]
    return np.array(table, np.intp).reshape((_LINES + 1,) * 4)
