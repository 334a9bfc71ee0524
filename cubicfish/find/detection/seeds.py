"""Which pieces of linked corners are worth growing: all are tried together, before any grows."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress

import cv2
import numpy as np

from cubicfish.find.detection.accept import LEAST_CORNERS, LEAST_SQUARES, find_squares
from cubicfish.find.detection.corners import XCorners
from cubicfish.find.detection.growth import clean, grow_once, measure_contrast
from cubicfish.find.detection.lattice import MARGIN, Lattice
from cubicfish.find.detection.links import Patch
from cubicfish.find.detection.nearby import Tree
from cubicfish.find.detection.pyramid import Pyramid
from cubicfish.types import BoolArray, FloatArray, IntArray

# Fewer corners make no square that growth could begin from.
_LEAST = 4
# More are a grid's without question, or as dear to look at as to grow.
SURE_CORNERS = 2 * LEAST_CORNERS
# Pieces that are not large enough after so many rounds are given up. Of 337 boards, rendered with
# noise, blur, hands, glare and markers or photographed with seven lenses, none was too small after
# three; of 3176 pieces that never became boards three quarters were after four.
_ROUNDS = 4
_ROOM = MARGIN + _ROUNDS  # each round may add a row or a column on either side


@dataclass(kw_only=True, eq=False)
class _Sheet(Lattice):
    """Many pieces in the maps of one lattice, too far apart to be neighbours.

    Attributes:
        piece: (I,) which of them each row of the maps belongs to.
        gaps: (K,) half the gap of each.

    """

    piece: IntArray
    gaps: FloatArray

    @classmethod
    def of_patches(cls, corners: XCorners, patches: Sequence[Patch]) -> "_Sheet":
        """Lay out patches below each other, so that all have the parity of the sheet."""
        size = np.array([len(patch.corner) for patch in patches])
        corner = np.concatenate([patch.corner for patch in patches])
        cells = np.concatenate([patch.cells for patch in patches])
        parity = np.array([patch.parity for patch in patches])
        first = np.cumsum(size) - size
        low, high = np.minimum.reduceat(cells, first), np.maximum.reduceat(cells, first)
        height = high[:, 0] - low[:, 0] + 1 + 2 * _ROOM
        shift = _ROOM - low
        shift[:, 0] += np.cumsum(height) - height
        shift[:, 1] += (shift.sum(1) % 2 == 0) != (parity > 0)
        width = int((high[:, 1] + shift[:, 1]).max()) + 1 + _ROOM
        sheet = cls(
            pixel=np.full((int(height.sum()), width, 2), np.nan),
            contrast=np.zeros((int(height.sum()), width)),
            parity=1,
            piece=np.repeat(np.arange(len(patches)), height),
            gaps=np.zeros(len(patches)),
        )
        at = cells + np.repeat(shift, size, axis=0)
        sheet.put(at, corners.pixel[corner], corners.contrast[corner])
        return sheet

    def make_room(self) -> None:
        """Keep the maps: they have room for all rounds that there are."""

    def gap_at(self, cells: IntArray) -> FloatArray:
        """Half the gap (N,) of the piece that each of (N, 2) cells belongs to."""
        return self.gaps[self.piece[cells[:, 0]]]

    def set_gap(self, cells: IntArray, gap: FloatArray) -> None:
        """Set each piece's from what its corners show: (N, 2), for (N, 2) cells, pixels."""
        piece = np.repeat(self.piece[cells[:, 0]], gap.shape[1])
        inorder = gap.ravel()[np.lexsort((gap.ravel(), piece))]
        count = np.bincount(piece, minlength=len(self.gaps))
        first = np.cumsum(count) - count
        some = count > 0
        low, high = (first + (count - 1) // 2)[some], (first + count // 2)[some]
        self.gaps[some] = 0.5 * (inorder[low] + inorder[high])

    def apart(self, cells: IntArray, pixel: FloatArray) -> FloatArray:
        """Pixels, and a third coordinate that keeps pieces from being in each other's way."""
        return np.column_stack([pixel, 1e6 * self.piece[cells[:, 0]]])

    def count(self, values: BoolArray) -> IntArray:
        """How many cells of a map (up to I, up to J) are true in each piece: (K,)."""
        of_row = np.count_nonzero(values, axis=1)
        piece = self.piece[: len(values)]
        return np.bincount(piece, of_row, minlength=len(self.gaps)).astype(int)

    def large_enough(self) -> BoolArray:
        """Which pieces (K,) are, as :func:`~.accept.is_large_enough` says."""
        squares = find_squares(self.known).astype(np.uint8)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(squares)
        large = stats[:, cv2.CC_STAT_AREA] >= LEAST_SQUARES
        large[0] = False  # what is no square
        hang_together: BoolArray = self.count(large[labels]) > 0
        return hang_together & (self.count(self.known) >= LEAST_CORNERS)


def find_promising(
    pyramid: Pyramid, corners: XCorners, patches: Sequence[Patch], free: Tree
) -> BoolArray:
    """Which of K patches may become boards (K,).

    Those of SURE_CORNERS, and those that are large enough for a board after some rounds of
    growth, for which they do not see each other. That costs little more than such rounds of
    one of them.

    Args:
        pyramid: the photo.
        corners: of which patches are made.
        patches: as :func:`~.links.find_patches` has them.
        free: candidates to snap to.

    """
    size = np.array([len(patch.corner) for patch in patches], int)
    promising, small = size >= SURE_CORNERS, (size >= _LEAST) & (size < SURE_CORNERS)
    some = list(compress(patches, small))
    if not some:
        return promising
    sheet = _Sheet.of_patches(corners, some)
    measure_contrast(pyramid, sheet)
    clean(sheet)
    for _ in range(_ROUNDS):
        cells = sheet.frontier()
        open_ = (sheet.count(sheet.known) >= _LEAST) & ~sheet.large_enough()
        cells = cells[open_[sheet.piece[cells[:, 0]]]]
        if not len(cells) or not grow_once(pyramid, sheet, free, cells):
            break
    promising[small] = sheet.large_enough()
    return promising
