"""Board: one rigid part of a target, with its corners in the world."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt

from cubicfish.target.boards.markers import Markers
from cubicfish.target.boards.section import PLACE_KEYS, SHAPE_KEYS, Section
from cubicfish.target.boards.shape import BoardShape
from cubicfish.types import FloatArray, IntArray

FirstSquare = Literal["dark", "light"]
_OTHER: dict[FirstSquare, FirstSquare] = {"dark": "light", "light": "dark"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Board(ABC):
    """One rigid part of the target: a planar grid of corners, or a list of points.

    A type of board is a subclass, listed in :data:`cubicfish.target.boards.types.BOARD_TYPES`.

    Attributes:
        kind: its ``type`` in target.yaml (of the class).
        own_keys: the keys that say there what it is (of the class).
        common_keys: the keys that say where it is and how it is deformed (of the class).
        has_squares: whether it shows as a grid of squares, with or without markers in them.
        per_cell: corners along each side of one cell of the print: 2 on a tag, else 1.
        marker_borders: widths in modules of the frames that its markers may have; they are
            printed with the first.
        AROUND_SQUARE: (4, 2) from the first corner of a square to all four, in order around it.
        name: unique within the target.
        columns, rows: number of corners along x and along y (a list of points: their count, 1).
        square: side of a square, in the target's units (0 for points; the side of a tag).
        origin: (3,) world position of corner (0, 0).
        x_axis, y_axis: (3,) unit world directions of growing column and growing row. Seen by
            someone who looks at the printed face, x is to the right and y down, so x × y
            points into the board, away from the viewer.
        first_square: whether the square up-left of corner (0, 0) is ``dark`` or ``light``.
        markers: the markers that it carries, else None.
        spacing: gap between tags / side of a tag; 0 where there are no tags.
        points: (N, 3) world points of a list of points, else None.
        shape: its deformation relative to the nominal board; None without one.
        mirrored: whether this is the board as a mirror shows it, see :meth:`in_mirror`.
        unplaced: whether nobody knows where it is: ``place: unknown``. Its origin and axes are
            then made up.

    """

    kind: ClassVar[str]
    own_keys: ClassVar[tuple[str, ...]]
    common_keys: ClassVar[tuple[str, ...]] = (*PLACE_KEYS, "place", *SHAPE_KEYS)
    has_squares: ClassVar[bool] = False
    per_cell: ClassVar[int] = 1
    marker_borders: ClassVar[tuple[int, ...]] = ()
    AROUND_SQUARE: ClassVar[IntArray] = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.intp)

    name: str
    columns: int
    rows: int
    square: float
    origin: FloatArray
    x_axis: FloatArray
    y_axis: FloatArray
    first_square: FirstSquare = "dark"
    markers: Markers | None = None
    spacing: float = 0.0
    points: FloatArray | None = None
    shape: BoardShape | None = None
    mirrored: bool = False
    unplaced: bool = False

    @classmethod
    def read(cls, section: Section, name: str, *, alone: bool) -> Board:
        """The board that a mapping of target.yaml describes.

        Args:
            section: the mapping.
            name: the board's.
            alone: whether it is the target's only board, which needs no place.

        Raises:
            TargetError: a key is missing or unknown, or a value is not usable.

        """
        keys = ("name", "type", *cls.own_keys, *cls.common_keys)
        section.allow_only(keys, f"a board of type {cls.kind}")
        own = cls.read_own(section)
        unplaced = section.is_unplaced()
        place = section.place(alone=alone or unplaced or "origin" not in cls.common_keys)
        shape = section.shape(own["columns"], own["rows"])
        return cls(name=name, **own, **place, shape=shape, unplaced=unplaced)

    @classmethod
    @abstractmethod
    def read_own(cls, section: Section) -> dict[str, Any]:
        """The fields that its :attr:`own_keys` say.

        Raises:
            TargetError: a key is missing, or a value is not usable.

        """

    @abstractmethod
    def own_record(self) -> dict[str, Any]:
        """The values of :attr:`own_keys`."""

    def as_record(self) -> dict[str, Any]:
        """Plain data: what target.yaml has of it."""
        record: dict[str, Any] = {"name": self.name, "type": self.kind, **self.own_record()}
        keys, shape = self.common_keys, self.shape
        if self.unplaced:
            record["place"] = "unknown"
        else:
            record |= {key: getattr(self, key).tolist() for key in PLACE_KEYS if key in keys}
        if shape is None:
            return record
        if "bend" in keys:
            bend, stretch = shape.bend.tolist(), shape.stretch.tolist()
            record |= {"bend": bend, "twist": shape.twist, "stretch": stretch}
        cells = np.argwhere(shape.offsets.any(axis=2)).tolist()
        if cells:
            own = [[column, row, *shape.offsets[row, column].tolist()] for row, column in cells]
            record["offsets"] = own
        return record

    def plane_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """Positions in the board's own plane: (...,) columns and rows -> (..., 2) in units."""
        column, row = np.broadcast_arrays(np.asarray(column, float), np.asarray(row, float))
        return np.stack([column, row], axis=-1) * self.square

    @property
    def family(self) -> str:
        """The family of its markers, as target.yaml calls it for such boards; empty without any."""
        return "" if self.markers is None else self.markers.dictionary

    @property
    def rim(self) -> float:
        """How far the print reaches beyond the outermost corners, in the target's units."""
        return self.square if self.has_squares else 0.0

    def printed_cells(self) -> IntArray:
        """:meth:`marker_cells` of the board as it is printed, not in a mirror."""
        return np.empty((0, 3), np.intp)

    def marker_cells(self) -> IntArray:
        """Where the markers are: (count, 3) rows of id, cell column and cell row.

        On a ``charuco`` board cells are squares, (0, 0) the one up-left of corner (0, 0);
        the light squares, or on an inverted board the dark ones, carry ids row by row from the
        top, as in ``cv2.aruco.CharucoBoard``.
        On an ``aprilgrid`` cells are tags, (0, 0) at the top left; ids run row by row from
        the bottom, as in Kalibr. Other boards have no rows.
        """
        if not self.mirrored:
            return self.printed_cells()
        printed = self.in_mirror().printed_cells()
        last = self.columns // 2 - 1 if self.per_cell == 2 else self.columns
        return np.stack([printed[:, 0], last - printed[:, 1], printed[:, 2]], axis=-1)

    def with_other_colours(self) -> Self:
        """The board with light and dark exchanged."""
        markers = self.markers and replace(self.markers, inverted=not self.markers.inverted)
        return replace(self, first_square=_OTHER[self.first_square], markers=markers)

    def in_mirror(self) -> Self:
        """The board in a mirror in the world's plane z = 0; twice in a mirror it is itself.

        A mirror image is a board like any other. Its columns are counted as the mirror shows them,
        so column 0 is the last one of the print.
        """
        mirror = np.array([1.0, 1.0, -1.0])
        # As many squares are before the first column as behind the last one.
        exchanged = self.columns % 2 and self.has_squares
        last = self.origin + self.plane_points(self.columns - 1, 0)[0] * self.x_axis
        return replace(
            self,
            origin=last * mirror,
            x_axis=-self.x_axis * mirror,
            y_axis=self.y_axis * mirror,
            first_square=_OTHER[self.first_square] if exchanged else self.first_square,
            shape=self.shape.in_mirror() if self.shape else None,
            mirrored=not self.mirrored,
        )

    @cached_property
    def axes(self) -> FloatArray:
        """(3, 3) rows x_axis, y_axis and x_axis × y_axis, which points into the board."""
        return np.stack([self.x_axis, self.y_axis, np.cross(self.x_axis, self.y_axis)])

    def normalised(self, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
        """x̂, ŷ of plane positions (..., 2), and the board's middle (2,), also its half extent."""
        end = self.plane_points(self.columns - 1, self.rows - 1)
        return (plane - end / 2) / (end / 2), end / 2

    def moved(self, offset: FloatArray) -> Self:
        """The board with ``offset`` (3,) added to all its points."""
        return replace(self, origin=self.origin + offset)

    def places(self) -> tuple[IntArray, IntArray]:
        """Column and row of all corners, row by row."""
        row, column = np.indices((self.rows, self.columns)).reshape(2, -1)
        return column, row

    def world_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """World points of corners: (...,) columns and rows -> (..., 3), in the target's units."""
        nominal = self._compute_nominal_points(column, row)
        if self.shape is None:
            return nominal
        return nominal + self._deform(self.shape, np.asarray(column, int), np.asarray(row, int))

    def outline(self) -> FloatArray:
        """(N, 3) world points that span the board: four outermost corners, or all its points."""
        last_column, last_row = self.columns - 1, self.rows - 1
        return self.world_points([0, last_column, last_column, 0], [0, 0, last_row, last_row])

    def _compute_nominal_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """World points of corners of the nominal board (..., 3)."""
        plane = self.plane_points(column, row)
        return self.origin + plane[..., :1] * self.x_axis + plane[..., 1:] * self.y_axis

    def _deform(self, shape: BoardShape, column: IntArray, row: IntArray) -> FloatArray:
        """World vectors from the nominal corners to the real ones: (..., 3)."""
        local = shape.offsets[row, column].copy()
        plane = self.plane_points(column, row)
        hat, middle = self.normalised(plane)
        local[..., :2] += shape.stretch * (plane - middle)
        local[..., 2] += hat * hat @ shape.bend + shape.twist * hat[..., 0] * hat[..., 1]
        return local @ self.axes
