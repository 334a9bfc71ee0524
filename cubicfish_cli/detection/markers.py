"""Photo + target -> named corners of ChArUco and AprilGrid boards.

Markers name the corners around them; found grids and growth along the board add those whose
markers cannot be read, as in the rim of a fisheye photo. A name must be supported by markers
that agree with each other about where the board is; what they contradict is left nameless.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from cubicfish_cli.boards.board import Board
from cubicfish_cli.detection.grids import (
    FoundGrids,
    Grid,
    grids_in_mirror,
    negative_grids,
    negative_photo,
)
from cubicfish_cli.detection.markers_detect import (
    Family,
    SeenMarkers,
    every_family,
    families,
    find_outlines,
    join,
)
from cubicfish_cli.detection.markers_lattice import BoardLattice, clean, grow, snap, verify
from cubicfish_cli.detection.markers_read import (
    NamedGrid,
    cell_corners,
    marker_ratio,
    module_places,
    quarter_turns,
    read_grid,
    read_modules,
    read_outlines,
    read_together,
    shortest_side,
    squares,
    surely_alike,
    wrong_modules,
)
from cubicfish_cli.detection.nearby import nearest
from cubicfish_cli.detection.pyramid import CLOSE, Pyramid, build_pyramid, enlarged, reduced
from cubicfish_cli.target import Target
from cubicfish_cli.types import BoolArray, FloatArray, IntArray

# Markers vouch for each other up to this many cells apart, when each is where the shape of both
# puts it, to this share of a cell: distortion takes a tenth or two, a wrong cell is 1 away.
_VOUCH_CELLS = 2
_VOUCH_MISS = 0.4
# A grid takes its names from at least this many of a board's corners, and from this share of
# those that it shares with the board.
_LEAST_VOTES, _LEAST_SHARE = 3, 0.8
# A marker that stands alone must have this many of its corners seen as corners.
_ALONE = 3
# Where nothing else vouches for markers, so many must agree.
_AGREEING = 2
# Of the markers that are clearly seen through a board's corners, so many times more must be
# its own than others; and a marker that nothing else vouched for must not be the only one.
_OWN_FOR_ANOTHER = 4
# Blurred markers lose a few of their modules; of another one's about half are wrong, and hardly
# ever less than this share.
_BLURRED = 0.25
# So many markers, at least two side by side, are no misreadings even where others refute them.
_NO_ACCIDENT = 3
_SAME_CORNER = 0.3  # of the distance to the next corner
# A marker's side that is off by this share puts its outermost modules half a module off. Fewer
# pairs of markers do not say how wide they are; theirs must lie this straight, as a share.
_SIDE_OFF, _FEWEST_PAIRS, _STRAIGHT = 0.1, 4, 0.2


class How(IntEnum):
    """What named a corner."""

    MARKER = 0
    """It belongs to a marker that was read, or to a grid whose markers were read together."""
    GRID = 1
    """A found grid, named by corners that it shares with markers, has it."""
    GROWN = 2
    """It is where its board continues."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MarkedCorners:
    """Corners of boards with markers, found and named in one photo.

    Attributes:
        board: (N,) index into the target's boards.
        column, row: (N,) place on the board.
        pixel: (N, 2) sub-pixel x, y.
        how: (N,) what named each, see :class:`How`.
        grid_board: (G,) for each grid that was given, the board that it is part of, or -1 when
            no marker names it.
        contradictory: indices of boards that were left out because markers put them in two
            places: two copies in view, or a board that is not as the target says.

    """

    board: IntArray
    column: IntArray
    row: IntArray
    pixel: FloatArray
    how: IntArray
    grid_board: IntArray
    contradictory: tuple[int, ...]

    def __len__(self) -> int:
        """Return the number of corners."""
        return len(self.board)


@dataclass(kw_only=True, eq=False)
class _Piece:
    """A board, or a part of it, at one place in the photo."""

    board: int
    lattice: BoardLattice
    how: IntArray = field(init=False)  # (columns, rows)
    markers: int  # how many agree
    grids: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Take what is known for what markers name, the rest for what will have grown."""
        self.how = np.where(self.lattice.known, int(How.MARKER), int(How.GROWN))


def find_marked_corners(
    image: npt.NDArray[np.generic], target: Target, grids: FoundGrids, *, closely: bool = False
) -> MarkedCorners:
    """Find and name the corners of the target's ChArUco and AprilGrid boards.

    Args:
        image: (H, W) grey photo, uint8, uint16 or float.
        target: the calibration target; boards without markers are passed over.
        grids: what :func:`~.finder.find_grids` found in the same photo.
        closely: look at the photo at twice its size, for markers half as small.

    """
    return _however_printed(_find_closely if closely else _find, image, target, grids)


def outlined_corners(image: npt.NDArray[np.generic], target: Target) -> MarkedCorners:
    """Corners of the same boards that markers with clear outlines name, and no others.

    They are good to a few tenths of a pixel, and boards of which fewer than two markers agree are
    left out: a fraction of the work, for those who want to know roughly what a photo shows.
    """
    height, width = image.shape
    none = FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=(width, height))
    return _however_printed(_outlined, image, target, none)


_Finder = Callable[[npt.NDArray[np.generic], Target, FoundGrids], MarkedCorners]


def _however_printed(
    find: _Finder, image: npt.NDArray[np.generic], target: Target, grids: FoundGrids
) -> MarkedCorners:
    """What is found of dark markers, light ones, and both in a mirror."""
    if target.mirrored:
        mirrored = image[:, ::-1], target.in_mirror(), grids_in_mirror(grids)
        return _in_mirror(_however_printed(find, *mirrored), target, image.shape[1])
    inverted = _with_markers(target, inverted=True)
    if inverted is None:
        return find(image, target, grids)
    negative = find(negative_photo(image), inverted, negative_grids(grids))
    others = _with_markers(target, inverted=False)
    return negative if others is None else _both(find(image, others, grids), negative)


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


def _in_mirror(found: MarkedCorners, target: Target, width: int) -> MarkedCorners:
    """What was found in the mirrored photo of the target, as corners of what the mirror shows."""
    columns = np.array([board.columns for board in target.boards])[found.board]
    return replace(
        found,
        column=columns - 1 - found.column,
        pixel=np.stack([width - 1 - found.pixel[:, 0], found.pixel[:, 1]], axis=-1),
    )


def _both(one: MarkedCorners, other: MarkedCorners) -> MarkedCorners:
    """The corners of boards of both kinds in one photo."""
    joined = {
        name: np.concatenate([getattr(one, name), getattr(other, name)])
        for name in ("board", "column", "row", "pixel", "how")
    }
    return MarkedCorners(
        **joined,
        grid_board=np.maximum(one.grid_board, other.grid_board),
        contradictory=tuple(sorted({*one.contradictory, *other.contradictory})),
    )


def _find(image: npt.NDArray[np.generic], target: Target, grids: FoundGrids) -> MarkedCorners:
    """The same for dark markers in a photo that is not mirrored."""
    all_families = families(target)
    if not all_families or min(image.shape) < 8:
        return _marked([], len(grids.grids), ())
    pyramid = build_pyramid(image)
    alone = _read_alone(pyramid, all_families)
    found = _named(pyramid, target, all_families, alone, grids)
    measured = _with_sides_seen(target, alone)
    if measured is None:
        return found
    return max(found, _named(pyramid, measured, all_families, alone, grids), key=len)


def _with_sides_seen(target: Target, alone: SeenMarkers) -> Target | None:
    """The target with its markers as wide as they are seen; None where that is what it says.

    A marker that lies two cells from another of its board, or nearer, is as far away as both say
    in their own sides. Corners do not depend on how wide markers are: a wrong size in the target's
    file hides them only because markers are looked for in the wrong parts of squares.
    """
    changed = {}
    for index in np.unique(alone.board).tolist():
        board, own = target.boards[index], alone.of(index)
        if board.markers is None or board.per_cell == 2:
            continue
        apart = own.cell[None] - own.cell[:, None]
        one, other = np.nonzero((apart != 0).any(-1) & (np.abs(apart).max(-1) <= _VOUCH_CELLS))
        middle, step = _axes(own.pixel)
        seen = middle[other] - middle[one]
        expected = (0.5 * (step[one] + step[other]) @ apart[one, other][..., None])[..., 0]
        times = (seen * expected).sum(axis=1) / np.square(expected).sum(axis=1)
        off = np.linalg.norm(seen - times[:, None] * expected, axis=1)
        straight = (times > 1) & (off < _STRAIGHT * np.linalg.norm(seen, axis=1))
        side = board.square / np.median(times[straight]) if straight.any() else 0.0
        enough = straight.sum() >= 2 * _FEWEST_PAIRS
        if enough and abs(np.log(side / board.markers.side)) > _SIDE_OFF:
            changed[index] = replace(board, markers=replace(board.markers, side=side))
    return target.with_boards(changed) if changed else None


def _named(
    pyramid: Pyramid,
    target: Target,
    all_families: list[Family],
    alone: SeenMarkers,
    grids: FoundGrids,
) -> MarkedCorners:
    """What markers that were read alone, and those in the squares of grids, name."""
    markers = _with_those_in_grids(pyramid, target, all_families, alone, grids)
    free = np.concatenate([grids.refused, *(grid.pixel for grid in grids.grids)])
    pieces: list[_Piece] = []
    refuted = np.zeros(len(target.boards), np.intp)
    for index in np.unique(markers.board):
        own = markers.of(int(index))
        label = _places(own, target, int(index))
        for place in np.unique(label):
            piece = _piece(pyramid, target, int(index), own, label == place, grids.grids, free)
            if piece is None:
                continue
            if _agrees(pyramid, target, all_families, piece):
                pieces.append(piece)
            elif piece.markers > 1:
                refuted[index] += piece.markers
    kept, contradictory = _settle(sorted(pieces, key=lambda piece: -piece.markers))
    named = {number for piece in kept for number in piece.grids}
    out = contradictory | set(np.flatnonzero(refuted).tolist())
    for number in sorted(set(range(len(grids.grids))) - named):
        one = read_together(pyramid, target, all_families, grids.grids[number])
        if one is None or one.board in out:
            continue
        piece = _blurred(pyramid, target, one, number, grids.grids, free)
        settled, against = _settle([*kept, piece])
        kept = kept if against else settled
    refuted[[piece.board for piece in kept]] = 0
    contradictory |= set(np.nonzero(refuted >= _NO_ACCIDENT)[0].tolist())
    return _marked(kept, len(grids.grids), tuple(sorted(contradictory)))


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


def agreeing_markers(
    image: npt.NDArray[np.generic],
    drawings: Sequence[Target],
    index: int,
    grids: FoundGrids,
) -> IntArray:
    """Count the markers that agree on where a board is, for each of several drawings of it.

    Args:
        image: (H, W) grey photo.
        drawings: the target with that board drawn otherwise, not in a mirror and not inverted;
            the first has all markers that are looked for.
        index: the board.
        grids: what was found in the same photo.

    Returns:
        (N,) for each drawing.

    """
    widest = drawings[0]
    all_families = families(widest)
    if min(image.shape) < 8:
        return np.zeros(len(drawings), np.intp)
    seen = _all_read(build_pyramid(image), widest, all_families, grids).of(index)
    ids = _ids_by_cell(widest.boards[index])[tuple(seen.cell.T)]
    counts = []
    for one in drawings:
        table = one.boards[index].marker_cells()
        row = ids - table[0, 0]
        known = row < len(table)
        own = replace(seen.select(known), cell=table[row[known], 1:])
        label = _places(own, one, index) if len(own) else np.zeros(0, np.intp)
        agreeing = [len(np.unique(own.cell[label == place], axis=0)) for place in np.unique(label)]
        counts.append(max(agreeing, default=0))
    return np.array(counts, np.intp)


def markers_of_any_kind(image: npt.NDArray[np.generic]) -> dict[str, IntArray]:
    """Ids of all markers (N,) that are clearly read in a grey photo (H, W), by dictionary."""
    names, all_families = every_family()
    seen = _read_alone(build_pyramid(image), all_families) if min(image.shape) >= 8 else join([])
    return {name: np.unique(seen.of(index).cell[:, 0]) for index, name in enumerate(names)}


def tags_apart(
    image: npt.NDArray[np.generic], target: Target, index: int, grids: FoundGrids
) -> FloatArray:
    """How far apart tags are that follow each other in a row of a board.

    Args:
        image: (H, W) grey photo.
        target: the calibration target, not in a mirror.
        index: the board.
        grids: what was found in the same photo.

    Returns:
        (N,) distances of their middles, in their sides.

    """
    if min(image.shape) < 8:
        return np.zeros(0)
    seen = _all_read(build_pyramid(image), target, families(target), grids).of(index)
    cell, first = np.unique(seen.cell, axis=0, return_index=True)
    middle, step = _axes(seen.pixel[first])
    row, following = np.nonzero((cell[None] - cell[:, None] == (1, 0)).all(axis=-1))
    side = np.linalg.norm(step[..., 0], axis=1)
    distance = np.linalg.norm(middle[following] - middle[row], axis=1)
    return np.asarray(distance / (0.5 * (side[row] + side[following])), float)


def _axes(outline: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middles (N, 2) of quadrangles (N, 4, 2), and (N, 2, 2): columns to the right, and down."""
    a, b, c, d = outline.transpose(1, 0, 2)
    return outline.mean(axis=1), 0.5 * np.stack([b + c - a - d, c + d - a - b], axis=-1)


def _ids_by_cell(board: Board) -> IntArray:
    """(cell columns, cell rows) ids of the markers; -1 in cells without one."""
    ids, column, row = board.marker_cells().T
    table = np.full((column.max() + 1, row.max() + 1), -1, np.intp)
    table[column, row] = ids
    return table


def _all_read(
    pyramid: Pyramid, target: Target, all_families: list[Family], grids: FoundGrids
) -> SeenMarkers:
    """Markers that are read by their own outlines, or in the squares of grids."""
    alone = _read_alone(pyramid, all_families)
    return _with_those_in_grids(pyramid, target, all_families, alone, grids)


def _with_those_in_grids(
    pyramid: Pyramid,
    target: Target,
    all_families: list[Family],
    alone: SeenMarkers,
    grids: FoundGrids,
) -> SeenMarkers:
    in_grids = (read_grid(pyramid, target, all_families, grid) for grid in grids.grids)
    return join([alone, *in_grids])


def _read_alone(pyramid: Pyramid, all_families: list[Family]) -> SeenMarkers:
    """Markers that are read by their own outlines."""
    grey = np.clip(np.rint(pyramid.levels[0]), 0, 255).astype(np.uint8)
    return read_outlines(pyramid, all_families, find_outlines(grey, all_families))


def _outlined(image: npt.NDArray[np.generic], target: Target, grids: FoundGrids) -> MarkedCorners:
    """As :func:`_find`, of outlines alone."""
    all_families = families(target)
    if not all_families or min(image.shape) < 8:
        return _marked([], len(grids.grids), ())
    pyramid = build_pyramid(image)
    markers = _read_alone(pyramid, all_families)
    pieces = []
    for index in np.unique(markers.board).tolist():
        own = markers.of(index)
        label = _places(own, target, index)
        agreeing = {
            place: len(np.unique(own.cell[label == place], axis=0)) for place in label.tolist()
        }
        place = max(agreeing, key=lambda one: agreeing[one])
        if agreeing[place] < _AGREEING:
            continue
        lattice = _placed(pyramid, target, index, own, label == place, np.zeros((0, 2)))
        pieces.append(_Piece(board=index, lattice=lattice, markers=agreeing[place]))
    return _marked(pieces, len(grids.grids), ())


def _places(markers: SeenMarkers, target: Target, board: int) -> IntArray:
    """Which markers of a board agree about where it is: (N,) the same number for those."""
    count = len(markers)
    pitch = 1 + target.boards[board].spacing if target.boards[board].kind == "aprilgrid" else 1.0
    square = squares(markers.pixel, marker_ratio(target, board))
    middle, step = _axes(square)
    apart = markers.cell[None] - markers.cell[:, None]
    step = 0.5 * pitch * (step[None] + step[:, None])
    expected = (step @ apart[..., None])[..., 0]
    miss = np.linalg.norm(middle[None] - middle[:, None] - expected, axis=-1)
    length = np.linalg.norm(step, axis=-2).min(axis=-1)
    agree = (np.abs(apart).max(axis=-1) <= _VOUCH_CELLS) & (miss < _VOUCH_MISS * length)
    label = np.arange(count)
    while True:
        lowest = np.where(agree | agree.T, label[None], count).min(axis=1)
        if (lowest == label).all():
            return label
        label = lowest


def _piece(
    pyramid: Pyramid,
    target: Target,
    index: int,
    markers: SeenMarkers,
    chosen: BoolArray,
    grids: tuple[Grid, ...],
    free: FloatArray,
) -> _Piece | None:
    """The board as the chosen markers place it, grown as far as it can be seen."""
    lattice = _placed(pyramid, target, index, markers, chosen, free)
    verify(pyramid, lattice)
    agreeing = len(np.unique(markers.cell[chosen], axis=0))
    if lattice.known.sum() < (_ALONE if agreeing == 1 else 4):
        return None
    piece = _Piece(board=index, lattice=lattice, markers=agreeing)
    _extend(pyramid, piece, grids, free)
    return piece if lattice.known.sum() >= 4 else None


def _placed(
    pyramid: Pyramid,
    target: Target,
    index: int,
    markers: SeenMarkers,
    chosen: BoolArray,
    free: FloatArray,
) -> BoardLattice:
    """The corners around the chosen markers, each where a saddle is seen nearby."""
    board = target.boards[index]
    lattice = BoardLattice(board=board)
    cells, pixel = _seeds(board, markers.cell[chosen], markers.pixel[chosen], target, index)
    lattice.put(cells, pixel)
    cells = lattice.cells()
    fit = lattice.fit(cells)
    pixel, found = snap(pyramid, lattice, lattice.at(cells), fit, free)
    lattice.put(cells, np.where((found & fit.sound)[:, None], pixel, np.nan))
    clean(lattice)
    return lattice


def _extend(pyramid: Pyramid, piece: _Piece, grids: tuple[Grid, ...], free: FloatArray) -> None:
    """Add what else of the board can be seen, and drop what is no corner."""
    lattice = piece.lattice
    for _ in range(2):
        _absorb(piece, grids)
        grow(pyramid, lattice, free)
        clean(lattice)
        verify(pyramid, lattice)
        clean(lattice)


def _blurred(
    pyramid: Pyramid,
    target: Target,
    one: NamedGrid,
    number: int,
    grids: tuple[Grid, ...],
    free: FloatArray,
) -> _Piece:
    """The board of a grid that is named by all of its markers together."""
    lattice = BoardLattice(board=target.boards[one.board])
    lattice.put(one.cells, grids[number].pixel)
    piece = _Piece(board=one.board, lattice=lattice, markers=one.markers, grids={number})
    _extend(pyramid, piece, grids, free)
    return piece


def _seeds(
    board: Board, cell: IntArray, outline: FloatArray, target: Target, index: int
) -> tuple[IntArray, FloatArray]:
    """Where markers put the corners around them: cells (K, 2), pixels (K, 2)."""
    square = squares(outline, marker_ratio(target, index))
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


def _absorb(piece: _Piece, grids: tuple[Grid, ...]) -> None:
    """Take the corners of grids that share corners with the piece, by majority vote."""
    lattice = piece.lattice
    for number, grid in enumerate(grids):
        names = _name_grid(lattice, grid)
        if names is None:
            continue
        piece.grids.add(number)
        fresh = ~lattice.known[names[:, 0], names[:, 1]]
        lattice.put(names[fresh], grid.pixel[fresh])
        piece.how[names[fresh, 0], names[fresh, 1]] = How.GRID


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


def _agrees(pyramid: Pyramid, target: Target, all_families: list[Family], piece: _Piece) -> bool:
    """Whether the markers that can be read through the piece's corners are the board's own."""
    board = target.boards[piece.board]
    corner = cell_corners(board, board.marker_cells()[:, 1:])
    whole = np.asarray(piece.lattice.inside(corner).all(axis=1))
    whole[whole] = ~np.isnan(piece.lattice.at(corner[whole].reshape(-1, 2))[:, 0]).reshape(
        -1, 4
    ).any(axis=1)
    if not whole.any():
        return False
    corner = corner[whole]
    ratio = marker_ratio(target, piece.board)
    side_px = ratio * shortest_side(piece.lattice.at(corner.reshape(-1, 2)).reshape(-1, 4, 2))
    own, other = np.zeros(len(corner), bool), np.zeros(len(corner), bool)
    for family in all_families:
        row = np.nonzero(family.board == piece.board)[0]
        if not len(row):
            continue
        points = piece.lattice.inside_squares(corner, module_places(family, ratio))
        modules = read_modules(pyramid, points, side_px, family)
        wrong = wrong_modules(modules.white, family)[:, 0]
        wrong = wrong[np.arange(len(wrong)), row[whole]]
        own |= modules.clear & (wrong <= family.corrected)
        other |= modules.clear & (wrong > max(family.corrected, _BLURRED * family.size**2))
    least = 2 if piece.markers == 1 else 1
    # Those that place the piece were read in the same squares, or beyond the known corners.
    agreeing = max(int(own.sum()), piece.markers)
    if own.sum() >= least and agreeing >= _OWN_FOR_ANOTHER * (other & ~own).sum():
        return True
    # Modules of a pixel or two are misread one by one where all together leave no doubt.
    return any(
        surely_alike(pyramid, target, family, piece.board, piece.lattice)
        for family in all_families
        if (family.board == piece.board).any()
    )


def _settle(pieces: list[_Piece]) -> tuple[list[_Piece], set[int]]:
    """Merge pieces that continue each other; leave out boards that are in two places."""
    kept: list[_Piece] = []
    contradictory: set[int] = set()
    for piece in pieces:
        rivals = [other for other in kept if _share_pixels(piece, other)]
        same = [other for other in kept if other.board == piece.board]
        if any(other.board != piece.board for other in rivals):
            continue  # what more markers name otherwise
        if not same:
            kept.append(piece)
        elif all(_continue_each_other(piece, other) for other in same):
            _merge(same[0], piece)
        else:
            contradictory.add(piece.board)
    return [piece for piece in kept if piece.board not in contradictory], contradictory


def _share_pixels(one: _Piece, other: _Piece) -> bool:
    """Whether a good part of the smaller piece is where the other piece has corners."""
    few, many = sorted((one.lattice, other.lattice), key=lambda lattice: int(lattice.known.sum()))
    cells = few.cells()
    near = nearest(few.at(cells), many.pixel[many.known], 1)[0][:, 0]
    limit = _SAME_CORNER * few.closest * few.fit(cells).side
    return bool((near < limit).mean() > 0.1)


def _continue_each_other(one: _Piece, other: _Piece) -> bool:
    """Whether two pieces of a board can be parts of one board in one place."""
    both = np.argwhere(one.lattice.known & other.lattice.known)
    if len(both):
        apart = np.hypot(*(one.lattice.at(both) - other.lattice.at(both)).T)
        limit = _SAME_CORNER * one.lattice.closest * one.lattice.fit(both).side
        return bool((apart < limit).all()) and not _names_differ(one, other)
    if _share_pixels(one, other):
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


def _names_differ(one: _Piece, other: _Piece) -> bool:
    """Whether a corner of one piece is where the other has a corner of another name."""
    cells, names = one.lattice.cells(), other.lattice.cells()
    distance, index = nearest(one.lattice.at(cells), other.lattice.at(names), 1)
    limit = _SAME_CORNER * one.lattice.closest * one.lattice.fit(cells).side
    near = distance[:, 0] < limit
    return bool((names[index[near, 0]] != cells[near]).any())


def _merge(into: _Piece, piece: _Piece) -> None:
    cells = np.argwhere(piece.lattice.known & ~into.lattice.known)
    into.lattice.put(cells, piece.lattice.at(cells))
    into.how[cells[:, 0], cells[:, 1]] = piece.how[cells[:, 0], cells[:, 1]]
    into.markers += piece.markers
    into.grids |= piece.grids


def _marked(pieces: list[_Piece], grids: int, contradictory: tuple[int, ...]) -> MarkedCorners:
    pieces = sorted(pieces, key=lambda piece: piece.board)
    grid_board = np.full(grids, -1, np.intp)
    for piece in pieces:
        grid_board[list(piece.grids)] = piece.board
    parts = [(piece, piece.lattice.cells()) for piece in pieces]
    cells = np.concatenate([np.zeros((0, 2), np.intp), *(cells for _, cells in parts)])
    return MarkedCorners(
        board=np.repeat(
            np.array([piece.board for piece, _ in parts], np.intp),
            [len(cells) for _, cells in parts],
        ),
        column=cells[:, 0],
        row=cells[:, 1],
        pixel=np.concatenate(
            [np.zeros((0, 2)), *(piece.lattice.at(cells) for piece, cells in parts)]
        ),
        how=np.concatenate(
            [np.zeros(0, np.intp), *(piece.how[cells[:, 0], cells[:, 1]] for piece, cells in parts)]
        ),
        grid_board=grid_board,
        contradictory=contradictory,
    )
