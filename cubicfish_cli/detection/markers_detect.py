"""Markers that OpenCV finds on its own: which board, which place, where its corners are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.grids import FloatArray, IntArray
from cubicfish_cli.target import Board, Target

# Width of the black frame in modules: Kalibr prints tags with 2, most others with 1.
CHARUCO_BORDERS = (1,)
APRILGRID_BORDERS = (2, 1)
# A marker whose modules are smaller than this cannot be read at that size.
_SMALLEST_MODULE_PX = 1.6
# Where modules are smaller than this, markers that are smaller still are missed.
_SMALL_MODULE_PX = 2.0
# Photos smaller than this are not halved, larger ones not doubled.
_LEAST_PX, _MOST_DOUBLED_PX = 200, 5_000_000
# Sides in strong distortion are curved: how far a contour may leave its quadrangle, as a share
# of its length.
_BENT_SIDES = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenMarkers:
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
        rows = self.board == board
        return SeenMarkers(board=self.board[rows], cell=self.cell[rows], pixel=self.pixel[rows])


def join(parts: list[SeenMarkers]) -> SeenMarkers:
    """Several sets of markers as one."""
    return SeenMarkers(
        board=np.concatenate([np.zeros(0, np.intp), *(part.board for part in parts)]),
        cell=np.concatenate([np.zeros((0, 2), np.intp), *(part.cell for part in parts)]),
        pixel=np.concatenate([np.zeros((0, 4, 2)), *(part.pixel for part in parts)]),
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
    keys: dict[tuple[str, int, str], list[int]] = {}
    for index, board in enumerate(target.boards):
        if board.markers is not None:
            for border in borders(board):
                keys.setdefault((board.markers.dictionary, border, board.kind), []).append(index)
    return [
        _family(target, indices, name, border, tags=kind == "aprilgrid")
        for (name, border, kind), indices in keys.items()
    ]


def borders(board: Board) -> tuple[int, ...]:
    """Widths of the frame to look for on a board, modules."""
    return APRILGRID_BORDERS if board.kind == "aprilgrid" else CHARUCO_BORDERS


def _family(target: Target, indices: list[int], name: str, border: int, *, tags: bool) -> Family:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    size = dictionary.markerSize
    ids = np.concatenate([target.boards[index].marker_cells() for index in indices])
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
        board=np.repeat(indices, [len(target.boards[i].marker_cells()) for i in indices]),
        cell=ids[:, 1:],
    )


def detect_markers(image: npt.NDArray[np.uint8], all_families: list[Family]) -> SeenMarkers:
    """Find markers with ``cv2.aruco`` in an 8-bit grey photo, at the sizes that promise some."""
    return join([part for family in all_families for part in _sizes(image, family)])


def _sizes(image: npt.NDArray[np.uint8], family: Family) -> Iterator[SeenMarkers]:
    found = _detect(image, family)
    yield found
    if family.joined and min(image.shape) >= _LEAST_PX:
        # Where tags touch the squares between them, each size of the photo parts others.
        half = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        yield _resized(_detect(np.asarray(half, np.uint8), family), 0.5)
    if image.size <= _MOST_DOUBLED_PX and (family.joined or _small(found, family)):
        double = cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
        yield _resized(_detect(np.asarray(double, np.uint8), family), 2.0)


def _small(found: SeenMarkers, family: Family) -> bool:
    """Whether there may be markers that are too small to be read: some nearly are, or none is."""
    if not len(found):
        return True
    sides = np.linalg.norm(found.pixel - np.roll(found.pixel, -1, axis=1), axis=2).mean(axis=1)
    modules = family.size + 2 * family.border
    return bool(np.percentile(sides, 10) < _SMALL_MODULE_PX * modules)


def _resized(found: SeenMarkers, scale: float) -> SeenMarkers:
    pixel = (found.pixel + 0.5) / scale - 0.5
    return SeenMarkers(board=found.board, cell=found.cell, pixel=pixel)


def _detect(image: npt.NDArray[np.uint8], family: Family) -> SeenMarkers:
    # Only the target's own markers are in the dictionary: faster, and no foreign names.
    lists = [
        cv2.aruco.Dictionary.getByteListFromBits(code.astype(np.uint8)) for code in family.codes
    ]
    dictionary = cv2.aruco.Dictionary(np.concatenate(lists), family.size, family.corrected)
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = family.border
    modules = family.size + 2 * family.border
    parameters.minMarkerPerimeterRate = 4 * _SMALLEST_MODULE_PX * modules / max(image.shape)
    parameters.polygonalApproxAccuracyRate = _BENT_SIDES
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
    if ids is None or not len(ids):
        return join([])
    index = np.asarray(ids, np.intp).ravel()
    return SeenMarkers(
        board=family.board[index],
        cell=family.cell[index],
        pixel=np.asarray(corners, float).reshape(-1, 4, 2),
    )
