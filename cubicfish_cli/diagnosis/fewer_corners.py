"""Boards that have fewer corners than drawn: in photos their pattern ends before the drawing's.

Beyond the last line of corners lies one more line of squares, and then nothing of the pattern.
Where something covers the board, or corners were missed, either those squares are not to be seen
or they end somewhere else in every photo, or more of them follow.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.diagnosis.evidence import boards_with_squares
from cubicfish_cli.diagnosis.more_corners import (
    FEWEST_PHOTOS,
    Count,
    is_full,
)
from cubicfish_cli.identification.ends import Ends
from cubicfish_cli.identification.identified import FEWEST_CORNERS, Identified, Place
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.photos import Picture
from cubicfish_cli.placement import TURNS
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray, IntArray

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
# A line of corners should be in view where so much of it would be visible.
_LINE_SHARE, _LINE_CORNERS = 0.6, 3
# Photos that are looked at for the end of a pattern: those with the largest squares. So many of
# them must show it, whatever the others leave open.
_LOOKED_AT = 20
_SHOWN_SHARE = 0.25
# Nearly all of them must agree, to so much of a square, on where the squares end; and so near must
# that be to the board's other ends. A strip that covers a board has its own end.
_AGREE_SHARE, _AGREE_SQUARES = 0.8, 0.15
_OTHERS_SQUARES = 0.08

_Look = Callable[["_Sight", "Side"], float | None]
Side = tuple[int, int]  # axis of the board (columns, rows), and 0 for its start, 1 for its end


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
    from scipy.ndimage import map_coordinates  # it takes long to load, and is seldom asked

    line, way = (int(last[axis]), 1) if after else (0, -1)
    middle = np.arange(int(last[1 - axis])) + 0.5
    distance = np.concatenate([[_BEFORE], _BEYOND])
    cell = np.empty((len(distance), len(middle), len(_PATCH), 2))
    cell[..., axis] = line + way * distance[:, None, None]
    cell[..., 1 - axis] = middle[:, None] + _PATCH
    points = np.concatenate([cell, np.ones((*cell.shape[:-1], 1))], axis=-1)
    pixel = camera.project(points @ camera_from_grid.T)
    side = np.linalg.norm(np.diff(pixel.mean(axis=2), axis=1), axis=-1)
    smallest = side.min(initial=np.inf, where=np.isfinite(side))
    # Brightness between the nearest four pixels; NaN outside the picture.
    x, y = np.moveaxis(np.nan_to_num(pixel, nan=-1.0), -1, 0)
    level = map_coordinates(picture, (y, x), float, order=1, cval=np.nan)
    level = level.mean(axis=-1)
    known = np.isfinite(level).all(axis=0)
    if known.sum() < _FEWEST_SQUARES or smallest < _SMALLEST_PX:
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sight:
    """One grid on a board.

    Attributes:
        photo: its photo.
        grid: the grid.
        form: (3, 3) camera_from_grid, (i, j, 1) to the camera frame.
        place: where it lies.
        ends: corners that are missing around it.

    """

    photo: int
    grid: Grid
    form: FloatArray
    place: Place
    ends: Ends

    @property
    def span(self) -> IntArray:
        """(2, 2) first and last column, and first and last row of the board, that it has."""
        cells = self.grid.cells @ TURNS[self.place.turn].T + [self.place.column, self.place.row]
        return np.stack([cells.min(axis=0), cells.max(axis=0)], axis=1)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the board that it spans."""
        columns, rows = (np.ptp(self.span, axis=1) + 1).tolist()
        return columns, rows

    def own_side(self, side: Side) -> tuple[Literal[0, 1], bool]:
        """The grid's axis, and whether after its last line, for a side of the board."""
        row = TURNS[self.place.turn][side[0]]
        axis: Literal[0, 1] = 0 if row[0] else 1
        return axis, bool((row[axis] > 0) == (side[1] == 1))

    def ended(self, axis: int, *, after: bool) -> bool:
        """Whether the next line of corners should be in view, and none of it is found."""
        room = [0, 0, 0, 0]
        room[2 * axis + after] = 1
        lines = self.grid.cells.max(axis=0) + 1
        least = max(_LINE_CORNERS, _LINE_SHARE * lines[1 - axis])
        return bool(self.ends.table[tuple(room)] >= least)


def fewer_corners(
    identified: Identified, target: Target, picture: Callable[[int], Picture | None]
) -> list[Count]:
    """Boards of which photos show an end before the drawing's.

    Args:
        identified: what became of the photos' grids.
        target: the drawing.
        picture: the brightness (H, W) of the photo of this number; None where it cannot be read.

    """
    camera = identified.lens
    doubtful = _doubtful(identified, target)
    if camera is None or not doubtful:
        return []
    sights, picture_of = _sights(identified, doubtful), cache(picture)

    def shows(sight: _Sight, side: Side) -> float | None:
        seen, (axis, after) = picture_of(sight.photo), sight.own_side(side)
        if seen is None:
            return None
        in_view = sight.ended(axis, after=after)
        return pattern_end(seen, camera, sight.form, sight.grid, axis, after=after, in_view=in_view)

    alone = len(boards_with_squares(target)) == 1
    found = []
    for board in sorted(doubtful):
        own = sights[board]
        count = (_alone if alone else _among_others)(board, target.boards[board], own, shows)
        found += [] if count is None else [count]
    return found


def _doubtful(identified: Identified, target: Target) -> set[int]:
    """Boards of which no photo has the first and last columns and rows that are drawn.

    Where one board is the whole target, corners of one photo alone say how many there are.
    """
    corners, boards = identified.corners, boards_with_squares(target)
    doubtful = set()
    for index in boards:
        drawn = np.array([target.boards[index].columns, target.boards[index].rows])
        own = np.stack([corners.column, corners.row], axis=1)[corners.board == index]
        if len(boards) == 1:
            reports = [one for of_photo in identified.grids for one in of_photo if one.named]
            sizes = [sorted(one.size) for one in reports if one.corners >= FEWEST_CORNERS]
            lacking = bool(sizes) and (np.max(sizes, axis=0) < sorted(drawn)).any()
        else:
            lacking = len(own) and (own.min(axis=0).any() or (own.max(axis=0) < drawn - 1).any())
        if lacking:
            doubtful.add(index)
    return doubtful


def _sights(identified: Identified, boards: set[int]) -> dict[int, list[_Sight]]:
    """The named grids of some boards, with the ends that they show."""
    sights: dict[int, list[_Sight]] = defaultdict(list)
    scene = identified.scene
    if scene is None:
        return sights
    scene.place_grids()
    for photo, (own, reports) in enumerate(zip(scene.photos, identified.grids, strict=True)):
        for index, report in zip(sorted(own), reports, strict=True):
            pose, place, grid = scene.poses[index], report.place, scene.grids[index]
            if pose is None or place is None or place.board not in boards:
                continue
            ends = scene.ends(own, index)
            if ends is not None and report.corners >= FEWEST_CORNERS:
                form = np.column_stack([pose.rotation[0][:, :2], pose.translation[0]])
                one = _Sight(photo=photo, grid=grid, form=form, place=place, ends=ends)
                sights[place.board].append(one)
    return sights


def _sides() -> Iterator[Side]:
    return ((axis, end) for axis in (0, 1) for end in (0, 1))


def _alone(index: int, board: Board, sights: Sequence[_Sight], shows: _Look) -> Count | None:
    """The size of a target's only board, from photos that show all its ends."""
    whole = [sight for sight in sights if is_full(sight.grid)]
    if not whole:
        return None
    size = max(_ordered(sight.size, board) for sight in whole)
    larger = any(np.any(np.greater(_ordered(one.size, board), size)) for one in sights)
    if size == (board.columns, board.rows) or larger:
        return None
    same = [sight for sight in whole if _ordered(sight.size, board) == size]
    ends = _ends(same, list(_sides()), shows)
    if ends is None or not _agree(ends, ends):
        return None
    return Count(board=index, size=size, photos=len(ends))


def _among_others(index: int, board: Board, sights: Sequence[_Sight], shows: _Look) -> Count | None:
    """The size of a board whose place is known from others: line by line from its ends."""
    if not sights:
        return None
    drawn = np.array([[0, board.columns - 1], [0, board.rows - 1]])
    spans = np.array([sight.span for sight in sights])
    seen = np.stack([spans[..., 0].min(axis=0), spans[..., 1].max(axis=0)], axis=1)
    short = [side for side in _sides() if seen[side] != drawn[side]]
    at = {
        side: [
            sights[number] for number in np.flatnonzero(spans[(..., *side)] == seen[side]).tolist()
        ]
        for side in _sides()
    }
    ends = {side: _ends(at[side], [side], shows) for side in short}
    photos = 0
    for side, own in ends.items():
        if own is None:
            continue
        at_others = [_ends(at[other], [other], shows) for other in _sides() if other not in short]
        others = [other for other in at_others if other is not None]
        if not _agree(own, np.concatenate(others) if others else np.ones((1, 1))):
            continue
        drawn[side] = seen[side]
        photos = max(photos, len(own))
    if not photos:
        return None
    columns, rows = (drawn[:, 1] - drawn[:, 0] + 1).tolist()
    sure = (seen == drawn).all(axis=1)
    return Count(
        board=index, size=(columns, rows), photos=photos, sure=(bool(sure[0]), bool(sure[1]))
    )


def _ends(sights: Sequence[_Sight], sides: Sequence[Side], shows: _Look) -> FloatArray | None:
    """How far beyond the last corners squares end, in each photo (P) and side (S): (P, S).

    None where too few photos show it, or any shows that squares go on.
    """
    largest = sorted(sights, key=lambda sight: -sight.grid.step)[:_LOOKED_AT]
    if len(largest) < FEWEST_PHOTOS:
        return None
    # NaN where a photo does not tell.
    ends = np.array([[shows(sight, side) for side in sides] for sight in largest], float)
    if np.isinf(ends).any():
        return None
    shown = ends[np.isfinite(ends).all(axis=1)]
    enough = len(shown) >= max(FEWEST_PHOTOS, _SHOWN_SHARE * len(largest))
    return np.asarray(shown) if enough else None


def _agree(ends: FloatArray, others: FloatArray) -> bool:
    """Whether ends (P, S) are the same in nearly all photos, and where others (Q, T) are."""
    usual = np.median(ends, axis=0)
    same = (np.abs(ends - usual) < _AGREE_SQUARES).all(axis=1).mean() >= _AGREE_SHARE
    return bool(same and (np.abs(usual - np.median(others)) < _OTHERS_SQUARES).all())


def _ordered(size: tuple[int, int], board: Board) -> tuple[int, int]:
    """A size with its longer side along the board's longer one."""
    short, long = sorted(size)
    return (short, long) if board.columns < board.rows else (long, short)
