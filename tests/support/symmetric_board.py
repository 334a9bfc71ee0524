"""Corners of a board that looks the same after a turn, by true names and by names by chance."""

from dataclasses import replace
from functools import cache

import numpy as np
from simulated import CornerErrors, simulated_corners
from synthetic_lenses import synthetic_lens

from cubicfish import Observations, Target
from cubicfish.target.boards.shape import BoardShape
from cubicfish.target.placement import renamed, symmetries

LENS = synthetic_lens("equisolid", (800, 600))
# Their corners are off together, as those of one photo are.
ERRORS = CornerErrors(noise=0.03, shared=0.03)


@cache
def drawn(columns: int, rows: int) -> Target:
    board = {"name": "b", "type": "checkerboard", "corners": [columns, rows], "square": 30.0}
    return Target.from_data({"units": "mm", "boards": [board]})


@cache
def photos(columns: int, rows: int, off_mm: float, count: int = 12) -> Observations:
    """Corners by their true names: of a print that bends, each corner off by so much."""
    target = drawn(columns, rows)
    shape = BoardShape(
        bend=np.array([0.5, -0.3]),
        twist=0.2,
        stretch=np.array([0.001, -0.001]),
        offsets=np.random.default_rng(4).normal(0, off_mm, (rows, columns, 3)),
    )
    real = target.with_boards({0: replace(target.boards[0], shape=shape)})
    return simulated_corners(LENS, real, count, seed=3, errors=ERRORS)[0].with_target(target)


def misnamed(pairs: Observations, target: Target) -> tuple[Observations, list[int]]:
    """Each photo named in one of all ways, by chance; which, 0 for the truth."""
    motions = symmetries(target)
    way = np.random.default_rng(0).integers(0, len(motions) + 1, len(pairs.images)).tolist()
    named = {pairs.images[k]: motions[w - 1] for k, w in enumerate(way) if w}
    return renamed(pairs, target, named), way
