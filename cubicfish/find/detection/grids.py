"""What the corner finder hands on: grids of sub-pixel checkerboard corners.

Also as they would be in a photo's mirror image, or in its negative.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from cubicfish.types import BoolArray, FloatArray, IntArray

Float32Array = npt.NDArray[np.float32]

# Positions are rounded to this many digits of a pixel, far below any noise: their last bits
# depend on how memory happens to be aligned, and no result may depend on the processes used.
_DIGITS = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """A record whose fields are arrays with one row for each thing that it is about."""

    def select(self, rows: BoolArray | IntArray | slice) -> Self:
        """Take some rows."""
        return type(self)(**{one.name: getattr(self, one.name)[rows] for one in fields(self)})

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The rows of several records, at least one, as those of one."""
        names = [one.name for one in fields(cls)]
        return cls(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """One board's visible corners, without knowing yet which board it is.

    Attributes:
        cells: (N, 2) integer (i, j) of each corner; the smallest i and the smallest j are 0.
            Right-handed: seen on the printed face with i to the right, j is down. Photos are
            never mirrored, so in pixels (y down) det[dp/di, dp/dj] > 0.
        pixel: (N, 2) sub-pixel x, y of each corner.
        parity: +1 when the square between (0, 0), (1, 0), (0, 1) and (1, 1) is bright, -1 when
            it is dark; every step along i or j flips it.
        step: median distance of neighbouring corners, pixels.
        contrast: (N,) bright minus dark level around each corner, in grey levels of the photo.

    """

    cells: IntArray
    pixel: FloatArray
    parity: int
    step: float
    contrast: FloatArray

    def __len__(self) -> int:
        """Return the number of corners."""
        return len(self.cells)


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundGrids:
    """Everything that was found in one photo.

    Attributes:
        grids: the accepted grids, largest first.
        refused: candidate corners (N, 2), pixels, that look like X-corners on their own but
            belong to no accepted grid; for drawing and for explaining an empty result.
        image_size: (width, height) of the photo, pixels.
        searched: whether the photo was searched for grids at all.

    """

    grids: tuple[Grid, ...]
    refused: FloatArray
    image_size: tuple[int, int]
    searched: bool = True

    @classmethod
    def not_searched(cls, image_size: tuple[int, int]) -> Self:
        """Those of a photo of (width, height) that nobody searched."""
        none = np.zeros((0, 2))
        return cls(grids=(), refused=none, image_size=image_size, searched=False)

    def each(self) -> list[Self]:
        """Every grid by itself."""
        return [replace(self, grids=(grid,)) for grid in self.grids]

    def moved(self, by: FloatArray | IntArray) -> Self:
        """The same in a photo of which this one is the part that begins at ``by`` (2,): x, y."""
        grids = tuple(replace(grid, pixel=grid.pixel + by) for grid in self.grids)
        return replace(self, grids=grids, refused=self.refused + by)


def negative_photo(image: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A grey photo (H, W) with light and dark exchanged."""
    integer = np.issubdtype(image.dtype, np.integer)
    top = image.dtype.type(np.iinfo(image.dtype).max if integer else 255)
    return np.asarray(top - image)


def negative_grids(found: FoundGrids) -> FoundGrids:
    """Grids of the negative photo."""
    return replace(found, grids=tuple(replace(grid, parity=-grid.parity) for grid in found.grids))


def grids_in_mirror(found: FoundGrids) -> FoundGrids:
    """Grids of the photo with left and right exchanged."""
    width = found.image_size[0]
    return replace(
        found,
        grids=tuple(grid_in_mirror(grid, width) for grid in found.grids),
        refused=_mirror_pixels(found.refused, width),
    )


def grid_in_mirror(grid: Grid, width: int) -> Grid:
    """One grid in the mirror image of a photo that is so many pixels wide."""
    return replace(
        grid,
        # Exchanging i and j keeps the grid right-handed, and the square at (0, 0) where it is.
        cells=grid.cells[:, ::-1].copy(),
        pixel=_mirror_pixels(grid.pixel, width),
    )


def _mirror_pixels(pixel: FloatArray, width: int) -> FloatArray:
    return np.stack([width - 1 - pixel[:, 0], pixel[:, 1]], axis=-1)


def round_pixels(pixel: FloatArray) -> FloatArray:
    """Pixels without the digits that differ from one process to another."""
    return np.asarray(np.round(pixel, _DIGITS))
