"""Photo + target -> named corners of ChArUco and AprilGrid boards.

Markers that agree with each other about where a board is name the corners around them, and the
board is grown from there to where its markers cannot be read, as in the rim of a fisheye photo. Its
markers are then read once more through its corners: what they contradict is left nameless.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from cubicfish_cli.core.boards.board import AROUND_SQUARE, Board
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.corners.detection.grids import nearest, negative_photo, settled
from cubicfish_cli.corners.detection.lattice import snap
from cubicfish_cli.corners.detection.markers_lattice import BoardLattice
from cubicfish_cli.corners.detection.markers_read import (
    Family,
    SeenMarkers,
    families,
    marker_ratio,
    module_places,
    places_told,
    read_alone,
    read_modules,
    shortest_side,
    squares,
    with_sides_seen,
    wrong_modules,
)
from cubicfish_cli.corners.detection.pyramid import (
    Pyramid,
    build_pyramid,
    enlarged,
    reduced,
    zoom_to,
)

# Where nothing else vouches for markers, so many must agree.
_AGREEING = 2
# So many markers, at least two side by side, are no misreadings even where others refute them.
_NO_ACCIDENT = 3
# A marker that stands alone must have this many of its corners seen as corners, others more.
_ALONE, _LEAST_CORNERS = 3, 4
# Of the markers that are clearly seen through a board's corners, so many times more must be
# its own than others; and a marker that nothing else vouched for must not be the only one.
_OWN_FOR_ANOTHER = 4
# Blurred markers lose a few of their modules; of another one's about half are wrong, and hardly
# ever less than this share.
_BLURRED = 0.25
_SAME_CORNER = 0.3  # of the distance to the next corner
_MOST_DOUBLED = 4_000_000  # pixels
_MOST_AT_A_GLANCE = 2_000_000  # pixels: modules of markers show at 1.6 px


@dataclass(frozen=True, kw_only=True, eq=False)
class MarkedCorners:
    """Corners of boards with markers, found and named in one photo.

    Attributes:
        board: (N,) index into the target's boards.
        column, row: (N,) place on the board.
        pixel: (N, 2) sub-pixel x, y.
        contradictory: indices of boards that were left out because markers put them in two
            places: two copies in view, or a board that is not as the target says.

    """

    board: IntArray
    column: IntArray
    row: IntArray
    pixel: FloatArray
    contradictory: tuple[int, ...] = ()

    def __len__(self) -> int:
        """Return the number of corners."""
        return len(self.board)


def find_marked_corners(
    image: npt.NDArray[np.generic], target: Target, candidates: FloatArray
) -> MarkedCorners:
    """Find and name the corners of the target's ChArUco and AprilGrid boards.

    Args:
        image: (H, W) grey photo, uint8, uint16 or float.
        target: the calibration target; boards without markers are passed over.
        candidates: (N, 2) pixels that look like corners of squares, where they are known.

    """
    found = _however_printed(_find, image, target, candidates)
    return replace(found, pixel=settled(found.pixel))


def glance_at_markers(image: npt.NDArray[np.generic], target: Target) -> MarkedCorners:
    """Corners of the same boards that markers with clear outlines name, and no others.

    They are good to a few tenths of a pixel, and boards of which fewer than two markers agree are
    left out: a fraction of the work, for those who want to know roughly what a photo shows.
    """
    zoom = zoom_to(image, _MOST_AT_A_GLANCE)
    found = _however_printed(_outlined, reduced(image, zoom), target, np.zeros((0, 2)))
    return replace(found, pixel=enlarged(found.pixel, zoom))


_Finder = Callable[[npt.NDArray[np.generic], Target, FloatArray], MarkedCorners]


def _however_printed(
    find: _Finder, image: npt.NDArray[np.generic], target: Target, candidates: FloatArray
) -> MarkedCorners:
    """What is found of dark markers, light ones, and both in a mirror."""
    if target.mirrored:
        width = image.shape[1]
        flipped = candidates * (-1, 1) + (width - 1, 0)
        found = _however_printed(find, image[:, ::-1], target.in_mirror(), flipped)
        columns = np.array([board.columns for board in target.boards])[found.board]
        pixel = found.pixel * (-1, 1) + (width - 1, 0)
        return replace(found, column=columns - 1 - found.column, pixel=pixel)
    inverted, others = (_with_markers(target, inverted=inverted) for inverted in (True, False))
    if inverted is None:
        return find(image, target, candidates)
    negative = find(negative_photo(image), inverted, candidates)
    return negative if others is None else _both(find(image, others, candidates), negative)


def _with_markers(target: Target, *, inverted: bool) -> Target | None:
    """The target with only the inverted markers, as positive ones, or only the others; or None."""
    boards = [
        (board.with_negative_markers() if inverted else board)
        if board.markers is not None and board.markers.inverted == inverted
        else replace(board, markers=None)
        for board in target.boards
    ]
    kept = any(board.markers is not None for board in boards)
    return replace(target, boards=tuple(boards)) if kept else None


def _both(one: MarkedCorners, other: MarkedCorners) -> MarkedCorners:
    """The corners of boards of both kinds in one photo."""
    return MarkedCorners(
        **{
            name: np.concatenate([getattr(one, name), getattr(other, name)])
            for name in ("board", "column", "row", "pixel")
        },
        contradictory=tuple(sorted({*one.contradictory, *other.contradictory})),
    )


def _find(image: npt.NDArray[np.generic], target: Target, candidates: FloatArray) -> MarkedCorners:
    """The same for dark markers in a photo that is not mirrored.

    One that shows none is searched at twice its size, for markers half as small; the photo itself
    then says where corners are.
    """
    pyramid = build_pyramid(image)
    found = _find_in(pyramid, target, candidates)
    if len(found) or image.size > _MOST_DOUBLED:
        return found
    single: npt.NDArray[np.integer | np.floating] = np.asarray(image)
    double = np.asarray(cv2.resize(single, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC))
    found = _find_in(build_pyramid(double), target, np.zeros((0, 2)))
    pixel = enlarged(found.pixel, 0.5)
    for index in np.unique(found.board):
        rows = np.flatnonzero(found.board == index)
        cells = np.stack([found.column[rows], found.row[rows]], axis=-1)
        part = BoardLattice(board=target.boards[index])
        part.put(cells, pixel[rows])
        refined, good = part.refined(pyramid, cells, pixel[rows], part.fit(cells))
        pixel[rows[good]] = refined[good]
    return replace(found, pixel=pixel)


def _find_in(pyramid: Pyramid, target: Target, candidates: FloatArray) -> MarkedCorners:
    """The same at one size."""
    all_families, free = families(target), cKDTree(candidates)
    markers = read_alone(pyramid, all_families)
    target = with_sides_seen(target, markers)
    parts: list[BoardLattice] = []
    refuted = np.zeros(len(target.boards), np.intp)
    for part in _parts(pyramid, target, markers, free):
        part.verify(pyramid)
        if part.known.sum() < (_ALONE if part.markers == 1 else _LEAST_CORNERS):
            continue
        part.grow(pyramid, free)
        part.clean()
        part.verify(pyramid)
        part.clean()
        if part.known.sum() < _LEAST_CORNERS:
            continue
        if _agrees(pyramid, target, all_families, part):
            parts.append(part)
        elif part.markers > 1:
            refuted[part.index] += part.markers
    kept, contradictory = _settle(sorted(parts, key=lambda part: -part.markers))
    refuted[[part.index for part in kept]] = 0
    contradictory |= set(np.flatnonzero(refuted >= _NO_ACCIDENT).tolist())
    return _named(kept, contradictory)


def _outlined(
    image: npt.NDArray[np.generic], target: Target, candidates: FloatArray
) -> MarkedCorners:
    """As :func:`_find`, of outlines alone: of each board the part where most markers are."""
    pyramid = build_pyramid(image)
    markers = read_alone(pyramid, families(target))
    best: dict[int, BoardLattice] = {}
    for part in _parts(pyramid, target, markers, cKDTree(candidates)):
        if part.markers >= _AGREEING and (
            part.index not in best or part.markers > best[part.index].markers
        ):
            best[part.index] = part
    return _named(list(best.values()), set())


def _named(parts: list[BoardLattice], contradictory: set[int]) -> MarkedCorners:
    """The corners of parts of boards, board by board."""
    parts = sorted(parts, key=lambda part: part.index)
    cells = [part.cells() for part in parts]
    pixel = [part.at(own) for part, own in zip(parts, cells, strict=True)]
    column, row = np.concatenate([np.zeros((0, 2), np.intp), *cells]).T
    return MarkedCorners(
        board=np.repeat([part.index for part in parts], list(map(len, cells))).astype(np.intp),
        column=column,
        row=row,
        pixel=np.concatenate([np.zeros((0, 2)), *pixel]),
        contradictory=tuple(sorted(contradictory)),
    )


def _parts(
    pyramid: Pyramid, target: Target, markers: SeenMarkers, free: cKDTree
) -> Iterator[BoardLattice]:
    """Boards, or parts of them: corners around markers that agree, where saddles are near."""
    for index in np.unique(markers.board).tolist():
        own = markers.of(index)
        label = places_told(own, target, index)
        for place in np.unique(label):
            agreeing = own.select(label == place)
            part = BoardLattice(
                board=target.boards[index],
                index=index,
                markers=len(np.unique(agreeing.cell, axis=0)),
            )
            part.put(*_seeds(part.board, agreeing))
            cells = part.cells()
            fit = part.fit(cells)
            pixel, found = snap(pyramid, part, part.at(cells), fit, free)
            part.put(cells, np.where((found & fit.sound)[:, None], pixel, np.nan))
            part.clean()
            yield part


def _seeds(board: Board, markers: SeenMarkers) -> tuple[IntArray, FloatArray]:
    """Where markers put the corners around them: cells (K, 2), pixels (K, 2)."""
    corner = _cell_corners(board, markers.cell).reshape(-1, 2)
    pixel = squares(markers.pixel, marker_ratio(board)).reshape(-1, 2)
    inside = ((corner >= 0) & (corner < (board.columns, board.rows))).all(axis=1)
    cells, same = np.unique(corner[inside], axis=0, return_inverse=True)
    mean = np.zeros((len(cells), 2))
    np.add.at(mean, same.ravel(), pixel[inside])
    return cells, mean / np.bincount(same.ravel(), minlength=len(cells))[:, None]


def _cell_corners(board: Board, cell: IntArray) -> IntArray:
    """Corners (N, 4, 2) around cells (N, 2) of a board: columns and rows, in order around each."""
    first = 2 * cell if board.per_cell == 2 else cell - 1
    return np.asarray(first[:, None] + AROUND_SQUARE)


def _agrees(
    pyramid: Pyramid, target: Target, all_families: list[Family], part: BoardLattice
) -> bool:
    """Whether the markers that can be read through a part's corners are the board's own."""
    board = part.board
    corner = _cell_corners(board, board.marker_cells()[:, 1:])
    whole = np.asarray(part.inside(corner).all(axis=1))
    whole[whole] = part.known[tuple(np.moveaxis(corner[whole], -1, 0))].all(axis=1)
    if not whole.any():
        return False
    corner = corner[whole]
    ratio = marker_ratio(board)
    side_px = ratio * shortest_side(part.at(corner.reshape(-1, 2)).reshape(-1, 4, 2))
    own, other = np.zeros(len(corner), bool), np.zeros(len(corner), bool)
    for family in all_families:
        row = np.flatnonzero(family.board == part.index)
        if not len(row):
            continue
        points = part.inside_squares(corner, module_places(family, ratio))
        white, clear = read_modules(pyramid, points, side_px, family)
        wrong = wrong_modules(white, family)[:, 0]
        wrong = wrong[np.arange(len(wrong)), row[whole]]
        own |= clear & (wrong <= family.corrected)
        other |= clear & (wrong > max(family.corrected, _BLURRED * family.size**2))
    least = 2 if part.markers == 1 else 1
    # Those that place the part were read in the same squares, or beyond the known corners.
    agreeing = max(int(own.sum()), part.markers)
    return bool(own.sum() >= least and agreeing >= _OWN_FOR_ANOTHER * (other & ~own).sum())


def _settle(parts: list[BoardLattice]) -> tuple[list[BoardLattice], set[int]]:
    """Merge parts that continue each other; leave out boards that are in two places."""
    kept: list[BoardLattice] = []
    contradictory: set[int] = set()
    for part in parts:
        same = [other for other in kept if other.index == part.index]
        if any(_share_pixels(part, other) for other in kept if other.index != part.index):
            continue  # what more markers name otherwise
        if not same:
            kept.append(part)
        elif all(_continue_each_other(part, other) for other in same):
            fresh = np.argwhere(part.known & ~same[0].known)
            same[0].put(fresh, part.at(fresh))
            same[0].markers += part.markers
        else:
            contradictory.add(part.index)
    return [part for part in kept if part.index not in contradictory], contradictory


def _share_pixels(one: BoardLattice, other: BoardLattice) -> bool:
    """Whether a good part of the smaller part is where the other one has corners."""
    few, many = sorted((one, other), key=lambda part: int(part.known.sum()))
    near, _ = _nearest_corners(few, many)
    return bool(near.mean() > 0.1)


def _nearest_corners(one: BoardLattice, other: BoardLattice) -> tuple[BoolArray, IntArray]:
    """Which corners (N,) of one part are corners of the other too, and the nearest's cells."""
    cells, names = one.cells(), other.cells()
    distance, index = nearest(one.at(cells), other.at(names), 1)
    return distance[:, 0] < _SAME_CORNER * one.closest * one.fit(cells).side, names[index[:, 0]]


def _continue_each_other(one: BoardLattice, other: BoardLattice) -> bool:
    """Whether two parts of a board can be parts of one board in one place."""
    near, names = _nearest_corners(one, other)
    cells = one.cells()
    both = other.known[tuple(cells.T)]
    if both.any() or near.any():  # the same corners in the same places, and no other ones
        return bool((near == both).all() and (names == cells)[near].all())
    # The way between their nearest cells must be as long, and lead where, both parts say.
    a, b = cells, other.cells()
    distance, index = nearest(a.astype(float), b.astype(float), 1)
    start = a[distance[:, 0].argmin()][None]
    end = b[index[distance[:, 0].argmin(), 0]][None]
    way = np.array([one.x[end[0, 0]] - one.x[start[0, 0]], one.y[end[0, 1]] - one.y[start[0, 1]]])
    expected = 0.5 * (one.fit(start).step[0] + other.fit(end).step[0]) @ way
    seen = other.at(end)[0] - one.at(start)[0]
    return bool(np.linalg.norm(seen - expected) < 0.5 * np.linalg.norm(expected))
