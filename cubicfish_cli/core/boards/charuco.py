"""ChArUco board: a checkerboard with a marker in each light square."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cubicfish_cli.core.boards.board import Board, Face, FirstSquare
from cubicfish_cli.core.boards.checkerboard import Checkerboard, squares_of
from cubicfish_cli.core.boards.markers import (
    MARKER_DICTIONARIES,
    known_family,
    marker_ink,
    marker_modules,
    read_markers,
    table_ink,
)
from cubicfish_cli.core.boards.section import Section
from cubicfish_cli.core.boards.shape import PLACE_KEYS, SHAPE_KEYS
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray

# Of boards that are designed here, where nobody asks for another.
_USUAL_FAMILIES = ("DICT_5X5_50", "DICT_5X5_100", "DICT_5X5_250", "DICT_5X5_1000")


class Charuco(Checkerboard):
    """A ChArUco board, laid out as ``cv2.aruco.CharucoBoard`` since OpenCV 4.6.

    Markers stand upright in the middle of the light squares, ids row by row; with
    ``first_square: light`` the first marker is in the corner square, as in the legacy layout of
    boards with an even number of rows. On an inverted board light and dark are exchanged.
    """

    kind = "charuco"
    keys = (
        *("corners", "square", "first_square", "dictionary", "marker", "first_marker", "inverted"),
        *PLACE_KEYS,
        *SHAPE_KEYS,
    )
    marker_borders = (1,)
    designed_counts = (4, 9)

    @classmethod
    def read(cls, section: Section, name: str, *, alone: bool) -> Board:
        """As :meth:`Board.read`."""
        inverted = section.flag("inverted")
        # As OpenCV lays boards out: the first square is one without a marker.
        usual: FirstSquare = "light" if inverted else "dark"
        fields = squares_of(section, name, alone=alone, usual_first=usual)
        dictionary = section.choice(
            "dictionary", MARKER_DICTIONARIES, hint="the markers' family, such as DICT_5X5_250"
        )
        side, square = section.length("marker", hint="the side of a marker"), fields["square"]
        if side >= square:
            section.refuse("marker", f"{side:g} must be smaller than the square, {square:g}")
        carries = _carriers(
            fields["columns"], fields["rows"], fields["first_square"], inverted=inverted
        )
        markers = read_markers(section, dictionary, side, int(carries.sum()))
        return cls(**fields, markers=replace(markers, inverted=inverted))

    @classmethod
    def designed_marker_count(cls, counts: tuple[int, int]) -> int:
        """As :meth:`Board.designed_marker_count`."""
        # The square up-left of corner (0, 0) is dark, and so is the larger half of an odd number.
        return (counts[0] + 1) * (counts[1] + 1) // 2

    @classmethod
    def designed_marker_side(cls, square: float) -> float:
        """As :meth:`Board.designed_marker_side`: large enough to be read."""
        return round(0.75 * square, 2)

    @classmethod
    def designed_family(cls, asked: str | None, count: int) -> str:
        """As :meth:`Board.designed_family`; else the smallest usual one that is large enough."""
        usual = [one for one in _USUAL_FAMILIES if MARKER_DICTIONARIES[one] >= count]
        name = next(iter(usual), _USUAL_FAMILIES[-1]) if asked is None else asked
        return known_family(cls.kind, name, MARKER_DICTIONARIES, MARKER_DICTIONARIES, count)

    def own_record(self) -> dict[str, Any]:
        """As :meth:`Board.own_record`."""
        record = super().own_record()
        if self.markers is not None:
            record |= {
                "dictionary": self.markers.dictionary,
                "marker": self.markers.side,
                "first_marker": self.markers.first,
            }
            if self.markers.inverted:
                record["inverted"] = True
        return record

    def printed_cells(self) -> IntArray:
        """As :meth:`Board.printed_cells`."""
        if self.markers is None:
            return super().printed_cells()
        row, column = np.nonzero(
            _carriers(self.columns, self.rows, self.first_square, inverted=self.markers.inverted)
        )
        return np.stack([self.markers.first + np.arange(self.markers.count), column, row], axis=-1)

    def with_negative_markers(self) -> Board:
        """The board with light and dark exchanged."""
        if self.markers is None:
            return self
        return replace(
            self,
            first_square="light" if self.first_square == "dark" else "dark",
            markers=replace(self.markers, inverted=not self.markers.inverted),
        )

    def printed_face(self, margin: float) -> Face:
        """As :meth:`Board.printed_face`."""
        squares, markers = super().printed_face(margin), self.markers
        if markers is None:
            return squares
        border = self.marker_borders[0]
        ids, column, row = self.marker_cells().T
        ink = marker_ink(markers, ids, border)
        size = marker_modules(markers, border)
        # A table over all squares; those without a marker stay white here.
        table = np.zeros((self.rows + 1, self.columns + 1, size, size), bool)
        table[row, column] = ink

        def is_dark(plane: FloatArray) -> BoolArray:
            in_squares = plane / self.square
            square = np.floor(in_squares)
            module = ((in_squares - square - 0.5) * (self.square / markers.side) + 0.5) * size
            module = np.floor(module).astype(np.int32)
            cell = square.astype(np.int32) + 1
            inside = ((module >= 0) & (module < size) & (cell >= 0)).all(axis=-1)
            inside &= (cell[..., 0] <= self.columns) & (cell[..., 1] <= self.rows)
            printed = table_ink(table, cell, module, inside)
            dark = self.square_is_dark(plane)
            return dark & ~printed if markers.inverted else dark | printed

        modules = self.square / 2 + markers.side * (np.arange(size + 1) / size - 0.5)
        x, y = (
            np.unique(np.concatenate([edges, (edges[:-1, None] + modules).ravel()]))
            for edges in self.square_edges()
        )
        return replace(squares, is_dark=is_dark, steps=(x, y))


def _carriers(columns: int, rows: int, first_square: FirstSquare, *, inverted: bool) -> BoolArray:
    """(rows + 1, columns + 1): which squares of a board of inner corners carry markers."""
    row, column = np.indices((rows + 1, columns + 1))
    first = (first_square == "light") != inverted
    return (row + column) % 2 == (0 if first else 1)
