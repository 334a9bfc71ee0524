"""Where a closer look may show more of boards with markers, and the markers that it shows.

Closer are outlines in a larger photo, grids in a part of the photo, and that part at twice its
size. Each is asked only for what is missing.
"""

import numpy as np

from cubicfish.find.detection.markers_detect import (
    NO_MARKERS,
    SeenMarkers,
    Sight,
    find_outlines,
    reading_zooms,
)
from cubicfish.find.detection.markers_missing import OpenEnds, Part, hidden, hidden_around
from cubicfish.find.detection.markers_named import Named, list_agreeing
from cubicfish.find.detection.markers_pieces import Piece
from cubicfish.find.detection.markers_read import (
    cell_corners,
    marker_ratio,
    read_alone,
    shortest_side,
)
from cubicfish.find.detection.medians import median
from cubicfish.find.detection.nearby import connected, nearest

# Outlines of markers whose modules are larger are found in a photo, and so are those in its double.
_CLEAR_MODULE_PX = 4.0
# Boards whose markers have smaller modules are looked at again at twice the size: twice what can
# be read at all.
_SMALL_MODULE_PX = 3.0
# A grid that has the corners around markers, and those next to them, says where a board is: so many
# squares (tags) from the middles of its markers. It grows from there.
_MARGIN = 3.0
# Dark squares of one size, so near to each other, are beside each other in a board; fewer than so
# many are too few to name it.
_BESIDE, _ALIKE, _SQUARES = 3.0, 1.6, 4
# Where nothing else vouches for markers, so many must agree.
_AGREEING = 2


def list_marked(sight: Sight) -> set[int]:
    """Indices of the boards that have markers."""
    return {k for k, board in enumerate(sight.target.boards) if board.markers is not None}


def read_closer(
    sight: Sight, found: Named, known: SeenMarkers, coarse: float, zoom: float
) -> SeenMarkers:
    """Markers that a photo reduced ``zoom`` times shows where one reduced ``coarse`` may hide some.

    These may be of boards of which nothing is seen, and at open ends with small markers.
    """
    pyramid, families = sight.pyramid, sight.families
    whole = Part.whole(pyramid.size)
    parts = []
    if zoom < coarse:
        parts = [part for piece in found.pieces if (part := _small_part(sight, piece, coarse))]
    if found.boards < list_marked(sight) or sum(part.pixels for part in parts) > whole.pixels:
        parts = [whole]
    photo = hidden(pyramid.levels[0], [piece.lattice for piece in found.pieces]) if parts else None
    read = [read_alone(pyramid, families, [zoom], part, photo) for part in parts]
    return _drop_known(SeenMarkers.joined([NO_MARKERS, *read]), known, found)


def _small_part(sight: Sight, piece: Piece, coarse: float) -> Part | None:
    """Where a board may go on with markers too small for a photo reduced ``coarse`` times."""
    ends = OpenEnds.of(sight.pyramid, piece.lattice)
    module = _module_side(sight, piece.board) * ends.side
    ends = ends.select(module < _CLEAR_MODULE_PX * coarse)
    return ends.part(sight.pyramid.size) if len(ends) else None


def _module_side(sight: Sight, index: int) -> float:
    """Side of the modules of a board's markers in squares (tags)."""
    own = [family for family in sight.families if (family.board == index).any()]
    modules = min(family.size + 2 * family.border for family in own)
    return marker_ratio(sight.target.boards[index]) / modules


def _drop_known(fresh: SeenMarkers, known: SeenMarkers, found: Named) -> SeenMarkers:
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


def parts_with_markers(
    sight: Sight, _found: Named, alone: SeenMarkers, unseen: set[int]
) -> list[Part]:
    """Where markers of unseen boards are, too few or too badly read to say where all of it is."""
    boards = sorted(unseen & set(alone.board.tolist()))
    groups = [group for index in boards for group in list_agreeing(sight, alone.of(index))]
    return [_part_around_read(sight, group, _MARGIN) for group in groups]


def parts_with_squares(
    sight: Sight, found: Named, _alone: SeenMarkers, _unseen: set[int]
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
    label = connected(beside)
    parts = []
    for number in np.unique(label):
        rows = label == number
        if rows.sum() >= _SQUARES:
            margin = _MARGIN * side[rows]
            parts.append(Part.around(middle[rows], margin, sight.pyramid.size))
    return parts


def _part_around_read(sight: Sight, markers: SeenMarkers, squares: float) -> Part:
    """What lies within so many squares (tags) of markers of one board."""
    outline = markers.pixel
    side = np.linalg.norm(outline - np.roll(outline, -1, axis=1), axis=2).max(axis=1)
    margin = squares * side / marker_ratio(sight.target.boards[markers.board[0]])
    return Part.around(outline.mean(axis=1), margin, sight.pyramid.size)


def small_boards(sight: Sight, found: Named) -> list[tuple[int, Part]]:
    """Boards that are found in part, and have small modules and windows that reach into markers.

    With each the part of the photo that it may be in.
    """
    size, small = sight.pyramid.size, []
    for piece in found.pieces:
        lattice = piece.lattice
        cells = lattice.cells()
        side = median(lattice.fit(cells).side)
        modules = side * _module_side(sight, piece.board) < _SMALL_MODULE_PX
        if not modules or side > lattice.least_side or not len(OpenEnds.of(sight.pyramid, lattice)):
            continue
        missing = np.array(lattice.known.shape) - np.ptp(cells, axis=0) - 1
        margin = np.full(len(cells), side * (missing.max() + _MARGIN))
        small.append((piece.board, Part.around(lattice.at(cells), margin, size)))
    return small


def hinted_boards(sight: Sight, alone: SeenMarkers) -> list[tuple[int, Part]]:
    """Boards of which most markers agree where they are, at least two, and where these may be."""
    hinted = []
    for index in np.unique(alone.board).tolist():
        board = sight.target.boards[index]
        group = max(list_agreeing(sight, alone.of(index)), key=_count_markers)
        if _count_markers(group) >= _AGREEING:
            corners = board.plane_points([0, board.columns - 1], [0, board.rows - 1])
            extent = float(np.ptp(corners, axis=0).max() / board.square)
            hinted.append((index, _part_around_read(sight, group, extent + 2)))
    return hinted


def _count_markers(markers: SeenMarkers) -> int:
    """How many markers there are of one board, each counted once."""
    return len(np.unique(markers.cell, axis=0))
