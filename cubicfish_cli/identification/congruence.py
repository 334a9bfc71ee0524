"""Labelings that no photo can tell apart, and the symmetries of a target.

Two labelings of the same grids are congruent when a similarity of space (turn, shift, scale)
carries every named corner's place under the one onto its place under the other: the same photo
is then explained equally well from another camera position. Some come from a symmetry of the
whole target, such as half a turn of a board with even sides, and are harmless: the turned object
is the same object. The others are slides along something that shows no end.
"""

from __future__ import annotations

import numpy as np

from cubicfish_cli.geometry import Similarity
from cubicfish_cli.identification.placement import Placement
from cubicfish_cli.types import FloatArray

# Places that agree this well, in squares, are the same place.
SAME = 0.01
_SAME_SCALE = 1e-3


def is_symmetry(motion: Similarity, sides: Placement) -> bool:
    """Whether ``motion`` carries the target onto itself, colours included."""
    if abs(motion.scale - 1) > _SAME_SCALE:
        return False
    upright = np.flatnonzero(sides.turn == 0)
    for one in upright:
        ends = np.array([[0, 0], sides.size[one] - 1])
        world = sides.origin[one] + sides.square[one] * ends @ sides.axes[one].T
        frame = motion.rotation @ sides.frame[one]
        world = world @ motion.rotation.T + motion.shift
        if not any(_lands_on(frame, world, int(one), other, sides) for other in upright):
            return False
    return True


def _lands_on(
    frame: FloatArray, world: FloatArray, one: int, other: np.intp, sides: Placement
) -> bool:
    """Whether board ``one``, moved to ``frame`` and end corners ``world``, covers ``other``."""
    square = sides.square[other]
    if abs(sides.square[one] - square) > 1e-3 * square:
        return False
    turned = sides.frame[other : other + 4]
    same = np.abs(turned - frame).max(axis=(1, 2)) < SAME / max(sides.size[other])
    if not same.any():
        return False
    turn = int(np.argmax(same))
    arm = (world - sides.origin[other]) / square
    cells = arm @ sides.axes[other]
    off_plane = np.abs(arm @ sides.frame[other][:, 2]).max()
    if np.abs(cells - np.rint(cells)).max() > SAME or off_plane > SAME:
        return False
    corners = np.rint(cells).astype(np.intp)
    if (corners.min(axis=0) != 0).any() or (corners.max(axis=0) != sides.size[other] - 1).any():
        return False
    # A quarter turn, and each odd step of the first corner, swap the two colours.
    flips = turn + int(corners[0].sum())
    return bool(sides.colour[one] == sides.colour[other] * (-1) ** flips)
