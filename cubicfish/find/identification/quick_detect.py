"""Quick detection: what pictures show, enough to choose which of them to detect in fully.

The first steps of the finder alone, on reduced photos: corners are good to a few tenths of a pixel,
and those that only growth finds are missing, as are boards with small squares. Photos or a target
that do not fit are not reported: full detection does that.

In films :func:`quick_detect_near` looks at half the size first, and then only where that, or a
picture before or after, shows a board.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.accept import is_beyond_chance, is_large_enough
from cubicfish.find.detection.corners import find_corners
from cubicfish.find.detection.grids import FoundGrids, Grid
from cubicfish.find.detection.growth import clean
from cubicfish.find.detection.links import find_patches
from cubicfish.find.detection.markers import MarkedCorners, outlined_corners
from cubicfish.find.detection.markers_read import marker_ratio
from cubicfish.find.detection.medians import median
from cubicfish.find.detection.nearby import nearest
from cubicfish.find.detection.pyramid import SMALLEST_SIDE, build_pyramid, enlarged, reduced
from cubicfish.find.detection.saddle import fit_saddles
from cubicfish.target.boards.markers import modules_along
from cubicfish.target.target import Target
from cubicfish.types import FloatArray, IntArray

# Photos are reduced to fewer pixels than these: squares show at 6 px, modules of markers at 1.6.
_MOST_PIXELS, _MOST_FOR_MARKERS = 250_000, 2_000_000
_SQUARE_PX, _MODULE_PX = 6.0, 1.6
# The first look at a picture of a film is at one that is reduced so many times more.
_COARSER = 2
# Small squares at a board's rim are not seen so. Where nobody says how many are missing, it may go
# on for this share of what is seen; and print goes on for so many squares beyond the last corners.
_MISSING, _BEYOND = 0.5, 1.5
# A board is seen whole at half the size where what must show, see above, is so many times as large:
# squares next to those that are seen are hardly half as large.
_CLEAR = 2.0
# Its corners are then found in the larger picture in windows of this half width, in squares, and at
# most of so many pixels.
_WINDOW, _LARGEST_WINDOW = 0.25, 5.0
# Parts that have more than this share of a picture's pixels are no less work than all of it.
_NEARLY_ALL = 0.7
QuickDetection = FoundGrids | MarkedCorners


def quick_detect(image: npt.NDArray[np.generic], target: Target | None) -> QuickDetection:
    """What a photo shows: corners of the target's boards with markers, or else checkerboards.

    Args:
        image: (H, W) grey photo, uint8, uint16 or floats.
        target: what is looked for; None for any checkerboard.

    """
    return _detect(image, target, _choose_zoom(image, target))


def quick_detect_near(
    image: npt.NDArray[np.generic],
    target: Target | None,
    near: Sequence[QuickDetection] = (),
    before: QuickDetection | None = None,
) -> QuickDetection:
    """As :func:`quick_detect`, in a picture of a film: closely only where boards may be.

    Boards are looked for at half the size everywhere. Where one is seen so that has small squares,
    and where one is expected that is not seen so, they are looked for at the whole size. So a board
    that is lost, or comes in, is found whatever is expected.

    Args:
        image: as for :func:`quick_detect`.
        target: the same.
        near: what pictures next to it show: the last two, or the one before and the one after.
            Boards are expected between and beyond their places, as far as these are apart.
        before: what this picture showed when less was expected, if that was no board.

    """
    zoom = _choose_zoom(image, target)
    size = image.shape[1], image.shape[0]
    known = [_list_boards(one, target) for one in near]
    expected = _list_expected(known)
    small = [not board.is_clear(_COARSER * zoom) for board in chain(*known)]
    if _fill(_apart(expected[np.array(small, bool)], size), size):
        return _detect(image, target, zoom)
    coarse = _detect(image, target, _COARSER * zoom) if before is None else before
    seen = _list_boards(coarse, target)
    clear = [one for one in seen if one.is_seen_whole(_COARSER * zoom)]
    others = [one.place for one in seen if one not in clear]
    missed = [one for one in expected if not any(own.covers(one.mean(axis=0)) for own in clear)]
    parts = _apart([*others, *missed], size)
    if _fill(parts, size):
        return _detect(image, target, zoom)
    photo = reduced(image, zoom)
    found = [_refined(one, photo, zoom) for one in clear]
    for low, high in parts:
        part = image[low[1] : high[1], low[0] : high[0]]
        found.append(_detect(part, target, zoom).moved(low))
    return _joined(found, coarse)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """A board as a picture shows it.

    Attributes:
        found: the detection of it alone.
        low, high: (2,) least and largest x, y of its corners.
        along: how many squares they are apart, the longer way.
        missing: how many squares it may go on for beyond them.
        is_whole: whether it is a board of the target with all of its corners.
        square: the least side of a square, pixels.
        clear_px: squares of this side are seen clearly.

    """

    found: QuickDetection
    low: FloatArray
    high: FloatArray
    along: float
    missing: float
    is_whole: bool
    square: float
    clear_px: float

    @classmethod
    def of(cls, found: QuickDetection, target: Target | None) -> _Seen:
        """Of a detection of one board."""
        boards = () if target is None else target.boards
        clear = _SQUARE_PX
        if isinstance(found, FoundGrids):
            cells, pixel = found.grids[0].cells, found.grids[0].pixel
            boards = tuple(board for board in boards if board.has_squares)
            plane = cells.astype(float)
        else:
            cells, pixel = np.stack([found.column, found.row], axis=-1), found.pixel
            board = boards[int(found.board[0])]
            boards, plane = (board,), board.plane_points(*cells.T) / board.square
            if board.markers is not None:
                modules = modules_along(board.markers.dictionary) + 2 * max(board.marker_borders)
                clear = _MODULE_PX * modules / marker_ratio(board)
        _, index = nearest(plane, plane, 2)
        one, other = index[:, 0], index[:, -1]
        apart = np.maximum(np.linalg.norm(plane[one] - plane[other], axis=1), 1e-9)
        square = float((np.linalg.norm(pixel[one] - pixel[other], axis=1) / apart).min())
        along = float(np.ptp(plane, axis=0).max())
        whole = [
            board.plane_points(board.columns - 1, board.rows - 1).max() / board.square
            for board in boards
        ]
        sizes = [(board.columns * board.rows, {board.columns, board.rows}) for board in boards]
        return cls(
            found=found,
            low=pixel.min(axis=0),
            high=pixel.max(axis=0),
            along=along,
            missing=max(0.0, max(whole) - along) if whole else _MISSING * along,
            is_whole=(len(cells), set(np.ptp(cells, axis=0) + 1)) in sizes,
            square=square,
            clear_px=_CLEAR * clear,
        )

    @property
    def place(self) -> FloatArray:
        """(2, 2) lowest and highest x, y of where more of it may be."""
        beside = (self.missing + _BEYOND) * max(
            self.square, float((self.high - self.low).max()) / max(self.along, 1.0)
        )
        return np.stack([self.low - beside, self.high + beside])

    def is_clear(self, zoom: float) -> bool:
        """Tell whether its squares are seen clearly in the picture, reduced so many times."""
        return self.square >= zoom * self.clear_px

    def is_seen_whole(self, zoom: float) -> bool:
        """Tell whether the picture, reduced so many times, shows all of it that there is."""
        return self.is_whole or self.is_clear(zoom)

    def covers(self, point: FloatArray) -> bool:
        """Tell whether it is seen around a point (2,)."""
        return bool((self.low <= point).all() and (point <= self.high).all())


def _detect(image: npt.NDArray[np.generic], target: Target | None, zoom: int) -> QuickDetection:
    """What a photo that is reduced so many times shows."""
    if target is not None and target.has_markers:
        return _detect_markers(image, target, zoom)
    return _detect_grids(image, zoom)


def _detect_markers(image: npt.NDArray[np.generic], target: Target, zoom: int) -> MarkedCorners:
    found = outlined_corners(reduced(image, zoom), target)
    return replace(found, pixel=enlarged(found.pixel, zoom))


def _detect_grids(image: npt.NDArray[np.generic], zoom: int) -> FoundGrids:
    height, width = image.shape
    small = reduced(image, zoom)
    if min(small.shape) < SMALLEST_SIDE:
        return FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=(width, height))
    pyramid = build_pyramid(small)
    corners = find_corners(pyramid)
    free = np.ones(len(corners.pixel), bool)
    found = []
    for patch in find_patches(pyramid, corners):
        lattice = patch.lattice(corners)
        clean(lattice)
        if is_large_enough(lattice):
            found.append(lattice)
            free[patch.corner] = False
    grids = [lattice.as_grid() for lattice in found]
    grids = [
        replace(grid, pixel=enlarged(grid.pixel, zoom), step=zoom * grid.step)
        for grid in grids
        if is_beyond_chance(len(grid), int(free.sum()))
    ]
    return FoundGrids(
        grids=tuple(sorted(grids, key=lambda grid: -len(grid))),
        refused=enlarged(corners.pixel[free], zoom),
        image_size=(width, height),
    )


def _choose_zoom(image: npt.NDArray[np.generic], target: Target | None) -> int:
    marked = target is not None and target.has_markers
    most = _MOST_FOR_MARKERS if marked else _MOST_PIXELS
    return max(1, math.ceil(math.sqrt(image.size / most)))


def _list_boards(found: QuickDetection, target: Target | None) -> list[_Seen]:
    """Each board that a picture shows."""
    return [_Seen.of(part, target) for part in found.each()]


def _refined(seen: _Seen, image: npt.NDArray[np.generic], zoom: int) -> QuickDetection:
    """A board with its corners where a picture shows them, which was reduced so many times."""
    found = seen.found
    pixel = found.grids[0].pixel if isinstance(found, FoundGrids) else found.pixel
    start = enlarged(pixel, 1 / zoom)
    half = np.clip(_WINDOW * seen.square / zoom, 1.5, _LARGEST_WINDOW)
    place, ok = fit_saddles(image, start, np.full(len(start), half))
    better = np.where(ok[:, None], enlarged(place, zoom), pixel)
    if isinstance(found, FoundGrids):
        return replace(found, grids=(replace(found.grids[0], pixel=better),))
    return replace(found, pixel=better)


def _list_expected(near: Sequence[Sequence[_Seen]]) -> FloatArray:
    """Where boards (B, 2, 2) of pictures before and after one, two or fewer, may be in that one."""
    places = [np.array([one.place for one in boards]).reshape(-1, 2, 2) for boards in near]
    grown = [_grown(own, other) for own, other in zip(places, places[::-1], strict=True)]
    return np.concatenate([np.zeros((0, 2, 2)), *grown])


def _grown(places: FloatArray, others: FloatArray) -> FloatArray:
    """Places (B, 2, 2), larger by how far off the nearest of others is, if there are any."""
    if not len(places) or not len(others):
        return places
    middle, other = places.mean(axis=1), others.mean(axis=1)
    apart = np.linalg.norm(middle[:, None] - other, axis=-1).min(axis=1)
    return np.asarray(places + apart[:, None, None] * np.array([[-1.0], [1.0]]))


def _apart(places: Sequence[FloatArray], size: tuple[int, int]) -> list[IntArray]:
    """Whole pixels (2, 2) of places, none of which overlap: those that do are one."""
    parts: list[IntArray] = []
    for place in np.clip(np.rint(np.reshape(places, (-1, 2, 2))), 0, size).astype(np.intp):
        part = place
        while over := [one for one in parts if _overlap(one, part)]:
            parts = [one for one in parts if not _overlap(one, part)]
            part = np.stack(
                [
                    np.min([part[0], *(one[0] for one in over)], axis=0),
                    np.max([part[1], *(one[1] for one in over)], axis=0),
                ]
            )
        if (part[1] > part[0]).all():
            parts.append(part)
    return parts


def _fill(parts: Sequence[IntArray], size: tuple[int, int]) -> bool:
    """Tell whether parts are nearly all of a picture."""
    pixels = sum(int((high - low).prod()) for low, high in parts)
    return pixels > _NEARLY_ALL * size[0] * size[1]


def _overlap(one: IntArray, other: IntArray) -> bool:
    return bool((one[0] < other[1]).all() and (other[0] < one[1]).all())


def _same(grid: Grid, other: Grid) -> bool:
    """Tell whether two grids are of one board: corners of one are corners of the other."""
    distance, _ = nearest(grid.pixel, other.pixel, 1)
    return bool(median(distance) < _WINDOW * grid.step)


def _joined(parts: Sequence[QuickDetection], coarse: QuickDetection) -> QuickDetection:
    """What parts of a picture show, of which this is seen at half the size."""
    if isinstance(coarse, FoundGrids):
        return _join_grids([one for one in parts if isinstance(one, FoundGrids)], coarse)
    return _join_marked([one for one in parts if isinstance(one, MarkedCorners)], coarse)


def _join_grids(parts: Sequence[FoundGrids], coarse: FoundGrids) -> FoundGrids:
    grids: list[Grid] = []
    for part in parts:
        grids += [grid for grid in part.grids if not any(_same(grid, one) for one in grids)]
    return replace(coarse, grids=tuple(sorted(grids, key=lambda grid: -len(grid))))


def _join_marked(parts: Sequence[MarkedCorners], coarse: MarkedCorners) -> MarkedCorners:
    # A board is in one part: in others is another like it, or what was misread.
    best = {int(one.board[0]): one for one in sorted(chain(*(p.each() for p in parts)), key=len)}
    return coarse.with_corners_of([best[board] for board in sorted(best)])
