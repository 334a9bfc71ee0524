"""Boards that have fewer corners than drawn: in photos their pattern ends before the drawing's.

Beyond the last line of corners lies one more line of squares, and then nothing of the pattern.
Where something covers the board, or corners were missed, either those squares are not to be seen
or they end somewhere else in every photo, or more of them follow.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.diagnosis.more_corners import (
    FEWEST_PHOTOS,
    Count,
    boards_with_squares,
    is_full,
)
from cubicfish_cli.identification.ends import ends_of, farthest_radius
from cubicfish_cli.identification.grid_views import grid_poses
from cubicfish_cli.identification.identified import FEWEST_CORNERS, Identified, Place
from cubicfish_cli.identification.placement import TURNS
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.photos import Picture
from cubicfish_cli.target import Target
from cubicfish_cli.types import BoolArray, FloatArray, IntArray

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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sight:
    """One grid on a board.

    Attributes:
        photo: its photo.
        grid: the grid.
        form: (3, 3) camera_from_grid, (i, j, 1) to the camera frame.
        low, high: (2,) first and last column and row of the board that it has.
        ended: (2, 2) by axis of the board and start or end: whether the next line of corners
            should be in view, and none of it is found.
        turn: quarter turns from grid to board.

    """

    photo: int
    grid: Grid
    form: FloatArray
    low: IntArray
    high: IntArray
    ended: BoolArray
    turn: int

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the board that it spans."""
        columns, rows = (self.high - self.low + 1).tolist()
        return columns, rows

    def own_side(self, side: Side) -> tuple[Literal[0, 1], bool]:
        """The grid's axis, and whether after its last line, for a side of the board."""
        row = TURNS[self.turn][side[0]]
        axis: Literal[0, 1] = 0 if row[0] else 1
        return axis, bool((row[axis] > 0) == (side[1] == 1))


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
    sights = _sights(identified, camera, doubtful)
    pictures: dict[int, Picture | None] = {}

    def shows(sight: _Sight, side: Side) -> float | None:
        if sight.photo not in pictures:
            pictures[sight.photo] = picture(sight.photo)
        seen = pictures[sight.photo]
        if seen is None:
            return None
        axis, after = sight.own_side(side)
        return pattern_end(
            seen,
            camera,
            sight.form,
            sight.grid,
            axis,
            after=after,
            in_view=bool(sight.ended[side]),
        )

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
    corners = identified.corners
    boards = boards_with_squares(target)
    if len(boards) == 1:
        (board,) = boards
        drawn = sorted((target.boards[board].columns, target.boards[board].rows))
        sizes = [
            sorted(report.size)
            for own in identified.grids
            for report in own
            if report.named and report.corners >= FEWEST_CORNERS
        ]
        whole = np.array(sizes or [[0, 0]]).max(axis=0)
        return {board} if sizes and (whole < drawn).any() else set()
    doubtful = set()
    for board in boards:
        own = corners.board == board
        if not own.any():
            continue
        for index, last in (
            (corners.column[own], target.boards[board].columns - 1),
            (corners.row[own], target.boards[board].rows - 1),
        ):
            if index.min() > 0 or index.max() < last:
                doubtful.add(board)
    return doubtful


def _sights(
    identified: Identified, camera: RadialCamera, boards: set[int]
) -> dict[int, list[_Sight]]:
    """The named grids of some boards, with the ends that they show."""
    grids = identified.found
    chosen: list[tuple[int, int, Place]] = [
        (photo, number, report.place)
        for photo, own in enumerate(identified.grids)
        for number, report in enumerate(own)
        if report.place is not None
        and report.place.board in boards
        and report.corners >= FEWEST_CORNERS
    ]
    sights: dict[int, list[_Sight]] = defaultdict(list)
    if not chosen:
        return sights
    poses = grid_poses(
        camera, [grids[photo][n] for photo, n, _ in chosen], identified.corners.image_size
    )
    farthest = farthest_radius(camera, np.concatenate([g.pixel for own in grids for g in own]))
    for (photo, number, place), pose in zip(chosen, poses, strict=True):
        if pose is None:
            continue
        grid = grids[photo][number]
        others = [one.pixel for n, one in enumerate(grids[photo]) if n != number]
        form = np.column_stack([pose.rotation[0][:, :2], pose.translation[0]])
        other_pixel = np.concatenate([np.empty((0, 2)), *others])
        table = ends_of(camera, grid, form, other_pixel, farthest).table
        cells = grid.cells @ TURNS[place.turn].T + [place.column, place.row]
        sight = _Sight(
            photo=photo,
            grid=grid,
            form=form,
            low=cells.min(axis=0),
            high=cells.max(axis=0),
            ended=np.zeros((2, 2), bool),
            turn=place.turn,
        )
        lines = grid.cells.max(axis=0) + 1
        for side in _sides():
            axis, after = sight.own_side(side)
            room = [0, 0, 0, 0]
            room[2 * axis + after] = 1
            least = max(_LINE_CORNERS, _LINE_SHARE * lines[1 - axis])
            sight.ended[side] = table[tuple(room)] >= least
        sights[place.board].append(sight)
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
    first = np.min([sight.low for sight in sights], axis=0)
    last = np.max([sight.high for sight in sights], axis=0)
    seen = np.stack([first, last], axis=1)
    short = [side for side in _sides() if seen[side] != drawn[side]]
    at = {
        side: [one for one in sights if (one.high if side[1] else one.low)[side[0]] == seen[side]]
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
