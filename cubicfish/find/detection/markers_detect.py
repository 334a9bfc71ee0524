"""What markers a target has, and quadrangles in a photo that may be markers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.grids import Float32Array, Rows
from cubicfish.find.detection.medians import medians
from cubicfish.find.detection.pyramid import (
    CLOSE,
    Pyramid,
    build_pyramid,
    enlarged,
    reduced,
)
from cubicfish.target.boards.markers import MARKER_DICTIONARIES, TAG_FAMILIES, alike
from cubicfish.target.target import Target
from cubicfish.types import FloatArray, IntArray

# Width of the black frame in modules: Kalibr prints tags with 2, most others with 1.
# A marker whose modules are smaller than this cannot be read at that size.
_SMALLEST_MODULE_PX = 1.6
# Photos smaller than this are not halved, larger ones not doubled.
_LEAST_PX, _MOST_DOUBLED_PX = 200, 5_000_000
# Outlines are looked for in a photo of at most so many pixels first. Markers whose modules are
# 1.6 px are read in it: those of a board of 20 x 20 squares that fills a quarter of it.
_COARSE_PX = 2_000_000
_SMALLEST_PHOTO_PX = 8
# Sides in strong distortion are curved: how far a contour may leave its quadrangle, as a share
# of its length.
_BENT_SIDES = 0.05


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


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """A photo in which the markers of a target are looked for.

    Attributes:
        pyramid: the photo.
        target: the calibration target.
        families: its markers.

    """

    pyramid: Pyramid
    target: Target
    families: list[Family]

    @classmethod
    def of(cls, image: npt.NDArray[np.generic], target: Target) -> Sight:
        """A grey photo (H, W), and all families of the target's markers."""
        return cls(pyramid=build_pyramid(image), target=target, families=families(target))


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
        found.append(_make_family(name, border, np.concatenate(cells), of, tags=tags))
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
            of = _make_family(name, border, cells, np.full(len(ids), index), tags=False)
            found.append(replace(of, corrected=0))
    return names, found


def _make_family(name: str, border: int, ids: IntArray, board: IntArray, *, tags: bool) -> Family:
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


def reading_zooms(size: tuple[int, int], all_families: list[Family]) -> list[float]:
    """How much a photo of (width, height) is reduced to look for outlines, in order.

    It is halved until it is small, at first; then it is larger each time, and doubled at last
    unless it is large. What one shows is not looked for in the next.
    """
    pixels = size[0] * size[1]
    zooms = [1.0]
    while pixels > _COARSE_PX * zooms[0] ** 2:
        zooms.insert(0, 2 * zooms[0])
    joined = any(family.joined for family in all_families)
    if joined and min(size) >= _LEAST_PX * zooms[0]:
        # Where tags touch the squares between them, each size of the photo parts others.
        zooms.insert(1, 2 * zooms[0])
    return zooms if pixels > _MOST_DOUBLED_PX else [*zooms, CLOSE]


def find_outlines(photo: Float32Array, all_families: list[Family], zoom: float = 1.0) -> FloatArray:
    """Dark quadrangles (N, 4, 2) in a photo of grey levels to 255 that may be markers, clockwise.

    These are the candidates of ``cv2.aruco``. It is not asked to read them: that takes it
    seconds when a target has hundreds of markers, and the rim needs a reader of its own anyway.
    ``zoom`` says how many times the photo is reduced for it; pixels are those of the photo.
    """
    if min(photo.shape) < _SMALLEST_PHOTO_PX * zoom:
        return np.zeros((0, 4, 2))
    modules = min(family.size + 2 * family.border for family in all_families)
    # Rounded, and held to 255 at most.
    small = cv2.convertScaleAbs(np.maximum(reduced(photo, zoom), np.float32(0)))
    # A dictionary of one marker that is nobody's.
    code = cv2.aruco.Dictionary.getByteListFromBits(np.eye(4, dtype=np.uint8))
    parameters = cv2.aruco.DetectorParameters()
    parameters.minMarkerPerimeterRate = 4 * _SMALLEST_MODULE_PX * modules / max(small.shape)
    parameters.polygonalApproxAccuracyRate = _BENT_SIDES
    detector = cv2.aruco.ArucoDetector(cv2.aruco.Dictionary(code, 4, 0), parameters)
    read, _, unread = detector.detectMarkers(small)
    return enlarged(np.array([*read, *unread], float).reshape(-1, 4, 2), zoom)


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
    search_px = np.clip(0.12 * length.mean(axis=1), 2.0, 12.0)
    across = np.linspace(-1, 1, 25)
    start = outline[:, :, None] + along[:, None] * side[:, :, None]
    points = start[:, :, :, None] + (
        (search_px[:, None, None, None] * across)[..., None] * outward[:, :, None, None]
    )
    level = pyramid.sample(points.reshape(len(outline), -1, 2), np.ones(len(outline)))
    level = level.reshape(points.shape[:-1]).astype(float)
    rise = level[..., 4:] - level[..., :-4]
    best = rise.argmax(axis=-1)
    # The edge's distance at both ends of each side, from a line that most of its points agree on.
    distance = across[best + 2] * search_px[:, None, None]
    middle = medians(distance, axis=2)
    slopes = (distance[..., 4:] - distance[..., :3]) / (along[4:] - along[:3])
    slope = medians(slopes, axis=2)
    first = outline + (middle - 0.5 * slope)[..., None] * outward
    second = following + (middle + 0.5 * slope)[..., None] * outward
    corner = _find_crossing(np.roll(first, 1, axis=1), np.roll(second, 1, axis=1), first, second)
    moved = np.linalg.norm(corner - outline, axis=2)
    usable = np.isfinite(corner).all(axis=2) & (moved < 2.5 * search_px[:, None])
    return np.where(usable[..., None], corner, outline)


def _find_crossing(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Where the lines through a, b and through c, d cross: (..., 2) each; NaN for parallels."""
    one, two, way = b - a, d - c, c - a
    area = one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]
    share = (way[..., 0] * two[..., 1] - way[..., 1] * two[..., 0]) / np.where(
        np.abs(area) > 1e-9, area, np.nan
    )
    return np.asarray(a + share[..., None] * one, float)
