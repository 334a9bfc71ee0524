"""Observations: corners or points seen in photos, by name, world point and pixel.

Everything between finding corners and fitting a camera is this one record. It keeps one row a
corner in flat arrays, since all the maths runs over all corners at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.arrays import Refusal
from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.errors import CorrespondenceError
from cubicfish_cli.core.reading import MAX_COORDINATE
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.core.wording import Brief, did_you_mean, quoted

_REFUSAL = Refusal(error=CorrespondenceError)
_OF_A_ROW = (
    "image",
    "board",
    "column",
    "row",
    "pixel",
    "weight",
    "world",
    "certain",
    "tells_error",
)
# Stand for as many rows as there are, where nothing is said of weights, world or certainty.
_UNSAID: FloatArray = np.empty(0)
_ALL: BoolArray = np.ones(0, bool)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Observations(Brief):
    """Corners of boards, or points, seen in photos: the paper's pairs M ↔ m.

    What looks for corners knows their names, and their world points once it is known of which
    target they are (:meth:`with_target`). Measured points without names have their world points
    from the start (:meth:`from_points`).

    Attributes:
        image_size: (width, height) of every photo, pixels.
        images: names of the photos, in order.
        boards: names of the boards, in the target's order; empty for points without names.
        image: (N,) index into ``images``; a fit needs the rows sorted by it.
        board: (N,) index into ``boards``, or -1 without names.
        column, row: (N,) the corner's place on its board; without names the column is the
            point's number in its file or photo, and the row is 0.
        pixel: (N, 2) x, y in pixels.
        weight: (N,) relative weight; by default 1.
        world: (N, 3) points in the world frame, in the target's units; NaN where they are not
            known, as by default.
        certain: (N,) whether it is surely this corner; by default all are. Where too little of a
            board was seen, its corners may be others of the same plane, some squares further on:
            as good for a lens, but they do not measure the target.
        tells_error: (N,) whether a fit can tell its error; by default of all. Where each corner of
            a target has an offset of its own, one that may be another has a point to itself,
            which goes where it was seen.
        target: the target that the world points are of; None where they are of none.

    """

    image_size: tuple[int, int]
    images: tuple[str, ...]
    boards: tuple[str, ...]
    image: IntArray
    board: IntArray
    column: IntArray
    row: IntArray
    pixel: FloatArray
    weight: FloatArray = field(default_factory=lambda: _UNSAID)
    world: FloatArray = field(default_factory=lambda: _UNSAID)
    certain: BoolArray = field(default_factory=lambda: _ALL)
    tells_error: BoolArray = field(default_factory=lambda: _ALL)
    target: Target | None = None

    def __post_init__(self) -> None:
        """Fill in what is not said; some of rows that were all certain are certain too."""
        rows = np.shape(self.pixel)[:1]
        if self.weight is _UNSAID:
            object.__setattr__(self, "weight", np.ones(rows))
        if self.world is _UNSAID:
            object.__setattr__(self, "world", np.full((*rows, 3), np.nan))
        for name in ("certain", "tells_error"):
            said = getattr(self, name)
            if np.shape(said)[:1] != rows and np.all(said):
                object.__setattr__(self, name, np.ones(rows, bool))

    @classmethod
    def from_corners(
        cls,
        places: Iterable[npt.ArrayLike],
        pixel: Iterable[npt.ArrayLike],
        image_size: Sequence[int],
        *,
        boards: Sequence[str],
        images: Sequence[str] | None = None,
        weight: Iterable[npt.ArrayLike] | None = None,
    ) -> Observations:
        """Named corners that any detector found, from plain arrays, one of each kind per photo.

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
        place, photos = _stack_photos("places", places, pixel, image_size, images, weight)
        board, column, row = place.T
        names = _REFUSAL.names(boards, "boards")
        made = cls(**photos, boards=names, board=board, column=column, row=row)._within_photos()
        twice = first_repeated(made.image, made.board, made.column, made.row)
        if twice is not None:
            row = twice[1]
            corner = [int(one[row]) for one in (made.board, made.column, made.row)]
            raise CorrespondenceError(
                f"places[{made.image[row]}]: the corner {corner} is there twice: keep one of them"
            )
        return made

    @classmethod
    def from_points(
        cls,
        world: Iterable[npt.ArrayLike],
        pixel: Iterable[npt.ArrayLike],
        image_size: Sequence[int],
        *,
        images: Sequence[str] | None = None,
        weight: Iterable[npt.ArrayLike] | None = None,
    ) -> Observations:
        """Points of known places in the world, from plain arrays, one of each kind per photo.

        They are taken where they are said to be. Corners of a board have names: a fit of
        :meth:`from_corners` and their target can tell how the board departs from its drawing.

        Args:
            world: for each photo (N, 3) points in the world frame, any unit of length.
            pixel: for each photo (N, 2) x, y of the same points, pixels.
            image_size: (width, height) of every photo, pixels.
            images: the photos' names; by default ``photo_0``, ``photo_1`` and so on.
            weight: for each photo (N,) relative weights above 0; by default 1.

        Returns:
            The points without names; ``column`` is the row's number in its photo's arrays.

        Raises:
            CorrespondenceError: an array has another shape, another number of rows than its
                fellow, or numbers that cannot be; one line that says which and where.

        """
        points, photos = _stack_photos("world", world, pixel, image_size, images, weight)
        column = np.concatenate([np.arange(count) for count in np.bincount(photos["image"])])
        made = cls.without_names(**photos, world=points, column=column)
        return made._within_photos()

    @classmethod
    def without_names(cls, *, column: IntArray, **others: Any) -> Observations:
        """Points without names: ``column`` (N,) is an index that tells them apart; and the rest."""
        board, row = np.full(len(column), -1, np.intp), np.zeros(len(column), np.intp)
        return cls(**others, boards=(), board=board, column=column, row=row)

    @classmethod
    def stacked(cls, parts: Sequence[Observations]) -> Observations:
        """The rows of all parts, one after the other, which list the same photos and boards."""
        rows: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts]) for name in _OF_A_ROW
        }
        return replace(parts[0], **rows)

    @classmethod
    def joined(cls, parts: Sequence[Observations]) -> Observations:
        """The photos of all parts, one after the other, which are of the same boards."""
        first = np.cumsum([0, *(len(part.images) for part in parts)])
        shifted = [
            replace(part, image=part.image + start)
            for part, start in zip(parts, first[:-1], strict=True)
        ]
        return replace(
            cls.stacked(shifted), images=tuple(name for part in parts for name in part.images)
        )

    def select(self, rows: IntArray | BoolArray) -> Observations:
        """Some of the rows, each by its index (K,), in that order, or by a mask (N,).

        All photos stay listed.
        """
        return replace(self, **{name: getattr(self, name)[rows] for name in _OF_A_ROW})

    def of(self, photo: str) -> Observations:
        """The rows of one photo.

        Raises:
            CorrespondenceError: there is no photo of that name.

        """
        if photo not in self.images:
            raise CorrespondenceError(
                f"photo {quoted(photo)} is not among these: {did_you_mean(photo, self.images)}"
            )
        return self.select(self.image == self.images.index(photo))

    def only_seen(self) -> tuple[Observations, IntArray]:
        """Without the photos that have no rows, and (M,) the index of each other photo here."""
        photos, image = np.unique(self.image, return_inverse=True)
        images = tuple(self.images[photo] for photo in photos)
        return replace(self, images=images, image=image.astype(np.intp)), photos.astype(np.intp)

    def by_photo(self) -> Observations:
        """The rows sorted by photo, else in their order."""
        return self.select(np.argsort(self.image, kind="stable"))

    def in_order(self) -> Observations:
        """The rows by photo, board, row and column."""
        return self.select(np.lexsort([self.column, self.row, self.board, self.image]))

    def with_world(self, world: FloatArray) -> Observations:
        """The same rows with other world points (N, 3), any unit, which are of no target."""
        return replace(self, world=world, target=None)

    def with_target(self, target: Target) -> Observations:
        """Give each corner its world point; rows are sorted by photo and else keep their order.

        Raises:
            CorrespondenceError: a board is not in the target, a corner is outside its board, or
                the rows are of points without names.

        """
        if len(self.image) and not self.boards:
            raise CorrespondenceError(
                "these points do not say which corners of the target they are: leave the target "
                "out, or name them with Observations.from_corners"
            )
        for name in self.boards:
            if name not in target.board_names:
                raise CorrespondenceError(no_such_board(name, target))
        index = np.array([target.board_names.index(name) for name in self.boards], np.intp)
        named = replace(
            self,
            boards=target.board_names,
            board=index[self.board] if index.size else self.board,
            world=_UNSAID,
            target=target,
        ).by_photo()
        place = named.board, named.column, named.row
        outside = first_outside(target, *place)
        if outside is not None:
            row, why = outside
            raise CorrespondenceError(f"{named.images[named.image[row]]}: {why}")
        return replace(named, world=target.world_points(*place))

    def checked(self, target: Target | None) -> Observations:
        """The same, ready for a fit: of ``target``, or else of the target that they carry.

        Raises:
            CorrespondenceError: an array is not what it must be, the world points are not known,
                or they do not fit the target; one line that says which.

        """
        own = self._of_good_rows()
        rows = len(own.pixel)
        target = self.target if target is None else target
        if target is not None:
            return own.with_target(target)
        world = self.world
        numbers = isinstance(world, np.ndarray) and world.dtype.kind == "f"
        if rows and numbers and np.isnan(world).all():
            raise CorrespondenceError("corners need the target that they are of: pass it as well")
        world = _REFUSAL.numbers(world, "world", 3)
        if len(world) != rows:
            raise CorrespondenceError(f"world has {len(world)} rows and pixel has {rows}")
        if (np.diff(own.image) < 0).any():
            raise CorrespondenceError("image must not decrease: sort the rows with by_photo()")
        return replace(own, world=world)

    def _within_photos(self) -> Observations:
        """The same with good rows, whose pixels lie within the photos."""
        own = self._of_good_rows()
        outside = first_outside_photo(own.pixel, own.image_size)
        if outside is not None:
            photo = own.images[own.image[outside[0]]]
            raise CorrespondenceError(f"{photo}: {outside[1]}: is image_size (width, height)?")
        return own

    def _of_good_rows(self) -> Observations:
        """The same with arrays of the types that they must have, whatever the world points are."""
        pixel = _REFUSAL.numbers(self.pixel, "pixel", 2)
        rows, least = len(pixel), 0 if self.boards else -1
        weight = _REFUSAL.column(self.weight, "weight", rows).astype(float)
        bad = first_bad_weight(weight)
        if bad is not None:
            raise CorrespondenceError(f"weight, row {bad[0]}: {bad[1]}")
        return replace(
            self,
            image_size=_REFUSAL.size(self.image_size),
            image=_REFUSAL.index(self.image, "image", rows, 0, len(self.images)),
            pixel=pixel,
            weight=weight,
            board=_REFUSAL.index(self.board, "board", rows, least, len(self.boards)),
            column=_REFUSAL.index(self.column, "column", rows, 0),
            row=_REFUSAL.index(self.row, "row", rows, 0),
            certain=_REFUSAL.flags(self.certain, "certain", rows),
        )


def no_such_board(name: str, target: Target) -> str:
    """What is said of a board that a target does not have."""
    return f"board {quoted(name)} is not in the target: {did_you_mean(name, target.board_names)}"


def first_outside(
    target: Target, board: IntArray, column: IntArray, row: IntArray
) -> tuple[int, str] | None:
    """The first row (N,) whose corner its board does not have, and what is said of it."""
    columns = np.array([one.columns for one in target.boards])[board]
    rows = np.array([one.rows for one in target.boards])[board]
    outside = np.flatnonzero((column < 0) | (column >= columns) | (row < 0) | (row >= rows))
    if not outside.size:
        return None
    first = int(outside[0])
    own: Board = target.boards[board[first]]
    return first, (
        f"column {column[first]}, row {row[first]} is outside board {quoted(own.name)} with "
        f"{own.columns}x{own.rows} corners, counted from 0: "
        "does one of them count squares instead of inner corners?"
    )


def first_repeated(*keys: IntArray) -> tuple[int, int] | None:
    """The first row that is as one before it in all keys (N,), as (that one, the row)."""
    order = np.lexsort(keys[::-1])
    same = np.logical_and.reduce([key[order][1:] == key[order][:-1] for key in keys])
    pairs = [(int(order[i + 1]), int(order[i])) for i in np.flatnonzero(same)]
    return min(pairs)[::-1] if pairs else None


def first_outside_photo(pixel: FloatArray, image_size: tuple[int, int]) -> tuple[int, str] | None:
    """The first row (N, 2) whose pixel is outside a photo, and what is said of it.

    One pixel of slack: a corner may be found a little beyond the outermost pixel centres.
    """
    outside = np.flatnonzero(((pixel < -1) | (pixel > image_size)).any(axis=1))
    if not outside.size:
        return None
    (x, y), (width, height) = pixel[outside[0]], image_size
    return int(outside[0]), f"x {x:g}, y {y:g} is outside the {width}x{height} image"


def first_bad_weight(weight: FloatArray) -> tuple[int, str] | None:
    """The first weight (N,) that cannot be, and what is said of it."""
    bad = np.flatnonzero(~((weight > 0) & (weight <= MAX_COORDINATE)))
    if not bad.size:
        return None
    return int(bad[0]), (
        f"weight {weight[bad[0]]:g} must be above 0 and at most {MAX_COORDINATE:g}: to leave a "
        "corner out, remove its row"
    )


def _stack_photos(
    name: str,
    known: Iterable[npt.ArrayLike],
    pixel: Iterable[npt.ArrayLike],
    image_size: Sequence[int],
    images: Sequence[str] | None,
    weight: Iterable[npt.ArrayLike] | None,
) -> tuple[FloatArray, dict[str, Any]]:
    """What is known of each row of all photos (N, 3), and the attributes that go with it."""
    given: dict[str, list[Any]] = {
        key: _list_arrays(arrays, key, columns)
        for key, arrays, columns in ((name, known, 3), ("pixel", pixel, 2), ("weight", weight, 0))
        if arrays is not None
    }
    if not given[name]:
        raise CorrespondenceError("no photo was given: pass one array for each photo")
    counts = [len(one) for one in given[name]]
    for key, arrays in given.items():
        own = [len(one) for one in arrays]
        if len(own) != len(counts):
            raise CorrespondenceError(
                f"{key} is given for {len(own)} photos and {name} for {len(counts)}: "
                "pass one array of each for every photo"
            )
        other = next((i for i, (a, b) in enumerate(zip(own, counts, strict=True)) if a != b), None)
        if other is not None:
            raise CorrespondenceError(
                f"{key}[{other}] has {own[other]} rows and {name}[{other}] has {counts[other]}: "
                "each row of one belongs to the same row of the other"
            )
    if 0 in counts:
        raise CorrespondenceError(
            f"photo {counts.index(0)} has no points: leave it out of all lists"
        )
    names = [f"photo_{index}" for index in range(len(counts))] if images is None else images
    photos = _REFUSAL.names(names, "images")
    if len(photos) != len(counts):
        raise CorrespondenceError(f"{len(photos)} names are given for {len(counts)} photos")
    stacked = {key: np.concatenate(arrays) for key, arrays in given.items()}
    image = np.repeat(np.arange(len(counts), dtype=np.intp), counts)
    size = _REFUSAL.size(image_size)
    return stacked.pop(name), {**stacked, "image_size": size, "images": photos, "image": image}


def _list_arrays(arrays: Iterable[npt.ArrayLike], name: str, columns: int) -> list[Any]:
    """The arrays of the photos: finite numbers (N, columns), or as they are without columns."""
    one_array = isinstance(arrays, np.ndarray) and arrays.ndim < 3 and arrays.dtype != object
    if one_array or isinstance(arrays, str | bytes) or not isinstance(arrays, Iterable):
        raise CorrespondenceError(f"{name} must be a list of arrays, one for each photo")
    if not columns:
        return [np.atleast_1d(one) for one in arrays]
    return [_REFUSAL.numbers(one, f"{name}[{i}]", columns) for i, one in enumerate(arrays)]
