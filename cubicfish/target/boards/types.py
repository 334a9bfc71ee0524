"""The types of boards: what target.yaml says of each, and where its corners and markers are.

Corners of an AprilGrid lie on tags: a grid of tags with small black squares between them. The
layout is Kalibr's (``kalibr_create_target_pdf --type apriltag``): tags stand upright as AprilTag
draws them, with a black frame of two modules; ids run along x and then upwards, so the first one is
at the bottom left; black squares as wide as the gaps touch the tags' corners, which makes each tag
corner an X-corner. Kalibr's board has its origin at the bottom left corner and y up; here corner
(0, 0) is the top left one and rows grow downwards, as on all boards. Kalibr's point at column c
and row r (from the bottom) is corner (c, rows - 1 - r) here.
"""

from dataclasses import replace
from typing import Any, ClassVar, Self, get_args

import numpy as np
import numpy.typing as npt

from cubicfish.target.boards.board import Board, FirstSquare
from cubicfish.target.boards.markers import MARKER_DICTIONARIES, TAG_FAMILIES, Markers
from cubicfish.target.boards.section import Section, are_numbers
from cubicfish.target.boards.shape import BoardShape
from cubicfish.types import BoolArray, FloatArray, IntArray


class Checkerboard(Board):
    """Squares around inner corners, of which (0, 0) is the origin of the board's plane."""

    kind = "checkerboard"
    own_keys: ClassVar[tuple[str, ...]] = ("corners", "square", "first_square")
    has_squares = True

    @classmethod
    def read_own(cls, section: Section) -> dict[str, Any]:
        """As :meth:`Board.read_own`."""
        return _read_squares(section, "dark")

    def own_record(self) -> dict[str, Any]:
        """As :meth:`Board.own_record`."""
        return {
            "corners": [self.columns, self.rows],
            "square": self.square,
            "first_square": self.first_square,
        }


class Charuco(Checkerboard):
    """A ChArUco board, laid out as ``cv2.aruco.CharucoBoard`` since OpenCV 4.6.

    Markers stand upright in the middle of the light squares, ids row by row; with
    ``first_square: light`` the first marker is in the corner square, as in the legacy layout of
    boards with an even number of rows. On an inverted board light and dark are exchanged.
    """

    kind = "charuco"
    own_keys = (*Checkerboard.own_keys, "dictionary", "marker", "first_marker", "inverted")
    marker_borders = (1,)

    @classmethod
    def read_own(cls, section: Section) -> dict[str, Any]:
        """As :meth:`Board.read_own`."""
        inverted = section.flag("inverted")
        # As OpenCV lays boards out: the first square is one without a marker.
        own = _read_squares(section, "light" if inverted else "dark")
        hint = "the markers' family, such as DICT_5X5_250"
        dictionary = section.choice("dictionary", MARKER_DICTIONARIES, hint=hint)
        side, square = section.length("marker", hint="the side of a marker"), own["square"]
        if side >= square:
            section.refuse("marker", f"{side:g} must be smaller than the square, {square:g}")
        carries = _carriers(own["columns"], own["rows"], own["first_square"], inverted=inverted)
        markers = _read_markers(section, dictionary, side, int(carries.sum()))
        return {**own, "markers": replace(markers, inverted=inverted)}

    def own_record(self) -> dict[str, Any]:
        """As :meth:`Board.own_record`."""
        own = super().own_record()
        if self.markers is None:
            return own
        own |= {"dictionary": self.markers.dictionary, "marker": self.markers.side}
        own["first_marker"] = self.markers.first
        return {**own, "inverted": True} if self.markers.inverted else own

    def printed_cells(self) -> IntArray:
        """As :meth:`Board.printed_cells`."""
        if self.markers is None:
            return super().printed_cells()
        row, column = np.nonzero(
            _carriers(self.columns, self.rows, self.first_square, inverted=self.markers.inverted)
        )
        return np.stack([self.markers.first + np.arange(self.markers.count), column, row], axis=-1)


class AprilGrid(Board):
    """A grid of tags, each with four corners."""

    kind = "aprilgrid"
    own_keys = ("tags", "tag", "spacing", "family", "first_marker")
    per_cell = 2
    # A tag's frame is not in the target file: other programs print one module.
    marker_borders = (2, 1)

    @classmethod
    def read_own(cls, section: Section) -> dict[str, Any]:
        """As :meth:`Board.read_own`."""
        columns, rows = section.counts("tags", "tags along x and along y")
        side = section.length("tag", hint="the side of a tag, black border included")
        spacing = section.length("spacing", hint="gap between tags divided by the side of a tag")
        family = "tag36h11"
        if "family" in section.data:
            family = section.choice("family", TAG_FAMILIES, hint="such as tag36h11")
        markers = _read_markers(section, TAG_FAMILIES[family], side, columns * rows)
        grid = {"columns": 2 * columns, "rows": 2 * rows, "square": side}
        return {**grid, "spacing": spacing, "markers": markers}

    @property
    def family(self) -> str:
        """Name of the tags' family, as AprilTag spells it."""
        dictionary = self.markers.dictionary if self.markers else None
        return next((tag for tag, name in TAG_FAMILIES.items() if name == dictionary), "")

    def own_record(self) -> dict[str, Any]:
        """As :meth:`Board.own_record`."""
        return {
            "tags": [self.columns // 2, self.rows // 2],
            "tag": self.square,
            "spacing": self.spacing,
            "family": self.family,
            "first_marker": self.markers.first if self.markers else 0,
        }

    def plane_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """As :meth:`Board.plane_points`."""
        index = np.stack(np.broadcast_arrays(np.asarray(column, float), row), axis=-1)
        tag = np.floor(index / 2)
        return self.square * (tag * (1 + self.spacing) + (index - 2 * tag))

    def printed_cells(self) -> IntArray:
        """As :meth:`Board.printed_cells`."""
        if self.markers is None:
            return super().printed_cells()
        row, column = np.divmod(np.arange(self.markers.count), self.columns // 2)
        row = self.rows // 2 - 1 - row
        return np.stack([self.markers.first + np.arange(self.markers.count), column, row], axis=-1)


class PointList(Board):
    """World points at any place, ``columns`` of them in one row, which another program finds."""

    kind = "points"
    own_keys = ("points",)
    common_keys = ("offsets",)

    @classmethod
    def read_own(cls, section: Section) -> dict[str, Any]:
        """As :meth:`Board.read_own`; the points themselves say where they are."""
        value = section.required("points", hint="a list of [x, y, z]")
        if not isinstance(value, list) or len(value) < 2:
            section.refuse("points", "must be a list of at least two points, each [x, y, z]")
        for index, point in enumerate(value):
            if not are_numbers(point, 3):
                section.refuse("points", f"point {index} must be three finite numbers, [x, y, z]")
        points = np.array(value, float)
        order = np.lexsort(points.T)
        twins = np.flatnonzero((np.diff(points[order], axis=0) == 0).all(axis=1))
        if twins.size:
            a, b = sorted(order[twins[0] : twins[0] + 2])
            section.refuse("points", f"points {a} and {b} are in the same place")
        return {"columns": len(points), "rows": 1, "square": 0.0, "points": points}

    @property
    def _points(self) -> FloatArray:
        assert self.points is not None
        return self.points

    def own_record(self) -> dict[str, Any]:
        """As :meth:`Board.own_record`."""
        return {"points": self._points.tolist()}

    def in_mirror(self) -> Self:
        """As :meth:`Board.in_mirror`; a point keeps its number."""
        mirror = np.array([1.0, 1.0, -1.0])
        shape = self.shape and replace(self.shape, offsets=self.shape.offsets * mirror)
        return replace(self, points=self._points * mirror, shape=shape, mirrored=not self.mirrored)

    def moved(self, offset: FloatArray) -> Self:
        """As :meth:`Board.moved`."""
        return replace(self, origin=self.origin + offset, points=self._points + offset)

    def outline(self) -> FloatArray:
        """All points."""
        return self._points

    def _compute_nominal_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        return self._points[np.asarray(column, int)]

    def _deform(self, shape: BoardShape, column: IntArray, row: IntArray) -> FloatArray:
        return np.asarray(shape.offsets[row, column] @ self.axes)


BOARD_TYPES: dict[str, type[Board]] = {
    own.kind: own for own in (Checkerboard, Charuco, AprilGrid, PointList)
}
"""The types by their names, in the order in which messages list them."""


def _read_squares(section: Section, usual_first: FirstSquare) -> dict[str, Any]:
    """The fields of a board of squares; ``usual_first`` stands for a missing first square."""
    columns, rows = section.counts("corners", "inner corners, not squares")
    square, first = section.length("square", hint="the side of a square"), str(usual_first)
    if "first_square" in section.data:
        first = section.choice("first_square", get_args(FirstSquare), hint="dark or light")
    return {"columns": columns, "rows": rows, "square": square, "first_square": first}


def _read_markers(section: Section, dictionary: str, side: float, count: int) -> Markers:
    """The markers of a board that carries ``count``, from its ``first_marker`` on."""
    first, available = section.marker_id("first_marker"), MARKER_DICTIONARIES[dictionary]
    if first + count > available:
        section.refuse(
            "first_marker",
            f"the board carries {count} markers, ids {first} to {first + count - 1}, "
            f"but {dictionary} has only {available}: choose a larger family",
        )
    return Markers(dictionary=dictionary, side=side, first=first, count=count)


def _carriers(columns: int, rows: int, first_square: FirstSquare, *, inverted: bool) -> BoolArray:
    """(rows + 1, columns + 1): which squares of a board of inner corners carry markers."""
    row, column = np.indices((rows + 1, columns + 1))
    first = (first_square == "light") != inverted
    return (row + column) % 2 == (0 if first else 1)
