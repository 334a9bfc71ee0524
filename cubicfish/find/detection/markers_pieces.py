"""Boards, or parts of them, that markers place in a photo: grown, checked and joined.

A piece begins with the corners around markers that agree, takes in grids that share corners with
it and grows along the board. Its markers are read again through its corners.
"""

from dataclasses import dataclass, field

import numpy as np

from cubicfish.find.detection.grids import Grid
from cubicfish.find.detection.markers_detect import SeenMarkers, Sight
from cubicfish.find.detection.markers_lattice import (
    BoardLattice,
    clean,
    grow,
    snap_named,
    verify,
)
from cubicfish.find.detection.markers_read import (
    cell_corners,
    marker_ratio,
    module_places,
    quarter_turns,
    read_modules,
    shortest_side,
    squares,
    surely_alike,
    wrong_modules,
)
from cubicfish.find.detection.nearby import Tree, nearest
from cubicfish.find.detection.pyramid import Pyramid
from cubicfish.target.boards.board import Board
from cubicfish.types import BoolArray, FloatArray, IntArray

# A grid takes its names from at least this many of a board's corners, and from this share of
# those that it shares with the board.
_LEAST_VOTES, _LEAST_SHARE = 3, 0.8
# A marker that stands alone must have this many of its corners seen as corners.
_ALONE = 3
# Of the markers that are clearly seen through a board's corners, so many times more must be
# its own than others; and a marker that nothing else vouched for must not be the only one.
_OWN_FOR_ANOTHER = 4
# Blurred markers lose a few of their modules; of another one's about half are wrong, and hardly
# ever less than this share.
_BLURRED = 0.25
_SAME_CORNER = 0.3  # of the distance to the next corner


@dataclass(kw_only=True, eq=False)
class Piece:
    """A board, or a part of it, at one place in the photo."""

    board: int
    lattice: BoardLattice
    markers: int  # how many agree
    grids: set[int] = field(default_factory=set)


def piece_of(
    sight: Sight,
    index: int,
    markers: SeenMarkers,
    chosen: BoolArray,
    grids: tuple[Grid, ...],
    free: Tree,
) -> Piece | None:
    """The board as the chosen markers place it, grown as far as it can be seen."""
    lattice = placed(sight, index, markers, chosen, free)
    verify(sight.pyramid, lattice)
    agreeing = len(np.unique(markers.cell[chosen], axis=0))
    if lattice.known.sum() < (_ALONE if agreeing == 1 else 4):
        return None
    piece = Piece(board=index, lattice=lattice, markers=agreeing)
    extend(sight.pyramid, piece, grids, free)
    return piece if lattice.known.sum() >= 4 else None


def placed(
    sight: Sight, index: int, markers: SeenMarkers, chosen: BoolArray, free: Tree
) -> BoardLattice:
    """The corners around the chosen markers, each where a saddle is seen nearby."""
    lattice = BoardLattice(board=sight.target.boards[index])
    _put_seeds(sight.pyramid, lattice, markers.select(chosen), free)
    clean(lattice)
    return lattice


def take_in(
    pyramid: Pyramid, piece: Piece, markers: SeenMarkers, grids: tuple[Grid, ...], free: Tree
) -> None:
    """Grow a piece on from more markers of its board, which agree about where it is."""
    _put_seeds(pyramid, piece.lattice, markers, free)
    piece.markers += len(np.unique(markers.cell, axis=0))
    verify(pyramid, piece.lattice)
    extend(pyramid, piece, grids, free)


def _put_seeds(pyramid: Pyramid, lattice: BoardLattice, markers: SeenMarkers, free: Tree) -> None:
    """Put the unknown corners around markers where a saddle is seen nearby."""
    cells, pixel = _make_seeds(lattice.board, markers.cell, markers.pixel)
    fresh = ~lattice.known[cells[:, 0], cells[:, 1]]
    cells = cells[fresh]
    lattice.put(cells, pixel[fresh])
    fit = lattice.fit(cells)
    pixel, found = snap_named(pyramid, lattice, lattice.at(cells), fit, free)
    lattice.put(cells, np.where((found & fit.sound)[:, None], pixel, np.nan))


def extend(pyramid: Pyramid, piece: Piece, grids: tuple[Grid, ...], free: Tree) -> None:
    """Add what else of the board can be seen, and drop what is no corner.

    The piece's own corners are refined and judged.
    """
    lattice = piece.lattice
    for _ in range(2):
        judged = lattice.known
        _absorb(piece, grids)
        grow(pyramid, lattice, free)
        clean(lattice)
        if (lattice.known == judged).all():
            return
        grown = lattice.known
        verify(pyramid, lattice)
        clean(lattice)
        # Growth that finds nothing more looked around all of these corners.
        if (lattice.known == grown).all():
            return


def _make_seeds(board: Board, cell: IntArray, outline: FloatArray) -> tuple[IntArray, FloatArray]:
    """Where markers put the corners around them: cells (K, 2), pixels (K, 2)."""
    square = squares(outline, marker_ratio(board))
    corner = cell_corners(board, cell).reshape(-1, 2)
    pixel = square.reshape(-1, 2)
    inside = ((corner >= 0) & (corner < (board.columns, board.rows))).all(axis=1)
    cells, same = np.unique(corner[inside], axis=0, return_inverse=True)
    same = same.ravel()
    count = np.bincount(same, minlength=len(cells))
    mean = np.stack(
        [np.bincount(same, pixel[inside, k], minlength=len(cells)) / count for k in (0, 1)], axis=-1
    )
    return cells, mean


def _absorb(piece: Piece, grids: tuple[Grid, ...]) -> None:
    """Take the corners of grids that share corners with the piece, by majority vote."""
    lattice = piece.lattice
    for number, grid in enumerate(grids):
        names = _name_grid(lattice, grid)
        if names is None:
            continue
        piece.grids.add(number)
        fresh = ~lattice.known[names[:, 0], names[:, 1]]
        lattice.put(names[fresh], grid.pixel[fresh])


def note_grids(piece: Piece, grids: tuple[Grid, ...]) -> None:
    """Set which grids are parts of the piece, and leave its corners as they are."""
    named = (_name_grid(piece.lattice, grid) for grid in grids)
    piece.grids = {number for number, names in enumerate(named) if names is not None}


def _name_grid(lattice: BoardLattice, grid: Grid) -> IntArray | None:
    """Names (N, 2) of a grid's corners, or None when the piece does not name it for sure."""
    known = lattice.cells()
    if not len(known):
        return None
    distance, index = nearest(grid.pixel, lattice.at(known), 1)
    shared = distance[:, 0] < max(1.0, 0.1 * grid.step)
    if shared.sum() < _LEAST_VOTES:
        return None
    names = known[index[shared, 0]]
    most, named = 0, None
    for cells, turned in quarter_turns(grid):
        offsets, votes = np.unique(names - cells[shared], axis=0, return_counts=True)
        if votes.max() > most:
            most, named = int(votes.max()), cells + offsets[votes.argmax()]
            sign = turned
    if named is None or most < max(_LEAST_VOTES, _LEAST_SHARE * shared.sum()):
        return None
    fits = lattice.inside(named).all() and (lattice.sign(named) == sign).all()
    return named if fits else None


def agrees(sight: Sight, piece: Piece) -> bool:
    """Whether the markers that can be read through the piece's corners are the board's own."""
    board, lattice = sight.target.boards[piece.board], piece.lattice
    corner = cell_corners(board, board.marker_cells()[:, 1:])
    whole, pixel = lattice.whole_squares(corner)
    if not whole.any():
        return False
    corner, ratio = corner[whole], marker_ratio(board)
    side_px = ratio * shortest_side(pixel)
    own, other = np.zeros(len(corner), bool), np.zeros(len(corner), bool)
    families = [one for one in sight.families if (one.board == piece.board).any()]
    for family in families:
        row = np.nonzero(family.board == piece.board)[0]
        points = lattice.inside_squares(corner, module_places(family, ratio))
        white, clear = read_modules(sight.pyramid, points, side_px, family)
        wrong = wrong_modules(white, family)[:, 0]
        wrong = wrong[np.arange(len(wrong)), row[whole]]
        own |= clear & (wrong <= family.corrected)
        other |= clear & (wrong > max(family.corrected, _BLURRED * family.size**2))
    least = 2 if piece.markers == 1 else 1
    # Those that place the piece were read in the same squares, or beyond the known corners.
    agreeing = max(int(own.sum()), piece.markers)
    if own.sum() >= least and agreeing >= _OWN_FOR_ANOTHER * (other & ~own).sum():
        return True
    # Modules of a pixel or two are misread one by one where all together leave no doubt.
    return any(surely_alike(sight.pyramid, family, piece.board, lattice) for family in families)


def merge_pieces(pieces: list[Piece]) -> tuple[list[Piece], set[int]]:
    """Merge pieces that continue each other; leave out boards that are in two places."""
    kept: list[Piece] = []
    contradictory: set[int] = set()
    for piece in pieces:
        overlapping = [other for other in kept if _do_share_pixels(piece, other)]
        same = [other for other in kept if other.board == piece.board]
        if any(other.board != piece.board for other in overlapping):
            continue  # what more markers name otherwise
        if not same:
            kept.append(piece)
        elif all(_do_continue_each_other(piece, other) for other in same):
            _merge(same[0], piece)
        else:
            contradictory.add(piece.board)
    return [piece for piece in kept if piece.board not in contradictory], contradictory


def _do_share_pixels(one: Piece, other: Piece) -> bool:
    """Whether a good part of the smaller piece is where the other piece has corners."""
    few, many = sorted((one.lattice, other.lattice), key=lambda lattice: int(lattice.known.sum()))
    cells = few.cells()
    near = nearest(few.at(cells), many.pixel[many.known], 1)[0][:, 0]
    limit = _SAME_CORNER * few.closest * few.fit(cells).side
    return bool((near < limit).mean() > 0.1)


def _do_continue_each_other(one: Piece, other: Piece) -> bool:
    """Whether two pieces of a board can be parts of one board in one place."""
    both = np.argwhere(one.lattice.known & other.lattice.known)
    if len(both):
        apart = np.hypot(*(one.lattice.at(both) - other.lattice.at(both)).T)
        limit = _SAME_CORNER * one.lattice.closest * one.lattice.fit(both).side
        return bool((apart < limit).all()) and not _do_names_differ(one, other)
    if _do_share_pixels(one, other):
        return False
    # The way between their nearest cells must be as long, and lead where, both pieces say.
    a, b = one.lattice.cells(), other.lattice.cells()
    distance, index = nearest(a.astype(float), b.astype(float), 1)
    start = a[distance[:, 0].argmin()][None]
    end = b[index[distance[:, 0].argmin(), 0]][None]
    lattice = one.lattice
    way = np.array(
        [
            lattice.x[end[0, 0]] - lattice.x[start[0, 0]],
            lattice.y[end[0, 1]] - lattice.y[start[0, 1]],
        ]
    )
    steps = 0.5 * (one.lattice.fit(start).step[0] + other.lattice.fit(end).step[0])
    expected = steps @ way
    seen = other.lattice.at(end)[0] - one.lattice.at(start)[0]
    return bool(np.linalg.norm(seen - expected) < 0.5 * np.linalg.norm(expected))


def _do_names_differ(one: Piece, other: Piece) -> bool:
    """Whether a corner of one piece is where the other has a corner of another name."""
    cells, names = one.lattice.cells(), other.lattice.cells()
    distance, index = nearest(one.lattice.at(cells), other.lattice.at(names), 1)
    limit = _SAME_CORNER * one.lattice.closest * one.lattice.fit(cells).side
    near = distance[:, 0] < limit
    return bool((names[index[near, 0]] != cells[near]).any())


def _merge(into: Piece, piece: Piece) -> None:
    cells = np.argwhere(piece.lattice.known & ~into.lattice.known)
    into.lattice.put(cells, piece.lattice.at(cells))
    into.markers += piece.markers
    into.grids |= piece.grids
