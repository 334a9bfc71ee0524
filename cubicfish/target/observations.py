"""Observations: corners or points seen in photos, by name, world point and pixel.

Everything between finding corners and fitting a camera is this one record. It keeps one row per
corner in flat arrays, since all the maths runs over all corners at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from cubicfish.arrays import Refusal
from cubicfish.errors import CorrespondenceError, TargetError
from cubicfish.files.reading import MAX_COORDINATE
from cubicfish.target.target import Target
from cubicfish.types import BoolArray, FloatArray, IntArray
from cubicfish.wording import Brief, did_you_mean, quoted

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
    "error_known",
)
# Default of weights, world and certainty, in place of as many rows as there are.
_DEFAULT: FloatArray = np.empty(0)
_ALL: BoolArray = np.ones(0, bool)

Refuse = Callable[[int, str], NoReturn]
"""Raises the error of a row, by its index, with what is wrong with it."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Observations(Brief):
    """Corners of boards, or points, seen in photos: the paper's pairs M ↔ m.

    A detector knows the names of corners; :meth:`with_target` adds their world points once it is
    known which target they are of. Measured points without names have their world points from the
    start (:meth:`from_points`).

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
        certain: (N,) whether the name is certain; by default all are. Where too little of a board
            was seen, its corners may be others of the same plane, some squares further on: as good
            for a lens, but they do not measure the target.
        error_known: (N,) whether a fit shows the corner's error; by default it does of all. Where
            each corner of a target has its own offset, an uncertain corner has a point of its own,
            which moves to where the corner was seen.
        target: the target that the world points belong to; None where they belong to none.

    """

    image_size: tuple[int, int]
    images: tuple[str, ...]
    boards: tuple[str, ...]
    image: IntArray
    board: IntArray
    column: IntArray
    row: IntArray
    pixel: FloatArray
    weight: FloatArray = field(default_factory=lambda: _DEFAULT)
    world: FloatArray = field(default_factory=lambda: _DEFAULT)
    certain: BoolArray = field(default_factory=lambda: _ALL)
    error_known: BoolArray = field(default_factory=lambda: _ALL)
    target: Target | None = None

    def __post_init__(self) -> None:
        """Fill in defaults; a selection of rows that are all certain is certain too."""
        rows = np.shape(self.pixel)[:1]
        if self.weight is _DEFAULT:
            object.__setattr__(self, "weight", np.ones(rows))
        if self.world is _DEFAULT:
            object.__setattr__(self, "world", np.full((*rows, 3), np.nan))
        for name in ("certain", "error_known"):
            flags = getattr(self, name)
            if np.shape(flags)[:1] != rows and np.all(flags):
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
        made = cls(**photos, boards=names, board=board, column=column, row=row)
        return made._of_good_rows().usable()

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

        Their places are taken as given. Corners of a board have names: a fit of
        :meth:`from_corners` and their target can show how the board departs from the nominal one.

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
        return cls.without_names(**photos, world=points, column=column)._of_good_rows().usable()

    @classmethod
    def without_names(cls, *, column: IntArray, **others: Any) -> Observations:
        """Points without names; ``column`` (N,) is an index that distinguishes them."""
        board, row = np.full(len(column), -1, np.intp), np.zeros(len(column), np.intp)
        return cls(**others, boards=(), board=board, column=column, row=row)

    @classmethod
    def stacked(cls, parts: Sequence[Observations]) -> Observations:
        """The rows of all parts, one after the other; the parts list the same photos and boards."""
        rows: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts]) for name in _OF_A_ROW
        }
        return replace(parts[0], **rows)

    @classmethod
    def joined(cls, parts: Sequence[Observations]) -> Observations:
        """The photos of all parts, one after the other; the parts list the same boards."""
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

        All photos stay listed. A mask of all rows copies none.
        """
        if np.asarray(rows).dtype == bool and np.all(rows):
            return self
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
        """Leave out photos that have no rows; (M,) is the index of each other photo before."""
        photos, image = np.unique(self.image, return_inverse=True)
        images = tuple(self.images[photo] for photo in photos)
        return replace(self, images=images, image=image.astype(np.intp)), photos.astype(np.intp)

    def of_photos(self, photos: IntArray) -> Observations:
        """The corners of some photos, each given by its index (M,) in ``images``; no others."""
        return self.select(np.isin(self.image, photos)).only_seen()[0]

    def by_photo(self) -> Observations:
        """The rows sorted by photo, otherwise in their order; no copy where they are sorted."""
        if (np.diff(self.image) >= 0).all():
            return self
        return self.select(np.argsort(self.image, kind="stable"))

    def in_order(self) -> Observations:
        """The rows by photo, board, row and column."""
        return self.select(np.lexsort([self.column, self.row, self.board, self.image]))

    def with_world(self, world: FloatArray) -> Observations:
        """The same rows with other world points (N, 3), any unit, which are of no target."""
        return replace(self, world=world, target=None)

    def with_target(self, target: Target, refuse: Refuse | None = None) -> Observations:
        """Give each corner its world point; rows are sorted by photo, and keep their order there.

        Args:
            target: the target that the photos show.
            refuse: raises the error of a row; by default it names the row's photo.

        Raises:
            CorrespondenceError: a board is not in the target, a corner is outside its board, or
                the rows are of points without names.

        """
        refuse = refuse or self._refuse
        if len(self.image) and not self.boards:
            raise CorrespondenceError(
                "these points do not say which corners of the target they are: leave the target "
                "out, or name them with Observations.from_corners"
            )
        numbers = {name: number for number, name in enumerate(target.board_names)}
        index = np.array([numbers.get(name, -1) for name in self.boards], np.intp)
        board, place = index[self.board], np.stack([self.column, self.row], axis=-1)
        unknown = np.flatnonzero(board < 0)
        if unknown.size:
            try:
                target.board(self.boards[self.board[unknown[0]]])
            except TargetError as problem:
                refuse(unknown[0], str(problem))
        size = np.array([(one.columns, one.rows) for one in target.boards])[board]
        outside = np.flatnonzero(((place < 0) | (place >= size)).any(axis=1))
        if outside.size:
            (column, row), own = place[outside[0]], target.boards[board[outside[0]]]
            refuse(
                outside[0],
                f"column {column}, row {row} is outside board {quoted(own.name)} with "
                f"{own.columns}x{own.rows} corners, counted from 0: "
                "does one of them count squares instead of inner corners?",
            )
        world = target.world_points(board, self.column, self.row)
        named = replace(self, boards=target.board_names, board=board, world=world, target=target)
        return named.by_photo()

    def usable(self, refuse: Refuse | None = None) -> Observations:
        """Return the same if pixels lie in the photos, weights are valid and no corner repeats.

        Args:
            refuse: raises the error of a row; by default it names the row's photo.

        Raises:
            CorrespondenceError: a row is not usable; the first such row is named.

        """
        refuse = refuse or self._refuse
        # One pixel of slack: a corner may be found a little beyond the outermost pixel centres.
        outside = np.flatnonzero(((self.pixel < -1) | (self.pixel > self.image_size)).any(axis=1))
        if outside.size:
            (x, y), (width, height) = self.pixel[outside[0]], self.image_size
            what = f"x {x:g}, y {y:g} is outside the {width}x{height} image"
            refuse(outside[0], f"{what}: is the image size (width, height) right?")
        self._refuse_weights(refuse)
        names = np.stack([self.image, self.board, self.column, self.row])
        order = np.lexsort(names)
        again = order[1:][(names[:, order[1:]] == names[:, order[:-1]]).all(axis=0)]
        if again.size:
            _, board, column, row = names[:, again.min()]
            what = f"column {column}, row {row} of board {quoted(self.boards[board])}"
            refuse(again.min(), f"{what} is there twice in this photo: keep one of them")
        return self

    def checked(self, target: Target | None) -> Observations:
        """Return the same, ready for a fit: of ``target``, or of the target that they carry.

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

    def _refuse(self, row: int, what: str) -> NoReturn:
        raise CorrespondenceError(f"{self.images[self.image[row]]}: {what}")

    def _refuse_weights(self, refuse: Refuse) -> None:
        bad = np.flatnonzero(~((self.weight > 0) & (self.weight <= MAX_COORDINATE)))
        if bad.size:
            refuse(
                bad[0],
                f"weight {self.weight[bad[0]]:g} must be above 0 and at most {MAX_COORDINATE:g}: "
                "to leave a corner out, remove its row",
            )

    def _of_good_rows(self) -> Observations:
        """The same with arrays of the types that they must have, whatever the world points are."""
        pixel = _REFUSAL.numbers(self.pixel, "pixel", 2)
        rows, least = len(pixel), 0 if self.boards else -1
        own = replace(
            self,
            image_size=_REFUSAL.size(self.image_size),
            image=_REFUSAL.index(self.image, "image", rows, 0, len(self.images)),
            pixel=pixel,
            weight=_REFUSAL.column(self.weight, "weight", rows).astype(float),
            board=_REFUSAL.index(self.board, "board", rows, least, len(self.boards)),
            column=_REFUSAL.index(self.column, "column", rows, 0),
            row=_REFUSAL.index(self.row, "row", rows, 0),
            certain=_REFUSAL.flags(self.certain, "certain", rows),
        )
        own._refuse_weights(own._refuse)
        return own


def _stack_photos(
    name: str,
    known: Iterable[npt.ArrayLike],
    pixel: Iterable[npt.ArrayLike],
    image_size: Sequence[int],
    images: Sequence[str] | None,
    weight: Iterable[npt.ArrayLike] | None,
) -> tuple[FloatArray, dict[str, Any]]:
    """Stack ``known`` (N, 3) of all photos, and the attributes that go with its rows."""
    given: dict[str, list[Any]] = {
        key: _list_arrays(arrays, key, columns)
        for key, arrays, columns in ((name, known, 3), ("pixel", pixel, 2), ("weight", weight, 0))
        if arrays is not None
    }
    if not given[name]:
        raise CorrespondenceError("no photo was given: pass one array for each photo")
    rows = {key: [len(one) for one in arrays] for key, arrays in given.items()}
    counts = rows[name]
    for key, own in rows.items():
        if len(own) != len(counts):
            raise CorrespondenceError(
                f"{key} is given for {len(own)} photos and {name} for {len(counts)}: "
                "pass one array of each for every photo"
            )
        for photo, count in enumerate(own):
            if count != counts[photo]:
                raise CorrespondenceError(
                    f"{key}[{photo}] has {count} rows and {name}[{photo}] has {counts[photo]}: "
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
