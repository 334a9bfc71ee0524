"""What can be known of a calibration target before a photo is taken.

How much its corners say about a camera, which turns of it look the same, which of its boards can
be taken for others when only some are in a photo, and boards whose places look like a slip.
Everything is judged on the target as drawn, with the same rules that name corners in photos.

Turns of a target after which all of it, or what one photo shows of it, looks the same.

Everything is judged on the target as drawn, with the same rules that name corners in photos.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from cubicfish_cli.boards.board import Board
from cubicfish_cli.boards.shape import AXES_TOLERANCE
from cubicfish_cli.fitting.point_fit import RANK_TOLERANCE
from cubicfish_cli.fitting.subset import flatness
from cubicfish_cli.geometry import Similarity, similarity
from cubicfish_cli.lenses.lift import lift
from cubicfish_cli.lenses.sphere import all_around
from cubicfish_cli.placement import Placement, placement_of
from cubicfish_cli.target import Target
from cubicfish_cli.types import BoolArray, FloatArray, IntArray

# A turn after which boards lie this close to boards, in squares, is nearly a symmetry.
NEARLY = 0.1
# Boards that a turn brings this close to boards, in squares, look the same in a photo: corners
# are some hundredths of a square wrong, and as far as that can be, so is a lens from one photo.
ALIKE = 0.03
# Targets of more plain boards are not searched for groups of boards that look alike.
_MOST_BOARDS = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """A motion of the target after which some or all of its boards cover boards again.

    Attributes:
        boards: names of the boards that do.
        onto: for each of them, the name of the board that it then covers.
        angle_deg: by how much the target is turned, 0 to 180.
        axis: (3,) unit direction about which, by the right-hand rule.
        point: (3,) a point of the axis (of a screw's, where the motion also shifts along it),
            the nearest to the middle of what is turned.
        error: the largest distance that is left between corners, in squares.

    """

    boards: tuple[str, ...]
    onto: tuple[str, ...]
    angle_deg: float
    axis: FloatArray
    point: FloatArray
    error: float


def symmetries(target: Target) -> tuple[list[Turn], list[Turn]]:
    """Turns of the whole target that make no difference, and those that hardly do."""
    sides = placement_of(target)
    everything = list(range(len(sides.wholes)))
    # The board with the fewest places has the fewest candidates.
    base = min(everything, key=lambda board: len(sides.wholes[board][0]))
    exact: list[Turn] = []
    near: list[Turn] = []
    # A board that is off by NEARLY turns the motion that is based on it.
    for places in sides.carried(base, 10 * NEARLY)[2]:
        motion, miss = _fitted(sides, everything, places)
        turn = _turn(target, sides, everything, places, motion, miss)
        if turn.angle_deg < 1 and turn.boards == turn.onto:
            continue
        if sides.is_symmetry(motion):
            exact.append(turn)
        elif miss < NEARLY:
            near.append(turn)
    return exact, near


def look_alikes(target: Target, faced: BoolArray) -> tuple[list[Turn] | None, int | None]:
    """The largest groups of boards that look like others, and how many boards are none."""
    sides = placement_of(target)
    everything = list(range(len(sides.wholes)))
    if len(everything) > _MOST_BOARDS:
        return None, None
    if len(everything) == 1:
        return [], 1
    groups: dict[frozenset[int], Turn] = {}
    looked: set[tuple[int, ...]] = set()
    views = np.unique(faced, axis=0)
    for base in everything:
        matrix, shift = sides.motions(base)
        landings = [sides.landing(matrix, shift, board) for board in everything]
        error = np.stack([one for one, _ in landings], axis=1)
        place = np.stack([one for _, one in landings], axis=1)
        for own, places in zip(error < ALIKE, place, strict=True):
            # One and the same motion comes up with each board that it moves to a board.
            key = tuple(np.where(own, places, -1).tolist())
            if key in looked:
                continue
            looked.add(key)
            if own.all():
                motion, miss = _fitted(sides, everything, places)
                if miss < NEARLY or sides.is_symmetry(motion):
                    continue
            for group in _seen_at_once(own, views):
                if any(frozenset(group) < other for other in groups):
                    continue
                motion, miss = _fitted(sides, group, places[group])
                turn = _turn(target, sides, group, places[group], motion, miss)
                known = groups.get(frozenset(group))
                # A board that could be another one says more than one that could be turned.
                if known is None or set(known.boards) == set(known.onto):
                    groups[frozenset(group)] = turn
    largest = [group for group in groups if not any(group < other for other in groups)]
    maximal = [groups[group] for group in sorted(largest, key=lambda g: (-len(g), sorted(g)))]
    return maximal, 1 + max((len(turn.boards) for turn in maximal), default=0)


def _seen_at_once(own: BoolArray, faced: BoolArray) -> list[list[int]]:
    """The largest groups of some boards (B,) that face one of the eyes (E, B) together."""
    together = {frozenset(np.flatnonzero(row).tolist()) for row in np.unique(faced & own, axis=0)}
    largest = [group for group in together if group and not any(group < o for o in together)]
    return sorted(sorted(group) for group in largest)


def _fitted(sides: Placement, group: Sequence[int], places: IntArray) -> tuple[Similarity, float]:
    """The motion of some boards onto their places that fits best, and its error in squares."""
    chosen = [(*sides.wholes[board], place) for board, place in zip(group, places, strict=True)]
    here = np.concatenate([at[0] for _, at, _ in chosen])
    motion = similarity(here, np.concatenate([at[place] for _, at, place in chosen]))
    covered = [side[place] for side, _, place in chosen]
    return motion, motion.error / float(sides.square[covered].min())


def _turn(
    target: Target,
    sides: Placement,
    group: Sequence[int],
    places: IntArray,
    motion: Similarity,
    error: float,
) -> Turn:
    covered = [sides.wholes[b][0][p] // 4 for b, p in zip(group, places, strict=True)]
    names = [target.boards[index].name for index in sides.board[::4]]
    angle, axis = _angle_axis(motion.rotation)
    middle = np.concatenate([sides.wholes[board][1][0] for board in group]).mean(axis=0)
    # Of the points that the motion moves along its axis only, the one nearest to the middle.
    moves = motion.scale * motion.rotation - np.eye(3)
    across = np.eye(3) - np.outer(axis, axis)
    to_middle = np.linalg.pinv(moves @ across, rcond=1e-6) @ (motion.shift + moves @ middle)
    return Turn(
        boards=tuple(names[b] for b in group),
        onto=tuple(names[b] for b in covered),
        angle_deg=float(np.degrees(angle)),
        axis=axis,
        point=middle - to_middle,
        error=error,
    )


def _angle_axis(rotation: FloatArray) -> tuple[float, FloatArray]:
    """Angle, 0 to π, and unit axis of a rotation (3, 3); (0, 0, 1) where there is no turn.

    Of the two axes of a half turn the one whose first entry, that is not 0, is positive.
    """
    vector = Rotation.from_matrix(rotation).as_rotvec()
    angle = float(np.linalg.norm(vector))
    if angle < 1e-9:
        return 0.0, np.array([0.0, 0.0, 1.0])
    axis = vector / angle
    if angle > np.pi - 1e-6:
        axis *= np.sign(axis[np.abs(axis) > 1e-6][0])
    return angle, np.where(np.abs(axis) < 1e-12, 0.0, axis)


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
