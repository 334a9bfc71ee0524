"""Corners of foreign files, named by the target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from cubicfish_cli import reading
from cubicfish_cli.boards.board import Board
from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.observations import (
    Observations,
    first_bad_weight,
    first_outside_photo,
    first_repeated,
    no_such_board,
)
from cubicfish_cli.tables import Table
from cubicfish_cli.target import Target
from cubicfish_cli.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.wording import quoted

# A camera sees boards from the front. Grids that run the wrong way round are refused when so many
# of their cells do: single ones may lie across the rim of a fisheye's picture.
_MIRRORED_SHARE = 0.5
# How a board's ``numbering`` counts its corners, in words.
_HOW = {"rows": "row by row", "rows-from-bottom": "row by row from the lowest row up"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Detections:
    """The corners in one file.

    Attributes:
        path: the file, for messages.
        lines: (N,) the line of each corner.
        images: names of the photos, in order.
        image: (N,) index into ``images``.
        labels: what the file calls the boards; ("",) where it tells no boards apart.
        label: (N,) index into ``labels``.
        number: (N,) the corner's number on its board, from 0.
        pixel: (N, 2).
        weight: (N,) relative weight of the corner's squared error.
        left_out: how many corners the file itself declares as not found.
        by_tags: whether numbers are four for each tag of an aprilgrid: bottom left, bottom right,
            top right, top left. Else they go by the board's own ``numbering``.
        cameras: whether the photos' names start with a camera's and a slash.

    """

    path: Path
    lines: IntArray
    images: tuple[str, ...]
    image: IntArray
    labels: tuple[str, ...]
    label: IntArray
    number: IntArray
    pixel: FloatArray
    weight: FloatArray
    left_out: int
    by_tags: bool = False
    cameras: bool = False

    def refuse(self, row: int, what: str) -> CorrespondenceError:
        """The error about a corner (by its index)."""
        return CorrespondenceError(f"{self.path}, line {self.lines[row]}: {what}")


def read_text(path: Path, *, max_bytes: int) -> str:
    """The text of a file of at most ``max_bytes``.

    Raises:
        CorrespondenceError: the file cannot be read, is larger, or is not text.

    """
    return reading.read_text(path, max_bytes=max_bytes, error=CorrespondenceError)


def rows_where(table: Table, keep: BoolArray) -> Table:
    """Some rows of a table."""
    index = np.flatnonzero(keep).tolist()
    return replace(
        table,
        columns={name: [column[i] for i in index] for name, column in table.columns.items()},
        lines=[table.lines[i] for i in index],
    )


def select_images(found: Detections, pattern: str) -> Detections:
    """The corners in photos whose names match a glob."""
    wanted = np.array([fnmatchcase(name, pattern) for name in found.images], bool)
    names = [name for name, chosen in zip(found.images, wanted, strict=True) if chosen]
    keep = wanted[found.image] if len(found.image) else np.zeros(0, bool)
    place = np.cumsum(wanted) - 1
    return replace(
        found,
        lines=found.lines[keep],
        images=tuple(names),
        image=place[found.image[keep]].astype(np.intp),
        label=found.label[keep],
        number=found.number[keep],
        pixel=found.pixel[keep],
        weight=found.weight[keep],
    )


def named_corners(
    files: Sequence[Detections],
    target: Target,
    *,
    boards: Mapping[str, str],
    image_size: tuple[int, int],
) -> Observations:
    """The corners of several files, named by the target's boards, columns and rows.

    Args:
        files: what was read.
        target: the calibration target.
        boards: the target's board for what a file calls one; "" for files that tell none apart.
            What is not in it is looked up: a board of that name, ``board`` and that name, or the
            board in that place of the target, from 0.
        image_size: (width, height) of the photos, which no such file states.

    Raises:
        CorrespondenceError: the files do not fit the target or one another; one line that names
            the file and, where it is about one corner, the line.

    """
    images: dict[str, int] = {}
    parts: list[tuple[IntArray, IntArray, IntArray, IntArray]] = []
    for found in files:
        _refuse_known_images(found, images)
        place = np.array([images.setdefault(name, len(images)) for name in found.images], np.intp)
        board = _boards(found, target, boards)
        column, row = np.empty_like(found.number), np.empty_like(found.number)
        for index, one in enumerate(target.boards):
            here = np.flatnonzero(board == index)
            if here.size:
                column[here], row[here] = _place(found, one, here)
        image = place[found.image] if len(found.image) else found.image
        _refuse_twice(found, image, board, column, row)
        _refuse_pixels(found, image_size)
        for index, one in enumerate(target.boards):
            here = np.flatnonzero(board == index)
            if here.size and _mirrored(
                one, image[here], column[here], row[here], found.pixel[here]
            ):
                how = "four a tag" if found.by_tags else _HOW[one.numbering]
                raise CorrespondenceError(
                    f"{found.path}: board {quoted(one.name)} is seen from behind if its corners "
                    f"are numbered {how}: number them so, from the target's corner (0, 0)"
                )
        parts.append((image, board, column, row))
    if not sum(len(found.image) for found in files):
        raise CorrespondenceError(f"{files[0].path}: no corner in it is declared as found")
    image, board, column, row = (np.concatenate(part) for part in zip(*parts, strict=True))
    used = np.unique(image)
    names = list(images)
    return Observations(
        image_size=image_size,
        images=tuple(names[i] for i in used.tolist()),
        boards=target.board_names,
        image=np.searchsorted(used, image).astype(np.intp),
        board=board,
        column=column,
        row=row,
        pixel=np.concatenate([found.pixel for found in files]),
        weight=np.concatenate([found.weight for found in files]),
        world=target.world_points(board, column, row),
        target=target,
    )


def _refuse_known_images(found: Detections, known: Mapping[str, int]) -> None:
    for name in found.images:
        if name in known:
            raise CorrespondenceError(
                f"{found.path}: another file holds the corners of {quoted(name)} already: "
                "leave one of them out"
            )


def _boards(found: Detections, target: Target, given: Mapping[str, str]) -> IntArray:
    """The target's board of each corner."""
    places = np.zeros(len(found.labels), np.intp)
    for index, label in enumerate(found.labels):
        name = given.get(label) or _likely_board(label, target)
        if name is None:
            said = f"board {quoted(label)}" if label else "boards that it does not tell apart"
            option = f"--board {quoted(label)[1:-1]}=NAME" if label else "--board NAME"
            shown = ", ".join(quoted(name) for name in target.board_names[:8])
            raise CorrespondenceError(
                f"{found.path}: it has {said}, and which of the target's ({shown}) "
                f"is not known: say so with {option}"
            )
        if name not in target.board_names:
            raise CorrespondenceError(no_such_board(name, target))
        places[index] = target.board_names.index(name)
    board: IntArray = places[found.label] if len(found.label) else found.label
    return board


def _likely_board(label: str, target: Target) -> str | None:
    names = target.board_names
    if not label:
        return names[0] if len(names) == 1 else None
    for name in (label, f"board{label}"):
        if name in names:
            return name
    # A place in the target means something only where no board bears a number as its name.
    numbered = any(name.removeprefix("board").isdigit() for name in names)
    if label.isascii() and label.isdigit() and len(label) < 6 and not numbered:
        return names[int(label)] if int(label) < len(names) else None
    return None


def _place(found: Detections, board: Board, here: IntArray) -> tuple[IntArray, IntArray]:
    """Columns and rows of corners of a board (their indices)."""
    number = _counted(found, board, here)
    if found.by_tags:
        tag, corner = np.divmod(number, 4)
        up, across = np.divmod(tag, board.columns // 2)
        column = 2 * across + ((corner == 1) | (corner == 2))
        return column, board.rows - 1 - (2 * up + (corner >= 2))
    row, column = np.divmod(number, board.columns)
    return column, board.rows - 1 - row if board.numbering == "rows-from-bottom" else row


def _counted(found: Detections, board: Board, here: IntArray) -> IntArray:
    """The corners' numbers, from the board's own first one."""
    number = found.number[here]
    if found.by_tags:
        if board.per_cell != 2 or board.markers is None:
            raise CorrespondenceError(
                f"{found.path}: corners are numbered by tags, and board {quoted(board.name)} of "
                "the target is not an aprilgrid"
            )
        number = number - 4 * board.markers.first
    outside = np.flatnonzero((number < 0) | (number >= board.columns * board.rows))
    if outside.size:
        first = here[outside[0]]
        raise found.refuse(
            int(first),
            f"corner {found.number[first]} is outside board {quoted(board.name)} with "
            f"{board.columns}x{board.rows} corners: "
            "does the target say how many corners there are along x and along y?",
        )
    return number


def _refuse_twice(found: Detections, *keys: IntArray) -> None:
    twice = first_repeated(*keys)
    if twice is not None:
        raise found.refuse(
            twice[1], f"the same corner as in line {found.lines[twice[0]]}: keep one of them"
        )


def _refuse_pixels(found: Detections, size: tuple[int, int]) -> None:
    outside = first_outside_photo(found.pixel, size)
    if outside is not None:
        raise found.refuse(outside[0], f"{outside[1]}: is the size right?")
    bad = first_bad_weight(found.weight)
    if bad is not None:
        raise found.refuse(*bad)


def _mirrored(
    board: Board, image: IntArray, column: IntArray, row: IntArray, pixel: FloatArray
) -> bool:
    """Whether a board's grids run the wrong way round in the photos, as if seen from behind."""
    if board.points is not None:
        return False
    # One more column and row than there are, so that a neighbour never wraps around.
    stride = board.columns + 1
    key = (image * (board.rows + 1) + row) * stride + column
    order = np.argsort(key)
    key, pixel = key[order], pixel[order]
    right, below = (_find(key, key + step) for step in (1, stride))
    cell = np.flatnonzero((right >= 0) & (below >= 0))
    along, down = pixel[right[cell]] - pixel[cell], pixel[below[cell]] - pixel[cell]
    area = along[:, 0] * down[:, 1] - along[:, 1] * down[:, 0]
    return bool(cell.size and (area < 0).mean() > _MIRRORED_SHARE)


def _find(keys: IntArray, wanted: IntArray) -> IntArray:
    """Where each wanted key stands among sorted keys; -1 where it is not."""
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return np.where(keys[place] == wanted, place, -1)
