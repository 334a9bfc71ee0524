"""Photo + target -> named corners of ChArUco and AprilGrid boards.

Markers name the corners around them; found grids and growth along the board add those whose
markers cannot be read, as in the rim of a fisheye photo. A name must be supported by markers
that agree with each other about where the board is; what they contradict is left nameless.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.finder import find_grids
from cubicfish.find.detection.grids import (
    FoundGrids,
    grids_in_mirror,
    negative_grids,
    negative_photo,
)
from cubicfish.find.detection.ladder import MOST_PIXELS
from cubicfish.find.detection.markers_closer import (
    hinted_boards,
    list_marked,
    parts_with_markers,
    parts_with_squares,
    read_closer,
    small_boards,
)
from cubicfish.find.detection.markers_detect import NO_MARKERS, SeenMarkers, Sight, reading_zooms
from cubicfish.find.detection.markers_lattice import BoardLattice
from cubicfish.find.detection.markers_measure import with_sides_seen
from cubicfish.find.detection.markers_missing import Part
from cubicfish.find.detection.markers_named import Named, name_corners, with_more_markers
from cubicfish.find.detection.markers_pieces import Piece, placed
from cubicfish.find.detection.markers_read import group_agreeing, read_alone
from cubicfish.find.detection.nearby import Tree
from cubicfish.find.detection.pyramid import CLOSE, build_pyramid, enlarged, reduced
from cubicfish.target.target import Target
from cubicfish.types import BoolArray, FloatArray, IntArray

# Where nothing else vouches for markers, so many must agree.
_AGREEING = 2
_NO_GRIDS = np.zeros(0, np.intp)
# What is known of each corner.
_OF_A_CORNER = ("board", "column", "row", "pixel")


@dataclass(frozen=True, kw_only=True, eq=False)
class MarkedCorners:
    """Corners of boards with markers, found and named in one photo.

    Attributes:
        board: (N,) index into the target's boards.
        column, row: (N,) place on the board.
        pixel: (N, 2) sub-pixel x, y.
        grid_board: (G,) for each grid that was given, the board that it is part of, or -1 when
            no marker names it.
        contradictory: indices of boards that were left out because markers put them in two
            places: two copies in view, or a board that is not as the target says.

    """

    board: IntArray
    column: IntArray
    row: IntArray
    pixel: FloatArray
    grid_board: IntArray
    contradictory: tuple[int, ...]

    def __len__(self) -> int:
        """Return the number of corners."""
        return len(self.board)

    @classmethod
    def none(cls) -> MarkedCorners:
        """Those of a photo in which no marker is read and no grid is known."""
        return _make_marked(Named(pieces=[], contradictory=set()), 0)

    def select(self, rows: BoolArray) -> MarkedCorners:
        """Some of the corners (N,)."""
        own: dict[str, Any] = {name: getattr(self, name)[rows] for name in _OF_A_CORNER}
        return replace(self, **own)

    def without(self, board: int) -> MarkedCorners:
        """All but the corners of one board."""
        return self.select(self.board != board)

    def with_corners_of(self, parts: Sequence[MarkedCorners]) -> MarkedCorners:
        """With the corners of others, in place of its own."""
        every = [self.select(self.board < 0), *parts]
        joined: dict[str, Any] = {
            name: np.concatenate([getattr(one, name) for one in every]) for name in _OF_A_CORNER
        }
        return replace(self, **joined)

    def each(self) -> list[MarkedCorners]:
        """The corners of every board by themselves."""
        return [self.select(self.board == board) for board in np.unique(self.board)]

    def moved(self, by: FloatArray | IntArray) -> MarkedCorners:
        """The same in a photo of which this one is the part that begins at ``by`` (2,): x, y."""
        return replace(self, pixel=self.pixel + by)


def find_marked_corners(
    image: npt.NDArray[np.generic],
    target: Target,
    grids: FoundGrids | None = None,
    *,
    closely: bool = False,
) -> MarkedCorners:
    """Find and name the corners of the target's ChArUco and AprilGrid boards.

    Args:
        image: (H, W) grey photo, uint8, uint16 or float.
        target: the calibration target; boards without markers are passed over.
        grids: what :func:`~.finder.find_grids` found in the same photo. By default it is asked
            only for those parts of it in which markers are, and more of their boards may be.
        closely: search the photo at twice its size, for markers half as small.

    """
    find = _find_closely if closely else _find_as_closely_as_needed
    return _find_however_printed(find, image, target, grids)


def outlined_corners(image: npt.NDArray[np.generic], target: Target) -> MarkedCorners:
    """Corners of the same boards that markers with clear outlines name, and no others.

    They are good to a few tenths of a pixel, and boards of which fewer than two markers agree are
    left out: a fraction of the work, for those who want to know roughly what a photo shows.
    """
    return _find_however_printed(_find_outlined, image, target, None)


_Finder = Callable[[npt.NDArray[np.generic], Target, FoundGrids | None], MarkedCorners]


def _find_however_printed(
    find: _Finder, image: npt.NDArray[np.generic], target: Target, grids: FoundGrids | None
) -> MarkedCorners:
    """What is found of dark markers, light ones, and both in a mirror."""
    if target.mirrored:
        mirrored = image[:, ::-1], target.in_mirror(), grids and grids_in_mirror(grids)
        return _mirror_found(_find_however_printed(find, *mirrored), target, image.shape[1])
    inverted = _select_markers(target, inverted=True)
    if inverted is None:
        return find(image, target, grids)
    negative = find(negative_photo(image), inverted, grids and negative_grids(grids))
    others = _select_markers(target, inverted=False)
    return negative if others is None else _join_both(find(image, others, grids), negative)


def _select_markers(target: Target, *, inverted: bool) -> Target | None:
    """The target with only the inverted markers, as positive ones, or only the others; or None."""
    boards = [
        (board.with_other_colours() if inverted else board)
        if board.markers is not None and board.markers.inverted == inverted
        else replace(board, markers=None)
        for board in target.boards
    ]
    kept = any(board.markers is not None for board in boards)
    return replace(target, boards=tuple(boards)) if kept else None


def _mirror_found(found: MarkedCorners, target: Target, width: int) -> MarkedCorners:
    """What was found in the mirrored photo of the target, as corners of what the mirror shows."""
    columns = np.array([board.columns for board in target.boards])[found.board]
    return replace(
        found,
        column=columns - 1 - found.column,
        pixel=np.stack([width - 1 - found.pixel[:, 0], found.pixel[:, 1]], axis=-1),
    )


def _join_both(one: MarkedCorners, other: MarkedCorners) -> MarkedCorners:
    """The corners of boards of both kinds in one photo."""
    return replace(
        one.with_corners_of([one, other]),
        grid_board=np.maximum(one.grid_board, other.grid_board),
        contradictory=tuple(sorted({*one.contradictory, *other.contradictory})),
    )


def _find_as_closely_as_needed(
    image: npt.NDArray[np.generic], target: Target, grids: FoundGrids | None
) -> MarkedCorners:
    """The same for dark markers in a photo that is not mirrored.

    Where no grids are given, boards of small squares that are not wholly found are looked for at
    twice the size, in their part of the photo.
    """
    marked, seen = _find(image, target, grids)
    if grids is not None or 4 * image.size > MOST_PIXELS:
        return marked
    for index, part in seen.list_closer():
        found = _find_closely(part.of(image), _with_markers_of_one(target, index), None)
        if len(found) > np.count_nonzero(marked.board == index):
            marked = _join_both(marked.without(index), replace(found, pixel=part.back(found.pixel)))
    return marked


def _with_markers_of_one(target: Target, index: int) -> Target:
    """The target, all of whose boards but one are without markers."""
    others = {k: replace(one, markers=None) for k, one in enumerate(target.boards) if k != index}
    return target.with_boards(others)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """What became of a search.

    Attributes:
        sight: where it was.
        alone: the markers that were read alone.
        named: what they name.

    """

    sight: Sight
    alone: SeenMarkers
    named: Named

    def list_closer(self) -> list[tuple[int, Part]]:
        """Boards that twice the size may show more of, and where they may be."""
        if not self.named.pieces:
            return hinted_boards(self.sight, self.alone)
        return small_boards(self.sight, self.named)


def _find(
    image: npt.NDArray[np.generic], target: Target, grids: FoundGrids | None
) -> tuple[MarkedCorners, _Seen]:
    """What is found in a photo at its own size."""
    sight = Sight.of(image, target)
    zooms = reading_zooms(sight.pyramid.size, sight.families)
    alone = read_alone(sight.pyramid, sight.families, zooms[:1])
    known = _no_grids(sight) if grids is None else grids
    found = name_corners(sight, alone, known)
    for number, zoom in enumerate(zooms[1:], start=1):
        fresh = read_closer(sight, found, alone, min(zooms[:number]), zoom)
        if len(fresh):
            found, alone = with_more_markers(sight, found, alone, fresh, known)
    if grids is None:
        for list_parts in (parts_with_markers, parts_with_squares):
            unseen = list_marked(sight) - found.boards
            parts = list_parts(sight, found, alone, unseen) if unseen else []
            if parts:
                known = _search_grids(image, parts)
                found = name_corners(sight, alone, known, found, unseen)
    marked = _make_marked(found, len(known.grids))
    measured = with_sides_seen(target, alone)
    if measured is not None:
        other = name_corners(replace(sight, target=measured), alone, known)
        marked = max(marked, _make_marked(other, len(known.grids)), key=len)
    if grids is None:
        marked = replace(marked, grid_board=_NO_GRIDS)
    return marked, _Seen(sight=sight, alone=alone, named=found)


def _no_grids(sight: Sight) -> FoundGrids:
    return FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=sight.pyramid.size)


def _search_grids(image: npt.NDArray[np.generic], parts: list[Part]) -> FoundGrids:
    """Grids in parts of a photo."""
    height, width = image.shape
    if sum(part.pixels for part in parts) >= height * width:
        return find_grids(image)
    grids, refused = [], [np.zeros((0, 2))]
    for part in parts:
        found = find_grids(part.of(image))
        grids += [replace(grid, pixel=part.back(grid.pixel)) for grid in found.grids]
        refused.append(part.back(found.refused))
    return FoundGrids(
        grids=tuple(grids), refused=np.concatenate(refused), image_size=(width, height)
    )


def _find_closely(
    image: npt.NDArray[np.generic], target: Target, grids: FoundGrids | None
) -> MarkedCorners:
    """As :func:`_find` at twice the size; what the photo itself shows says where corners are."""
    larger = None
    if grids is not None:
        scaled = [
            replace(grid, pixel=enlarged(grid.pixel, 1 / CLOSE), step=grid.step / CLOSE)
            for grid in grids.grids
        ]
        refused = enlarged(grids.refused, 1 / CLOSE)
        larger = replace(grids, grids=tuple(scaled), refused=refused)
    found, _ = _find(reduced(image, CLOSE), target, larger)
    pyramid, pixel = build_pyramid(image), enlarged(found.pixel, CLOSE)
    for index in np.unique(found.board):
        rows = np.flatnonzero(found.board == index)
        cells = np.stack([found.column[rows], found.row[rows]], axis=-1)
        lattice = BoardLattice(board=target.boards[index])
        lattice.put(cells, pixel[rows])
        refined, good = lattice.refined(pyramid, cells, pixel[rows], lattice.fit(cells))
        pixel[rows[good]] = refined[good]
    return replace(found, pixel=pixel)


def _find_outlined(
    image: npt.NDArray[np.generic], target: Target, _grids: FoundGrids | None
) -> MarkedCorners:
    """As :func:`_find`, of outlines alone."""
    sight, markers, places = Sight.of(image, target), NO_MARKERS, dict[int, BoolArray]()
    for zoom in reading_zooms(sight.pyramid.size, sight.families):
        read = read_alone(sight.pyramid, sight.families, [zoom])
        markers = SeenMarkers.joined([markers, read])
        places = _agreeing(markers, target)
        if list_marked(sight) <= set(places):
            break
    pieces = []
    for index, chosen in places.items():
        own = markers.of(index)
        lattice = placed(sight, index, own, chosen, Tree(np.zeros((0, 2))))
        pieces.append(Piece(board=index, lattice=lattice, markers=len(own)))
    return _make_marked(Named(pieces=pieces, contradictory=set()), 0)


def _agreeing(markers: SeenMarkers, target: Target) -> dict[int, BoolArray]:
    """Boards that enough markers place, and which of a board's these are where most agree."""
    found = {}
    for index in np.unique(markers.board).tolist():
        own = markers.of(index)
        label = group_agreeing(own, target.boards[index])
        agreeing = {
            place: len(np.unique(own.cell[label == place], axis=0))
            for place in dict.fromkeys(label.tolist())
        }
        place = max(agreeing, key=lambda one: agreeing[one])
        if agreeing[place] >= _AGREEING:
            found[index] = label == place
    return found


def _make_marked(found: Named, grids: int) -> MarkedCorners:
    """The corners that markers name in a photo with so many grids."""
    pieces = sorted(found.pieces, key=lambda piece: piece.board)
    grid_board = np.full(grids, -1, np.intp)
    for piece in pieces:
        grid_board[list(piece.grids)] = piece.board
    own = [piece.lattice.cells() for piece in pieces]
    pixel = [piece.lattice.at(cells) for piece, cells in zip(pieces, own, strict=True)]
    cells = np.concatenate([np.zeros((0, 2), np.intp), *own])
    board = np.array([piece.board for piece in pieces], np.intp)
    return MarkedCorners(
        board=np.repeat(board, [len(one) for one in own]),
        column=cells[:, 0],
        row=cells[:, 1],
        pixel=np.concatenate([np.zeros((0, 2)), *pixel]),
        grid_board=grid_board,
        contradictory=tuple(sorted(found.contradictory)),
    )
