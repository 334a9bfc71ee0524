"""What is printed on a board: cells of black and white in the board's own plane."""

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.errors import TargetError
from cubicfish.target.boards.board import Board
from cubicfish.target.boards.markers import Markers
from cubicfish.types import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Face:
    """The printed face of a board, in the board's own plane and the target's units.

    Attributes:
        x, y: (C + 1,) and (R + 1,) growing positions between which lie the cells of the print.
        dark: (R, C) whether a cell is black.
        margin: width of the white paper around the print.

    """

    x: FloatArray
    y: FloatArray
    dark: npt.NDArray[np.bool_]
    margin: float

    @property
    def lower(self) -> tuple[float, float]:
        """The paper's corner of the smallest x and y."""
        return float(self.x[0]) - self.margin, float(self.y[0]) - self.margin

    @property
    def upper(self) -> tuple[float, float]:
        """The paper's corner of the largest x and y."""
        return float(self.x[-1]) + self.margin, float(self.y[-1]) + self.margin

    def covers(self, plane: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether plane positions (..., 2) are on the paper -> (...)."""
        return np.asarray(((plane >= self.lower) & (plane <= self.upper)).all(axis=-1))

    def is_dark(self, plane: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether there is ink at plane positions (..., 2) -> (...)."""
        column = np.searchsorted(self.x, plane[..., 0], side="right")
        row = np.searchsorted(self.y, plane[..., 1], side="right")
        return np.pad(self.dark, 1)[row, column]


@lru_cache(maxsize=64)  # boards are seen from many places
def board_face(board: Board, *, margin: float) -> Face:
    """The printed face of a board with a white margin of ``margin`` squares around the print.

    Raises:
        TargetError: the board has no print.

    """
    if board.points is not None:
        raise TargetError(f"board {board.name!r}: a points board cannot be drawn: change its type")
    if board.mirrored:
        face = board_face(board.in_mirror(), margin=margin)
        last = board.plane_points(board.columns - 1, 0)[0]
        return replace(face, x=last - face.x[::-1], dark=face.dark[:, ::-1])
    start, pitch, steps, blocks, last = (
        _lay_out_tags(board) if board.per_cell == 2 else _lay_out_squares(board)
    )
    rows, columns = (count * len(steps) - last for count in blocks.shape[::2])
    x, y = (
        ((np.arange(count // len(steps) + 1) + start)[:, None] * pitch + steps).ravel()[: count + 1]
        for count in (columns, rows)
    )
    dark = blocks.reshape(len(blocks) * len(steps), -1)[:rows, :columns]
    return Face(x=x, y=y, dark=dark, margin=margin * board.square)


_Blocks = tuple[int, float, FloatArray, npt.NDArray[np.bool_], int]
"""Number of the first block of cells, distance between blocks, where (B,) a block's cells begin,
(R, B, C, B) which are black, and how many of the last block are not there."""


def _lay_out_squares(board: Board) -> _Blocks:
    """Blocks that are squares, whose markers have white or black around them."""
    row, column = np.indices((board.rows + 1, board.columns + 1))
    squares = (row + column) % 2 == (board.first_square == "light")
    if board.markers is None:
        return -1, board.square, np.zeros(1), squares[:, None, :, None], 0
    ids, column, row = board.marker_cells().T
    ink = marker_ink(board.markers, ids, board.marker_borders[0])
    modules = np.arange(ink.shape[1] + 1) / ink.shape[1] - 0.5
    steps = np.append(0.0, board.square / 2 + board.markers.side * modules)
    blocks = np.tile(squares[:, None, :, None], (1, len(steps), 1, len(steps)))
    blocks[row, 1:-1, column, 1:-1] = ink ^ board.markers.inverted
    return -1, board.square, steps, blocks, 0


def _lay_out_tags(board: Board) -> _Blocks:
    """Blocks that are a gap and a tag; one more gap follows the last. Gaps cross in black."""
    if board.markers is None:
        raise TargetError(f"board {board.name!r} has no markers: it cannot be drawn")
    ids, column, row = board.marker_cells().T
    # OpenCV keeps these families upside down.
    ink = marker_ink(board.markers, ids, board.marker_borders[0])[:, ::-1, ::-1]
    size = ink.shape[1]
    steps = board.square * np.append(-board.spacing, np.arange(size) / size)
    blocks = np.zeros((board.rows // 2 + 1, 1 + size, board.columns // 2 + 1, 1 + size), bool)
    blocks[:, 0, :, 0] = True
    blocks[row, 1:, column, 1:] = ink
    return 0, board.square * (1 + board.spacing), steps, blocks, size


def marker_ink(markers: Markers, ids: npt.NDArray[np.intp], border: int) -> npt.NDArray[np.bool_]:
    """Which modules of markers are black: ids (N,) -> (N, S, S), as ``cv2.aruco`` prints them.

    ``border`` is the width of the black frame in modules; it is part of S.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, markers.dictionary))
    side = dictionary.markerSize + 2 * border
    drawn = [
        cv2.aruco.generateImageMarker(dictionary, int(one), side, borderBits=border) for one in ids
    ]
    return np.array(drawn).reshape(-1, side, side) == 0
