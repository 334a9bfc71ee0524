"""Photo + target -> named corners of ChArUco and AprilGrid boards.

Markers name the corners around them; found grids and growth along the board add those whose
markers cannot be read, as in the rim of a fisheye photo. A name must be supported by markers
that agree with each other about where the board is; what they contradict is left nameless.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import FloatArray, IntArray
from cubicfish_cli.corners.detection.finder import MOST_PIXELS, find_grids
from cubicfish_cli.corners.detection.grids import (
    FoundGrids,
    grids_in_mirror,
    negative_grids,
    negative_photo,
)
from cubicfish_cli.corners.detection.markers_detect import (
    NO_MARKERS,
    SeenMarkers,
    Sight,
    find_outlines,
    reading_zooms,
)
from cubicfish_cli.corners.detection.markers_lattice import BoardLattice, verify
from cubicfish_cli.corners.detection.markers_measure import with_sides_seen
from cubicfish_cli.corners.detection.markers_missing import OpenEnds, Part, hidden, hidden_around
from cubicfish_cli.corners.detection.markers_pieces import (
    Piece,
    agrees,
    extend,
    merge_pieces,
    note_grids,
    piece_of,
    placed,
    take_in,
)
from cubicfish_cli.corners.detection.markers_read import (
    all_read,
    cell_corners,
    group_agreeing,
    marker_ratio,
    read_alone,
    read_together,
    shortest_side,
)
from cubicfish_cli.corners.detection.nearby import nearest
from cubicfish_cli.corners.detection.pyramid import CLOSE, build_pyramid, enlarged, reduced

# Outlines of markers whose modules are larger are found in a photo, and so are those in its double.
_CLEAR_MODULE_PX = 4.0
# A grid that has the corners around markers, and those next to them, says where a board is: so many
# squares (tags) from the middles of its markers. It grows from there.
_MARGIN = 3.0
# Dark squares of one size, so near to each other, are beside each other in a board; fewer than so
# many are too few to name it.
_BESIDE, _ALIKE, _SQUARES = 3.0, 1.6, 4
_NO_GRIDS = np.zeros(0, np.intp)
# Where nothing else vouches for markers, so many must agree.
_AGREEING = 2
# So many markers, at least two side by side, are no misreadings even where others refute them.
_NO_ACCIDENT = 3


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

    def without(self, board: int) -> MarkedCorners:
        """All but the corners of one board."""
        rows = self.board != board
        return replace(
            self,
            board=self.board[rows],
            column=self.column[rows],
            row=self.row[rows],
            pixel=self.pixel[rows],
        )


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
    joined = {
        name: np.concatenate([getattr(one, name), getattr(other, name)])
        for name in ("board", "column", "row", "pixel")
    }
    return MarkedCorners(
        **joined,
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
    for index, part in [*_list_small_boards(seen), *(() if len(marked) else _list_hinted(seen))]:
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
    named: _Named


def _find(
    image: npt.NDArray[np.generic], target: Target, grids: FoundGrids | None
) -> tuple[MarkedCorners, _Seen]:
    """What is found in a photo at its own size."""
    sight = Sight.of(image, target)
    zooms = reading_zooms(sight.pyramid.size, sight.families)
    alone = read_alone(sight.pyramid, sight.families, zooms[:1])
    known = _no_grids(sight) if grids is None else grids
    found = _name_corners(sight, alone, known)
    for number, zoom in enumerate(zooms[1:], start=1):
        fresh = _read_closer(sight, found, alone, min(zooms[:number]), zoom)
        if len(fresh):
            found, alone = _add_fresh(sight, found, alone, fresh, known)
    if grids is None:
        for list_parts in (_list_parts_with_markers, _list_parts_with_squares):
            unseen = _list_marked(sight) - found.boards
            parts = list_parts(sight, found, alone, unseen) if unseen else []
            if parts:
                known = _search_grids(image, parts)
                found = _name_corners(sight, alone, known, found, unseen)
    marked = found.marked(len(known.grids))
    measured = with_sides_seen(target, alone)
    if measured is not None:
        other = _name_corners(replace(sight, target=measured), alone, known)
        marked = max(marked, other.marked(len(known.grids)), key=len)
    if grids is None:
        marked = replace(marked, grid_board=_NO_GRIDS)
    return marked, _Seen(sight=sight, alone=alone, named=found)


def _no_grids(sight: Sight) -> FoundGrids:
    return FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=sight.pyramid.size)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Named:
    """What markers name in a photo.

    Attributes:
        pieces: the boards.
        contradictory: indices of boards that were left out, see :class:`MarkedCorners`.

    """

    pieces: list[Piece]
    contradictory: set[int]

    @property
    def boards(self) -> set[int]:
        """Indices of all boards that markers place, in one place or in several."""
        return {piece.board for piece in self.pieces} | self.contradictory

    def marked(self, grids: int) -> MarkedCorners:
        """The corners, of so many grids that were given."""
        return _make_marked(self.pieces, grids, tuple(sorted(self.contradictory)))


def _list_marked(sight: Sight) -> set[int]:
    """Indices of the boards that have markers."""
    return {k for k, board in enumerate(sight.target.boards) if board.markers is not None}


def _add_fresh(
    sight: Sight, found: _Named, known: SeenMarkers, fresh: SeenMarkers, grids: FoundGrids
) -> tuple[_Named, SeenMarkers]:
    """What is found with more markers than the known ones, and all of them."""
    both = SeenMarkers.joined([known, fresh])
    again = set()
    for index in np.unique(fresh.board).tolist():
        own, old = fresh.of(index), known.of(index)
        piece = next((one for one in found.pieces if one.board == index), None)
        label = group_agreeing(SeenMarkers.joined([old, own]), sight.target.boards[index])
        if piece is None or not np.isin(label, label[: len(old)]).all():
            again.add(index)
            continue
        take_in(sight.pyramid, piece, own, grids.grids, _make_tree(grids))
    return (_name_corners(sight, both, grids, found, again) if again else found), both


def _make_tree(grids: FoundGrids) -> cKDTree:
    """The corners of grids, and those of none."""
    return cKDTree(np.concatenate([grids.refused, *(grid.pixel for grid in grids.grids)]))


def _read_closer(
    sight: Sight, found: _Named, known: SeenMarkers, coarse: float, zoom: float
) -> SeenMarkers:
    """Markers that a photo reduced ``zoom`` times shows where one reduced ``coarse`` may hide some.

    These may be of boards of which nothing is seen, and at open ends with small markers.
    """
    pyramid, families = sight.pyramid, sight.families
    whole = Part.whole(pyramid.size)
    parts = []
    if zoom < coarse:
        parts = [part for piece in found.pieces if (part := _small_part(sight, piece, coarse))]
    if found.boards < _list_marked(sight) or sum(part.pixels for part in parts) > whole.pixels:
        parts = [whole]
    photo = hidden(pyramid.levels[0], [piece.lattice for piece in found.pieces]) if parts else None
    read = [read_alone(pyramid, families, [zoom], part, photo) for part in parts]
    return _drop_known(SeenMarkers.joined([NO_MARKERS, *read]), known, found)


def _small_part(sight: Sight, piece: Piece, coarse: float) -> Part | None:
    """Where a board may go on with markers too small for a photo reduced ``coarse`` times."""
    ends = OpenEnds.of(sight.pyramid, piece.lattice)
    modules = min(
        family.size + 2 * family.border
        for family in sight.families
        if (family.board == piece.board).any()
    )
    side = marker_ratio(piece.lattice.board) * ends.side
    ends = ends.select(side < _CLEAR_MODULE_PX * modules * coarse)
    return ends.part(sight.pyramid.size) if len(ends) else None


def _list_parts_with_markers(
    sight: Sight, _found: _Named, alone: SeenMarkers, unseen: set[int]
) -> list[Part]:
    """Where markers of unseen boards are, too few or too badly read to say where all of it is."""
    boards = sorted(unseen & set(alone.board.tolist()))
    groups = [group for index in boards for group in _list_agreeing(sight, alone.of(index))]
    return [_part_around_read(sight, group, _MARGIN) for group in groups]


def _list_parts_with_squares(
    sight: Sight, found: _Named, _alone: SeenMarkers, _unseen: set[int]
) -> list[Part]:
    """Where more dark squares are than an accident has, and none of the boards that are found."""
    if not found.pieces:
        return []
    photo = hidden_around(sight.pyramid.levels[0], [piece.lattice for piece in found.pieces])
    zooms = [zoom for zoom in reading_zooms(sight.pyramid.size, sight.families) if zoom >= 1]
    outline = np.concatenate([find_outlines(photo, sight.families, zoom) for zoom in zooms])
    side = np.linalg.norm(outline - np.roll(outline, -1, axis=1), axis=2).mean(axis=1)
    middle = outline.mean(axis=1)
    apart = np.linalg.norm(middle[:, None] - middle, axis=-1)
    smaller, larger = np.minimum(side[:, None], side), np.maximum(side[:, None], side)
    beside = (apart < _BESIDE * smaller) & (larger < _ALIKE * smaller)
    label = connected_components(beside, directed=False)[1] if len(outline) else side
    parts = []
    for number in np.unique(label):
        rows = label == number
        if rows.sum() >= _SQUARES:
            margin = _MARGIN * side[rows]
            parts.append(Part.around(middle[rows], margin, sight.pyramid.size))
    return parts


def _list_agreeing(sight: Sight, own: SeenMarkers) -> list[SeenMarkers]:
    """Markers of a board, at least one, by the place that they agree on."""
    label = group_agreeing(own, sight.target.boards[own.board[0]])
    return [own.select(label == place) for place in np.unique(label)]


def _part_around_read(sight: Sight, markers: SeenMarkers, squares: float) -> Part:
    """What lies within so many squares (tags) of markers of one board."""
    outline = markers.pixel
    side = np.linalg.norm(outline - np.roll(outline, -1, axis=1), axis=2).max(axis=1)
    margin = squares * side / marker_ratio(sight.target.boards[markers.board[0]])
    return Part.around(outline.mean(axis=1), margin, sight.pyramid.size)


def _drop_known(fresh: SeenMarkers, known: SeenMarkers, found: _Named) -> SeenMarkers:
    """Markers that are not among the known ones, and may say more than is known of their board."""
    if len(fresh) and len(known):
        distance, index = nearest(fresh.pixel.mean(axis=1), known.pixel.mean(axis=1), 1)
        same = distance[:, 0] < 0.5 * shortest_side(fresh.pixel)
        same &= fresh.board == known.board[index[:, 0]]
        same &= (fresh.cell == known.cell[index[:, 0]]).all(axis=1)
        fresh = fresh.select(~same)
    for piece in found.pieces:
        rows = np.flatnonzero(fresh.board == piece.board)
        corner = cell_corners(piece.lattice.board, fresh.cell[rows])
        fresh = fresh.select(
            np.delete(np.arange(len(fresh)), rows[piece.lattice.are_known(corner)])
        )
    return fresh


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


def _list_small_boards(seen: _Seen) -> list[tuple[int, Part]]:
    """Boards that are found in part, and so small that windows around corners reach into markers.

    With each the part of the photo that it may be in.
    """
    pyramid, found = seen.sight.pyramid, []
    for piece in seen.named.pieces:
        lattice = piece.lattice
        cells = lattice.cells()
        side = float(np.median(lattice.fit(cells).side))
        if side < lattice.least_side and len(OpenEnds.of(pyramid, lattice)):
            missing = np.array(lattice.known.shape) - np.ptp(cells, axis=0) - 1
            margin = np.full(len(cells), side * (missing.max() + _MARGIN))
            found.append((piece.board, Part.around(lattice.at(cells), margin, pyramid.size)))
    return found


def _list_hinted(seen: _Seen) -> list[tuple[int, Part]]:
    """Boards of which most markers agree where they are, at least two, and where these may be."""
    alone, found = seen.alone, []
    for index in np.unique(alone.board).tolist():
        board = seen.sight.target.boards[index]
        group = max(_list_agreeing(seen.sight, alone.of(index)), key=_count_markers)
        if _count_markers(group) >= _AGREEING:
            corners = board.plane_points([0, board.columns - 1], [0, board.rows - 1])
            extent = float(np.ptp(corners, axis=0).max() / board.square)
            found.append((index, _part_around_read(seen.sight, group, extent + 2)))
    return found


def _count_markers(markers: SeenMarkers) -> int:
    """How many markers there are of one board, each counted once."""
    return len(np.unique(markers.cell, axis=0))


def _name_corners(
    sight: Sight,
    alone: SeenMarkers,
    grids: FoundGrids,
    before: _Named | None = None,
    again: set[int] | None = None,
) -> _Named:
    """What markers that were read alone, and those in the squares of grids, name.

    What is known ``before`` of other boards than those to be looked at ``again`` stays.
    """
    boards = sight.target.boards
    done = [] if before is None else [p for p in before.pieces if p.board not in (again or ())]
    for kept_piece in done:
        note_grids(kept_piece, grids.grids)
    settled = {kept_piece.board for kept_piece in done}
    markers = all_read(sight, grids, alone)
    free = _make_tree(grids)
    pieces: list[Piece] = []
    refuted = np.zeros(len(boards), np.intp)
    for index in np.unique(markers.board).tolist():
        if index in settled:
            continue
        own = markers.of(index)
        label = group_agreeing(own, boards[index])
        for place in np.unique(label):
            piece = piece_of(sight, index, own, label == place, grids.grids, free)
            if piece is None:
                continue
            if agrees(sight, piece):
                pieces.append(piece)
            elif piece.markers > 1:
                refuted[index] += piece.markers
    pieces.sort(key=lambda piece: -piece.markers)
    kept, contradictory = merge_pieces([*done, *pieces])
    named = {number for piece in kept for number in piece.grids}
    out = contradictory | set(np.flatnonzero(refuted).tolist())
    for number in sorted(set(range(len(grids.grids))) - named):
        one = read_together(sight, grids.grids[number])
        if one is None or one.board in out:
            continue
        lattice = BoardLattice(board=boards[one.board])
        lattice.put(one.cells, grids.grids[number].pixel)
        verify(sight.pyramid, lattice)
        piece = Piece(board=one.board, lattice=lattice, markers=one.markers, grids={number})
        extend(sight.pyramid, piece, grids.grids, free)
        merged, against = merge_pieces([*kept, piece])
        kept = kept if against else merged
    refuted[[piece.board for piece in kept]] = 0
    contradictory |= set(np.nonzero(refuted >= _NO_ACCIDENT)[0].tolist())
    return _Named(pieces=kept, contradictory=contradictory)


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
    sight = Sight.of(image, target)
    markers = read_alone(sight.pyramid, sight.families)
    pieces = []
    for index in np.unique(markers.board).tolist():
        own = markers.of(index)
        label = group_agreeing(own, target.boards[index])
        agreeing = {
            place: len(np.unique(own.cell[label == place], axis=0)) for place in label.tolist()
        }
        place = max(agreeing, key=lambda one: agreeing[one])
        if agreeing[place] < _AGREEING:
            continue
        lattice = placed(sight, index, own, label == place, cKDTree(np.zeros((0, 2))))
        pieces.append(Piece(board=index, lattice=lattice, markers=agreeing[place]))
    return _make_marked(pieces, 0, ())


def _make_marked(pieces: list[Piece], grids: int, contradictory: tuple[int, ...]) -> MarkedCorners:
    pieces = sorted(pieces, key=lambda piece: piece.board)
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
        contradictory=contradictory,
    )
