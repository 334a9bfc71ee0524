"""What is known of a calibration target before a photo is taken.

The turns after which it looks the same, the boards that look like others, and the prints that reach
into each other. Everything is judged on the nominal target.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Literal

import numpy as np

from cubicfish.solve.poses import vector_from_rotation
from cubicfish.solve.subset import flatness
from cubicfish.target.boards.board import Board
from cubicfish.target.boards.section import AXES_TOLERANCE
from cubicfish.target.placement import placement_of, symmetries
from cubicfish.target.target import Target
from cubicfish.types import FloatArray

NamedBy = Literal["markers", "geometry", "table"]

_FLAT = 1e-4
_ONE_PLANE = 1e-6
# Prints that reach into each other by less than this, in squares, only touch.
_TOUCH = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """A motion of the target after which its boards cover boards again.

    Attributes:
        boards: names of its plain boards.
        onto: for each of them, the name of the board that it then covers.
        angle_deg: by how much the target is turned, 0 to 180.
        axis: (3,) unit direction of the axis, by the right-hand rule; for a half turn the one of
            the two directions whose first entry that is not 0 is positive.

    """

    boards: tuple[str, ...]
    onto: tuple[str, ...]
    angle_deg: float
    axis: FloatArray

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON: ``angle_deg``, ``axis``, and ``onto``, by the boards' names."""
        onto = dict(zip(self.boards, self.onto, strict=True))
        return {"angle_deg": self.angle_deg, "axis": self.axis, "onto": onto}


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectFacts:
    """The facts about a target that :func:`check_object` found.

    Attributes:
        corners: how many corners the target has.
        planes: number of distinct planes of its boards.
        flat: whether all corners lie in one plane.
        named_by: what names corners in photos: ``markers``, else ``geometry``, which is size and
            colours of plain boards; ``table`` where nothing can be found in photos (lists of
            points).
        plain: names of the boards that carry no markers and are found in photos.
        symmetries: turns, other than the identity, after which the whole target looks the same.
        look_alikes: groups of boards that look the same where nothing else is in a photo; a group
            of one looks the same after half a turn, or a quarter. There are none where markers name
            the corners.
        crossing: pairs of boards whose prints reach into each other.

    """

    corners: int
    planes: int
    flat: bool
    named_by: NamedBy
    plain: tuple[str, ...]
    symmetries: tuple[Turn, ...]
    look_alikes: tuple[tuple[str, ...], ...]
    crossing: tuple[tuple[str, str], ...]

    @property
    def ambiguous(self) -> bool:
        """Whether some photo of whole boards can be named in more than one way."""
        return bool(self.symmetries or self.look_alikes)


def check_object(target: Target) -> ObjectFacts:
    """Find the facts about the nominal target, without deformations that a calibration found."""
    nominal = target.with_flat_boards()
    world = nominal.corners()[3]
    printed = [board for board in nominal.boards if board.points is None]
    plain = [board for board in printed if board.markers is None]
    by_geometry = bool(plain) and not nominal.has_markers
    named = replace(nominal, boards=tuple(plain)) if by_geometry else None
    return ObjectFacts(
        corners=len(world),
        planes=count_planes(nominal.boards),
        flat=flatness(world) < _FLAT,
        named_by="markers" if nominal.has_markers else "geometry" if plain else "table",
        plain=tuple(board.name for board in plain),
        symmetries=() if named is None else _find_turns(named),
        look_alikes=() if named is None else _find_look_alikes(named),
        crossing=_find_crossing(printed),
    )


def count_planes(boards: Sequence[Board]) -> int:
    """Count the distinct planes in which boards lie: each one determines more of P.

    A list of points counts if its points lie in one plane (to 1e-6 of their extent).
    """
    planes: list[tuple[FloatArray, FloatArray]] = []
    outlines = [board.outline() for board in boards]
    apart = 1e-3 * max(np.ptp(outline, axis=0).max() for outline in outlines)
    for outline in outlines:
        middle = outline.mean(axis=0)
        _, extents, axes = np.linalg.svd(outline - middle)
        flat = len(extents) < 3 or extents[2] <= _ONE_PLANE * extents[0]
        if flat and not any(
            abs(normal @ axes[2]) > 1 - AXES_TOLERANCE**2 and abs((middle - point) @ normal) < apart
            for point, normal in planes
        ):
            planes.append((middle, axes[2]))
    return len(planes)


def _find_turns(target: Target) -> tuple[Turn, ...]:
    names = target.board_names
    turns = []
    for symmetry in symmetries(target):
        vector = vector_from_rotation(symmetry.rotation[None])[0]
        angle = float(np.linalg.norm(vector))
        axis = np.where(np.abs(vector) < 1e-12 * angle, 0.0, vector / angle)
        if angle > np.pi - 1e-6:
            axis *= np.sign(axis[np.abs(axis) > 1e-6][0])
        onto = tuple(names[board] for board in symmetry.board)
        turns.append(Turn(boards=names, onto=onto, angle_deg=float(np.degrees(angle)), axis=axis))
    return tuple(turns)


def _find_look_alikes(target: Target) -> tuple[tuple[str, ...], ...]:
    """Find groups of boards whose whole patterns lie on more than one place of the target."""
    sides = placement_of(target)
    groups = {
        tuple(np.unique(sides.board[places]).tolist()): None
        for places, _ in sides.wholes
        if len(places) > 1
    }
    return tuple(tuple(target.boards[index].name for index in group) for group in groups)


def _find_crossing(boards: Sequence[Board]) -> tuple[tuple[str, str], ...]:
    """Find pairs whose prints, outer squares included, cut through or cover each other."""
    return tuple((a.name, b.name) for a, b in combinations(boards, 2) if _do_cross(a, b))


def _do_cross(one: Board, other: Board) -> bool:
    """Whether two prints come nearer to each other than they may."""
    if one.axes[2] @ other.axes[2] < -1 + 1e-9:  # back to back they are a plate with two faces
        return False
    touch = np.repeat([_TOUCH * board.square for board in (one, other)], 2)
    rim = np.repeat([board.rim for board in (one, other)], 2)
    last = [board.plane_points(board.columns - 1, board.rows - 1) for board in (one, other)]
    low, high = touch - rim, np.concatenate(last) + rim - touch
    axes = np.concatenate([one.axes[:2], -other.axes[:2]]).T
    apart = other.origin - one.origin
    middle = np.linalg.norm(apart - axes @ (low + high) / 2)
    if middle > (np.linalg.norm((high - low)[:2]) + np.linalg.norm((high - low)[2:])) / 2:
        return False
    from scipy.optimize import lsq_linear  # slow to load, and seldom needed

    nearest = lsq_linear(axes, apart, (low, high), method="bvls")
    return bool(np.linalg.norm(nearest.fun) < touch.min() / 2)
