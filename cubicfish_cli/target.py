"""``target.yaml`` -> Target: the boards of the calibration object and their world points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any, Literal, NoReturn, get_args

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import TargetError
from cubicfish_cli.plain_yaml import load_plain_yaml
from cubicfish_cli.wording import did_you_mean, quoted

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]
BoardKind = Literal["checkerboard", "charuco", "aprilgrid", "points"]
FirstSquare = Literal["dark", "light"]

# A refined object of some ten thousand corners, each with its offset.
MAX_BYTES = 4_000_000
MAX_COUNT = 1000
MAX_BOARDS = 256
MIN_LENGTH, MAX_LENGTH = 1e-9, 1e9
AXES_TOLERANCE = 1e-3

# Number of markers in each family, as cv2.aruco.getPredefinedDictionary has them.
MARKER_DICTIONARIES: dict[str, int] = {
    **{f"DICT_{n}X{n}_{count}": count for n in (4, 5, 6, 7) for count in (50, 100, 250, 1000)},
    "DICT_ARUCO_ORIGINAL": 1024,
    "DICT_ARUCO_MIP_36h12": 250,
    "DICT_APRILTAG_16h5": 30,
    "DICT_APRILTAG_25h9": 35,
    "DICT_APRILTAG_36h10": 2320,
    "DICT_APRILTAG_36h11": 587,
}
TAG_FAMILIES = {
    name.replace("DICT_APRILTAG_", "tag"): name
    for name in MARKER_DICTIONARIES
    if name.startswith("DICT_APRILTAG_")
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Markers:
    """The markers printed on a ``charuco`` or ``aprilgrid`` board.

    Attributes:
        dictionary: name of the marker family as cv2.aruco spells it (``DICT_...``).
        side: side of a marker, in the target's units.
        first: id of the board's first marker.
        count: how many markers the board carries; ids are ``first .. first + count - 1``.
        inverted: whether they are light on dark: on a ``charuco`` board they are in its dark
            squares then.

    """

    dictionary: str
    side: float
    first: int
    count: int
    inverted: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class BoardShape:
    """How a real board departs from the drawn plane, as a calibration found it.

    With x̂ and ŷ running from -1 to 1 across the board's corners, a corner drawn at (x, y) from
    the board's middle is at ((1 + stretch x) x, (1 + stretch y) y) in its plane and
    bend x · x̂² + bend y · ŷ² + twist · x̂ ŷ behind it (along x_axis × y_axis), plus its offset.

    Attributes:
        bend: (2,) how far the edges lie behind the middle, along x and along y.
        twist: how far two opposite corners lie behind the middle, and the others before it.
        stretch: (2,) relative stretch along x and along y.
        offsets: (rows, columns, 3) each corner's own offset along x_axis, y_axis and
            x_axis × y_axis; zeros where there is none.

    """

    bend: FloatArray
    twist: float
    stretch: FloatArray
    offsets: FloatArray

    def plus(self, other: BoardShape) -> BoardShape:
        """Both departures together."""
        return BoardShape(
            bend=self.bend + other.bend,
            twist=self.twist + other.twist,
            stretch=self.stretch + other.stretch,
            offsets=self.offsets + other.offsets,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Board:
    """One rigid part of the object: a planar grid of corners, or a list of points.

    Attributes:
        name: unique within the target.
        kind: ``checkerboard``, ``charuco``, ``aprilgrid`` or ``points``.
        columns, rows: number of corners along x and along y (``points``: their count and 1).
        square: side of a square, in the target's units (0 for ``points``; the side of a tag
            for ``aprilgrid``).
        origin: (3,) world position of corner (0, 0).
        x_axis, y_axis: (3,) unit world directions of growing column and growing row. Seen by
            someone who looks at the printed face, x is to the right and y down, so x × y
            points into the board, away from the viewer.
        first_square: whether the square up-left of corner (0, 0) is ``dark`` or ``light``.
        markers: the markers of a ``charuco`` or ``aprilgrid`` board, else None.
        spacing: for ``aprilgrid``, gap between tags / side of a tag; else 0.
        points: (N, 3) world points of a ``points`` board, else None.
        shape: how the board departs from the drawing; None where it is as drawn.
        mirrored: whether this is the board as a mirror shows it, see :meth:`in_mirror`.

    """

    name: str
    kind: BoardKind
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

    def in_mirror(self) -> Board:
        """The board as a mirror in the world's plane z = 0 shows it; of that, the board itself.

        What a mirror shows is a board like any other. Its columns are counted as the mirror shows
        them, so column 0 is the last one of the print.
        """
        mirror = np.array([1.0, 1.0, -1.0])
        if self.points is not None:
            points = self.points * mirror
            return replace(
                self, points=points, shape=_shape_in_mirror(self), mirrored=not self.mirrored
            )
        last = self.origin + self.plane_points(self.columns - 1, 0)[0] * self.x_axis
        other: FirstSquare = "light" if self.first_square == "dark" else "dark"
        return replace(
            self,
            origin=last * mirror,
            x_axis=-self.x_axis * mirror,
            y_axis=self.y_axis * mirror,
            # As many squares are before the first column as behind the last one.
            first_square=other if self.columns % 2 and self.has_squares else self.first_square,
            shape=_shape_in_mirror(self),
            mirrored=not self.mirrored,
        )

    @property
    def has_squares(self) -> bool:
        """Whether it shows as a grid of squares, with or without markers in them."""
        return self.kind in ("checkerboard", "charuco")

    @cached_property
    def axes(self) -> FloatArray:
        """(3, 3) rows x_axis, y_axis and x_axis × y_axis, which points into the board."""
        return np.stack([self.x_axis, self.y_axis, np.cross(self.x_axis, self.y_axis)])

    def normalised(self, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
        """x̂, ŷ of plane positions (..., 2), and the board's middle (2,), also its half extent."""
        end = self.plane_points(self.columns - 1, self.rows - 1)
        return (plane - end / 2) / (end / 2), end / 2

    def moved(self, offset: FloatArray) -> Board:
        """The board with ``offset`` (3,) added to all its points."""
        points = None if self.points is None else self.points + offset
        return replace(self, origin=self.origin + offset, points=points)

    def places(self) -> tuple[IntArray, IntArray]:
        """Column and row of all corners, row by row."""
        row, column = np.indices((self.rows, self.columns)).reshape(2, -1)
        return column, row

    def plane_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """Positions in the board's own plane: (...,) columns and rows -> (..., 2) in units."""
        column, row = np.broadcast_arrays(np.asarray(column, float), np.asarray(row, float))
        if self.kind == "aprilgrid":
            return np.stack([self._tag_offset(column), self._tag_offset(row)], axis=-1)
        return np.stack([column, row], axis=-1) * self.square

    def marker_cells(self) -> npt.NDArray[np.intp]:
        """Where the markers are: (count, 3) rows of id, cell column and cell row.

        On a ``charuco`` board cells are squares, (0, 0) the one up-left of corner (0, 0);
        the light squares, or on an inverted board the dark ones, carry ids row by row from the
        top, as in ``cv2.aruco.CharucoBoard``.
        On an ``aprilgrid`` cells are tags, (0, 0) at the top left; ids run row by row from
        the bottom, as in Kalibr. Other boards have no rows.
        """
        if self.markers is None:
            return np.empty((0, 3), np.intp)
        if self.mirrored:
            printed = self.in_mirror().marker_cells()
            last = self.columns // 2 - 1 if self.kind == "aprilgrid" else self.columns
            return np.stack([printed[:, 0], last - printed[:, 1], printed[:, 2]], axis=-1)
        if self.kind == "aprilgrid":
            row, column = np.divmod(np.arange(self.markers.count), self.columns // 2)
            row = self.rows // 2 - 1 - row
        else:
            row, column = np.nonzero(
                _marker_squares(
                    self.columns, self.rows, self.first_square, inverted=self.markers.inverted
                )
            )
        return np.stack([self.markers.first + np.arange(self.markers.count), column, row], axis=-1)

    def with_negative_markers(self) -> Board:
        """The ``charuco`` board with light and dark exchanged; others as they are."""
        if self.kind != "charuco" or self.markers is None:
            return self
        return replace(
            self,
            first_square="light" if self.first_square == "dark" else "dark",
            markers=replace(self.markers, inverted=not self.markers.inverted),
        )

    def _tag_offset(self, index: FloatArray) -> FloatArray:
        tag = np.floor(index / 2)
        return self.square * (tag * (1 + self.spacing) + (index - 2 * tag))

    def world_points(self, column: npt.ArrayLike, row: npt.ArrayLike) -> FloatArray:
        """World points of corners: (...,) columns and rows -> (..., 3), in the target's units."""
        if self.points is not None:
            drawn = self.points[np.asarray(column, int)]
        else:
            plane = self.plane_points(column, row)
            drawn = self.origin + plane[..., :1] * self.x_axis + plane[..., 1:] * self.y_axis
        if self.shape is None:
            return drawn
        return drawn + self._departure(self.shape, np.asarray(column, int), np.asarray(row, int))

    def _departure(
        self, shape: BoardShape, column: npt.NDArray[np.intp], row: npt.NDArray[np.intp]
    ) -> FloatArray:
        """World vectors from the drawn corners to the real ones: (..., 3)."""
        local = shape.offsets[row, column].copy()
        if self.points is None:
            plane = self.plane_points(column, row)
            hat, middle = self.normalised(plane)
            local[..., :2] += shape.stretch * (plane - middle)
            local[..., 2] += hat * hat @ shape.bend + shape.twist * hat[..., 0] * hat[..., 1]
        return local @ self.axes


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """A rigid calibration object: several boards in one world frame, in one unit of length."""

    units: str
    boards: tuple[Board, ...]

    @classmethod
    def load(cls, path: Path | str) -> Target:
        """Read ``target.yaml``, as :func:`load_target` does.

        Raises:
            TargetError: the file cannot be read or does not describe a usable object.

        """
        return load_target(Path(path))

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Target:
        """The object that plain data describe: the keys and values of ``target.yaml``.

        Raises:
            TargetError: a key is missing or unknown, or a value is not usable; one line that
                names the board and the key.

        """
        try:
            plain = _plain(data)
        except RecursionError as problem:
            raise TargetError("target: is nested without end") from problem
        return _target("target", plain)

    @cached_property
    def board_names(self) -> tuple[str, ...]:
        """The boards' names, in the file's order."""
        return tuple(board.name for board in self.boards)

    def with_boards(self, boards: Mapping[int, Board]) -> Target:
        """The object with other boards in the place of those of these indices."""
        changed = (boards.get(index, board) for index, board in enumerate(self.boards))
        return replace(self, boards=tuple(changed))

    @property
    def mirrored(self) -> bool:
        """Whether this is the object as a mirror shows it, as in ``mirrored: true``."""
        return any(board.mirrored for board in self.boards)

    def in_mirror(self) -> Target:
        """The object as a mirror shows it; of that, the object itself."""
        return replace(self, boards=tuple(board.in_mirror() for board in self.boards))

    def as_printed(self) -> Target:
        """The object itself, whether or not photos show it in a mirror."""
        return self.in_mirror() if self.mirrored else self

    def moved(self, offset: FloatArray) -> Target:
        """The object with ``offset`` (3,), in the target's units, added to all its points."""
        if not offset.any():
            return self
        return replace(self, boards=tuple(board.moved(offset) for board in self.boards))

    def with_flat_boards(self) -> Target:
        """The object with plane boards: without the shapes that a calibration found."""
        return replace(self, boards=tuple(replace(board, shape=None) for board in self.boards))

    def world_points(
        self, board: npt.ArrayLike, column: npt.ArrayLike, row: npt.ArrayLike
    ) -> FloatArray:
        """World points of corners given by (N,) board index, column and row -> (N, 3)."""
        board, column, row = np.broadcast_arrays(board, column, row)
        world = np.full((*board.shape, 3), np.nan)
        for index, one in enumerate(self.boards):
            here = board == index
            world[here] = one.world_points(column[here], row[here])
        return world

    def corners(self) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
        """All corners: board index, column and row (N,) each, and world points (N, 3) in units.

        Board by board in the file's order, row by row.
        """
        parts = []
        for index, board in enumerate(self.boards):
            column, row = board.places()
            parts.append((np.full(len(row), index), column, row, board.world_points(column, row)))
        boards, columns, rows, world = (np.concatenate(part) for part in zip(*parts, strict=True))
        return boards, columns, rows, world

    def plane_count(self) -> int:
        """Number of distinct planes that the boards lie in (each decides how much P can know).

        A ``points`` board counts when its points lie in one plane (to 1e-6 of their extent).
        """
        planes: list[tuple[FloatArray, FloatArray]] = []
        extent = max(np.ptp(_outline(board), axis=0).max() for board in self.boards)
        for plane in filter(None, map(_plane_of, self.boards)):
            if not any(_same_plane(plane, known, 1e-3 * extent) for known in planes):
                planes.append(plane)
        return len(planes)


_NO_TARGET = (
    "name the target.yaml that says where the boards are, or make one with 'cubicfish target print'"
)


def load_target(path: Path) -> Target:
    """Read ``target.yaml``, or a target file of Kalibr's.

    Raises:
        TargetError: the file cannot be read or does not describe a usable object; the text
            names the file, the board and the key.

    """
    data = load_plain_yaml(Path(path), error=TargetError, max_bytes=MAX_BYTES, if_empty=_NO_TARGET)
    if isinstance(data, dict) and "cubicfish" in data and "boards" not in data:
        raise TargetError(f"{path} is a camera file, not a calibration target: {_NO_TARGET}")
    if not isinstance(data, dict):
        raise TargetError(f"{path} must hold the keys units and boards: {_NO_TARGET}")
    if "target_type" in data:
        data = _of_kalibr(str(path), data)
    return _target(str(path), data)


def colourings(target: Target) -> list[Target]:
    """The target, and where that is another one also the same with its colours exchanged.

    Turned by 180°, or by 90° where it is as wide as high, some boards look as if they were.
    """
    board = target.boards[0]
    if len(target.boards) > 1 or board.kind != "checkerboard":
        return [target]
    columns, rows = board.columns, board.rows
    if columns % 2 != rows % 2 or (columns == rows and columns % 2):
        return [target]
    other: FirstSquare = "light" if board.first_square == "dark" else "dark"
    return [target, target.with_boards({0: replace(board, first_square=other)})]


# Kalibr's key -> ours, by the type of the target. Its counts of a checkerboard are of inner corners
# too, its lengths are metres.
_KALIBR_KEYS = {
    "checkerboard": ("targetCols", "targetRows", "rowSpacingMeters", "colSpacingMeters"),
    "aprilgrid": ("tagCols", "tagRows", "tagSize", "tagSpacing"),
}
# Two spacings that were measured differ by less than this, relatively.
_ONE_SPACING = 1e-3


def _of_kalibr(where: str, data: dict[str, Any]) -> dict[str, Any]:
    """What target.yaml would hold for a target file of Kalibr's."""
    top = _Section(where, data)
    kind = data["target_type"]
    if kind not in _KALIBR_KEYS:
        top.refuse(
            "target_type",
            f"{quoted(kind)} is not found in photos here: use a checkerboard or an aprilgrid",
        )
    columns, rows, *lengths = _KALIBR_KEYS[kind]
    for key in (columns, rows, *lengths):
        top.required(key, f"a target of type {kind} of Kalibr's has it")
    counts = [data[columns], data[rows]]
    board: dict[str, Any] = {"name": "board", "type": kind}
    if kind == "aprilgrid":
        board |= {"tags": counts, "tag": data["tagSize"], "spacing": data["tagSpacing"]}
    else:
        high, wide = (top.length(key, "metres between corners") for key in lengths)
        if abs(high - wide) > _ONE_SPACING * wide:
            top.refuse(
                "rowSpacingMeters",
                f"{high:g} and colSpacingMeters, {wide:g}, differ: squares must be as high as wide",
            )
        board |= {"corners": counts, "square": wide}
    return {"units": "m", "boards": [board]}


def _target(where: str, data: object) -> Target:
    if not isinstance(data, dict):
        raise TargetError(f"{where}: must hold the keys units and boards")
    top = _Section(where, data)
    top.allow_only(("units", "boards", "mirrored"), "a target file")
    mirrored = top.flag("mirrored")
    units = top.text("units", hint="the unit of every length in it, such as mm")
    entries = top.required("boards", hint="a list of boards")
    if not isinstance(entries, list) or not entries:
        top.refuse("boards", "must be a list of at least one board, each starting with '- name:'")
    if len(entries) > MAX_BOARDS:
        top.refuse("boards", f"{len(entries)} boards are more than the {MAX_BOARDS} allowed")
    names: set[str] = set()
    boards = []
    for number, entry in enumerate(entries, start=1):
        board = _board(where, number, entry, alone=len(entries) == 1)
        if board.name in names:
            raise TargetError(
                f"{where}, board {quoted(board.name)}, name: another board has it too"
            )
        names.add(board.name)
        boards.append(board)
    _refuse_shared_markers(where, boards)
    _refuse_shared_places(where, boards)
    target = Target(units=units, boards=tuple(boards))
    return target.in_mirror() if mirrored else target


def _plain(value: object) -> Any:
    """Data as a file holds them: lists for tuples and arrays, Python's numbers for numpy's."""
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise TargetError(f"target: the key {quoted(key)} must be text")
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return value


class _Section:
    """One mapping of the file, with where it is, so that every refusal can say so."""

    def __init__(self, where: str, data: dict[str, Any]) -> None:
        self.where = where
        self.data = data

    def refuse(self, key: str, what: str) -> NoReturn:
        raise TargetError(f"{self.where}, {key}: {what}")

    def allow_only(self, keys: Iterable[str], owner: str) -> None:
        keys = tuple(keys)
        for key in self.data:
            if key not in keys:
                raise TargetError(
                    f"{self.where}: unknown key {quoted(key)} for {owner}: "
                    f"{did_you_mean(key, keys)}"
                )

    def required(self, key: str, hint: str) -> Any:
        if self.data.get(key) is None:
            raise TargetError(f"{self.where}: {key} is missing: {hint}")
        return self.data[key]

    def text(self, key: str, hint: str) -> str:
        value = self.required(key, hint)
        if isinstance(value, int | float) and not isinstance(value, bool):
            self.refuse(key, f"must be text: write it in quotes, {key}: '{value}'")
        if not isinstance(value, str):
            self.refuse(key, "must be text")
        if not value.strip() or value != value.strip():
            self.refuse(key, "must be text that does not start or end with a blank")
        if not value.isprintable() or len(value) > 100:
            self.refuse(key, "must be printable text of at most 100 characters")
        return value

    def choice(self, key: str, known: Iterable[str], hint: str) -> str:
        value = self.text(key, hint)
        if value not in (known := tuple(known)):
            self.refuse(key, f"{quoted(value)} is not known: {did_you_mean(value, known)}")
        return value

    def length(self, key: str, hint: str) -> float:
        value = self.required(key, hint)
        if not _is_number(value) or not MIN_LENGTH <= value <= MAX_LENGTH:
            self.refuse(key, f"must be a positive, finite number, not {quoted(value)}")
        return float(value)

    def counts(self, key: str, what: str) -> tuple[int, int]:
        value = self.required(key, hint=f"[columns, rows], {what}")
        if (
            not isinstance(value, list)
            or len(value) != 2
            or not all(isinstance(n, int) and not isinstance(n, bool) for n in value)
        ):
            self.refuse(key, f"must be two whole numbers, [columns, rows], {what}")
        if not all(2 <= n <= MAX_COUNT for n in value):
            self.refuse(key, f"{value} must both lie within 2 to {MAX_COUNT} ({what})")
        return value[0], value[1]

    def flag(self, key: str) -> bool:
        value = self.data.get(key, False)
        if not isinstance(value, bool):
            self.refuse(key, f"must be true or false, not {quoted(value)}")
        return value

    def marker_id(self, key: str) -> int:
        value = self.data.get(key, 0)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 1_000_000:
            self.refuse(key, f"must be a marker's id, 0 or more, not {quoted(value)}")
        return value

    def pair(self, key: str, limit: float) -> FloatArray:
        value = self.data.get(key) or [0.0, 0.0]
        if (
            not isinstance(value, list)
            or len(value) != 2
            or not all(_is_number(x) and abs(x) <= limit for x in value)
        ):
            self.refuse(key, f"must be two finite numbers, [along x, along y], within ±{limit:g}")
        return np.array(value, float)

    def vector(self, key: str, hint: str) -> FloatArray:
        value = self.required(key, hint)
        if not _is_point(value):
            self.refuse(key, "must be three finite numbers, [x, y, z]")
        return np.array(value, float)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_point(value: object) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 3
        and all(_is_number(x) and abs(x) <= MAX_LENGTH for x in value)
    )


_PLACE_KEYS = ("origin", "x_axis", "y_axis")
_SHAPE_KEYS = ("bend", "twist", "stretch", "offsets")
_KEYS: dict[str, tuple[str, ...]] = {
    "checkerboard": ("corners", "square", "first_square", *_PLACE_KEYS, *_SHAPE_KEYS),
    "charuco": (
        "corners", "square", "first_square", "dictionary", "marker", "first_marker", "inverted",
        *_PLACE_KEYS, *_SHAPE_KEYS,
    ),
    "aprilgrid": (
        "tags", "tag", "spacing", "family", "first_marker", *_PLACE_KEYS, *_SHAPE_KEYS,
    ),
    "points": ("points", "offsets"),
}  # fmt: skip


def _board(path: str, number: int, entry: object, *, alone: bool) -> Board:
    where = f"{path}, board {number}"
    if not isinstance(entry, dict):
        raise TargetError(f"{where}: must be a mapping that starts with name: and type:")
    section = _Section(where, entry)
    name = section.text("name", hint="a name that no other board has")
    section.where = f"{path}, board {quoted(name)}"
    kind = section.choice("type", get_args(BoardKind), hint="one of " + ", ".join(_KEYS))
    section.allow_only(("name", "type", *_KEYS[kind]), f"a board of type {kind}")
    if kind == "points":
        return _points_board(section, name)
    origin, x_axis, y_axis = _place(section, alone=alone)
    if kind == "aprilgrid":
        tag_columns, tag_rows = section.counts("tags", "tags along x and along y")
        side = section.length("tag", hint="the side of a tag, black border included")
        spacing = section.length("spacing", hint="gap between tags divided by the side of a tag")
        family = "tag36h11"
        if "family" in entry:
            family = section.choice("family", TAG_FAMILIES, hint="such as tag36h11")
        markers = _markers(section, TAG_FAMILIES[family], side, tag_columns * tag_rows)
        return Board(
            name=name,
            kind="aprilgrid",
            columns=2 * tag_columns,
            rows=2 * tag_rows,
            square=side,
            origin=origin,
            x_axis=x_axis,
            y_axis=y_axis,
            markers=markers,
            spacing=spacing,
            shape=_shape(section, 2 * tag_columns, 2 * tag_rows),
        )
    columns, rows = section.counts("corners", "inner corners, not squares")
    square = section.length("square", hint="the side of a square")
    inverted = kind == "charuco" and section.flag("inverted")
    # As OpenCV lays boards out: the first square is one without a marker.
    first: FirstSquare = "light" if inverted else "dark"
    if "first_square" in entry:
        light = section.choice("first_square", get_args(FirstSquare), hint="dark or light")
        first = "light" if light == "light" else "dark"
    charuco_markers = None
    if kind == "charuco":
        dictionary = section.choice(
            "dictionary", MARKER_DICTIONARIES, hint="the markers' family, such as DICT_5X5_250"
        )
        side = section.length("marker", hint="the side of a marker")
        if side >= square:
            section.refuse("marker", f"{side:g} must be smaller than the square, {square:g}")
        count = int(_marker_squares(columns, rows, first, inverted=inverted).sum())
        charuco_markers = replace(_markers(section, dictionary, side, count), inverted=inverted)
    return Board(
        name=name,
        kind="charuco" if kind == "charuco" else "checkerboard",
        columns=columns,
        rows=rows,
        square=square,
        origin=origin,
        x_axis=x_axis,
        y_axis=y_axis,
        first_square=first,
        markers=charuco_markers,
        shape=_shape(section, columns, rows),
    )


def _points_board(section: _Section, name: str) -> Board:
    value = section.required("points", hint="a list of [x, y, z]")
    if not isinstance(value, list) or len(value) < 2:
        section.refuse("points", "must be a list of at least two points, each [x, y, z]")
    for index, point in enumerate(value):
        if not _is_point(point):
            section.refuse("points", f"point {index} must be three finite numbers, [x, y, z]")
    points = np.array(value, float)
    order = np.lexsort(points.T)
    twins = np.flatnonzero((np.diff(points[order], axis=0) == 0).all(axis=1))
    if twins.size:
        a, b = sorted(order[twins[0] : twins[0] + 2])
        section.refuse("points", f"points {a} and {b} are in the same place")
    return Board(
        name=name,
        kind="points",
        columns=len(points),
        rows=1,
        square=0.0,
        origin=np.zeros(3),
        x_axis=np.array([1.0, 0.0, 0.0]),
        y_axis=np.array([0.0, 1.0, 0.0]),
        points=points,
        shape=_shape(section, len(points), 1),
    )


def _shape(section: _Section, columns: int, rows: int) -> BoardShape | None:
    """The keys that a calibration adds to a refined target; None where there are none."""
    if not any(section.data.get(key) is not None for key in _SHAPE_KEYS):
        return None
    offsets = np.zeros((rows, columns, 3))
    entries = section.data.get("offsets") or []
    hint = "a list of [column, row, along x_axis, along y_axis, into the board]"
    if not isinstance(entries, list):
        section.refuse("offsets", f"must be {hint}")
    for entry in entries:
        if (
            not isinstance(entry, list)
            or len(entry) != 5
            or not _is_corner(entry[0], columns)
            or not _is_corner(entry[1], rows)
            or not _is_point(entry[2:])
        ):
            section.refuse("offsets", f"{quoted(entry)} does not fit: {hint}")
        offsets[entry[1], entry[0]] = entry[2:]
    twist = section.data.get("twist", 0.0)
    if not _is_number(twist) or not abs(twist) <= MAX_LENGTH:
        section.refuse("twist", f"must be a finite number, not {quoted(twist)}")
    return BoardShape(
        bend=section.pair("bend", MAX_LENGTH),
        twist=float(twist),
        stretch=section.pair("stretch", 0.5),
        offsets=offsets,
    )


def _shape_in_mirror(board: Board) -> BoardShape | None:
    """A board's shape as a mirror shows it: columns run the other way."""
    shape = board.shape
    if shape is None:
        return None
    if board.points is not None:
        return replace(shape, offsets=shape.offsets * [1, 1, -1])
    return replace(shape, twist=-shape.twist, offsets=shape.offsets[:, ::-1] * [-1, 1, 1])


def _is_corner(value: object, count: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < count


def _place(section: _Section, *, alone: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Origin and orthonormal axes; a board that is alone lies in the world's z = 0 plane."""
    given = [key for key in _PLACE_KEYS if section.data.get(key) is not None]
    if alone and "x_axis" not in given and "y_axis" not in given:
        section.data = {**section.data, "x_axis": [1, 0, 0], "y_axis": [0, 1, 0]}
    if alone and "origin" not in given:
        section.data = {**section.data, "origin": [0, 0, 0]}
    hint = "a target of several boards needs origin, x_axis and y_axis for each"
    if alone:
        hint = "x_axis and y_axis go together"
    origin, x_axis, y_axis = (section.vector(key, hint) for key in _PLACE_KEYS)
    for key, axis in (("x_axis", x_axis), ("y_axis", y_axis)):
        norm = float(np.linalg.norm(axis))
        if abs(norm - 1) > AXES_TOLERANCE:
            section.refuse(key, f"must have length 1 (to {AXES_TOLERANCE:g}), not {norm:.6g}")
    cosine = float(x_axis @ y_axis)
    if abs(cosine) > AXES_TOLERANCE:
        angle = math.degrees(math.acos(min(1.0, max(-1.0, cosine))))
        section.refuse("y_axis", f"must be at a right angle to x_axis, not at {angle:.2f} degrees")
    # The nearest orthonormal pair: the polar factor, which favours neither axis.
    left, _, right = np.linalg.svd(np.stack([x_axis, y_axis]), full_matrices=False)
    x_axis, y_axis = left @ right
    return origin, x_axis, y_axis


def _markers(section: _Section, dictionary: str, side: float, count: int) -> Markers:
    first = section.marker_id("first_marker")
    available = MARKER_DICTIONARIES[dictionary]
    if first + count > available:
        section.refuse(
            "first_marker",
            f"the board carries {count} markers, ids {first} to {first + count - 1}, "
            f"but {dictionary} has only {available}: choose a larger family",
        )
    return Markers(dictionary=dictionary, side=side, first=first, count=count)


def _marker_squares(
    columns: int, rows: int, first_square: FirstSquare, *, inverted: bool
) -> npt.NDArray[np.bool_]:
    """(rows + 1, columns + 1): which squares of a board of inner corners carry markers."""
    row, column = np.indices((rows + 1, columns + 1))
    first = (first_square == "light") != inverted
    carries: npt.NDArray[np.bool_] = (row + column) % 2 == (0 if first else 1)
    return carries


def _refuse_shared_markers(path: str, boards: list[Board]) -> None:
    for one, other in combinations([board for board in boards if board.markers], 2):
        a, b = one.markers, other.markers
        if a is None or b is None or a.dictionary != b.dictionary:
            continue
        low, high = max(a.first, b.first), min(a.first + a.count, b.first + b.count) - 1
        if low <= high:
            raise TargetError(
                f"{path}, board {quoted(other.name)}, first_marker: ids {low} to {high} are on "
                f"board {quoted(one.name)} too: every marker may be there only once"
            )


def _refuse_shared_places(path: str, boards: list[Board]) -> None:
    for one, other in combinations(boards, 2):
        if _in_the_same_place(one, other):
            key = "points" if other.kind == "points" else "origin"
            raise TargetError(
                f"{path}, board {quoted(other.name)}, {key}: it is in the same place as "
                f"board {quoted(one.name)}"
            )


def _in_the_same_place(one: Board, other: Board) -> bool:
    """Whether two faces cover each other: same plane, same side, outlines that overlap.

    A plate printed on both sides is two boards whose faces look away from each other.
    Lists of points are in the same place when one list is part of the other.
    """
    if one.points is not None and other.points is not None:
        few, many = sorted((one.points, other.points), key=len)
        return {tuple(point) for point in few.tolist()} <= {tuple(p) for p in many.tolist()}
    if one.points is not None or other.points is not None:
        return False
    pitch = min(one.square, other.square)
    a, b = _outline(one), _outline(other)
    normal_a = np.cross(one.x_axis, one.y_axis)
    normal_b = np.cross(other.x_axis, other.y_axis)
    if normal_a @ normal_b < 1 - AXES_TOLERANCE:
        return False
    if np.abs((b - one.origin) @ normal_a).max() > 0.1 * pitch:
        return False
    # Two rectangles are apart exactly when a side's direction of either separates them.
    for axis in (one.x_axis, one.y_axis, other.x_axis, other.y_axis):
        if min((a @ axis).max(), (b @ axis).max()) - max((a @ axis).min(), (b @ axis).min()) < (
            0.1 * pitch
        ):
            return False
    return True


def _outline(board: Board) -> FloatArray:
    """World points that span a board: its four outermost corners, or all its points."""
    if board.points is not None:
        return board.points
    last_column, last_row = board.columns - 1, board.rows - 1
    return board.world_points([0, last_column, last_column, 0], [0, 0, last_row, last_row])


def _plane_of(board: Board) -> tuple[FloatArray, FloatArray] | None:
    """A point of the board's plane and its unit normal, or None for points off one plane."""
    if board.points is None:
        return board.origin, np.cross(board.x_axis, board.y_axis)
    middle = board.points.mean(axis=0)
    _, extents, axes = np.linalg.svd(board.points - middle, full_matrices=True)
    if len(extents) == 3 and extents[2] > 1e-6 * extents[0]:
        return None
    return middle, axes[2]


def _same_plane(
    one: tuple[FloatArray, FloatArray], other: tuple[FloatArray, FloatArray], tolerance: float
) -> bool:
    parallel = abs(one[1] @ other[1]) > 1 - AXES_TOLERANCE**2
    return bool(parallel and abs((other[0] - one[0]) @ one[1]) < tolerance)
