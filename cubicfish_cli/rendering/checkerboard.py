"""The print of a checkerboard: squares around the inner corners, in the board's plane."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cubicfish_cli.target import Board

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


def checkerboard_extent(
    board: Board, margin: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Opposite corners of the plate: the outer squares and ``margin`` squares of paper."""
    reach = (1.0 + margin) * board.square
    return (-reach, -reach), (
        (board.columns - 1) * board.square + reach,
        (board.rows - 1) * board.square + reach,
    )


def checkerboard_steps(board: Board) -> tuple[FloatArray, FloatArray]:
    """Where ink may begin or end along x (columns + 2,) and along y (rows + 2,)."""
    x, y = (np.arange(-1.0, count + 1) * board.square for count in (board.columns, board.rows))
    return x, y


def checkerboard_is_dark(board: Board, plane: FloatArray) -> BoolArray:
    """Whether there is ink at plane positions (..., 2), in the target's units -> (...).

    Inner corner (0, 0) is the plane's origin; the square up-left of it has the colour
    ``board.first_square``.
    """
    square = np.floor(plane / board.square).astype(np.int32)
    column, row = square[..., 0], square[..., 1]
    printed = (column >= -1) & (column < board.columns) & (row >= -1) & (row < board.rows)
    odd = 0 if board.first_square == "dark" else 1
    return printed & ((column + row) % 2 == odd)
