"""What can be known of a calibration target before a photo is taken.

Which turns of it look the same, which of its boards look like others, and prints that reach into
each other. Everything is judged on the target as
drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.fit.subset import flatness
from cubicfish_cli.core.placement import placement_of, symmetries
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import FloatArray

NamedBy = Literal["markers", "geometry", "table"]

_FLAT = 1e-4
# Prints that reach into each other by less than this, in squares, only touch.
_TOUCH = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """A motion of the target after which its boards cover boards again.

    Attributes:
        boards: names of its plain boards.
        onto: for each of them, the name of the board that it then covers.
        angle_deg: by how much the target is turned, 0 to 180.
        axis: (3,) unit direction about which, by the right-hand rule; of the two of a half turn
            the one whose first entry, that is not 0, is positive.

    """

    boards: tuple[str, ...]
    onto: tuple[str, ...]
    angle_deg: float
    axis: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectFacts:
    """What :func:`check_object` found.

    Attributes:
        corners: how many corners the target has.
        planes: number of distinct planes of its boards.
        flat: whether all corners lie in one plane.
        named_by: what names corners in photos: ``markers``, else size, colours and ``geometry``
            of plain boards; ``table`` where nothing can be found in photos (lists of points).
        plain: names of the boards that carry no markers and are found in photos.
        symmetries: turns, other than none, after which the whole target looks the same.
        look_alikes: groups of boards that look the same where nothing else is in a photo; a
            group of one looks the same after half a turn, or a quarter. None of these where
            markers name the corners.
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
    """Look at the target as drawn; deformations that a calibration found do not count."""
    drawn = target.with_flat_boards()
    world = drawn.corners()[3]
    printed = [board for board in drawn.boards if board.points is None]
    plain = [board for board in printed if board.markers is None]
    by_geometry = bool(plain) and not drawn.has_markers
    named = replace(drawn, boards=tuple(plain)) if by_geometry else None
    return ObjectFacts(
        corners=len(world),
        planes=drawn.plane_count(),
        flat=flatness(world) < _FLAT,
        named_by="markers" if drawn.has_markers else "geometry" if plain else "table",
        plain=tuple(board.name for board in plain),
        symmetries=() if named is None else _find_turns(named),
        look_alikes=() if named is None else _find_look_alikes(named),
        crossing=_find_crossing(printed),
    )


def _find_turns(target: Target) -> tuple[Turn, ...]:
    names = target.board_names
    turns = []
    for symmetry in symmetries(target):
        vector = Rotation.from_matrix(symmetry.rotation).as_rotvec()
        angle = float(np.linalg.norm(vector))
        axis = np.where(np.abs(vector) < 1e-12 * angle, 0.0, vector / angle)
        if angle > np.pi - 1e-6:
            axis *= np.sign(axis[np.abs(axis) > 1e-6][0])
        onto = tuple(names[board] for board in symmetry.board)
        turns.append(Turn(boards=names, onto=onto, angle_deg=float(np.degrees(angle)), axis=axis))
    return tuple(turns)


def _find_look_alikes(target: Target) -> tuple[tuple[str, ...], ...]:
    """Groups of boards whose patterns, whole, lie on more than one place of the target."""
    sides = placement_of(target)
    groups = {
        tuple(np.unique(sides.board[places]).tolist()): None
        for places, _ in sides.wholes
        if len(places) > 1
    }
    return tuple(tuple(target.boards[index].name for index in group) for group in groups)


def _find_crossing(boards: Sequence[Board]) -> tuple[tuple[str, str], ...]:
    """Pairs whose prints, outer squares included, cut through or cover each other."""
    if not boards:
        return ()
    rim = np.array([b.rim for b in boards])
    touch = _TOUCH * np.array([b.square for b in boards])
    size = np.array([b.plane_points(b.columns - 1, b.rows - 1) for b in boards])
    low = (touch - rim)[:, None] * np.ones(2)
    high = size - low
    axes = np.array([b.axes for b in boards])
    origin = np.array([b.origin for b in boards])
    x = np.stack([low[:, 0], high[:, 0], high[:, 0], low[:, 0]], axis=1)
    y = np.stack([low[:, 1], low[:, 1], high[:, 1], high[:, 1]], axis=1)
    outline = origin[:, None] + np.stack([x, y], axis=-1) @ axes[:, :2]
    count = len(boards)
    # (B, B, 4, 3): the outline of board i in the frame of board j, and its next corner.
    local = np.einsum("ijkc,jdc->ijkd", outline[:, None] - origin[None, :, None], axes)
    ahead = np.roll(local, -1, axis=2)
    height, next_height = local[..., 2], ahead[..., 2]
    through = height * next_height < 0
    share = np.where(through, height, 0) / np.where(through, height - next_height, 1)
    hit = local[..., :2] + share[..., None] * (ahead - local)[..., :2]
    inside = (hit > low[:, None]) & (hit < high[:, None])
    cut = (through & inside.all(axis=-1)).any(axis=-1)
    coplanar = (np.abs(local[..., 2]) < touch[:, None]).all(axis=-1)
    # Two boards of one plane that look the same way; back to back is a plate with two faces.
    coplanar &= np.einsum("ic,jc->ij", axes[:, 2], axes[:, 2]) > 0
    for i, j in combinations(range(count), 2):
        if coplanar[i, j]:
            cut[i, j] = _overlap(outline[i], outline[j], np.concatenate([axes[i, :2], axes[j, :2]]))
    pairs = np.argwhere(np.triu(cut | cut.T, 1))
    return tuple((boards[i].name, boards[j].name) for i, j in pairs)


def _overlap(one: FloatArray, other: FloatArray, directions: FloatArray) -> bool:
    """Whether two rectangles (4, 3) of one plane overlap: none of their sides parts them."""
    a, b = one @ directions.T, other @ directions.T
    return bool((np.minimum(a.max(0), b.max(0)) > np.maximum(a.min(0), b.min(0))).all())
