"""Boards that cannot be part of one target: in the same place, or with the same markers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.boards.shape import AXES_TOLERANCE
from cubicfish_cli.errors import TargetError
from cubicfish_cli.types import FloatArray
from cubicfish_cli.wording import quoted


def refuse_overlaps(where: str, boards: Sequence[Board]) -> None:
    """Refuse markers that two boards carry, and two boards in one place.

    Raises:
        TargetError: there are such boards.

    """
    for one, other in combinations(boards, 2):
        a, b = one.markers, other.markers
        if a is None or b is None or a.dictionary != b.dictionary:
            continue
        low, high = max(a.first, b.first), min(a.first + a.count, b.first + b.count) - 1
        if low <= high:
            raise TargetError(
                f"{where}, board {quoted(other.name)}, first_marker: ids {low} to {high} are on "
                f"board {quoted(one.name)} too: every marker may be there only once"
            )
    for one, other in combinations(boards, 2):
        if _in_the_same_place(one, other):
            key = "origin" if other.points is None else "points"
            raise TargetError(
                f"{where}, board {quoted(other.name)}, {key}: it is in the same place as "
                f"board {quoted(one.name)}"
            )


def plane_count(boards: Sequence[Board]) -> int:
    """Number of distinct planes that boards lie in."""
    planes: list[tuple[FloatArray, FloatArray]] = []
    extent = max(np.ptp(board.outline(), axis=0).max() for board in boards)
    for board in boards:
        plane = board.plane()
        if plane and not any(_same_plane(plane, known, 1e-3 * extent) for known in planes):
            planes.append(plane)
    return len(planes)


def _in_the_same_place(one: Board, other: Board) -> bool:
    """Whether two faces cover each other: same plane, same side, outlines that overlap.

    A plate printed on both sides is two boards whose faces look away from each other.
    Lists of points are in the same place when one list is part of the other.
    """
    if one.points is not None and other.points is not None:
        few, many = sorted((one.points, other.points), key=len)
        return {tuple(point) for point in few.tolist()} <= {tuple(p) for p in many.tolist()}
    if one.points is not None or other.points is not None:
        return False
    pitch = min(one.square, other.square)
    a, b = one.outline(), other.outline()
    if one.axes[2] @ other.axes[2] < 1 - AXES_TOLERANCE:
        return False
    if np.abs((b - one.origin) @ one.axes[2]).max() > 0.1 * pitch:
        return False
    # Two rectangles are apart exactly when a side's direction of either separates them.
    for axis in (one.x_axis, one.y_axis, other.x_axis, other.y_axis):
        if min((a @ axis).max(), (b @ axis).max()) - max((a @ axis).min(), (b @ axis).min()) < (
            0.1 * pitch
        ):
            return False
    return True


def _same_plane(
    one: tuple[FloatArray, FloatArray], other: tuple[FloatArray, FloatArray], tolerance: float
) -> bool:
    parallel = abs(one[1] @ other[1]) > 1 - AXES_TOLERANCE**2
    return bool(parallel and abs((other[0] - one[0]) @ one[1]) < tolerance)
