"""What was found in a photo as it would be in the photo's mirror image, or in its negative."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.grids import FoundGrids, Grid
from cubicfish_cli.types import FloatArray


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
        refused=_pixels_in_mirror(found.refused, width),
    )


def grid_in_mirror(grid: Grid, width: int) -> Grid:
    """One grid in the mirror image of a photo that is so many pixels wide."""
    return replace(
        grid,
        # Exchanging i and j keeps the grid right-handed, and the square at (0, 0) where it is.
        cells=grid.cells[:, ::-1].copy(),
        pixel=_pixels_in_mirror(grid.pixel, width),
    )


def _pixels_in_mirror(pixel: FloatArray, width: int) -> FloatArray:
    return np.stack([width - 1 - pixel[:, 0], pixel[:, 1]], axis=-1)
