"""The print of an AprilGrid: a grid of tags with small black squares between them.

The layout is Kalibr's (``kalibr_create_target_pdf --type apriltag``): tags stand upright as
AprilTag draws them, with a black frame of two modules; ids run along x and then upwards, so the
first one is at the bottom left; black squares as wide as the gaps touch the tags' corners, which
makes each tag corner an X-corner. Kalibr's board has its origin at the bottom left corner and y
up; here corner (0, 0) is the top left one and rows grow downwards, as on all boards. Kalibr's
point at column c and row r (from the bottom) is corner (c, rows - 1 - r) here.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from cubicfish_cli.rendering.charuco import marker_ink
from cubicfish_cli.target import Board

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_BORDER_MODULES = 2


def aprilgrid_extent(
    board: Board, margin: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Opposite corners of the plate: the outer black squares and ``margin`` tags of paper."""
    reach = (board.spacing + margin) * board.square
    far_x, far_y = board.plane_points(board.columns - 1, board.rows - 1)
    return (-reach, -reach), (float(far_x) + reach, float(far_y) + reach)


def aprilgrid_steps(board: Board) -> tuple[FloatArray, FloatArray]:
    """Where ink may begin or end along x (N,) and along y (M,): gaps and tags' modules."""
    markers = board.markers
    if markers is None:
        raise ValueError(f"board {board.name!r} has no markers")
    size = marker_ink(markers, np.empty(0, np.intp), _BORDER_MODULES).shape[-1]
    pitch = board.square * (1 + board.spacing)
    gap = board.square * board.spacing
    modules = np.arange(size + 1) / size * board.square
    x, y = (
        np.unique(
            np.concatenate(
                [
                    [-gap],
                    (np.arange(tags)[:, None] * pitch + modules).ravel(),
                    [tags * pitch],
                ]
            )
        )
        for tags in (board.columns // 2, board.rows // 2)
    )
    return x, y


def aprilgrid_is_dark(board: Board) -> Callable[[FloatArray], BoolArray]:
    """Plane positions (..., 2) in the target's units -> (...) whether there is ink."""
    markers = board.markers
    if markers is None:
        raise ValueError(f"board {board.name!r} has no markers")
    ids, column, row = board.marker_cells().T
    # OpenCV keeps these families upside down.
    ink = marker_ink(markers, ids, _BORDER_MODULES)[:, ::-1, ::-1]
    size = ink.shape[-1]
    columns, rows = board.columns // 2, board.rows // 2
    table = np.zeros((rows, columns, size, size), bool)
    table[row, column] = ink
    pitch = board.square * (1 + board.spacing)
    gap = board.square * board.spacing

    def is_dark(plane: FloatArray) -> BoolArray:
        # Gaps lie before each tag; one more gap follows the last.
        cell = np.floor((plane + gap) / pitch).astype(np.int32)
        within = plane - cell * pitch
        in_gap = np.less(within, 0)
        printed: BoolArray = np.all((cell >= 0) & (cell <= (columns, rows)), axis=-1)
        square: BoolArray = in_gap.all(axis=-1) & printed
        tag: BoolArray = printed & ~in_gap.any(axis=-1) & (cell < (columns, rows)).all(axis=-1)
        module = np.floor(within / board.square * size).astype(np.int32)
        x, y = np.where(tag[..., None], cell, 0).astype(np.intp).reshape(-1, 2).T
        u, v = np.where(tag[..., None], module, 0).astype(np.intp).reshape(-1, 2).T
        # Rounding may put a position on the last edge one module too far.
        u, v = np.minimum(u, size - 1), np.minimum(v, size - 1)
        inked: BoolArray = square | (tag & table[y, x, v, u].reshape(tag.shape))
        return inked

    return is_dark
