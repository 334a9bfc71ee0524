"""Markers that can be read in a photo, and which of them agree about where their board is."""

from __future__ import annotations

import numpy as np

from cubicfish_cli.detection.grids import FoundGrids
from cubicfish_cli.detection.markers_detect import Family, SeenMarkers, find_outlines, join
from cubicfish_cli.detection.markers_read import marker_ratio, read_grid, read_outlines, squares
from cubicfish_cli.detection.pyramid import Pyramid
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray, IntArray

# Markers vouch for each other up to this many cells apart, when each is where the shape of both
# puts it, to this share of a cell: distortion takes a tenth or two, a wrong cell is 1 away.
VOUCH_CELLS = 2
_VOUCH_MISS = 0.4


def middles_and_axes(outline: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middles (N, 2) of quadrangles (N, 4, 2), and (N, 2, 2): columns to the right, and down."""
    a, b, c, d = outline.transpose(1, 0, 2)
    return outline.mean(axis=1), 0.5 * np.stack([b + c - a - d, c + d - a - b], axis=-1)


def all_read(
    pyramid: Pyramid,
    target: Target,
    all_families: list[Family],
    grids: FoundGrids,
    alone: SeenMarkers | None = None,
) -> SeenMarkers:
    """Markers that are read by their own outlines, as ``alone`` if given, or in grids' squares."""
    alone = read_alone(pyramid, all_families) if alone is None else alone
    in_grids = (read_grid(pyramid, target, all_families, grid) for grid in grids.grids)
    return join([alone, *in_grids])


def read_alone(pyramid: Pyramid, all_families: list[Family]) -> SeenMarkers:
    """Markers that are read by their own outlines."""
    grey = np.clip(np.rint(pyramid.levels[0]), 0, 255).astype(np.uint8)
    return read_outlines(pyramid, all_families, find_outlines(grey, all_families))


def places_told(markers: SeenMarkers, target: Target, board: int) -> IntArray:
    """Which markers of a board agree about where it is: (N,) the same number for those."""
    count = len(markers)
    pitch = 1 + target.boards[board].spacing if target.boards[board].kind == "aprilgrid" else 1.0
    square = squares(markers.pixel, marker_ratio(target, board))
    middle, step = middles_and_axes(square)
    apart = markers.cell[None] - markers.cell[:, None]
    step = 0.5 * pitch * (step[None] + step[:, None])
    expected = (step @ apart[..., None])[..., 0]
    miss = np.linalg.norm(middle[None] - middle[:, None] - expected, axis=-1)
    length = np.linalg.norm(step, axis=-2).min(axis=-1)
    agree = (np.abs(apart).max(axis=-1) <= VOUCH_CELLS) & (miss < _VOUCH_MISS * length)
    label = np.arange(count)
    while True:
        lowest = np.where(agree | agree.T, label[None], count).min(axis=1)
        if (lowest == label).all():
            return label
        label = lowest
