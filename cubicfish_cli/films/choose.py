"""Choosing the photos or frames that add most information.

A class that knows lenses says what a picture adds, or :class:`Coverage` if no lens is known.
Pictures that are clearly worse than the others come last, and near copies of one that was taken are
avoided.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from cubicfish import FloatArray
from cubicfish.geometry import outermost

# The parts of the picture: columns and rows, fine for places and coarse for what is seen there.
_FINE, _COARSE = (12, 9), (4, 3)
# Sides that a board may be seen from, beside the front.
_SIDES = 4
# So many corners in a part are all that one picture can say of it.
_FULL = 4
# A board counts as tilted where squares grow by this share (of a logarithm) from end to end.
_TILTED = 0.25
# Views that differ by less than this share of the picture's diagonal come after all others.
_SAME_VIEW = 0.02
_FEWEST_COMMON = 4
_MANY = 1_000_000  # columns or rows, more than any board has
# Beside the better pictures: blurred below this share of their sharpness, moving above these times
# their motion.
_BLURRED, _MOVING = 0.75, 5.0
# A picture is worth its time if it adds so much of what is wanted.
_LEAST_GAIN = 0.01
FEWEST = 10
"""So many different views are taken even if the last ones add hardly anything, or are worse than
the others: it takes many views to tell a lens from the poses of one flat board, and to measure a
held-out error. The verdict asks for as many."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """Corners of one board in a picture.

    Attributes:
        board: its number; -1 where that is not known, and cells mean nothing across pictures.
        cells: (N, 2) column and row of each corner.
        pixel: (N, 2) its x, y.
        certain: whether the corners are surely these; if little of a board is seen, they may be
            others, some squares further on.

    """

    board: int
    cells: npt.NDArray[np.intp]
    pixel: FloatArray
    certain: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """A picture that may be chosen.

    Attributes:
        sharpness: how sharp it is, in any measure.
        motion: how far it moved, pixels.
        patches: what it shows.

    """

    sharpness: float
    motion: float = 0.0
    patches: tuple[Patch, ...] = ()

    @property
    def corners(self) -> int:
        """How many corners it shows."""
        return len(self.pixel)

    @cached_property
    def pixel(self) -> FloatArray:
        """(N, 2) x, y of all of them."""
        return np.concatenate([np.zeros((0, 2)), *(patch.pixel for patch in self.patches)])

    @cached_property
    def names(self) -> npt.NDArray[np.intp]:
        """(N,) a number for each of them, the same in every picture."""
        named = [
            (patch.board * _MANY + patch.cells[:, 0]) * _MANY + patch.cells[:, 1]
            for patch in self.patches
        ]
        return np.concatenate([np.zeros(0, np.int64), *named]).astype(np.int64)


_NOTHING = Seen(patches=(), sharpness=0.0)

Ended = Literal["all", "asked", "enough"]
"""Why no more pictures are chosen: no more are usable, no more were wanted, or one more would add
less than 1 % of what is wanted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """A choice of pictures.

    Attributes:
        order: indices of the chosen pictures, the one that adds most first.
        gain: what each of them added when it was chosen.
        ended: why no more were chosen.

    """

    order: tuple[int, ...]
    gain: tuple[float, ...]
    ended: Ended = "all"


class Gains(Protocol):
    """The information gain of pictures, by their numbers, beside those that are taken."""

    def of(self, picture: int, /) -> float:
        """Return what a picture adds; 0 where it shows nothing that can be used."""

    def share(self, gain: float, /) -> float:
        """Return how much of what is wanted a gain is, to what is taken now."""

    def take(self, picture: int, /) -> None:
        """Take it."""


class Coverage:
    """Corners in parts of the picture, and boards seen from some side in wider parts.

    For several cameras: those of each, and what each two of them show at once. Each such thing
    counts as measurements do, the n-th less than the one before.
    """

    def __init__(
        self,
        shots: Sequence[Sequence[Seen]],
        sizes: Sequence[tuple[int, int]],
        quality: FloatArray,
    ) -> None:
        """Collect what each of the shots shows.

        Args:
            shots: for each a picture of every camera.
            sizes: (width, height) of each camera's pictures.
            quality: (S, C) how much each picture weighs, 0 to 1.

        """
        self._rate_shown = [
            _rate_together(shot, sizes, weight) for shot, weight in zip(shots, quality, strict=True)
        ]
        self._known = np.zeros_like(self._rate_shown[0])
        self._first = max(self.of(number) for number in range(len(self._rate_shown)))

    def of(self, picture: int) -> float:
        """See :class:`Gains`."""
        return float(np.log1p(self._rate_shown[picture] / (1 + self._known)).sum())

    def share(self, gain: float) -> float:
        """See :class:`Gains`: of what the first may add."""
        return gain / self._first if self._first > 0 else 0.0

    def take(self, picture: int) -> None:
        """See :class:`Gains`."""
        self._known = self._known + self._rate_shown[picture]


def choose(
    pictures: Sequence[Seen],
    size: tuple[int, int],
    most: int,
    still_px: float,
    gains_of: Callable[[FloatArray], Gains | None] = lambda quality: None,
) -> Choice:
    """Choose at most ``most`` pictures of one camera; see :func:`choose_shots`.

    Args:
        pictures: all of them.
        size: (width, height) of them.
        most: how many may be chosen.
        still_px: motion below which a picture counts as still, pixels.
        gains_of: makes the pictures' :class:`Gains` of their quality (N,), 0 to 1; None for
            :class:`Coverage`.

    """
    shots = [[picture] for picture in pictures]
    return choose_shots(shots, [size], most, [still_px], lambda quality: gains_of(quality[:, 0]))


def choose_shots(
    shots: Sequence[Sequence[Seen | None]],
    sizes: Sequence[tuple[int, int]],
    most: int,
    still_px: Sequence[float],
    gains_of: Callable[[FloatArray], Gains | None] = lambda quality: None,
) -> Choice:
    """Choose at most ``most`` shots of several cameras, each a picture of every camera.

    A shot adds what its pictures add to their cameras, and what two cameras show at once. Spoilt
    pictures of a shot that is good for another camera add nothing.

    Args:
        shots: for each shot a picture of every camera; None where that camera has none.
        sizes: (width, height) of each camera's pictures.
        most: how many may be chosen.
        still_px: for each camera the motion below which a picture counts as still, pixels.
        gains_of: makes the shots' :class:`Gains` of the pictures' quality (S, C), 0 to 1; None
            for :class:`Coverage`.

    """
    pictures = [[_NOTHING if one is None else one for one in shot] for shot in shots]
    cameras = list(zip(*pictures, strict=True))
    rated = [_rate_pictures(own, still) for own, still in zip(cameras, still_px, strict=True)]
    good, quality = (np.column_stack(part) for part in zip(*rated, strict=True))
    seen = np.array([[one.corners > 0 for one in shot] for shot in pictures])
    if not seen.any():
        return Choice(order=(), gain=())
    usable = np.asarray(good.any(axis=1))
    spoilt = seen.any(axis=1) & ~usable
    quality = np.where(usable[:, None] & ~good, 0.0, quality)

    views = [_Views(own, size) for own, size in zip(cameras, sizes, strict=True)]

    def apart(one: int) -> FloatArray:
        return np.max([own.measure_distances(one) for own in views], axis=0)

    gains = gains_of(quality) or Coverage(pictures, sizes, quality)
    # What moved no farther than a picture that counts as still is that picture again.
    copy = min(still / float(np.hypot(*size)) for still, size in zip(still_px, sizes, strict=True))
    pools = np.flatnonzero(usable).tolist(), np.flatnonzero(spoilt).tolist()
    return _choose_greedily(*pools, gains, apart, copy, most)


def _rate_pictures(
    pictures: Sequence[Seen], still_px: float
) -> tuple[npt.NDArray[np.bool_], FloatArray]:
    """Which of a camera's pictures are good (S,), and how much their corners weigh (S,).

    Those without corners are not good, and weigh nothing.
    """
    shown = [one for one in pictures if one.corners]
    scale = Scale.of(shown or [_NOTHING], still_px)
    good = [one.corners > 0 and not scale.is_spoilt(one) for one in pictures]
    return np.array(good), np.array(
        [scale.quality(one) if one.corners else 0.0 for one in pictures]
    )


def _rate_together(
    shot: Sequence[Seen], sizes: Sequence[tuple[int, int]], weight: FloatArray
) -> FloatArray:
    parts = [
        own * _rate_shown(one, size) for one, size, own in zip(shot, sizes, weight, strict=True)
    ]
    # Wider parts of the picture, whatever a board's tilt.
    fine = _FINE[0] * _FINE[1]
    wide = [part[fine:].reshape(_COARSE[0] * _COARSE[1], -1).sum(axis=1) for part in parts]
    for first, second in combinations(range(len(shot)), 2):
        both = wide[first].any() and wide[second].any()
        parts += [np.minimum(1.0, both * wide[own]) for own in (first, second)]
    return np.concatenate(parts)


def _choose_greedily(
    usable: Sequence[int],
    spoilt: Sequence[int],
    gains: Gains,
    apart: Callable[[int], FloatArray],
    copy: float,
    most: int,
) -> Choice:
    """Take what adds most, again and again; spoilt ones only if there are too few others.

    Args:
        usable: numbers of those that show something.
        spoilt: numbers of those that show something and are worse than the others.
        gains: what they add.
        apart: the distances of a view to all, as shares of the picture's diagonal.
        copy: of two views nearer than this one is taken at most.
        most: how many may be taken.

    """
    order: list[int] = []
    gain: list[float] = []
    nearest = np.full(max([*usable, *spoilt]) + 1, np.inf)
    ended: Ended = "all"
    few = min(FEWEST, most)
    passes = ((usable, most, _SAME_VIEW), (usable, most, copy), (spoilt, few, copy))
    for pool, enough, least in passes:
        left = [one for one in pool if one not in order and nearest[one] >= least]
        while left and len(order) < enough:
            value, best = max(((gains.of(index), index) for index in left), key=lambda one: one[0])
            if len(order) >= FEWEST and gains.share(value) < _LEAST_GAIN:
                ended = "enough"
                break
            order.append(best)
            gain.append(value)
            gains.take(best)
            nearest = np.minimum(nearest, apart(best)[: len(nearest)])
            left = [one for one in left if one != best and nearest[one] >= least]
        if left and len(order) >= most:
            ended = "asked"
    return Choice(order=tuple(order), gain=tuple(gain), ended=ended)


@dataclass(frozen=True, kw_only=True)
class Scale:
    """The sharpness and motion of good pictures among all.

    Attributes:
        sharp: sharpness of the better ones.
        still: motion of the better ones, pixels.

    """

    sharp: float
    still: float

    @classmethod
    def of(cls, pictures: Sequence[Seen], still_px: float) -> Scale:
        """Return the scale of pictures; ``still_px`` as in :func:`choose`."""
        return cls(
            sharp=float(np.quantile([one.sharpness for one in pictures], 0.75)),
            still=max(still_px, float(np.quantile([one.motion for one in pictures], 0.25))),
        )

    def is_spoilt(self, picture: Seen) -> bool:
        """Return whether a picture is blurred or moving, clearly more than the others."""
        return picture.sharpness < _BLURRED * self.sharp or picture.motion > _MOVING * self.still

    def quality(self, picture: Seen) -> float:
        """Return how much its corners weigh beside those of a good one: 0 to 1."""
        blur = min(1.0, picture.sharpness / self.sharp) if self.sharp > 0 else 1.0
        return float(blur**2 / (1 + (picture.motion / self.still) ** 2))


def _rate_shown(picture: Seen, size: tuple[int, int]) -> FloatArray:
    """Return how well a picture shows each thing: 1 where it says all that one picture can."""
    places = np.bincount(_find_part(picture.pixel, size, _FINE), minlength=_FINE[0] * _FINE[1])
    tilts = np.zeros((_COARSE[0] * _COARSE[1], _SIDES + 1))
    for patch in picture.patches:
        count = np.bincount(_find_part(patch.pixel, size, _COARSE), minlength=len(tilts))
        tilts[:, _find_tilt(patch)] += count
    shown = np.concatenate([places, tilts.ravel()])
    return np.asarray(np.minimum(1.0, shown / _FULL))


def _find_part(
    pixel: FloatArray, size: tuple[int, int], parts: tuple[int, int]
) -> npt.NDArray[np.intp]:
    """Return the number of the part of the picture that each point (N, 2) is in."""
    at = (pixel + 0.5) / np.array(size) * np.array(parts)
    column, row = np.clip(at.astype(int), 0, np.array(parts) - 1).T
    return np.asarray(row * parts[0] + column)


def _find_tilt(patch: Patch) -> int:
    """0 for a board seen from the front, else 1 to 4 for the side that is nearer."""
    centre, area = _find_squares(patch)
    if len(area) < 4:
        return 0
    extent = np.ptp(patch.pixel, axis=0).max()
    terms = np.column_stack([np.ones(len(area)), (centre - centre.mean(axis=0)) / extent])
    slope = np.linalg.lstsq(terms, np.log(area), rcond=None)[0][1:]
    if float(np.hypot(*slope)) < _TILTED:
        return 0
    return 1 + round(float(np.arctan2(slope[1], slope[0])) / (np.pi / 2)) % 4


def _find_squares(patch: Patch) -> tuple[FloatArray, FloatArray]:
    """Return centres (N, 2) and areas (N,) of a patch's whole squares, pixels."""
    where = {(int(i), int(j)): n for n, (i, j) in enumerate(patch.cells)}
    corners = [
        (n, where[i + 1, j], where[i, j + 1])
        for (i, j), n in where.items()
        if (i + 1, j) in where and (i, j + 1) in where
    ]
    if not corners:
        return np.zeros((0, 2)), np.zeros(0)
    one, right, down = patch.pixel[np.array(corners)].swapaxes(0, 1)
    a, b = right - one, down - one
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return (right + down)[area > 0] / 2, area[area > 0]


class _Views:
    """What pictures of one camera show, to be compared."""

    def __init__(self, pictures: Sequence[Seen], size: tuple[int, int]) -> None:
        self._diagonal = float(np.hypot(*size))
        self._corners = np.array([one.corners for one in pictures])
        self._first = np.concatenate([[0], np.cumsum(self._corners)])
        self._picture = np.repeat(np.arange(len(pictures)), self._corners)
        self._pixel = np.concatenate([np.zeros((0, 2)), *(one.pixel for one in pictures)])
        names = np.concatenate([np.zeros(0, np.intp), *(one.names for one in pictures)])
        self._kinds, self._name = np.unique(names, return_inverse=True)
        self._is_named = np.array(
            [all(patch.board >= 0 and patch.certain for patch in one.patches) for one in pictures]
        )
        nothing = np.zeros((1, 2))
        outer = [outermost(one.pixel if one.corners else nothing) for one in pictures]
        self._outer = np.array(outer)

    def measure_distances(self, one: int) -> FloatArray:
        """Return how far all views are from one, as shares of the diagonal.

        inf where nothing is common; -inf where neither shows anything.
        """
        fewer = np.minimum(self._corners[one], self._corners)
        apart = np.full(len(self._corners), np.inf)
        apart[np.maximum(self._corners[one], self._corners) == 0] = -np.inf
        by_names = self._is_named[one] & self._is_named
        outer = (fewer > 0) & ~by_names
        away = np.linalg.norm(self._outer[outer] - self._outer[one], axis=-1)
        apart[outer] = np.median(away, axis=1) / self._diagonal
        own = slice(self._first[one], self._first[one + 1])
        place = np.full(len(self._kinds), -1)
        place[self._name[own]] = np.arange(own.start, own.stop)
        rows = np.flatnonzero((place[self._name] >= 0) & by_names[self._picture])
        away = np.linalg.norm(self._pixel[place[self._name[rows]]] - self._pixel[rows], axis=1)
        away = away[np.lexsort([away, self._picture[rows]])]
        count = np.bincount(self._picture[rows], minlength=len(apart))
        first = np.concatenate([[0], np.cumsum(count)[:-1]])
        enough = (count >= np.maximum(1, np.minimum(_FEWEST_COMMON, fewer))) & (2 * count >= fewer)
        enough &= by_names & (fewer > 0)
        middle = first[enough] + count[enough] // 2
        lower = first[enough] + (count[enough] - 1) // 2
        apart[enough] = (away[lower] + away[middle]) / 2 / self._diagonal
        return apart
