"""The print of a ChArUco board: a checkerboard with a marker in each light square."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.rendering.checkerboard import checkerboard_is_dark, checkerboard_steps
from cubicfish_cli.target import Board, Markers

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_BORDER_MODULES = 1


def marker_ink(markers: Markers, ids: npt.NDArray[np.intp], border: int) -> BoolArray:
    """Which modules of markers are black: ids (N,) -> (N, S, S), as ``cv2.aruco`` prints them.

    ``border`` is the width of the black frame in modules; it is part of S.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, markers.dictionary))
    side = dictionary.markerSize + 2 * border
    return np.array(
        [
            cv2.aruco.generateImageMarker(dictionary, int(one), side, borderBits=border) == 0
            for one in ids
        ]
    ).reshape(-1, side, side)


def charuco_steps(board: Board) -> tuple[FloatArray, FloatArray]:
    """Where ink may begin or end along x (N,) and along y (M,): squares and markers' modules."""
    markers = board.markers
    if markers is None:
        raise ValueError(f"board {board.name!r} has no markers")
    size = marker_ink(markers, np.empty(0, np.intp), _BORDER_MODULES).shape[-1]
    modules = board.square / 2 + markers.side * (np.arange(size + 1) / size - 0.5)
    x, y = (
        np.unique(np.concatenate([squares, (squares[:-1, None] + modules).ravel()]))
        for squares in checkerboard_steps(board)
    )
    return x, y


def charuco_is_dark(board: Board) -> Callable[[FloatArray], BoolArray]:
    """Plane positions (..., 2) in the target's units -> (...) whether there is ink.

    The layout is ``cv2.aruco.CharucoBoard``'s since OpenCV 4.6: markers stand upright in the
    middle of the light squares, ids row by row; with ``first_square: light`` the first marker
    is in the corner square, as in the legacy layout of boards with an even number of rows. On an
    inverted board light and dark are exchanged.
    """
    markers = board.markers
    if markers is None:
        raise ValueError(f"board {board.name!r} has no markers")
    ids, column, row = board.marker_cells().T
    ink = marker_ink(markers, ids, _BORDER_MODULES)
    size = ink.shape[-1]
    # A table over all squares; those without a marker stay white here.
    table = np.zeros((board.rows + 1, board.columns + 1, size, size), bool)
    table[row, column] = ink

    def is_dark(plane: FloatArray) -> BoolArray:
        in_squares = plane / board.square
        square = np.floor(in_squares)
        module = ((in_squares - square - 0.5) * (board.square / markers.side) + 0.5) * size
        module = np.floor(module).astype(np.int32)
        cell = square.astype(np.int32) + 1
        inside = ((module >= 0) & (module < size) & (cell >= 0)).all(axis=-1)
        inside &= (cell[..., 0] <= board.columns) & (cell[..., 1] <= board.rows)
        x, y = np.where(inside[..., None], cell, 0).astype(np.intp).reshape(-1, 2).T
        u, v = np.where(inside[..., None], module, 0).astype(np.intp).reshape(-1, 2).T
        printed: BoolArray = inside & table[y, x, v, u].reshape(inside.shape)
        squares = checkerboard_is_dark(board, plane)
        return squares & ~printed if markers.inverted else squares | printed

    return is_dark
