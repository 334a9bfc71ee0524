"""Board: one rigid part of a target, with its corners in the world."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import floor
from typing import Any, ClassVar, Literal, Self

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.boards.markers import Markers
from cubicfish_cli.core.boards.section import Section
from cubicfish_cli.core.boards.shape import BoardShape
from cubicfish_cli.core.errors import UsageError
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray

FirstSquare = Literal["dark", "light"]

# From the first corner of a square to all four, in order around it.
AROUND_SQUARE: IntArray = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.intp)


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

    def in_mirror(self, last: float) -> Face:
        """The face whose columns run the other way: x of its first corner is ``last`` here."""

        def is_dark(plane: FloatArray) -> BoolArray:
            return self.is_dark(np.stack([last - plane[..., 0], plane[..., 1]], axis=-1))

        x, y = self.steps
        return Face(
            lower=(last - self.upper[0], self.lower[1]),
            upper=(last - self.lower[0], self.upper[1]),
            is_dark=is_dark,
            steps=((last - x)[::-1], y),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Board(ABC):
    """One rigid part of the target: a planar grid of corners, or a list of points.

    A type of board is a subclass, listed in :data:`cubicfish_cli.core.boards.registry.ENTRIES`.

    Attributes:
        kind: its ``type`` in target.yaml (of the class).
        keys: the keys that it may have there beside ``name`` and ``type`` (of the class).
        has_squares: whether it shows as a grid of squares, with or without markers in them.
        per_cell: corners along each side of one cell of the print: 2 on a tag, else 1.
        marker_borders: widths in modules of the frames that its markers may have; they are
            printed with the first.
        designed_counts: the fewest and the most corners (of an aprilgrid: tags) along a side of
            boards that are designed for a size of paper: fewer say little, more are small (of the
            class).
        designed_spacing: ``spacing`` of such boards (of the class).
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
        shape: its deformation against the drawing; None where it is as drawn.
        mirrored: whether this is the board as a mirror shows it, see :meth:`in_mirror`.

    """

    kind: ClassVar[str]
    keys: ClassVar[tuple[str, ...]]
    has_squares: ClassVar[bool] = False
    per_cell: ClassVar[int] = 1
    marker_borders: ClassVar[tuple[int, ...]] = ()
    designed_counts: ClassVar[tuple[int, int]] = (4, 11)
    designed_spacing: ClassVar[float] = 0.0

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

    @classmethod
    @abstractmethod
    def read(cls, section: Section, name: str, *, alone: bool) -> Board:
        """The board that a mapping of target.yaml describes.

        Args:
            section: the mapping; it has no unknown keys.
            name: the board's.
            alone: whether it is the target's only board, which needs no place.

        Raises:
            TargetError: a key is missing, or a value is not usable.

        """

    @classmethod
    def designed(
        cls, name: str, counts: tuple[int, int], square: float, family: str | None, first: int
    ) -> Board:
        """A new board at the world's origin.

        Args:
            name: the board's.
            counts: corners (of an aprilgrid: tags) along x and along y.
            square: side of a square, or of a tag.
            family: of its markers, of those of :meth:`designed_family`; None without markers.
            first: id of its first marker.

        """
        columns, rows = (cls.per_cell * count for count in counts)
        return cls(
            name=name,
            columns=columns,
            rows=rows,
            square=square,
            origin=np.zeros(3),
            x_axis=np.array([1.0, 0.0, 0.0]),
            y_axis=np.array([0.0, 1.0, 0.0]),
            markers=None
            if family is None
            else Markers(
                dictionary=family,
                side=cls.designed_marker_side(square),
                first=first,
                count=cls.designed_marker_count(counts),
            ),
            spacing=cls.designed_spacing,
        )

    @classmethod
    def designed_marker_count(cls, counts: tuple[int, int]) -> int:
        """How many markers a board of so many corners (or tags) carries."""
        return 0

    @classmethod
    def designed_marker_side(cls, square: float) -> float:
        """Side of a marker."""
        return square

    @classmethod
    def designed_length(cls, count: int, square: float) -> float:
        """Length of the print of so many corners (or tags)."""
        return square * (count + 1)

    @classmethod
    def designed_count(cls, length: float, square: float) -> int:
        """How many corners (or tags) fit into a length."""
        return floor(length / square + 1e-9) - 1

    @classmethod
    def designed_family(cls, asked: str | None, count: int) -> str | None:
        """The family of ``count`` markers, by the name that is asked for or the usual one.

        Raises:
            TargetError: there is none of this name for such boards, or it is too small.
            UsageError: such boards have none.

        """
        if asked is not None:
            raise UsageError(
                f"--dictionary is of markers, and {cls.kind}s have no markers: '--type charuco' or "
                "'aprilgrid' do"
            )
        return None

    @abstractmethod
    def own_record(self) -> dict[str, Any]:
        """The keys and values that :meth:`read` takes, without place and shape."""

    @abstractmethod
    def plane_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """Positions in the board's own plane: (...,) columns and rows -> (..., 2) in units."""

    @abstractmethod
    def printed_face(self, margin: float) -> Face:
        """The printed face, not in a mirror, with a margin of ``margin`` squares of paper.

        Raises:
            TargetError: there is no picture of this type of board.

        """

    @abstractmethod
    def dark_squares(self) -> FloatArray:
        """(N, 4, 2) the corners of dark squares (or of tags) in the board's plane."""

    @property
    def rim(self) -> float:
        """How far the print reaches beyond the outermost corners, in the target's units."""
        return 0.0

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

    def with_negative_markers(self) -> Board:
        """The board with light and dark exchanged, where that is another one; or itself."""
        return self

    def in_mirror(self) -> Self:
        """The board as a mirror in the world's plane z = 0 shows it; of that, the board itself.

        What a mirror shows is a board like any other. Its columns are counted as the mirror shows
        them, so column 0 is the last one of the print.
        """
        mirror = np.array([1.0, 1.0, -1.0])
        last = self.origin + self.plane_points(self.columns - 1, 0)[0] * self.x_axis
        other: FirstSquare = "light" if self.first_square == "dark" else "dark"
        return replace(
            self,
            origin=last * mirror,
            x_axis=-self.x_axis * mirror,
            y_axis=self.y_axis * mirror,
            # As many squares are before the first column as behind the last one.
            first_square=other if self.columns % 2 and self.has_squares else self.first_square,
            shape=self.shape.in_mirror() if self.shape else None,
            mirrored=not self.mirrored,
        )

    def face(self, *, margin: float) -> Face:
        """The printed face with a white margin of ``margin`` squares around the print.

        Raises:
            TargetError: there is no picture of this type of board.

        """
        if not self.mirrored:
            return self.printed_face(margin)
        last = float(self.plane_points(self.columns - 1, 0)[0])
        return self.in_mirror().printed_face(margin).in_mirror(last)

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
        drawn = self._drawn_points(column, row)
        if self.shape is None:
            return drawn
        return drawn + self._deformation(self.shape, np.asarray(column, int), np.asarray(row, int))

    def outline(self) -> FloatArray:
        """(N, 3) world points that span it: its four outermost corners, or all its points."""
        last_column, last_row = self.columns - 1, self.rows - 1
        return self.world_points([0, last_column, last_column, 0], [0, 0, last_row, last_row])

    def plane(self) -> tuple[FloatArray, FloatArray] | None:
        """A point (3,) of the board's plane and its unit normal (3,), None for points off one."""
        return self.origin, self.axes[2]

    def _drawn_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """World points of corners of the board as drawn (..., 3)."""
        plane = self.plane_points(column, row)
        return self.origin + plane[..., :1] * self.x_axis + plane[..., 1:] * self.y_axis

    def _deformation(self, shape: BoardShape, column: IntArray, row: IntArray) -> FloatArray:
        """World vectors from the drawn corners to the real ones: (..., 3)."""
        local = shape.offsets[row, column].copy()
        plane = self.plane_points(column, row)
        hat, middle = self.normalised(plane)
        local[..., :2] += shape.stretch * (plane - middle)
        local[..., 2] += hat * hat @ shape.bend + shape.twist * hat[..., 0] * hat[..., 1]
        return local @ self.axes
