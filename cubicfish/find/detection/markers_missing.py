"""Where boards of markers may go on beyond what was found of them: what a closer look is for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.grids import Float32Array, Rows
from cubicfish.find.detection.lattice import LocalFit, neighbours
from cubicfish.find.detection.markers_lattice import BoardLattice
from cubicfish.find.detection.pyramid import Pyramid
from cubicfish.target.boards.board import Board
from cubicfish.types import BoolArray, FloatArray

_Scalar = TypeVar("_Scalar", bound=np.generic)
# A corner has 0.15 of the contrast around it at least; what shows less than two thirds of that is
# none, and what lies beyond the lens's circle or the light is even.
_SHOWN, _LEAST_SIGNAL = 0.1, 6.0
# A marker beyond an unknown corner vouches for those two cells away, and has corners around it.
_MARGIN = 3.0
# A place is off by up to half a cell, so that a corner shows within as much around it.
_AROUND = np.stack(np.meshgrid(*2 * [np.linspace(-0.5, 0.5, 5)]), axis=-1).reshape(-1, 2)


@dataclass(frozen=True, kw_only=True)
class Part:
    """A rectangle of a photo.

    Attributes:
        rows, columns: which pixels.

    """

    rows: slice
    columns: slice

    @classmethod
    def whole(cls, size: tuple[int, int]) -> Part:
        """All of a photo of (width, height)."""
        return cls(rows=slice(0, size[1]), columns=slice(0, size[0]))

    @classmethod
    def around(cls, pixel: FloatArray, margin: FloatArray, size: tuple[int, int]) -> Part:
        """What lies within (N,) margins of (N, 2) pixels, N at least 1, of such a photo."""
        low = np.floor((pixel - margin[:, None]).min(axis=0)).clip(0, size).astype(int)
        high = np.ceil((pixel + margin[:, None]).max(axis=0) + 1).clip(0, size).astype(int)
        return cls(rows=slice(low[1], high[1]), columns=slice(low[0], high[0]))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The least that holds all of several parts, at least one."""
        return cls(
            rows=_join([part.rows for part in parts]),
            columns=_join([part.columns for part in parts]),
        )

    @property
    def pixels(self) -> int:
        """How many there are."""
        return (self.rows.stop - self.rows.start) * (self.columns.stop - self.columns.start)

    def of(self, image: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
        """The part of a photo (H, W)."""
        return image[self.rows, self.columns]

    def back(self, pixel: FloatArray) -> FloatArray:
        """Pixels (..., 2) of the part as pixels of the photo."""
        return pixel + np.array([self.columns.start, self.rows.start])


def _join(slices: Sequence[slice]) -> slice:
    return slice(min(one.start for one in slices), max(one.stop for one in slices))


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenEnds(Rows):
    """Where a board may go on: beside its known corners, in the photo, and something shows.

    Attributes:
        pixel: (N, 2) where the next corners would be.
        side: (N,) length of a square (tag) there, pixels.

    """

    pixel: FloatArray
    side: FloatArray

    @classmethod
    def of(cls, pyramid: Pyramid, lattice: BoardLattice) -> OpenEnds:
        """Those of the known corners of a board in a photo."""
        known = lattice.known
        cells = np.argwhere((neighbours(known) > 0) & ~known)
        fit = lattice.fit(cells)
        there = fit.sound & pyramid.inside(fit.pixel, 2.0)
        cells, fit = cells[there], fit.select(there)
        if not len(cells):
            return cls(pixel=np.zeros((0, 2)), side=np.zeros(0))
        own = lattice.cells()
        shown = np.zeros(known.shape)
        shown[own[:, 0], own[:, 1]] = _measure_shown(pyramid, lattice.fit(own), lattice.closest)
        count = np.maximum(lattice.neighbour_sum(known.astype(float)), 1)
        usual = (lattice.neighbour_sum(shown) / count)[cells[:, 0], cells[:, 1]]
        seen: BoolArray = _measure_shown(pyramid, fit, lattice.closest) > np.maximum(
            _SHOWN * usual, _LEAST_SIGNAL * pyramid.noise
        )
        return cls(pixel=fit.pixel[seen], side=fit.side[seen])

    def part(self, size: tuple[int, int]) -> Part:
        """What part of a photo of (width, height) they, at least one, and what is beyond are in."""
        return Part.around(self.pixel, _MARGIN * self.side, size)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.side)


def _measure_shown(pyramid: Pyramid, fit: LocalFit, closest: float) -> FloatArray:
    """How far apart light and dark (N,) are around places, in grey levels."""
    level = pyramid.sample(fit.at(closest * _AROUND), fit.side)
    return np.asarray(np.ptp(level, axis=1), float)


def hidden(photo: Float32Array, lattices: Sequence[BoardLattice]) -> Float32Array:
    """A copy of a photo in which the squares between known corners are an even grey."""
    shapes = []
    for lattice in lattices:
        first = np.stack(np.meshgrid(*map(np.arange, lattice.known.shape), indexing="ij"), axis=-1)
        shapes.append(lattice.whole_squares(first.reshape(-1, 1, 2) + Board.AROUND_SQUARE)[1])
    return _paint(photo, shapes)


def hidden_around(photo: Float32Array, lattices: Sequence[BoardLattice]) -> Float32Array:
    """The same of all squares (tags) that have a known corner, those beyond the outermost too."""
    around = np.asarray(2 * Board.AROUND_SQUARE - 1, float)
    return _paint(photo, [lattice.fit(lattice.cells()).at(around) for lattice in lattices])


def _paint(photo: Float32Array, shapes: Sequence[FloatArray]) -> Float32Array:
    """A copy of a photo with quadrangles (N, 4, 2) of several boards in one grey each."""
    painted = photo.copy()
    last = np.array(photo.shape[::-1]) - 1
    for shape in shapes:
        corner = np.rint(shape.reshape(-1, 2)).clip(0, last).astype(int)
        grey = float(np.mean(photo[corner[:, 1], corner[:, 0]])) if len(corner) else 0.0
        for one in np.rint(shape).clip(-30_000, 30_000).astype(np.int32):
            cv2.fillConvexPoly(painted, one, grey)
    return painted
