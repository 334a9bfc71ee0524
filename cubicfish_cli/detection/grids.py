"""What the corner finder hands on: grids of sub-pixel checkerboard corners."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from cubicfish_cli.types import BoolArray, FloatArray, IntArray

Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows:
    """A record whose fields are arrays with one row for each thing that it is about."""

    def select(self, rows: BoolArray | IntArray | slice) -> Self:
        """Take some rows."""
        return replace(self, **{one.name: getattr(self, one.name)[rows] for one in fields(self)})


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

    """

    grids: tuple[Grid, ...]
    refused: FloatArray
    image_size: tuple[int, int]
