"""The ink of a board as polygons: what the renderer calls dark, in one exact outline.

The ink's edges run along x and along y only, so its places are a grid of cells, each of one
colour, which the face itself tells. All cells that touch along a side become one polygon: black
next to black is one area, and no reader or printer can leave a white hair between them.
"""

from __future__ import annotations

import numpy as np

from cubicfish_cli.boards.board import Face
from cubicfish_cli.types import BoolArray, FloatArray, IntArray

Corner = tuple[int, int]

# Edges nearer to each other than this share of the face are one edge, but for rounding.
_SAME = 1e-12
_RIGHT, _DOWN, _LEFT, _UP = range(4)
_STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))


def ink_outlines(
    face: Face, lower: tuple[float, float], upper: tuple[float, float]
) -> list[FloatArray]:
    """Closed outlines (K, 2) of the ink between two opposite corners, in the board's plane.

    Outlines have the ink on their right (y runs down), holes included, so that the rule of
    non-zero winding fills just the ink. Areas that only touch at a corner are apart.
    """
    x = _cuts(face.steps[0], lower[0], upper[0])
    y = _cuts(face.steps[1], lower[1], upper[1])
    middle = np.stack(np.meshgrid((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2), axis=-1)
    loops = _loops(face.is_dark(middle))
    return [np.stack([x[loop[:, 0]], y[loop[:, 1]]], axis=-1) for loop in loops]


def _cuts(steps: FloatArray, lower: float, upper: float) -> FloatArray:
    inside = np.unique(steps[(steps > lower) & (steps < upper)])
    cuts = np.concatenate([[lower], inside, [upper]])
    same = _SAME * max(abs(lower), abs(upper))
    return cuts[np.concatenate([[True], np.diff(cuts) > same])]


def _loops(dark: BoolArray) -> list[IntArray]:
    """(rows, columns) -> the corners (K, 2), as x and y, of each outline of the dark cells."""
    around = np.pad(dark, 1)
    inside = around[1:-1, 1:-1]
    ways: dict[Corner, list[int]] = {}
    # With the ink on the right: along a cell's top to the right, down its right side, and so on.
    for way, light, start in (
        (_RIGHT, ~around[:-2, 1:-1], (0, 0)),
        (_DOWN, ~around[1:-1, 2:], (1, 0)),
        (_LEFT, ~around[2:, 1:-1], (1, 1)),
        (_UP, ~around[1:-1, :-2], (0, 1)),
    ):
        row, column = np.nonzero(inside & light)
        for corner in zip((column + start[0]).tolist(), (row + start[1]).tolist(), strict=True):
            ways.setdefault(corner, []).append(way)
    return [np.array(loop, np.intp) for loop in _follow(ways)]


def _follow(ways: dict[Corner, list[int]]) -> list[list[Corner]]:
    """Corners of closed ways, of which each part leaves a corner in one of its ``ways``."""
    loops = []
    left = dict.fromkeys((corner, way) for corner, leaving in ways.items() for way in leaving)
    while left:
        first = corner, way = next(iter(left))
        loop: list[Corner] = []
        while True:
            del left[corner, way]
            before = way
            corner = (corner[0] + _STEPS[way][0], corner[1] + _STEPS[way][1])
            # Where two areas touch, a turn to the right stays with the same one.
            way = ways[corner][0] if len(ways[corner]) == 1 else (way + 1) % 4
            if way != before:
                loop.append(corner)
            if (corner, way) == first:
                break
        loops.append(loop)
    return loops
