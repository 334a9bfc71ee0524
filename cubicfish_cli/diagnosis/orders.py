"""The ways in which a board's corners may be counted, and its axes be drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy.typing as npt

from cubicfish_cli.boards.board import Board

_Numbers = npt.NDArray[Any]
_Order = Callable[[_Numbers, _Numbers, int, int], tuple[_Numbers, _Numbers]]
# Column and row of the corner that the drawing means, from those in the table. C and R are how
# many the drawing has.
ORDERS: Mapping[str, _Order] = {
    "as_it_is": lambda c, r, C, R: (c, r),
    "columns_backwards": lambda c, r, C, R: (C - 1 - c, r),
    "rows_backwards": lambda c, r, C, R: (c, R - 1 - r),
    "half_a_turn": lambda c, r, C, R: (C - 1 - c, R - 1 - r),
    "exchanged": lambda c, r, C, R: (r, c),
    "a_quarter_turn": lambda c, r, C, R: (R - 1 - r, c),
    "a_quarter_turn_back": lambda c, r, C, R: (r, C - 1 - c),
    "exchanged_backwards": lambda c, r, C, R: (R - 1 - r, C - 1 - c),
}
"""The eight ways to count a board's corners, by their keys in what is told (words/catalogue.py)."""
COUNTED = tuple(ORDERS)[1:7]
"""Those of them that one photo's corners may be in, where others are in none."""
EXCHANGED = ("exchanged", "a_quarter_turn", "a_quarter_turn_back", "exchanged_backwards")
"""Orders that a drawing with rows and columns exchanged may have."""
AXES: Mapping[str, Callable[[Board], Board]] = {
    "x_axis": lambda board: replace(board, x_axis=-board.x_axis),
    "y_axis": lambda board: replace(board, y_axis=-board.y_axis),
    "both_axes": lambda board: replace(board, x_axis=-board.x_axis, y_axis=-board.y_axis),
}
"""Axes that are drawn the other way round from corner (0, 0), by their keys: the board as meant."""
