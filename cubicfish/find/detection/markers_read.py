"""Markers that can be read in a photo, and which of them agree about where their board is.

Through corners that are known no outline has to be found first.

Where blur leaves none that can be read alone, all of a grid are read together: each of a board's
few dozen markers still looks more like itself than like others. A grid's place on a board says
which marker lies in which of its squares: the right place shows in all of them at once, and a board
of other markers in none.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from cubicfish.find.detection.grids import Float32Array, FoundGrids, Grid
from cubicfish.find.detection.markers_detect import (
    NO_MARKERS,
    Family,
    SeenMarkers,
    Sight,
    find_outlines,
    reading_zooms,
    straightened,
)
from cubicfish.find.detection.markers_lattice import BoardLattice
from cubicfish.find.detection.markers_missing import Part
from cubicfish.find.detection.nearby import connected
from cubicfish.find.detection.pyramid import Pyramid
from cubicfish.target.boards.board import Board
from cubicfish.types import BoolArray, FloatArray, IntArray

# Modules smaller than this run into each other.
_SMALLEST_MODULE_PX = 1.5
# Share of the frame's modules that must be black, and how far black and white are apart.
_FRAME = 0.85
_LEAST_CONTRAST = 8.0  # times the noise
_MOST_WRONG = 2
# Standard deviations above what the same markers' likeness to all others of the dictionary would
# give, for the best place, and between it and the next; nothing near comes about by chance.
_CERTAIN, _APART = 5.0, 2.5
# Share of the markers that look more like themselves than others do on the whole: nearly all, so
# that no board with a part of the same markers, or another order of them, is taken for this one.
_SHARE = 0.8
# Fewer markers are too few to tell, and more places than that are not looked through.
_FEWEST, _MOST_PLACES = 4, 150
_QUARTER = np.array([(0, 1), (-1, 0)])
# Markers vouch for each other up to this many cells apart, when each is where the shape of both
# puts it, to this share of a cell: distortion takes a tenth or two, a wrong cell is 1 away.
VOUCH_CELLS = 2
_VOUCH_MISS = 0.4


def outlines(square: FloatArray, ratio: float) -> FloatArray:
    """Outlines (N, 4, 2) of markers of ``ratio`` squares in the middle of squares (N, 4, 2)."""
    low, high = 0.5 * (1 - ratio), 0.5 * (1 + ratio)
    return through_square(square, np.array([(low, low), (high, low), (high, high), (low, high)]))


def squares(outline: FloatArray, ratio: float) -> FloatArray:
    """Squares (N, 4, 2) around outlines (N, 4, 2) of markers that are ``ratio`` squares wide."""
    low, high = 0.5 - 0.5 / ratio, 0.5 + 0.5 / ratio
    return through_square(outline, np.array([(low, low), (high, low), (high, high), (low, high)]))


def shortest_side(square: FloatArray) -> FloatArray:
    """Length (N,) of the shortest side of (N, 4, 2) quadrangles."""
    return np.linalg.norm(square - np.roll(square, -1, axis=1), axis=2).min(axis=1)


def through_square(corner: FloatArray, place: FloatArray) -> FloatArray:
    """Pixels (N, K, 2) of places (K, 2) in unit squares that are seen as (N, 4, 2) corners.

    By each square's own homography (Heckbert, 1989, the square-to-quadrilateral case); corners
    are at (0, 0), (1, 0), (1, 1) and (0, 1).
    """
    a, b, c, d = corner.transpose(1, 0, 2)
    one, two, rest = b - c, d - c, a - b + c - d
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    area = np.where(np.abs(area) > 1e-9, area, 1e-9)
    g = (rest[:, 0] * two[:, 1] - rest[:, 1] * two[:, 0]) / area
    h = (one[:, 0] * rest[:, 1] - one[:, 1] * rest[:, 0]) / area
    along_u = b - a + g[:, None] * b
    along_v = d - a + h[:, None] * d
    u, v = place[None, :, 0], place[None, :, 1]
    depth = 1 + g[:, None] * u + h[:, None] * v
    depth = np.where(np.abs(depth) > 1e-6, depth, 1e-6)
    return (a[:, None] + along_u[:, None] * u[..., None] + along_v[:, None] * v[..., None]) / depth[
        ..., None
    ]


def module_places(family: Family, ratio: float) -> FloatArray:
    """Where to look at each module: (K, 2) in a square whose middle holds the marker.

    ``ratio`` is the marker's side in squares. Five points per module, module by module and row
    by row: its middle and half way to its corners.
    """
    side = family.size + 2 * family.border
    middle = (np.arange(side) + 0.5) / side
    place = np.stack(np.meshgrid(middle, middle), axis=-1).reshape(-1, 1, 2)
    spread = np.array([(0, 0), (-1, -1), (1, -1), (1, 1), (-1, 1)]) * (0.22 / side)
    return 0.5 + ratio * ((place + spread).reshape(-1, 2) - 0.5)


def module_levels(
    pyramid: Pyramid, points: FloatArray, side_px: FloatArray, family: Family
) -> FloatArray:
    """Grey levels (N, S, S) of all modules, frame and all; arguments as of :func:`read_modules`."""
    side = family.size + 2 * family.border
    level = pyramid.sample(points, side_px).astype(float)
    return level.reshape(len(points), side, side, -1).mean(axis=-1)


def read_modules(
    pyramid: Pyramid, points: FloatArray, side_px: FloatArray, family: Family
) -> tuple[BoolArray, BoolArray]:
    """Read markers at the (N, K, 2) pixels of their :func:`module_places`.

    ``side_px`` (N,) is how long a marker's shortest side is.

    Returns:
        (N, size, size) which modules are white, and (N,) whether there is a black frame around, and
        the modules are large enough to be read.

    """
    side = family.size + 2 * family.border
    level = module_levels(pyramid, points, side_px, family)
    inner = slice(family.border, side - family.border)
    frame = np.ones((side, side), bool)
    frame[inner, inner] = False
    black = level[:, frame].mean(axis=1)
    white = np.sort(level[:, inner, inner].reshape(len(level), -1), axis=1)[:, -4:].mean(axis=1)
    between = 0.5 * (black + white)
    clear = (level[:, frame] < between[:, None]).mean(axis=1) >= _FRAME
    clear &= white - black > _LEAST_CONTRAST * pyramid.noise
    clear &= side_px > _SMALLEST_MODULE_PX * side
    clear &= pyramid.inside(points.reshape(-1, 2), 1.0).reshape(len(points), -1).all(axis=1)
    return level[:, inner, inner] > between[:, None, None], clear


def wrong_modules(white: BoolArray, family: Family) -> IntArray:
    """Number of modules (N, 4, M) that differ from each code.

    The second axis counts quarter turns: at k the k-th corner of the outline (clockwise) is the
    upright marker's top left.
    """
    turned = np.stack([np.rot90(white, k, axes=(1, 2)) for k in range(4)], axis=1)
    bits = turned.reshape(len(white), 4, family.size**2).astype(np.float32)
    codes = family.codes.reshape(-1, family.size**2).astype(np.float32)
    # White in one of both: those of the code, and more for each white one where it is black.
    return np.rint(codes.sum(axis=1) + bits @ (1 - 2 * codes).T).astype(np.intp)


def read_grid(sight: Sight, grid: Grid) -> SeenMarkers:
    """Markers in the squares of a found grid whose four corners are known."""
    size = grid.cells.max(axis=0) + 2
    pixel = np.full((*size, 2), np.nan)
    pixel[grid.cells[:, 0], grid.cells[:, 1]] = grid.pixel
    square = np.stack([pixel[:-1, :-1], pixel[1:, :-1], pixel[1:, 1:], pixel[:-1, 1:]], axis=2)
    whole = ~np.isnan(square).any(axis=(2, 3))
    bright = np.indices(whole.shape).sum(axis=0) % 2 == (0 if grid.parity > 0 else 1)
    found = []
    for family in sight.families:
        chosen = square[whole & (~bright if family.joined else bright)]
        every = np.array([marker_ratio(sight.target.boards[board]) for board in family.board])
        for ratio in np.unique(every).tolist():
            found.append(_read(sight.pyramid, chosen, family, ratio, every == ratio)[0])
    return SeenMarkers.joined([NO_MARKERS, *found])


def cell_corners(board: Board, cell: IntArray) -> IntArray:
    """Corners (N, 4, 2) around cells (N, 2) of a board: columns and rows, in order around each."""
    first = 2 * cell if board.per_cell == 2 else cell - 1
    return np.asarray(first[:, None] + Board.AROUND_SQUARE)


def quarter_turns(grid: Grid) -> Iterator[tuple[IntArray, IntArray]]:
    """Cells (N, 2) of a grid in its four turns, and (N,) +1 where the quadrant (+, +) is bright."""
    for turn in range(4):
        # Every other one swaps which quadrant lies right and below.
        sign = grid.parity * (-1) ** (grid.cells.sum(axis=1) + turn)
        yield grid.cells @ np.linalg.matrix_power(_QUARTER, turn), sign


def marker_ratio(board: Board) -> float:
    """Side of a board's markers in squares (tags: 1)."""
    if board.markers is None or board.per_cell == 2:
        return 1.0
    return board.markers.side / board.square


def read_outlines(pyramid: Pyramid, all_families: list[Family], outline: FloatArray) -> SeenMarkers:
    """Markers among quadrangles (N, 4, 2) that were found without knowing what they are."""
    # Straight sides make most readable; where sides are bent, the contour's corners are better.
    straight = straightened(pyramid, outline)
    found, unread = [], np.ones(len(outline), bool)
    for family in all_families:
        everything = np.ones(len(family.board), bool)
        seen, rows = _read(pyramid, straight, family, 1.0, everything)
        unread[rows] = False
        found.append(seen)
    for family in all_families:
        everything = np.ones(len(family.board), bool)
        rough, _ = _read(pyramid, outline[unread], family, 1.0, everything)
        found.append(replace(rough, pixel=straightened(pyramid, rough.pixel)))
    return SeenMarkers.joined([NO_MARKERS, *found])


def _read(
    pyramid: Pyramid, square: FloatArray, family: Family, ratio: float, allowed: BoolArray
) -> tuple[SeenMarkers, IntArray]:
    """Read markers in squares (N, 4, 2), and which of these show one."""
    if not len(square):
        return NO_MARKERS, np.zeros(0, np.intp)
    points = through_square(square, module_places(family, ratio))
    white, clear = read_modules(pyramid, points, ratio * shortest_side(square), family)
    rows = np.flatnonzero(clear)
    wrong = wrong_modules(white[rows], family)
    wrong[:, :, ~allowed] = family.size**2
    wrong = wrong.reshape(len(rows), 4 * len(family.codes))
    best = wrong.argmin(axis=1)
    turn, code = np.divmod(best, len(family.codes))
    good = wrong[np.arange(len(rows)), best] <= min(_MOST_WRONG, family.corrected // 2)
    rows, turn, code = rows[good], turn[good], code[good]
    order = (np.arange(4) + turn[:, None]) % 4
    upright = np.take_along_axis(outlines(square[rows], ratio), order[..., None], axis=1)
    return SeenMarkers(board=family.board[code], cell=family.cell[code], pixel=upright), rows


@dataclass(frozen=True, kw_only=True, eq=False)
class NamedGrid:
    """A grid's place.

    Attributes:
        board: index into the target's boards.
        cells: (N, 2) column and row of each of the grid's corners.
        markers: how many were compared.

    """

    board: int
    cells: IntArray
    markers: int


def read_together(sight: Sight, grid: Grid) -> NamedGrid | None:
    """Find where on which board with markers in its bright squares a grid lies.

    None where no place stands out, or the grid shows fewer than four markers.
    """
    found: list[tuple[float, float, NamedGrid]] = []
    for family in sight.families:
        if family.joined:
            continue
        for board in np.unique(family.board).tolist():
            nominal = sight.target.boards[board]
            places = _list_places(BoardLattice(board=nominal), grid)
            if len(places) > _MOST_PLACES:
                continue
            for cells in places:
                lattice = BoardLattice(board=nominal)
                lattice.put(cells, grid.pixel)
                likeness, share, markers = _measure_likeness(sight.pyramid, family, board, lattice)
                one = NamedGrid(board=board, cells=cells, markers=markers)
                found.append((likeness, share, one))
    found.sort(key=lambda one: -one[0])
    if not found or found[0][0] < _CERTAIN or found[0][1] < _SHARE:
        return None
    if len(found) > 1 and found[0][0] - found[1][0] < _APART:
        return None
    return found[0][2]


def _list_places(lattice: BoardLattice, grid: Grid) -> list[IntArray]:
    """All names (N, 2) that a grid's corners may have, by the board's size and colours."""
    places = []
    columns, rows = lattice.known.shape
    for turned, sign in quarter_turns(grid):
        cells = turned - turned.min(axis=0)
        width, height = cells.max(axis=0)
        for column in range(columns - int(width)):
            for row in range(rows - int(height)):
                named = cells + np.array([column, row])
                if (lattice.sign(named[:1]) == sign[:1]).all():
                    places.append(named)
    return places


def surely_alike(pyramid: Pyramid, family: Family, index: int, lattice: BoardLattice) -> bool:
    """Tell whether a board's markers, taken together, are surely those between its corners."""
    likeness, share, _ = _measure_likeness(pyramid, family, index, lattice)
    return likeness >= _CERTAIN and share >= _SHARE


def _measure_likeness(
    pyramid: Pyramid, family: Family, index: int, lattice: BoardLattice
) -> tuple[float, float, int]:
    """How much a board's squares look like the markers that belong there.

    In standard deviations of what other markers would give; then the share of markers that look
    more like themselves than the mean of others, and how many there are.
    """
    own = np.nonzero(family.board == index)[0]
    corner = cell_corners(lattice.board, family.cell[own])
    whole, pixel = lattice.whole_squares(corner)
    corner, own = corner[whole], own[whole]
    if len(own) < _FEWEST:
        return 0.0, 0.0, len(own)
    ratio = marker_ratio(lattice.board)
    points = lattice.inside_squares(corner, module_places(family, ratio))
    level = module_levels(pyramid, points, ratio * shortest_side(pixel), family)
    alike = _correlate(level, family)
    inside = np.asarray(
        pyramid.inside(points.reshape(-1, 2), 1.0).reshape(len(own), -1).all(axis=1)
    )
    alike, own = alike[inside], own[inside]
    if len(own) < _FEWEST:
        return 0.0, 0.0, len(own)
    mean, spread = alike.mean(axis=1), np.maximum(alike.std(axis=1), 1e-6)
    excess = alike[np.arange(len(own)), own] - mean
    return (
        float(excess.sum() / np.sqrt((spread**2).sum())),
        float((excess > 0).mean()),
        len(own),
    )


def _correlate(level: FloatArray, family: Family) -> FloatArray:
    """Correlation (N, 4 M) of N markers' levels with M blurred codes, upright ones first."""
    border = family.border
    inner = slice(border, -border)
    turned = np.concatenate([np.rot90(family.codes, k, axes=(1, 2)) for k in range(4)])
    codes = np.pad(turned.astype(float), ((0, 0), (border, border), (border, border)))
    # Blur takes fine patterns away: what is compared is what it leaves.
    for axis in (1, 2):
        codes = codes + 0.5 * (np.roll(codes, 1, axis=axis) + np.roll(codes, -1, axis=axis))
    return (
        _scale_to_unit_length(level[:, inner, inner])
        @ _scale_to_unit_length(codes[:, inner, inner]).T
    )


def _scale_to_unit_length(patches: FloatArray) -> FloatArray:
    flat = patches.reshape(len(patches), -1)
    flat = flat - flat.mean(axis=1, keepdims=True)
    return np.asarray(flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9))


def middles_and_axes(outline: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middles (N, 2) of quadrangles (N, 4, 2), and (N, 2, 2): columns to the right, and down."""
    a, b, c, d = outline.transpose(1, 0, 2)
    return outline.mean(axis=1), 0.5 * np.stack([b + c - a - d, c + d - a - b], axis=-1)


def all_read(sight: Sight, grids: FoundGrids, alone: SeenMarkers) -> SeenMarkers:
    """Markers that were read alone, by their own outlines, and those in grids' squares."""
    return SeenMarkers.joined([alone, *(read_grid(sight, grid) for grid in grids.grids)])


def read_alone(
    pyramid: Pyramid,
    all_families: list[Family],
    zooms: Iterable[float] | None = None,
    part: Part | None = None,
    photo: Float32Array | None = None,
) -> SeenMarkers:
    """Markers that are read by their own outlines; none in a photo too small for any.

    Args:
        pyramid: the photo.
        all_families: what may be seen.
        zooms: how many times the photo is reduced to look for outlines; by default all of
            :func:`~.markers_detect.reading_zooms`.
        part: where outlines are looked for; by default everywhere.
        photo: what they are looked for in; by default the pyramid's photo.

    """
    if not all_families:
        return NO_MARKERS
    part = part or Part.whole(pyramid.size)
    zooms = reading_zooms(pyramid.size, all_families) if zooms is None else zooms
    seen = part.of(pyramid.levels[0] if photo is None else photo)
    found = [find_outlines(seen, all_families, zoom) for zoom in zooms]
    return read_outlines(pyramid, all_families, part.back(np.concatenate(found)))


def group_agreeing(markers: SeenMarkers, board: Board) -> IntArray:
    """Which markers of a board agree about where it is: (N,) the same number for those."""
    pitch = 1 + board.spacing if board.kind == "aprilgrid" else 1.0
    square = squares(markers.pixel, marker_ratio(board))
    middle, step = middles_and_axes(square)
    apart = markers.cell[None] - markers.cell[:, None]
    step = 0.5 * pitch * (step[None] + step[:, None])
    expected = (step @ apart[..., None])[..., 0]
    miss = np.linalg.norm(middle[None] - middle[:, None] - expected, axis=-1)
    length = np.linalg.norm(step, axis=-2).min(axis=-1)
    agree = (np.abs(apart).max(axis=-1) <= VOUCH_CELLS) & (miss < _VOUCH_MISS * length)
    return connected(agree)
