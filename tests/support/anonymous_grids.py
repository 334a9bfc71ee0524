"""Grids without names, made from corners of known names, and the places that they had."""

from __future__ import annotations

import numpy as np

from cubicfish import Observations, Target
from cubicfish.find.detection.grids import Grid
from cubicfish.find.identification.identified import Place
from cubicfish.target.placement import TURNS


def anonymous(
    corners: Observations, target: Target, keep: np.ndarray, rng: np.random.Generator
) -> tuple[Grid, Place]:
    """The corners where ``keep`` is true, all of one board, as a grid turned at random."""
    board = int(corners.board[keep][0])
    turn = int(rng.integers(4))
    named = np.stack([corners.column[keep], corners.row[keep]], axis=-1)
    cells = named @ TURNS[turn]
    first = cells.min(axis=0)
    offset = TURNS[turn] @ first
    pixel = corners.pixel[keep]
    # The square down-right of corner (0, 0) has the colour of the first; each step flips it,
    # and so does a quarter turn of the pair of squares that lie down-right and up-left.
    light = target.boards[board].first_square == "light"
    parity = (1 if light else -1) * (-1) ** int(offset.sum() + turn)
    distance = np.linalg.norm(pixel[:, None] - pixel[None], axis=-1)
    np.fill_diagonal(distance, np.inf)
    grid = Grid(
        cells=cells - first,
        pixel=pixel,
        parity=parity,
        step=float(np.median(distance.min(axis=1))),
        contrast=np.full(len(pixel), 100.0),
    )
    return grid, Place(board=board, turn=turn, column=int(offset[0]), row=int(offset[1]))


def anonymous_photos(
    corners: Observations, target: Target, *, least: int = 8, seed: int = 0
) -> tuple[list[list[Grid]], list[list[Place]]]:
    """Every board of every photo with at least ``least`` corners, in random order."""
    rng = np.random.default_rng(seed)
    photos, places = [], []
    for image in range(len(corners.images)):
        both = []
        for board in rng.permutation(len(target.boards)):
            keep = (corners.image == image) & (corners.board == board)
            spans = keep.sum() >= least and all(
                np.ptp(axis[keep]) > 0 for axis in (corners.column, corners.row)
            )
            if spans:
                both.append(anonymous(corners, target, keep, rng))
        photos.append([grid for grid, _ in both])
        places.append([place for _, place in both])
    return photos, places
