"""Markers that are read in a photo: dark quadrangles that hold the code of one of a target's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt
from scipy.sparse.csgraph import connected_components

from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.boards.markers import MARKER_DICTIONARIES, TAG_FAMILIES, alike
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.corners.detection.grids import Rows
from cubicfish_cli.corners.detection.pyramid import Pyramid, build_pyramid

# Modules smaller than this run into each other.
_SMALLEST_MODULE_PX = 1.5
# Photos smaller than this are not halved, larger ones not doubled; the smallest have no room.
_LEAST_PX, _MOST_DOUBLED_PX, _SMALLEST_PHOTO_PX = 200, 5_000_000, 8
# Sides in strong distortion are curved: how far a contour may leave its quadrangle, as a share
# of its length.
_BENT_SIDES = 0.05
# Share of the frame's modules that must be black, and how far black and white are apart.
_FRAME = 0.85
_LEAST_CONTRAST = 8.0  # times the noise
_MOST_WRONG = 2
# Markers vouch for each other up to this many cells apart, when each is where the shape of both
# puts it, to this share of a cell: distortion takes a tenth or two, a wrong cell is 1 away.
_VOUCH_CELLS = 2
_VOUCH_MISS = 0.4
# A marker's side that is off by this share puts its outermost modules half a module off. Fewer
# pairs of markers do not say how wide they are; theirs must lie this straight, as a share.
_SIDE_OFF, _FEWEST_PAIRS, _STRAIGHT = 0.1, 4, 0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenMarkers(Rows):
    """Markers of the target in one photo, one row a marker.

    Attributes:
        board: (N,) index into the target's boards.
        cell: (N, 2) column and row of its cell, as in ``Board.marker_cells``.
        pixel: (N, 4, 2) corners of its outline: top left, top right, bottom right and bottom
            left on the upright board.

    """

    board: IntArray
    cell: IntArray
    pixel: FloatArray

    def __len__(self) -> int:
        """Return the number of markers."""
        return len(self.board)

    def of(self, board: int) -> SeenMarkers:
        """Those of one board."""
        return self.select(self.board == board)


NO_MARKERS = SeenMarkers(
    board=np.zeros(0, np.intp), cell=np.zeros((0, 2), np.intp), pixel=np.zeros((0, 4, 2))
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Family:
    """The markers of all boards that share a dictionary and a frame's width.

    Attributes:
        border: width of the black frame, modules.
        size: modules along a side without the frame.
        joined: whether other ink touches the markers' corners, as on an AprilGrid.
        codes: (M, size, size) True where a module is white, upright on the board.
        corrected: wrong modules that the dictionary's distances allow to correct.
        board: (M,) index into the target's boards.
        cell: (M, 2) cell on that board.

    """

    border: int
    size: int
    joined: bool
    codes: npt.NDArray[np.bool_]
    corrected: int
    board: IntArray
    cell: IntArray


def families(target: Target) -> list[Family]:
    """All families of markers that may be seen; empty for a target without markers.

    A tag's frame is not in the target file: grids of tags are looked for with both widths.
    """
    keys: dict[tuple[str, int, bool], list[int]] = {}
    for index, board in enumerate(target.boards):
        if board.markers is not None:
            for border in board.marker_borders:
                key = board.markers.dictionary, border, board.per_cell == 2
                keys.setdefault(key, []).append(index)
    found = []
    for (name, border, tags), indices in keys.items():
        cells = [target.boards[index].marker_cells() for index in indices]
        of = np.repeat(indices, [len(own) for own in cells])
        found.append(_family_of(name, border, np.concatenate(cells), of, tags=tags))
    return found


def every_family() -> tuple[list[str], list[Family]]:
    """The names of dictionaries, and all their markers.

    The board is an index into the names, a marker's cell is (its id, 0). Of dictionaries that begin
    alike there is the largest. None of so many is to be read with an error.
    """
    names = [name for name in MARKER_DICTIONARIES if alike(name)[-1] == name]
    found = []
    for index, name in enumerate(names):
        ids = np.arange(MARKER_DICTIONARIES[name])
        cells = np.stack([ids, ids, np.zeros_like(ids)], axis=-1)
        for border in (1, 2) if name in TAG_FAMILIES.values() else (1,):
            of = _family_of(name, border, cells, np.full(len(ids), index), tags=False)
            found.append(replace(of, corrected=0))
    return names, found


def _family_of(name: str, border: int, ids: IntArray, board: IntArray, *, tags: bool) -> Family:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    size = dictionary.markerSize
    codes = np.array(
        [
            cv2.aruco.generateImageMarker(dictionary, int(one), size + 2)[1:-1, 1:-1] > 0
            for one in ids[:, 0]
        ]
    )
    return Family(
        border=border,
        size=size,
        joined=tags,
        # OpenCV keeps AprilTag's families upside down; Kalibr prints them as AprilTag does.
        codes=codes[:, ::-1, ::-1] if tags else codes,
        corrected=int(dictionary.maxCorrectionBits),
        board=board,
        cell=ids[:, 1:],
    )


def read_alone(pyramid: Pyramid, all_families: list[Family]) -> SeenMarkers:
    """Markers that are read by their own outlines; none in a photo too small for any."""
    if not all_families or min(pyramid.size) < _SMALLEST_PHOTO_PX:
        return NO_MARKERS
    grey = np.clip(np.rint(pyramid.levels[0]), 0, 255).astype(np.uint8)
    return read_outlines(pyramid, all_families, find_outlines(grey, all_families))


def find_outlines(grey: npt.NDArray[np.uint8], all_families: list[Family]) -> FloatArray:
    """Dark quadrangles (N, 4, 2) in an 8-bit grey photo that may be markers, clockwise.

    These are the candidates of ``cv2.aruco``. It is not asked to read them: that takes it
    seconds when a target has hundreds of markers, and the rim needs a reader of its own anyway.
    """
    modules = min(family.size + 2 * family.border for family in all_families)
    parts = [_candidates(grey, modules)]
    joined = any(family.joined for family in all_families)
    if joined and min(grey.shape) >= _LEAST_PX:
        # Where tags touch the squares between them, each size of the photo parts others.
        half = cv2.resize(grey, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        parts.append((_candidates(np.asarray(half, np.uint8), modules) + 0.5) / 0.5 - 0.5)
    if grey.size <= _MOST_DOUBLED_PX:
        double = cv2.resize(grey, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
        parts.append((_candidates(np.asarray(double, np.uint8), modules) + 0.5) / 2 - 0.5)
    return np.concatenate(parts)


def _candidates(grey: npt.NDArray[np.uint8], modules: int) -> FloatArray:
    # A dictionary of one marker that is nobody's.
    code = cv2.aruco.Dictionary.getByteListFromBits(np.eye(4, dtype=np.uint8))
    parameters = cv2.aruco.DetectorParameters()
    parameters.minMarkerPerimeterRate = 4 * _SMALLEST_MODULE_PX * modules / max(grey.shape)
    parameters.polygonalApproxAccuracyRate = _BENT_SIDES
    detector = cv2.aruco.ArucoDetector(cv2.aruco.Dictionary(code, 4, 0), parameters)
    read, _, unread = detector.detectMarkers(grey)
    return np.array([*read, *unread], float).reshape(-1, 4, 2)


def straightened(pyramid: Pyramid, outline: FloatArray) -> FloatArray:
    """Outlines (N, 4, 2) whose sides are moved to where it gets brightest outwards.

    Corners of a contour are off by some pixels, most where small squares touch a tag; the middle
    parts of the sides are not.
    """
    if not len(outline):
        return outline
    along = np.linspace(0.25, 0.75, 7)
    following = np.roll(outline, -1, axis=1)
    side = following - outline
    length = np.maximum(np.linalg.norm(side, axis=2), 1e-6)
    outward = np.stack([side[..., 1], -side[..., 0]], axis=-1) / length[..., None]
    reach = np.clip(0.12 * length.mean(axis=1), 2.0, 12.0)
    across = np.linspace(-1, 1, 25)
    start = outline[:, :, None] + along[:, None] * side[:, :, None]
    points = start[:, :, :, None] + (
        (reach[:, None, None, None] * across)[..., None] * outward[:, :, None, None]
    )
    level = pyramid.sample(points.reshape(len(outline), -1, 2), np.ones(len(outline)))
    level = level.reshape(points.shape[:-1]).astype(float)
    rise = level[..., 4:] - level[..., :-4]
    best = rise.argmax(axis=-1)
    # The edge's distance at both ends of each side, from a line that most of its points agree on.
    distance = across[best + 2] * reach[:, None, None]
    middle = np.median(distance, axis=2)
    slopes = (distance[..., 4:] - distance[..., :3]) / (along[4:] - along[:3])
    slope = np.median(slopes, axis=2)
    first = outline + (middle - 0.5 * slope)[..., None] * outward
    second = following + (middle + 0.5 * slope)[..., None] * outward
    corner = _crossing(np.roll(first, 1, axis=1), np.roll(second, 1, axis=1), first, second)
    moved = np.linalg.norm(corner - outline, axis=2)
    usable = np.isfinite(corner).all(axis=2) & (moved < 2.5 * reach[:, None])
    return np.where(usable[..., None], corner, outline)


def _crossing(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Where the lines through a, b and through c, d cross: (..., 2) each; NaN for parallels."""
    one, two, way = b - a, d - c, c - a
    area = one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]
    share = (way[..., 0] * two[..., 1] - way[..., 1] * two[..., 0]) / np.where(
        np.abs(area) > 1e-9, area, np.nan
    )
    return np.asarray(a + share[..., None] * one, float)


def read_outlines(pyramid: Pyramid, all_families: list[Family], outline: FloatArray) -> SeenMarkers:
    """Markers among quadrangles (N, 4, 2) that were found without knowing what they are."""
    # Straight sides make most readable; where sides are bent, the contour's corners are better.
    straight = straightened(pyramid, outline)
    found = []
    for family in all_families:
        found.append(_read(pyramid, straight, family))
        rough = _read(pyramid, outline, family)
        found.append(replace(rough, pixel=straightened(pyramid, rough.pixel)))
    return SeenMarkers.joined([NO_MARKERS, *found])


def _read(pyramid: Pyramid, outline: FloatArray, family: Family) -> SeenMarkers:
    if not len(outline):
        return NO_MARKERS
    points = through_square(outline, module_places(family, 1.0))
    white, clear = read_modules(pyramid, points, shortest_side(outline), family)
    wrong = wrong_modules(white, family)
    best = wrong.reshape(len(wrong), -1).argmin(axis=1)
    turn, code = np.divmod(best, len(family.codes))
    good = clear & (wrong.min(axis=(1, 2)) <= min(_MOST_WRONG, family.corrected // 2))
    order = (np.arange(4) + turn[:, None]) % 4
    upright = np.take_along_axis(outline, order[..., None], axis=1)
    return SeenMarkers(
        board=family.board[code[good]], cell=family.cell[code[good]], pixel=upright[good]
    )


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
    level = pyramid.sample(points, side_px).astype(float)
    level = level.reshape(len(points), side, side, -1).mean(axis=-1)
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
    bits = turned.reshape(len(white), 4, -1).astype(np.float32)
    codes = family.codes.reshape(len(family.codes), -1).astype(np.float32)
    same = bits @ codes.T + (1 - bits) @ (1 - codes).T
    return np.rint(codes.shape[1] - same).astype(np.intp)


def places_told(markers: SeenMarkers, target: Target, board: int) -> IntArray:
    """Which markers of a board agree about where it is: (N,) the same number for those."""
    pitch = 1 + target.boards[board].spacing if target.boards[board].kind == "aprilgrid" else 1.0
    square = squares(markers.pixel, marker_ratio(target.boards[board]))
    middle, step = middles_and_axes(square)
    apart = markers.cell[None] - markers.cell[:, None]
    step = 0.5 * pitch * (step[None] + step[:, None])
    expected = (step @ apart[..., None])[..., 0]
    miss = np.linalg.norm(middle[None] - middle[:, None] - expected, axis=-1)
    length = np.linalg.norm(step, axis=-2).min(axis=-1)
    agree = (np.abs(apart).max(axis=-1) <= _VOUCH_CELLS) & (miss < _VOUCH_MISS * length)
    return connected_components(agree, directed=False)[1].astype(np.intp)


def middles_and_axes(outline: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middles (N, 2) of quadrangles (N, 4, 2), and (N, 2, 2): columns to the right, and down."""
    a, b, c, d = outline.transpose(1, 0, 2)
    return outline.mean(axis=1), 0.5 * np.stack([b + c - a - d, c + d - a - b], axis=-1)


def marker_ratio(board: Board) -> float:
    """Side of a board's markers in squares (tags: 1)."""
    if board.markers is None or board.per_cell == 2:
        return 1.0
    return board.markers.side / board.square


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


def with_sides_seen(target: Target, markers: SeenMarkers) -> Target:
    """The target with its markers as wide as they are seen.

    A marker that lies two cells from another of its board, or nearer, is as far away as both say
    in their own sides. Corners do not depend on how wide markers are: a wrong size in the target's
    file hides them only because markers are looked for in the wrong parts of squares.
    """
    changed = {}
    for index in np.unique(markers.board).tolist():
        board, own = target.boards[index], markers.of(index)
        if board.markers is None or board.per_cell == 2:
            continue
        apart = own.cell[None] - own.cell[:, None]
        one, other = np.nonzero((apart != 0).any(-1) & (np.abs(apart).max(-1) <= _VOUCH_CELLS))
        middle, step = middles_and_axes(own.pixel)
        seen = middle[other] - middle[one]
        expected = (0.5 * (step[one] + step[other]) @ apart[one, other][..., None])[..., 0]
        times = (seen * expected).sum(axis=1) / np.square(expected).sum(axis=1)
        off = np.linalg.norm(seen - times[:, None] * expected, axis=1)
        straight = (times > 1) & (off < _STRAIGHT * np.linalg.norm(seen, axis=1))
        side = board.square / np.median(times[straight]) if straight.any() else 0.0
        enough = straight.sum() >= 2 * _FEWEST_PAIRS
        if enough and abs(np.log(side / board.markers.side)) > _SIDE_OFF:
            changed[index] = replace(board, markers=replace(board.markers, side=side))
    return target.with_boards(changed)


def agreeing_markers(
    image: npt.NDArray[np.generic],
    drawings: Sequence[Target],
    index: int,
) -> IntArray:
    """Count the markers that agree on where a board is, for each of several drawings of it.

    Args:
        image: (H, W) grey photo.
        drawings: the target with that board drawn otherwise, not in a mirror and not inverted;
            the first has all markers that are looked for.
        index: the board.

    Returns:
        (N,) for each drawing.

    """
    widest = drawings[0]
    seen = read_alone(build_pyramid(image), families(widest)).of(index)
    ids = _ids_by_cell(widest.boards[index])[tuple(seen.cell.T)]
    counts = []
    for one in drawings:
        table = one.boards[index].marker_cells()
        row = ids - table[0, 0]
        known = row < len(table)
        own = replace(seen.select(known), cell=table[row[known], 1:])
        label = places_told(own, one, index) if len(own) else np.zeros(0, np.intp)
        agreeing = [len(np.unique(own.cell[label == place], axis=0)) for place in np.unique(label)]
        counts.append(max(agreeing, default=0))
    return np.array(counts, np.intp)


def markers_of_any_kind(image: npt.NDArray[np.generic]) -> dict[str, IntArray]:
    """Ids of all markers (N,) that are clearly read in a grey photo (H, W), by dictionary."""
    names, all_families = every_family()
    seen = read_alone(build_pyramid(image), all_families)
    return {name: np.unique(seen.of(index).cell[:, 0]) for index, name in enumerate(names)}


def tags_apart(image: npt.NDArray[np.generic], target: Target, index: int) -> FloatArray:
    """How far apart tags are that follow each other in a row of a board.

    Args:
        image: (H, W) grey photo.
        target: the calibration target, not in a mirror.
        index: the board.

    Returns:
        (N,) distances of their middles, in their sides.

    """
    seen = read_alone(build_pyramid(image), families(target)).of(index)
    cell, first = np.unique(seen.cell, axis=0, return_index=True)
    middle, step = middles_and_axes(seen.pixel[first])
    row, following = np.nonzero((cell[None] - cell[:, None] == (1, 0)).all(axis=-1))
    side = np.linalg.norm(step[..., 0], axis=1)
    distance = np.linalg.norm(middle[following] - middle[row], axis=1)
    return np.asarray(distance / (0.5 * (side[row] + side[following])), float)


def _ids_by_cell(board: Board) -> IntArray:
    """(cell columns, cell rows) ids of the markers; -1 in cells without one."""
    ids, column, row = board.marker_cells().T
    table = np.full((column.max() + 1, row.max() + 1), -1, np.intp)
    table[column, row] = ids
    return table
