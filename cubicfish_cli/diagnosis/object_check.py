"""What can be known of a calibration target before a photo is taken.

How much its corners say about a camera, which turns of it look the same, which of its boards can
be taken for others when only some are in a photo, and boards whose places look like a slip.
Everything is judged on the target as drawn, with the same rules that name corners in photos.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.boards.shape import AXES_TOLERANCE
from cubicfish_cli.fitting.point_fit import RANK_TOLERANCE
from cubicfish_cli.fitting.subset import flatness
from cubicfish_cli.identification.look_alikes import Turn, look_alikes, symmetries
from cubicfish_cli.lenses.lift import lift
from cubicfish_cli.lenses.sphere import all_around
from cubicfish_cli.target import Target
from cubicfish_cli.types import BoolArray, FloatArray

NamedBy = Literal["markers", "geometry", "table"]

_FLAT = 1e-4
# An eye that sees a board flatter than this (sine of the angle to its plane) does not see it.
_FLATTEST = 0.05
_EYE_DIRECTIONS = 400
_EYE_DISTANCES = (0.15, 0.3, 0.6, 1.0, 2.0, 4.0)  # from the target's middle, in its diagonals
# Prints that reach into each other by less than this, in squares, only touch.
_TOUCH = 0.1
# Boards at an angle between these (cosine of their normals) form an edge, inside or outside.
_EDGE_COSINES = (-0.9, 0.7)


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectFacts:
    """What :func:`check_object` found.

    Attributes:
        corners: how many corners the target has.
        planes: number of distinct planes of its boards.
        rank: numerical rank of Φ over all corners, of 20, as the ``point`` lift has it.
        flat: whether all corners lie in one plane.
        named_by: what names corners in photos: ``markers``, else size, colours and ``geometry``
            of plain boards; ``table`` where nothing can be found in photos (lists of points).
        plain: names of the boards that carry no markers and are found in photos.
        symmetries: turns, other than none, after which the whole target looks the same.
        near_symmetries: turns after which it nearly does, to :data:`NEARLY` squares.
        look_alikes: turns, no symmetries, after which some boards that a camera can see at once
            look the same, to :data:`ALIKE` squares: a photo that shows no other boards can be
            named in more than one way. Only the largest groups, one turn for each; None where
            there are too many boards to look.
        boards_needed: so many plain boards in one photo, whichever they are, can always be
            told apart; None where that was not looked at, or markers name the corners.
        boards_at_once: the most boards that face any one camera.
        never_together: pairs of boards that no camera sees the printed faces of at once.
        turned_away: (board, other): the board lies before the other's face but shows it its
            back.
        crossing: pairs of boards whose prints reach into each other.

    """

    corners: int
    planes: int
    rank: int
    flat: bool
    named_by: NamedBy
    plain: tuple[str, ...]
    symmetries: tuple[Turn, ...]
    near_symmetries: tuple[Turn, ...]
    look_alikes: tuple[Turn, ...] | None
    boards_needed: int | None
    boards_at_once: int
    never_together: tuple[tuple[str, str], ...]
    turned_away: tuple[tuple[str, str], ...]
    crossing: tuple[tuple[str, str], ...]

    @property
    def ambiguous(self) -> bool:
        """Whether some photo of whole boards can be named in more than one way."""
        return bool(self.symmetries or self.near_symmetries or self.look_alikes)


def check_object(target: Target) -> ObjectFacts:
    """Look at the target as drawn; deformations that a calibration found do not count."""
    drawn = target.with_flat_boards()
    world = drawn.corners()[3]
    printed = [board for board in drawn.boards if board.points is None]
    plain = [board for board in printed if board.markers is None]
    faced = _faced(printed, world)
    same: list[Turn] = []
    near: list[Turn] = []
    alike: list[Turn] | None = []
    needed = None
    if plain and not drawn.has_markers:
        same, near = symmetries(drawn)
        alike, needed = look_alikes(drawn, faced)
    return ObjectFacts(
        corners=len(world),
        planes=drawn.plane_count(),
        rank=rank_of_lift(world),
        flat=flatness(world) < _FLAT,
        named_by="markers" if drawn.has_markers else "geometry" if plain else "table",
        plain=tuple(board.name for board in plain),
        symmetries=tuple(same),
        near_symmetries=tuple(near),
        look_alikes=None if alike is None else tuple(alike),
        boards_needed=needed,
        boards_at_once=int(faced.sum(axis=1).max()) if printed else 0,
        never_together=_never_together(printed),
        turned_away=_turned_away(printed),
        crossing=_crossing(printed),
    )


def rank_of_lift(world: FloatArray) -> int:
    """Numerical rank of Φ (20 columns) over points (N, 3), which may be in any unit."""
    middle = world.mean(axis=0)
    scale = float(np.sqrt(np.mean(np.square(world - middle)))) or 1.0
    # The triangular factor has Φ's singular values and at most 20 rows.
    size = np.linalg.svd(np.linalg.qr(lift((world - middle) / scale), mode="r"), compute_uv=False)
    return int(np.sum(size > RANK_TOLERANCE * size[0]))


def _normals(boards: Sequence[Board]) -> FloatArray:
    """(B, 3) unit normals out of the printed faces, towards who looks at them."""
    return -np.array([board.axes[2] for board in boards]).reshape(-1, 3)


def _corner_rectangle(board: Board) -> tuple[FloatArray, FloatArray]:
    """Opposite outermost corners (2,), (2,) in the board's plane."""
    return np.zeros(2), board.plane_points(board.columns - 1, board.rows - 1)


def _middles(boards: Sequence[Board]) -> FloatArray:
    """(B, 3) world points of the boards' middles."""
    middles = [board.origin + _corner_rectangle(board)[1] / 2 @ board.axes[:2] for board in boards]
    return np.array(middles).reshape(-1, 3)


def _faced(boards: Sequence[Board], world: FloatArray) -> BoolArray:
    """(E, B) which boards turn their faces to each of many eyes around and in the target."""
    way = all_around(_EYE_DIRECTIONS)
    middle = (world.min(axis=0) + world.max(axis=0)) / 2
    diagonal = float(np.linalg.norm(np.ptp(world, axis=0)))
    eyes = middle + diagonal * (np.array(_EYE_DISTANCES)[:, None, None] * way).reshape(-1, 3)
    eyes = np.concatenate([middle[None], eyes])
    to_eye = eyes[:, None] - _middles(boards)
    height = (to_eye * _normals(boards)).sum(axis=-1)
    return height > _FLATTEST * np.linalg.norm(to_eye, axis=-1)


def _heights(boards: Sequence[Board]) -> FloatArray:
    """(B, B): sine of how far the middle of board j lies before (+) the face of board i."""
    middles = _middles(boards)
    way = middles[None] - middles[:, None]
    distance = np.linalg.norm(way, axis=-1)
    height = (way * _normals(boards)[:, None]).sum(axis=-1)
    return np.asarray(height / np.where(distance > 0, distance, 1.0))


def _never_together(boards: Sequence[Board]) -> tuple[tuple[str, str], ...]:
    """Pairs whose half-spaces, those before their faces, have nothing in common."""
    normals, height = _normals(boards), _heights(boards)
    opposite = (normals @ normals.T < -1 + AXES_TOLERANCE) & (height <= _FLATTEST)
    return _names(boards, opposite)


def _turned_away(boards: Sequence[Board]) -> tuple[tuple[str, str], ...]:
    """(i, j): i lies before the face of j, at an angle, and shows it its back."""
    normals, height = _normals(boards), _heights(boards)
    low, high = _EDGE_COSINES
    cosine = normals @ normals.T
    away = (cosine > low) & (cosine < high) & (height < -_TOUCH) & (height.T > _TOUCH)
    return tuple((boards[i].name, boards[j].name) for i, j in np.argwhere(away))


def _crossing(boards: Sequence[Board]) -> tuple[tuple[str, str], ...]:
    """Pairs whose prints, outer squares included, cut through or cover each other."""
    if not boards:
        return ()
    rim = np.array([b.rim for b in boards])
    touch = _TOUCH * np.array([b.square for b in boards])
    size = np.array([_corner_rectangle(b)[1] for b in boards])
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
            cut[i, j] = _cover(outline[i], outline[j], np.concatenate([axes[i, :2], axes[j, :2]]))
    np.fill_diagonal(cut, False)
    return _names(boards, cut | cut.T)


def _cover(one: FloatArray, other: FloatArray, directions: FloatArray) -> bool:
    """Whether two rectangles (4, 3) of one plane overlap: none of their sides parts them."""
    a, b = one @ directions.T, other @ directions.T
    return bool((np.minimum(a.max(0), b.max(0)) > np.maximum(a.min(0), b.min(0))).all())


def _names(boards: Sequence[Board], pairs: BoolArray) -> tuple[tuple[str, str], ...]:
    upper = np.triu(pairs, 1)
    return tuple((boards[i].name, boards[j].name) for i, j in np.argwhere(upper))
