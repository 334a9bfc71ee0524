"""The shapes that a drawing of a board is made of: its paper, and its dark squares."""

import numpy as np

from cubicfish import FloatArray
from cubicfish.target import Board


def dark_squares(board: Board) -> FloatArray:
    """(N, 4, 2) the corners of dark squares, or of tags, in the board's plane."""
    if board.per_cell == 2:
        row, column = np.indices((board.rows // 2, board.columns // 2)).reshape(2, -1)
        first = 2 * np.stack([column, row], axis=-1)
    else:
        row, column = np.indices((board.rows + 1, board.columns + 1)).reshape(2, -1)
        dark = (row + column) % 2 == (board.first_square == "light")
        first = np.stack([column, row], axis=-1)[dark] - 1
    corner = first[:, None] + Board.AROUND_SQUARE
    return board.plane_points(corner[..., 0], corner[..., 1])


def paper(board: Board, pieces: int = 1) -> FloatArray:
    """(pieces², 4, 3) world points of a print, in pieces."""
    end = board.plane_points(board.columns - 1, board.rows - 1) + board.rim
    share = np.linspace(0, 1, pieces + 1)[:-1]
    step = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) / pieces
    low = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 1, 2)
    return board.origin + (-board.rim + (low + step) * (end + board.rim)) @ board.axes[:2]
