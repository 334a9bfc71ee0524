"""Photo + target -> named corners of ChArUco and AprilGrid boards.

Markers name the corners around them; found grids and growth along the board add those whose
markers cannot be read, as in the rim of a fisheye photo. A name must be supported by markers
that agree with each other about where the board is; what they contradict is left nameless.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import FloatArray, IntArray
from cubicfish_cli.corners.detection.grids import (
    FoundGrids,
    grids_in_mirror,
    negative_grids,
    negative_photo,
)
from cubicfish_cli.corners.detection.markers_detect import SeenMarkers, Sight
from cubicfish_cli.corners.detection.markers_lattice import BoardLattice
from cubicfish_cli.corners.detection.markers_measure import with_sides_seen
from cubicfish_cli.corners.detection.markers_pieces import (
    Piece,
    agrees,
    extend,
    merge_pieces,
    piece_of,
    placed,
)
from cubicfish_cli.corners.detection.markers_read import (
    all_read,
    group_agreeing,
    read_alone,
    read_together,
)
from cubicfish_cli.corners.detection.pyramid import CLOSE, build_pyramid, enlarged, reduced

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


def find_marked_corners(
    image: npt.NDArray[np.generic], target: Target, grids: FoundGrids, *, closely: bool = False
) -> MarkedCorners:
    """Find and name the corners of the target's ChArUco and AprilGrid boards.

    Args:
        image: (H, W) grey photo, uint8, uint16 or float.
        target: the calibration target; boards without markers are passed over.
        grids: what :func:`~.finder.find_grids` found in the same photo.
        closely: search the photo at twice its size, for markers half as small.

    """
    return _find_however_printed(_find_closely if closely else _find, image, target, grids)


def outlined_corners(image: npt.NDArray[np.generic], target: Target) -> MarkedCorners:
    """Corners of the same boards that markers with clear outlines name, and no others.

    They are good to a few tenths of a pixel, and boards of which fewer than two markers agree are
    left out: a fraction of the work, for those who want to know roughly what a photo shows.
    """
    height, width = image.shape
    none = FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=(width, height))
    return _find_however_printed(_find_outlined, image, target, none)


_Finder = Callable[[npt.NDArray[np.generic], Target, FoundGrids], MarkedCorners]


def _find_however_printed(
    find: _Finder, image: npt.NDArray[np.generic], target: Target, grids: FoundGrids
) -> MarkedCorners:
    """What is found of dark markers, light ones, and both in a mirror."""
    if target.mirrored:
        mirrored = image[:, ::-1], target.in_mirror(), grids_in_mirror(grids)
        return _mirror_found(_find_however_printed(find, *mirrored), target, image.shape[1])
    inverted = _select_markers(target, inverted=True)
    if inverted is None:
        return find(image, target, grids)
    negative = find(negative_photo(image), inverted, negative_grids(grids))
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


def _find(image: npt.NDArray[np.generic], target: Target, grids: FoundGrids) -> MarkedCorners:
    """The same for dark markers in a photo that is not mirrored."""
    sight = Sight.of(image, target)
    alone = read_alone(sight.pyramid, sight.families)
    found = _name_corners(sight, alone, grids)
    measured = with_sides_seen(target, alone)
    if measured is None:
        return found
    return max(found, _name_corners(replace(sight, target=measured), alone, grids), key=len)


def _name_corners(sight: Sight, alone: SeenMarkers, grids: FoundGrids) -> MarkedCorners:
    """What markers that were read alone, and those in the squares of grids, name."""
    boards = sight.target.boards
    markers = all_read(sight, grids, alone)
    free = cKDTree(np.concatenate([grids.refused, *(grid.pixel for grid in grids.grids)]))
    pieces: list[Piece] = []
    refuted = np.zeros(len(boards), np.intp)
    for index in np.unique(markers.board).tolist():
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
    kept, contradictory = merge_pieces(sorted(pieces, key=lambda piece: -piece.markers))
    named = {number for piece in kept for number in piece.grids}
    out = contradictory | set(np.flatnonzero(refuted).tolist())
    for number in sorted(set(range(len(grids.grids))) - named):
        one = read_together(sight, grids.grids[number])
        if one is None or one.board in out:
            continue
        lattice = BoardLattice(board=boards[one.board])
        lattice.put(one.cells, grids.grids[number].pixel)
        piece = Piece(board=one.board, lattice=lattice, markers=one.markers, grids={number})
        extend(sight.pyramid, piece, grids.grids, free)
        merged, against = merge_pieces([*kept, piece])
        kept = kept if against else merged
    refuted[[piece.board for piece in kept]] = 0
    contradictory |= set(np.nonzero(refuted >= _NO_ACCIDENT)[0].tolist())
    return _make_marked(kept, len(grids.grids), tuple(sorted(contradictory)))


def _find_closely(
    image: npt.NDArray[np.generic], target: Target, grids: FoundGrids
) -> MarkedCorners:
    """As :func:`_find` at twice the size; what the photo itself shows says where corners are."""
    larger = [
        replace(grid, pixel=enlarged(grid.pixel, 1 / CLOSE), step=grid.step / CLOSE)
        for grid in grids.grids
    ]
    refused = enlarged(grids.refused, 1 / CLOSE)
    found = _find(
        reduced(image, CLOSE), target, replace(grids, grids=tuple(larger), refused=refused)
    )
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
    image: npt.NDArray[np.generic], target: Target, grids: FoundGrids
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
    return _make_marked(pieces, len(grids.grids), ())


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
