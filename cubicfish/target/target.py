"""``target.yaml`` -> Target: the boards of the calibration target and their world points."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish.errors import TargetError
from cubicfish.files.plain_yaml import load_plain_yaml, plain_yaml_text
from cubicfish.target.boards.board import Board
from cubicfish.target.boards.section import AXES_TOLERANCE, Section
from cubicfish.target.boards.types import BOARD_TYPES
from cubicfish.types import FloatArray, IntArray
from cubicfish.units import explain_unknown
from cubicfish.wording import Brief, did_you_mean, quoted

# A refined target of some ten thousand corners, each with its offset.
MAX_BYTES = 4_000_000
MAX_BOARDS = 256
# How far apart boards of unknown places are taken to be, by the size of the largest.
_APART = 10.0


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Target(Brief):
    """A rigid calibration target: several boards in one world frame, in one unit of length."""

    units: str
    boards: tuple[Board, ...]

    @classmethod
    def load(cls, path: Path | str) -> Target:
        """Read ``target.yaml``.

        Raises:
            TargetError: the file cannot be read or does not describe a usable target; the text
                names the file, the board and the key.

        """
        return cls.from_data(cls.load_data(path), str(path))

    @staticmethod
    def load_data(path: Path | str) -> Any:
        """The plain data of a target file, whatever they hold.

        Raises:
            TargetError: the file cannot be read, or is of a camera.

        """
        data = load_plain_yaml(
            Path(path), error=TargetError, max_bytes=MAX_BYTES, if_empty=_NO_TARGET
        )
        if isinstance(data, dict) and "cubicfish" in data and "boards" not in data:
            raise TargetError(f"{path} is a camera file, not a calibration target: {_NO_TARGET}")
        return data

    def text(self) -> str:
        """The text of its file, which :meth:`load` reads back."""
        boards = [board.as_record() for board in self.as_printed().boards]
        mirrored = {"mirrored": True} if self.mirrored else {}
        return plain_yaml_text({"units": self.units, **mirrored, "boards": boards})

    @classmethod
    def from_data(cls, data: Mapping[str, Any], where: str = "target") -> Target:
        """The target that plain data describe: the keys and values of ``target.yaml``.

        Args:
            data: the keys and values.
            where: what messages about them begin with.

        Raises:
            TargetError: a key is missing or unknown, or a value is not usable; one line that
                names the board and the key.

        """
        try:
            plain = json.loads(json.dumps(data, default=_convert_array))
        except (TypeError, ValueError, RecursionError) as problem:
            raise TargetError(f"{where}: must hold plain data: {problem}") from problem
        return _make_target(where, plain)

    @cached_property
    def board_names(self) -> tuple[str, ...]:
        """The boards' names, in the file's order."""
        return tuple(board.name for board in self.boards)

    def board(self, name: str, *, flat: bool = False) -> Board:
        """The board of this name.

        Args:
            name: one of :attr:`board_names`.
            flat: whether it must have a plane.

        Raises:
            TargetError: there is none, and the text names the nearest; or it has no plane.

        """
        if name not in self.board_names:
            near = did_you_mean(name, self.board_names)
            raise TargetError(f"board {quoted(name)} is not in the target: {near}")
        one = self.boards[self.board_names.index(name)]
        if flat and one.points is not None:
            what = f"board {quoted(name)} is a list of points and has no plane"
            raise TargetError(what, do="name a board with a grid")
        return one

    def with_boards(self, boards: Mapping[int, Board]) -> Target:
        """The target with other boards in place of those with these indices."""
        changed = (boards.get(index, board) for index, board in enumerate(self.boards))
        return replace(self, boards=tuple(changed))

    @property
    def unplaced(self) -> tuple[str, ...]:
        """Names of the boards of which nobody knows where they are."""
        return tuple(board.name for board in self.boards if board.unplaced)

    @property
    def has_markers(self) -> bool:
        """Whether any board carries markers."""
        return any(board.markers is not None for board in self.boards)

    @property
    def has_only_markers(self) -> bool:
        """Whether all boards have markers that name their corners."""
        return all(board.markers is not None for board in self.boards)

    @property
    def mirrored(self) -> bool:
        """Whether this is the target as a mirror shows it, as with ``mirrored: true``."""
        return any(board.mirrored for board in self.boards)

    def in_mirror(self) -> Target:
        """The mirror image of the target; the image of an image is the target."""
        return replace(self, boards=tuple(board.in_mirror() for board in self.boards))

    def as_printed(self) -> Target:
        """The target itself, whether or not photos show it in a mirror."""
        return self.in_mirror() if self.mirrored else self

    def moved(self, offset: FloatArray) -> Target:
        """The target with ``offset`` (3,), in the target's units, added to all its points."""
        if not offset.any():
            return self
        return replace(self, boards=tuple(board.moved(offset) for board in self.boards))

    def with_flat_boards(self) -> Target:
        """The target with plane boards: without the shapes that a calibration found."""
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


_NO_TARGET = (
    "name the target.yaml that says where the boards are, or make one with 'cubicfish target print'"
)


def _make_target(where: str, data: object) -> Target:
    if not isinstance(data, dict):
        raise TargetError(f"{where} must hold the keys units and boards: {_NO_TARGET}")
    top = Section(where, data)
    top.allow_only(("units", "boards", "mirrored"), "a target file")
    mirrored = top.flag("mirrored")
    units = top.text("units", hint="the unit of every length in it, such as mm")
    if unknown := explain_unknown(units):
        top.refuse("units", unknown)
    entries = top.required("boards", hint="a list of boards")
    if not isinstance(entries, list) or not entries:
        top.refuse("boards", "must be a list of at least one board, each starting with '- name:'")
    if len(entries) > MAX_BOARDS:
        top.refuse("boards", f"{len(entries)} boards are more than the {MAX_BOARDS} allowed")
    names: set[str] = set()
    boards = []
    for number, entry in enumerate(entries, start=1):
        board = _make_board(where, number, entry, units, alone=len(entries) == 1)
        if board.name in names:
            raise TargetError(
                f"{where}, board {quoted(board.name)}, name: another board has it too"
            )
        names.add(board.name)
        boards.append(board)
    boards = _laid_out(boards)
    _refuse_overlaps(where, boards)
    target = Target(units=units, boards=tuple(boards))
    return target.in_mirror() if mirrored else target


def _laid_out(boards: Sequence[Board]) -> list[Board]:
    """Boards of unknown places beside each other, far from the others.

    Where no place is known, the first board is the world's plane z = 0.
    """
    placed = [board for board in boards if not board.unplaced]
    if not placed:
        placed, boards = [replace(boards[0], unplaced=False)], [*boards]
        boards[0] = placed[0]
    sizes = [float(np.abs(board.outline()).max()) for board in boards]
    step = _APART * max(max(sizes), 1.0)
    return [
        replace(board, origin=np.array([step * number, 0.0, 0.0])) if board.unplaced else board
        for number, board in enumerate(boards, start=1)
    ]


def _convert_array(value: object) -> Any:
    """A numpy array or number as Python has it."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{quoted(value)} is something else")


def _make_board(path: str, number: int, entry: object, units: str, *, alone: bool) -> Board:
    where = f"{path}, board {number}"
    if not isinstance(entry, dict):
        raise TargetError(f"{where}: must be a mapping that starts with name: and type:")
    section = Section(where, entry, units)
    name = section.text("name", hint="a name that no other board has")
    section.where = f"{path}, board {quoted(name)}"
    kind = section.choice("type", BOARD_TYPES, hint="one of " + ", ".join(BOARD_TYPES))
    return BOARD_TYPES[kind].read(section, name, alone=alone)


def _refuse_overlaps(where: str, boards: Sequence[Board]) -> None:
    """Refuse markers that two boards carry, and two boards in one place.

    Raises:
        TargetError: there are such boards.

    """
    for one, other in combinations(boards, 2):
        a, b = one.markers, other.markers
        if a is None or b is None or a.dictionary != b.dictionary:
            continue
        low, high = max(a.first, b.first), min(a.first + a.count, b.first + b.count) - 1
        if low <= high:
            raise TargetError(
                f"{where}, board {quoted(other.name)}, first_marker: ids {low} to {high} are on "
                f"board {quoted(one.name)} too: every marker may be there only once"
            )
    for one, other in combinations(boards, 2):
        if _in_the_same_place(one, other):
            key = "origin" if other.points is None else "points"
            raise TargetError(
                f"{where}, board {quoted(other.name)}, {key}: it is in the same place as "
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
    a, b = one.outline(), other.outline()
    if one.axes[2] @ other.axes[2] < 1 - AXES_TOLERANCE:
        return False
    if np.abs((b - one.origin) @ one.axes[2]).max() > 0.1 * pitch:
        return False
    # Two rectangles are apart exactly when a side's direction of either separates them.
    for axis in (one.x_axis, one.y_axis, other.x_axis, other.y_axis):
        if min((a @ axis).max(), (b @ axis).max()) - max((a @ axis).min(), (b @ axis).min()) < (
            0.1 * pitch
        ):
            return False
    return True
