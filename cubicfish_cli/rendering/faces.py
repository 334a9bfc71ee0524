"""What is printed on a board: a function from the board's plane to brightness.

One function a kind of board makes its :class:`Face`; a further kind is a further module and
a further entry in the table here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import TargetError
from cubicfish_cli.rendering.aprilgrid import aprilgrid_extent, aprilgrid_is_dark, aprilgrid_steps
from cubicfish_cli.rendering.charuco import charuco_is_dark, charuco_steps
from cubicfish_cli.rendering.checkerboard import (
    checkerboard_extent,
    checkerboard_is_dark,
    checkerboard_steps,
)
from cubicfish_cli.target import Board, BoardKind

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Face:
    """The printed face of a board, in the board's own plane.

    Attributes:
        lower, upper: opposite corners of the plate, (x, y) in the target's units; the white
            margin is inside.
        is_dark: (..., 2) plane positions -> (...) whether there is ink.
        steps: positions along x and along y, (N,) and (M,), between which ink neither begins
            nor ends: cells between them are of one colour.

    """

    lower: tuple[float, float]
    upper: tuple[float, float]
    is_dark: Callable[[FloatArray], BoolArray]
    steps: tuple[FloatArray, FloatArray]

    def covers(self, plane: FloatArray) -> BoolArray:
        """Whether plane positions (..., 2) are on the plate -> (...)."""
        return (
            (plane[..., 0] >= self.lower[0])
            & (plane[..., 0] <= self.upper[0])
            & (plane[..., 1] >= self.lower[1])
            & (plane[..., 1] <= self.upper[1])
        )


def _checkerboard(board: Board, margin: float) -> Face:
    lower, upper = checkerboard_extent(board, margin)
    return Face(
        lower=lower,
        upper=upper,
        is_dark=lambda plane: checkerboard_is_dark(board, plane),
        steps=checkerboard_steps(board),
    )


def _charuco(board: Board, margin: float) -> Face:
    lower, upper = checkerboard_extent(board, margin)
    return Face(
        lower=lower, upper=upper, is_dark=charuco_is_dark(board), steps=charuco_steps(board)
    )


def _aprilgrid(board: Board, margin: float) -> Face:
    lower, upper = aprilgrid_extent(board, margin)
    return Face(
        lower=lower,
        upper=upper,
        is_dark=aprilgrid_is_dark(board),
        steps=aprilgrid_steps(board),
    )


_FACES: Mapping[BoardKind, Callable[[Board, float], Face]] = {
    "checkerboard": _checkerboard,
    "charuco": _charuco,
    "aprilgrid": _aprilgrid,
}


def face(board: Board, *, margin: float) -> Face:
    """The printed face of a board with a white margin of ``margin`` squares around the print.

    Raises:
        TargetError: there is no picture of this kind of board.

    """
    make = _FACES.get(board.kind)
    if make is None:
        raise TargetError(
            f"board {board.name!r}: a {board.kind} board cannot be drawn, "
            f"only {', '.join(_FACES)}: change its type"
        )
    if not board.mirrored:
        return make(board, margin)
    return _in_mirror(
        make(board.in_mirror(), margin), float(board.plane_points(board.columns - 1, 0)[0])
    )


def _in_mirror(printed: Face, last: float) -> Face:
    """The face whose columns run the other way: x of its first corner is ``last`` of the print."""

    def is_dark(plane: FloatArray) -> BoolArray:
        return printed.is_dark(np.stack([last - plane[..., 0], plane[..., 1]], axis=-1))

    x, y = printed.steps
    return Face(
        lower=(last - printed.upper[0], printed.lower[1]),
        upper=(last - printed.lower[0], printed.upper[1]),
        is_dark=is_dark,
        steps=((last - x)[::-1], y),
    )
