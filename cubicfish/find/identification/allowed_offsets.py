"""Where on a target a grid of corners fits, by its extent and the colour of its squares."""

from dataclasses import dataclass

import numpy as np

from cubicfish.target.placement import Placement
from cubicfish.types import BoolArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class AllowedOffsets:
    """The offsets that keep a grid on its board, for every side.

    Attributes:
        low, high: (S, 2) smallest and largest offset; a side that is too small has high < low.
        parity: (S,) 0 or 1: what (offset column + offset row) mod 2 must be for the squares'
            colours to agree.

    """

    low: IntArray
    high: IntArray
    parity: IntArray

    def allows(self, side: IntArray, offset: IntArray) -> BoolArray:
        """(K,) sides and (K, 2) offsets -> (K,) whether the grid can lie there."""
        inside = ((offset >= self.low[side]) & (offset <= self.high[side])).all(axis=-1)
        return inside & (offset.sum(axis=-1) % 2 == self.parity[side])

    def places(self) -> tuple[IntArray, IntArray]:
        """Every allowed place: sides (H,) and offsets (H, 2)."""
        sides, offsets = [np.empty(0, np.intp)], [np.empty((0, 2), np.intp)]
        for side, (low, high) in enumerate(zip(self.low, self.high, strict=True)):
            offset = low + np.indices(np.maximum(high - low + 1, 0)).reshape(2, -1).T
            offset = offset[offset.sum(axis=-1) % 2 == self.parity[side]]
            sides.append(np.full(len(offset), side, np.intp))
            offsets.append(offset)
        return np.concatenate(sides), np.concatenate(offsets)

    @property
    def wide_enough(self) -> bool:
        """Whether there is a board that is large enough, whatever its colours."""
        return bool((self.high >= self.low).all(axis=1).any())

    @property
    def possible(self) -> bool:
        """Whether there is any place."""
        extent = self.high - self.low + 1
        # Among two offsets side by side one is of either parity.
        colours = (extent > 1).any(axis=1) | (self.low.sum(axis=1) % 2 == self.parity)
        return bool(((extent > 0).all(axis=1) & colours).any())


def find_allowed_offsets(cells: IntArray, parity: int, sides: Placement) -> AllowedOffsets:
    """Where on the target a grid fits, by its extent and the colour of its squares.

    Args:
        cells: (N, 2) of its corners.
        parity: +1 when the square down-right of cell (0, 0) is light, else -1.
        sides: the target's boards in all turns.

    """
    box = np.stack([cells.min(axis=0), cells.max(axis=0)])
    ends = box @ np.swapaxes(sides.matrix, -1, -2)
    return AllowedOffsets(
        low=-ends.min(axis=1),
        high=sides.size - 1 - ends.max(axis=1),
        parity=sides.flips(parity).astype(np.intp),
    )
