"""Checkerboard: squares around inner corners."""

from __future__ import annotations

from typing import Any, ClassVar, get_args

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.boards.board import AROUND_SQUARE, Board, Face, FirstSquare
from cubicfish_cli.core.boards.section import Section
from cubicfish_cli.core.boards.shape import PLACE_KEYS, SHAPE_KEYS, read_place, read_shape
from cubicfish_cli.core.types import BoolArray, FloatArray


class Checkerboard(Board):
    """A checkerboard: inner corner (0, 0) is the origin of the board's plane."""

    kind = "checkerboard"
    keys: ClassVar[tuple[str, ...]] = (
        "corners",
        "square",
        "first_square",
        *PLACE_KEYS,
        *SHAPE_KEYS,
    )
    has_squares = True

    @classmethod
    def read(cls, section: Section, name: str, *, alone: bool) -> Board:
        """As :meth:`Board.read`."""
        return cls(**squares_of(section, name, alone=alone))

    def own_record(self) -> dict[str, Any]:
        """As :meth:`Board.own_record`."""
        return {
            "corners": [self.columns, self.rows],
            "square": self.square,
            "first_square": self.first_square,
        }

    @property
    def rim(self) -> float:
        """The outer squares."""
        return self.square

    def plane_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """As :meth:`Board.plane_points`."""
        column, row = np.broadcast_arrays(np.asarray(column, float), np.asarray(row, float))
        return np.stack([column, row], axis=-1) * self.square

    def printed_face(self, margin: float) -> Face:
        """As :meth:`Board.printed_face`."""
        reach = (1.0 + margin) * self.square
        far_x, far_y = self.plane_points(self.columns - 1, self.rows - 1) + reach
        return Face(
            lower=(-reach, -reach),
            upper=(float(far_x), float(far_y)),
            is_dark=self.square_is_dark,
            steps=self.square_edges(),
        )

    def dark_squares(self) -> FloatArray:
        """As :meth:`Board.dark_squares`."""
        row, column = np.indices((self.rows + 1, self.columns + 1)).reshape(2, -1)
        dark = (row + column) % 2 == (0 if self.first_square == "dark" else 1)
        corner = np.stack([column, row], axis=-1)[dark][:, None] - 1 + AROUND_SQUARE
        return np.asarray(self.square * corner)

    def square_edges(self) -> tuple[FloatArray, FloatArray]:
        """Where squares begin and end along x (columns + 2,) and along y (rows + 2,)."""
        x, y = (np.arange(-1.0, count + 1) * self.square for count in (self.columns, self.rows))
        return x, y

    def square_is_dark(self, plane: FloatArray) -> BoolArray:
        """Whether plane positions (..., 2), in the target's units, are in a dark square -> (...).

        The square up-left of corner (0, 0) has the colour ``first_square``.
        """
        square = np.floor(plane / self.square).astype(np.int32)
        column, row = square[..., 0], square[..., 1]
        printed = (column >= -1) & (column < self.columns) & (row >= -1) & (row < self.rows)
        odd = 0 if self.first_square == "dark" else 1
        return printed & ((column + row) % 2 == odd)


def squares_of(
    section: Section, name: str, *, alone: bool, usual_first: FirstSquare = "dark"
) -> dict[str, Any]:
    """The fields of a board of squares.

    Raises:
        TargetError: a key is missing, or a value is not usable.

    """
    origin, x_axis, y_axis = read_place(section, alone=alone)
    columns, rows = section.counts("corners", "inner corners, not squares")
    square = section.length("square", hint="the side of a square")
    first = usual_first
    if "first_square" in section.data:
        light = section.choice("first_square", get_args(FirstSquare), hint="dark or light")
        first = "light" if light == "light" else "dark"
    return {
        "name": name,
        "columns": columns,
        "rows": rows,
        "square": square,
        "origin": origin,
        "x_axis": x_axis,
        "y_axis": y_axis,
        "first_square": first,
        "shape": read_shape(section, columns, rows),
    }
