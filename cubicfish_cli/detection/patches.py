"""Integer coordinates: connected pieces of linked corners, the seeds of the grids."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from cubicfish_cli.detection.links import Links
from cubicfish_cli.types import FloatArray, IntArray

# Step of arm 0, 1, 2, 3 of a corner that is not rotated: clockwise on screen.
DIRECTIONS = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """One connected piece.

    Attributes:
        corner: (N,) indices of the corners.
        cells: (N, 2) their integer coordinates.
        parity: +1 when the square (0, 0)..(1, 1) is bright, else -1.

    """

    corner: IntArray
    cells: IntArray
    parity: int


def find_patches(links: Links, strength: FloatArray) -> list[Patch]:
    """Walk along the links of :func:`~.links.keep_squares`; largest piece first.

    Pieces of the same size come in the order of their corners' summed ``strength`` (N,).

    A corner that is reached with two different coordinates stays where it was first put, a
    second corner in the same cell is left out; growing repairs either.
    """
    corner, arm = links.corner.tolist(), links.arm.tolist()
    steps = [tuple(step) for step in DIRECTIONS.tolist()]
    visited = [False] * len(corner)
    patches = []
    for first in np.nonzero((links.corner >= 0).any(1))[0].tolist():
        if visited[first]:
            continue
        # Arm a of a corner with rotation r points along DIRECTIONS[(r + a) % 4].
        place: dict[tuple[int, int], int] = {(0, 0): first}
        state = {first: (0, 0, 0)}
        visited[first] = True
        queue = deque([first])
        while queue:
            here = queue.popleft()
            i, j, rotation = state[here]
            for a in range(4):
                there = corner[here][a]
                if there < 0 or visited[there]:
                    continue
                direction = (rotation + a) % 4
                cell = (i + steps[direction][0], j + steps[direction][1])
                if cell in place:
                    continue
                visited[there] = True
                place[cell] = there
                state[there] = (*cell, (direction + 2 - arm[here][a]) % 4)
                queue.append(there)
        members = np.fromiter(state, int, len(state))
        coordinates = np.array([state[member] for member in state])
        # Arms are counted from one with its bright side clockwise: even arms lead along a
        # bright sector, so an even rotation means that the quadrant (+i, +j) is bright.
        bright = (coordinates[:, 2] % 2 == 0) == (coordinates[:, :2].sum(1) % 2 == 0)
        patches.append(
            Patch(
                corner=members,
                cells=coordinates[:, :2],
                parity=1 if 2 * bright.sum() >= len(bright) else -1,
            )
        )
    return sorted(patches, key=lambda p: (-len(p.corner), -float(strength[p.corner].sum())))
