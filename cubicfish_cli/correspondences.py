"""Named corners, their known world points, and the CSV files that hold either.

``Corners`` is what a detector found: which corner of which board is where in which photo.
``Correspondences`` is what a fit needs: world points and pixels. Both keep one row a corner
in flat arrays, since all the maths runs over all corners at once.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from cubicfish_cli.arrays import Refusal
from cubicfish_cli.boards.board import Board
from cubicfish_cli.errors import CorrespondenceError
from cubicfish_cli.files import write_text
from cubicfish_cli.tables import Table, csv_text, read_table
from cubicfish_cli.target import Target
from cubicfish_cli.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.wording import did_you_mean, quoted

# Stands for as many True as there are rows, where nothing is said of certainty.
_ALL_CERTAIN: BoolArray = np.ones(0, bool)


@dataclass(frozen=True, kw_only=True, eq=False)
class Corners:
    """Corners found in photos, named by board, column and row.

    Attributes:
        image_size: (width, height) of every photo, pixels.
        images: names of the photos, in order.
        boards: names of the boards, in the target's order.
        image: (N,) index into ``images``.
        board: (N,) index into ``boards``.
        column, row: (N,) the corner's place on its board.
        pixel: (N, 2) x, y in pixels.
        weight: (N,) relative weight, 1 where nothing else is known.
        certain: (N,) whether it is surely this corner; by default all are. Where too little of a
            board was seen, its corners may be others of the same plane, some squares further on:
            as good for a lens, but they do not measure the object.
        target: the object that they are of; None where only their names are known.

    """

    image_size: tuple[int, int]
    images: tuple[str, ...]
    boards: tuple[str, ...]
    image: IntArray
    board: IntArray
    column: IntArray
    row: IntArray
    pixel: FloatArray
    weight: FloatArray
    certain: BoolArray = field(default_factory=lambda: _ALL_CERTAIN)
    target: Target | None = None

    def __post_init__(self) -> None:
        """Fill in certainty where nothing is said of it."""
        _fill_in_certain(self)

    @classmethod
    def from_arrays(
        cls,
        places: Iterable[npt.ArrayLike],
        pixel: Iterable[npt.ArrayLike],
        image_size: Sequence[int],
        *,
        boards: Sequence[str],
        images: Sequence[str] | None = None,
        weight: Iterable[npt.ArrayLike] | None = None,
    ) -> Corners:
        """Corners that any detector found, from plain arrays, one of each kind a photo.

        Args:
            places: for each photo (N, 3) whole numbers: index into ``boards``, column, row.
            pixel: for each photo (N, 2) x, y of the same corners, pixels.
            image_size: (width, height) of every photo, pixels.
            boards: the boards' names, as in the target.
            images: the photos' names; by default ``photo_0``, ``photo_1`` and so on.
            weight: for each photo (N,) relative weights above 0; by default 1.

        Raises:
            CorrespondenceError: an array has another shape, another number of rows than its
                fellow, or numbers that cannot be; one line that says which and where.

        """
        names = _REFUSAL.names(boards, "boards")
        found = [_REFUSAL.places(one, f"places[{i}]", 3) for i, one in _listed(places, "places")]
        size, photos, image, own, weights = _photos_of(found, pixel, image_size, images, weight)
        place = np.concatenate(found)
        bad = np.flatnonzero(place[:, 0] >= len(names))
        if bad.size:
            raise CorrespondenceError(
                f"places[{image[bad[0]]}]: board {place[bad[0], 0]} is not one of the "
                f"{len(names)} boards, counted from 0"
            )
        _, first, count = np.unique(
            np.column_stack([image, place]), axis=0, return_index=True, return_counts=True
        )
        if (count > 1).any():
            twice = first[count > 1][0]
            raise CorrespondenceError(
                f"places[{image[twice]}]: the corner {place[twice].tolist()} is there twice: "
                "keep one of them"
            )
        return cls(
            image_size=size,
            images=photos,
            boards=names,
            image=image,
            board=place[:, 0],
            column=place[:, 1],
            row=place[:, 2],
            pixel=own,
            weight=weights,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Correspondences:
    """2D-3D pairs: the paper's M ↔ m.

    Attributes:
        image_size: (width, height) of every photo, pixels.
        images: names of the photos, in order.
        boards: names of the boards; empty when the pairs came without a target.
        image: (N,) index into ``images``, non-decreasing (pairs are kept sorted by photo).
        world: (N, 3) points in the world frame, in the target's units.
        pixel: (N, 2) x, y in pixels.
        weight: (N,) relative weight.
        board: (N,) index into ``boards``, or -1 without a target.
        column, row: (N,) the corner's place on its board; without a target the column is
            the row's number in the file and the row is 0.
        certain: (N,) whether it is surely this corner, as in :class:`Corners`.

    """

    image_size: tuple[int, int]
    images: tuple[str, ...]
    boards: tuple[str, ...]
    image: IntArray
    world: FloatArray
    pixel: FloatArray
    weight: FloatArray
    board: IntArray
    column: IntArray
    row: IntArray
    certain: BoolArray = field(default_factory=lambda: _ALL_CERTAIN)

    def __post_init__(self) -> None:
        """Fill in certainty where nothing is said of it."""
        _fill_in_certain(self)

    @property
    def uncertain_images(self) -> tuple[str, ...]:
        """Photos with corners that may be others than they are named as."""
        return tuple(self.images[image] for image in np.unique(self.image[~self.certain]))

    @classmethod
    def from_arrays(
        cls,
        world: Iterable[npt.ArrayLike],
        pixel: Iterable[npt.ArrayLike],
        image_size: Sequence[int],
        *,
        images: Sequence[str] | None = None,
        weight: Iterable[npt.ArrayLike] | None = None,
    ) -> Correspondences:
        """2D-3D pairs from plain arrays, one of each kind a photo.

        Args:
            world: for each photo (N, 3) points in the world frame, any unit of length.
            pixel: for each photo (N, 2) x, y of the same points, pixels.
            image_size: (width, height) of every photo, pixels.
            images: the photos' names; by default ``photo_0``, ``photo_1`` and so on.
            weight: for each photo (N,) relative weights above 0; by default 1.

        Returns:
            The pairs; ``column`` is the row's number in its photo's arrays.

        Raises:
            CorrespondenceError: an array has another shape, another number of rows than its
                fellow, or numbers that cannot be; one line that says which and where.

        """
        points = [
            _REFUSAL.numbers(one, f"world[{i}]", 3, limit=MAX_COORDINATE)
            for i, one in _listed(world, "world")
        ]
        size, photos, image, own, weights = _photos_of(points, pixel, image_size, images, weight)
        return cls(
            image_size=size,
            images=photos,
            boards=(),
            image=image,
            world=np.concatenate(points),
            pixel=own,
            weight=weights,
            board=np.full(len(image), -1, np.intp),
            column=np.concatenate([np.arange(len(one), dtype=np.intp) for one in points]),
            row=np.zeros(len(image), np.intp),
        )


Rows = TypeVar("Rows", Corners, Correspondences)
_OF_A_ROW = ("image", "board", "column", "row", "world", "pixel", "weight", "certain")

CORNER_COLUMNS = ("image", "board", "column", "row", "x", "y")
PAIR_COLUMNS = ("image", "X", "Y", "Z", "x", "y")
_CERTAIN = "certain"
# The newest version of each kind of file that is read.
_VERSIONS = {"corners": 2, "correspondences": 1}
MAX_SIDE = 100_000
MAX_COORDINATE = 1e9
_REFUSAL = Refusal(error=CorrespondenceError)


def parse_size(text: str) -> tuple[int, int]:
    """``1280x800`` -> (1280, 800).

    Raises:
        CorrespondenceError: the text is not two positive whole numbers.

    """
    match = re.fullmatch(r"\s*([0-9]{1,6})\s*[xX×]\s*([0-9]{1,6})\s*", text)
    width, height = (int(match[1]), int(match[2])) if match else (0, 0)
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE):
        raise CorrespondenceError(
            f"{quoted(text)} is not an image size: write WIDTHxHEIGHT, such as 1280x800"
        )
    return width, height


def load_corners(
    path: Path | str, target: Target, *, image_size: tuple[int, int] | None = None
) -> Corners:
    """Read ``corners.csv``: pixels (N, 2) and the names of the corners.

    Args:
        path: the file; its first line is ``# cubicfish corners 2, image_size WxH``, or with a 1
            where there is no column ``certain``.
        target: the object that the boards, columns and rows are of.
        image_size: (width, height), for files without that first line.

    Raises:
        CorrespondenceError: the file is malformed or does not fit the target; the text names
            the file and the line.

    """
    table = read_table(
        Path(path),
        required=CORNER_COLUMNS,
        optional=("weight", _CERTAIN),
        error=CorrespondenceError,
    )
    image_size = _image_size(table, "corners", image_size)
    images, image = table.codes("image")
    board = _boards(table, target)
    column, row = table.integers("column"), table.integers("row")
    _refuse_outside_board(table, target, board, column, row)
    _refuse_twice(table, image, board, column, row)
    return Corners(
        image_size=image_size,
        images=images,
        boards=target.board_names,
        image=image,
        board=board,
        column=column,
        row=row,
        pixel=_pixels(table, image_size),
        weight=_weights(table),
        certain=_certain(table),
        target=target,
    )


def save_corners(path: Path | str, corners: Corners, *, overwrite: bool = False) -> None:
    """Write ``corners.csv``, pixels (N, 2) a corner a line; numbers read back exactly.

    Where all names are certain, as nearly always, it is a file of version 1, which every reader
    understands; else of version 2, with the column ``certain``.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    columns = [
        _names(corners.images, corners.image),
        _names(corners.boards, corners.board),
        corners.column.tolist(),
        corners.row.tolist(),
        *corners.pixel.T.tolist(),
    ]
    header: tuple[str, ...] = CORNER_COLUMNS
    version = 1
    if not corners.certain.all():
        header, version = (*header, _CERTAIN), 2
        columns.append(corners.certain.astype(int).tolist())
    _save(Path(path), "corners", header, columns, corners, overwrite, version=version)


def load_correspondences(
    path: Path, *, image_size: tuple[int, int] | None = None
) -> Correspondences:
    """Read ``correspondences.csv``: 2D-3D pairs that need no target.

    Args:
        path: the file; a first line ``# cubicfish correspondences 1, image_size WxH`` may
            give the size.
        image_size: (width, height), for files without that first line.

    Raises:
        CorrespondenceError: the file is malformed, or its image size is not known; the text
            names the file and the line.

    """
    table = read_table(path, required=PAIR_COLUMNS, optional=("weight",), error=CorrespondenceError)
    image_size = _image_size(table, "correspondences", image_size)
    images, image = table.codes("image")
    world = np.stack([table.floats(axis) for axis in ("X", "Y", "Z")], axis=-1)
    bad = np.flatnonzero((np.abs(world) > MAX_COORDINATE).any(axis=1))
    if bad.size:
        table.refuse(bad[0], f"X, Y, Z must lie within ±{MAX_COORDINATE:g}")
    order = np.argsort(image, kind="stable")
    return Correspondences(
        image_size=image_size,
        images=images,
        boards=(),
        image=image[order],
        world=world[order],
        pixel=_pixels(table, image_size)[order],
        weight=_weights(table)[order],
        board=np.full(len(image), -1, np.intp),
        column=np.arange(len(image), dtype=np.intp)[order],
        row=np.zeros(len(image), np.intp),
    )


def save_correspondences(path: Path, pairs: Correspondences, *, overwrite: bool) -> None:
    """Write ``correspondences.csv``; numbers read back exactly.

    Raises:
        OutputError: the file exists and ``overwrite`` is false, or it cannot be written.

    """
    columns = [_names(pairs.images, pairs.image), *pairs.world.T.tolist(), *pairs.pixel.T.tolist()]
    _save(path, "correspondences", PAIR_COLUMNS, columns, pairs, overwrite)


def taken(rows: Rows, which: IntArray | BoolArray) -> Rows:
    """Some of the rows of corners or pairs, in the order of their indices (K,), or by a mask (N,).

    All photos stay listed.
    """
    own = {name: getattr(rows, name)[which] for name in _OF_A_ROW if hasattr(rows, name)}
    return replace(rows, **own)


def in_order(corners: Corners) -> Corners:
    """The corners by photo, board, row and column."""
    return taken(corners, np.lexsort([corners.column, corners.row, corners.board, corners.image]))


def stacked(parts: Sequence[Rows]) -> Rows:
    """The rows of all parts, one after the other; they list the photos and boards of the first."""
    whole: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in _OF_A_ROW
        if hasattr(parts[0], name)
    }
    return replace(parts[0], **whole)


def joined(one: Correspondences, other: Correspondences) -> Correspondences:
    """The pairs of both: other photos of the same object."""
    both = stacked([one, replace(other, image=other.image + len(one.images))])
    return replace(both, images=one.images + other.images)


def pair(corners: Corners, target: Target) -> Correspondences:
    """Give each corner its world point; rows are sorted by photo and else keep their order.

    Raises:
        CorrespondenceError: a board is not in the target, or a corner is outside its board.

    """
    for name in corners.boards:
        if name not in target.board_names:
            raise CorrespondenceError(
                f"board {quoted(name)} is not in the target: "
                f"{did_you_mean(name, target.board_names)}"
            )
    index = np.array([target.board_names.index(name) for name in corners.boards], np.intp)
    order = np.argsort(corners.image, kind="stable")
    board = index[corners.board[order]] if index.size else corners.board[order]
    column, row = corners.column[order], corners.row[order]
    outside = np.flatnonzero(_outside_board(target, board, column, row))
    if outside.size:
        first = outside[0]
        photo = corners.images[corners.image[order][first]]
        raise CorrespondenceError(
            f"{photo}: {_says_outside(target.boards[board[first]], column[first], row[first])}"
        )
    return Correspondences(
        image_size=corners.image_size,
        images=corners.images,
        boards=target.board_names,
        image=corners.image[order],
        world=target.world_points(board, column, row),
        pixel=corners.pixel[order],
        weight=corners.weight[order],
        board=board,
        column=column,
        row=row,
        certain=corners.certain[order],
    )


def _image_size(table: Table, kind: str, given: tuple[int, int] | None) -> tuple[int, int]:
    """The image size from the file's first line, from the caller, or from both if they agree."""
    match = re.fullmatch(r"cubicfish (\w+) ([0-9]+)\s*,\s*image_size\s+(\S+)", table.comment)
    if match is None:
        if given is None:
            raise CorrespondenceError(
                f"{table.name}: the image size is not known: add --size WxH, or start the file "
                f"with the line '# cubicfish {kind} 1, image_size WxH'"
            )
        return given
    if match[1] != kind:
        raise CorrespondenceError(
            f"{table.name}, line 1: a file of {kind} is expected, this one holds {quoted(match[1])}"
        )
    if match[2] not in map(str, range(1, _VERSIONS[kind] + 1)):
        raise CorrespondenceError(
            f"{table.name}, line 1: version {quoted(match[2])[1:-1]} of this format is not known "
            "here: use a newer cubicfish"
        )
    try:
        stated = parse_size(match[3])
    except CorrespondenceError as error:
        raise CorrespondenceError(f"{table.name}, line 1: {error}") from error
    if given is not None and stated != given:
        raise CorrespondenceError(
            f"{table.name}, line 1: the image size is {stated[0]}x{stated[1]} here, "
            f"but {given[0]}x{given[1]} is expected"
        )
    return stated


def _boards(table: Table, target: Target) -> IntArray:
    names, code = table.codes("board")
    index = np.empty(len(names), np.intp)
    for number, name in enumerate(names):
        if name not in target.board_names:
            table.refuse(
                int(np.argmax(code == number)),
                f"board {quoted(name)} is not in the target: "
                f"{did_you_mean(name, target.board_names)}",
            )
        index[number] = target.board_names.index(name)
    board: IntArray = index[code]
    return board


def _outside_board(target: Target, board: IntArray, column: IntArray, row: IntArray) -> BoolArray:
    columns = np.array([one.columns for one in target.boards])[board]
    rows = np.array([one.rows for one in target.boards])[board]
    outside: BoolArray = (column < 0) | (column >= columns) | (row < 0) | (row >= rows)
    return outside


def _says_outside(board: Board, column: int, row: int) -> str:
    return (
        f"column {column}, row {row} is outside board {quoted(board.name)} with "
        f"{board.columns}x{board.rows} corners, counted from 0: "
        "does one of them count squares instead of inner corners?"
    )


def _refuse_outside_board(
    table: Table, target: Target, board: IntArray, column: IntArray, row: IntArray
) -> None:
    outside = np.flatnonzero(_outside_board(target, board, column, row))
    if outside.size:
        first = outside[0]
        table.refuse(first, _says_outside(target.boards[board[first]], column[first], row[first]))


def _refuse_twice(table: Table, *keys: IntArray) -> None:
    order = np.lexsort(keys[::-1])
    same = np.logical_and.reduce([key[order][1:] == key[order][:-1] for key in keys])
    twice = np.flatnonzero(same)
    if twice.size:
        first, second = min((order[i + 1], order[i]) for i in twice)[::-1]
        table.refuse(second, f"the same corner as in line {table.lines[first]}: keep one of them")


def _listed(arrays: Iterable[npt.ArrayLike], name: str) -> list[tuple[int, npt.ArrayLike]]:
    """The arrays of the photos, numbered."""
    one_array = isinstance(arrays, np.ndarray) and arrays.ndim < 3 and arrays.dtype != object
    if one_array or isinstance(arrays, str | bytes) or not isinstance(arrays, Iterable):
        raise CorrespondenceError(f"{name} must be a list of arrays, one for each photo")
    return list(enumerate(arrays))


def _photos_of(
    known: Sequence[FloatArray | IntArray],
    pixel: Iterable[npt.ArrayLike],
    image_size: Sequence[int],
    images: Sequence[str] | None,
    weight: Iterable[npt.ArrayLike] | None,
) -> tuple[tuple[int, int], tuple[str, ...], IntArray, FloatArray, FloatArray]:
    """Size, names, photo of each row, pixels and weights that go with what is known of photos."""
    size = _REFUSAL.size(image_size, "image_size", limit=MAX_SIDE)
    own = [
        _REFUSAL.numbers(one, f"pixel[{i}]", 2, limit=MAX_COORDINATE)
        for i, one in _listed(pixel, "pixel")
    ]
    if not known:
        raise CorrespondenceError("no photo was given: pass one array for each photo")
    if len(own) != len(known):
        raise CorrespondenceError(
            f"pixels are given for {len(own)} photos and points for {len(known)}: "
            "pass one array of each for every photo"
        )
    for index, (points, seen) in enumerate(zip(known, own, strict=True)):
        if len(points) != len(seen):
            raise CorrespondenceError(
                f"photo {index} has {len(points)} points and {len(seen)} pixels: "
                "each row of one belongs to the same row of the other"
            )
        if not len(points):
            raise CorrespondenceError(f"photo {index} has no points: leave it out of both lists")
        outside = np.flatnonzero(_outside(seen, size))
        if outside.size:
            x, y = seen[outside[0]]
            raise CorrespondenceError(
                f"pixel[{index}], row {outside[0]}: {x:g}, {y:g} is outside the "
                f"{size[0]}x{size[1]} image: is image_size (width, height)?"
            )
    counts = [len(one) for one in own]
    names = [f"photo_{index}" for index in range(len(own))] if images is None else images
    photos = _REFUSAL.names(names, "images")
    if len(photos) != len(own):
        raise CorrespondenceError(f"{len(photos)} names are given for {len(own)} photos")
    weights = [np.ones(count) for count in counts]
    if weight is not None:
        given = _listed(weight, "weight")
        if len(given) != len(own):
            raise CorrespondenceError(f"weights are given for {len(given)} of {len(own)} photos")
        weights = [
            _REFUSAL.weights(one, f"weight[{i}]", counts[i], limit=MAX_COORDINATE)
            for i, one in given
        ]
    image = np.repeat(np.arange(len(own), dtype=np.intp), counts)
    return size, photos, image, np.concatenate(own), np.concatenate(weights)


def _outside(pixel: FloatArray, image_size: tuple[int, int]) -> BoolArray:
    """Which pixels (N, 2) are outside a photo.

    One pixel of slack: a corner may be found a little beyond the outermost pixel centres.
    """
    return np.asarray(((pixel < -1) | (pixel > image_size)).any(axis=1))


def _pixels(table: Table, image_size: tuple[int, int]) -> FloatArray:
    pixel = np.stack([table.floats("x"), table.floats("y")], axis=-1)
    outside = np.flatnonzero(_outside(pixel, image_size))
    if outside.size:
        x, y = pixel[outside[0]]
        table.refuse(
            outside[0],
            f"x {x:g}, y {y:g} is outside the {image_size[0]}x{image_size[1]} image: "
            "is the image size right?",
        )
    return pixel


def _weights(table: Table) -> FloatArray:
    if "weight" not in table.columns:
        return np.ones(len(table.lines))
    weight = table.floats("weight")
    bad = np.flatnonzero(~((weight > 0) & (weight <= MAX_COORDINATE)))
    if bad.size:
        table.refuse(
            bad[0],
            f"weight {weight[bad[0]]:g} must be above 0 and at most {MAX_COORDINATE:g}: to leave a "
            "corner out, remove its row",
        )
    return weight


def _certain(table: Table) -> BoolArray:
    if _CERTAIN not in table.columns:
        return _ALL_CERTAIN
    certain = table.integers(_CERTAIN)
    bad = np.flatnonzero((certain != 0) & (certain != 1))
    if bad.size:
        table.refuse(bad[0], f"{_CERTAIN} must be 1, or 0 where it may be another corner")
    return certain == 1


def _fill_in_certain(rows: Corners | Correspondences) -> None:
    """Of as many rows as there are; some of rows that were all certain are certain too."""
    if np.shape(rows.certain)[:1] != np.shape(rows.pixel)[:1] and np.all(rows.certain):
        object.__setattr__(rows, "certain", np.ones(len(rows.pixel), bool))


def _names(names: tuple[str, ...], index: IntArray) -> list[str]:
    return [names[i] for i in index.tolist()]


def _save(
    path: Path,
    kind: str,
    header: tuple[str, ...],
    columns: list[list[Any]],
    rows: Corners | Correspondences,
    overwrite: bool,
    *,
    version: int = 1,
) -> None:
    if (rows.weight != 1).any():
        header, columns = (*header, "weight"), [*columns, rows.weight.tolist()]
    width, height = rows.image_size
    first = f"# cubicfish {kind} {version}, image_size {width}x{height}\n"
    text = csv_text(chain([header], zip(*columns, strict=True)))
    write_text(path, first + text, overwrite=overwrite)
