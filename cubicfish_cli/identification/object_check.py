"""What can be known of a calibration object before a photo is taken.

How much its corners say about a camera, which turns of it look the same, which of its boards can
be taken for others when only some are in a photo, and boards whose places look like a slip.
Everything is judged on the object as drawn, with the same rules that name corners in photos.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
import numpy.typing as npt

from cubicfish_cli.boards.board import Board
from cubicfish_cli.boards.shape import AXES_TOLERANCE
from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.fitting.point_fit import RANK_TOLERANCE
from cubicfish_cli.fitting.subset import flatness
from cubicfish_cli.geometry import Similarity, similarity
from cubicfish_cli.identification.congruence import is_symmetry
from cubicfish_cli.identification.placement import Placement, placement_of, reach_of
from cubicfish_cli.model.lift import lift
from cubicfish_cli.target import Target

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]
BoolArray = npt.NDArray[np.bool_]

NamedBy = Literal["markers", "geometry", "table"]

# A turn after which boards lie this close to boards, in squares, is nearly a symmetry.
NEARLY = 0.1
# Boards that a turn brings this close to boards, in squares, look the same in a photo: corners
# are some hundredths of a square wrong, and as far as that can be, so is a lens from one photo.
ALIKE = 0.03
_FLAT = 1e-4
# Objects of more plain boards are not searched for groups of boards that look alike.
_MOST_BOARDS = 16
# Candidate motions times places that are compared at a time, to bound memory.
_AT_A_TIME = 100_000
# An eye that sees a board flatter than this (sine of the angle to its plane) does not see it.
_FLATTEST = 0.05
_EYE_DIRECTIONS = 400
_EYE_DISTANCES = (0.15, 0.3, 0.6, 1.0, 2.0, 4.0)  # from the object's middle, in its diagonals
# Prints that reach into each other by less than this, in squares, only touch.
_TOUCH = 0.1
# Boards at an angle between these (cosine of their normals) form an edge, inside or outside.
_EDGE_COSINES = (-0.9, 0.7)


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """A motion of the object after which some or all of its boards cover boards again.

    Attributes:
        boards: names of the boards that do.
        onto: for each of them, the name of the board that it then covers.
        angle_deg: by how much the object is turned, 0 to 180.
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


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectFacts:
    """What :func:`check_object` found.

    Attributes:
        corners: how many corners the object has.
        planes: number of distinct planes of its boards.
        rank: numerical rank of Φ over all corners, of 20, as the ``point`` lift has it.
        flat: whether all corners lie in one plane.
        named_by: what names corners in photos: ``markers``, else size, colours and ``geometry``
            of plain boards; ``table`` where nothing can be found in photos (lists of points).
        plain: names of the boards that carry no markers and are found in photos.
        symmetries: turns, other than none, after which the whole object looks the same.
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
    """Look at the object as drawn; departures that a calibration found do not count."""
    drawn = target.with_flat_boards()
    world = drawn.corners()[3]
    printed = [board for board in drawn.boards if board.points is None]
    plain = [board for board in printed if board.markers is None]
    faced = _faced(printed, world)
    symmetries: list[Turn] = []
    near: list[Turn] = []
    alike: list[Turn] | None = []
    needed = None
    if plain and not drawn.has_markers:
        boards = _Plain.of(drawn)
        symmetries, near = _symmetries(boards)
        alike, needed = _look_alikes(boards, faced)
    return ObjectFacts(
        corners=len(world),
        planes=drawn.plane_count(),
        rank=rank_of_lift(world),
        flat=flatness(world) < _FLAT,
        named_by="markers" if drawn.has_markers else "geometry" if plain else "table",
        plain=tuple(board.name for board in plain),
        symmetries=tuple(symmetries),
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Plain:
    """The plain boards, and where each board's pattern, whole, lies on the object.

    Attributes:
        sides: their sides; board b is upright at side 4 b.
        names: (B,) their names.
        outline: (B, 4, 3) world points of the outermost corners.
        side: for each board, (P,) the sides that its whole pattern covers, colours included.
        places: for each board, (P, 4, 3) its outline there.

    """

    sides: Placement
    names: tuple[str, ...]
    outline: FloatArray
    side: list[IntArray]
    places: list[FloatArray]

    @classmethod
    def of(cls, target: Target) -> _Plain:
        sides = placement_of(target)
        outline, covered, places = [], [], []
        for upright in range(0, len(sides.board), 4):
            last = sides.size[upright] - 1
            cells = np.array([[0, 0], [last[0], 0], last, [0, last[1]]])
            whole = Grid(
                cells=cells,
                pixel=cells.astype(float),
                parity=int(sides.colour[upright]),
                step=1.0,
                contrast=np.ones(4),
            )
            side, offset = reach_of(whole, sides).places()
            fills = (np.abs(sides.matrix[side]) @ (last + 1) == sides.size[side]).all(axis=1)
            side, offset = side[fills], offset[fills]
            homogeneous = np.column_stack([cells, np.ones(4)])
            there = homogeneous @ np.swapaxes(sides.world_from_grid(side, offset), -1, -2)
            covered.append(side)
            places.append(there)
            outline.append(there[np.flatnonzero(side == upright)[0]])
        return cls(
            sides=sides,
            names=tuple(target.boards[index].name for index in sides.board[::4]),
            outline=np.stack(outline),
            side=covered,
            places=places,
        )

    def motions(self, board: int) -> tuple[FloatArray, FloatArray]:
        """(P, 3, 3), (P, 3) matrices and shifts that carry a board onto each of its places."""
        frame = self.sides.frame[self.side[board]] @ self.sides.frame[4 * board].T
        scale = self.sides.square[self.side[board]] / self.sides.square[4 * board]
        matrix = scale[:, None, None] * frame
        middle = self.outline[board].mean(axis=0)
        return matrix, self.places[board].mean(axis=1) - matrix @ middle

    def landing(
        self, matrix: FloatArray, shift: FloatArray, board: int
    ) -> tuple[FloatArray, IntArray]:
        """How far a board, moved, is from the nearest of its places, in squares, and which.

        (C, 3, 3), (C, 3) -> (C,) the largest distance of an outermost corner, (C,) the place.
        """
        moved = self.outline[board] @ np.swapaxes(matrix, -1, -2) + shift[:, None]
        square = self.sides.square[self.side[board]]
        error, place = [], []
        step = max(1, _AT_A_TIME // len(square))
        for first in range(0, len(moved), step):
            apart = moved[first : first + step, None] - self.places[board]
            distance = np.linalg.norm(apart, axis=-1).max(axis=-1) / square
            nearest = distance.argmin(axis=1)
            place.append(nearest)
            error.append(distance[np.arange(len(nearest)), nearest])
        return np.concatenate(error), np.concatenate(place)


def _symmetries(boards: _Plain) -> tuple[list[Turn], list[Turn]]:
    """Turns of the whole object that make no difference, and those that hardly do."""
    # The board with the fewest places has the fewest candidates.
    base = min(range(len(boards.names)), key=lambda b: len(boards.places[b]))
    matrix, shift = boards.motions(base)
    # A board that is off by NEARLY turns the motion that is based on it.
    slack = 10 * NEARLY
    landed = np.empty((len(matrix), 0), np.intp)
    for board in range(len(boards.names)):
        error, place = boards.landing(matrix, shift, board)
        kept = error < slack
        matrix, shift = matrix[kept], shift[kept]
        landed = np.column_stack([landed, place])[kept]
    exact: list[Turn] = []
    near: list[Turn] = []
    everything = list(range(len(boards.names)))
    for places in landed:
        motion, miss = _fitted(boards, everything, places)
        turn = _turn(boards, everything, places, motion, miss)
        if turn.angle_deg < 1 and turn.boards == turn.onto:
            continue
        if is_symmetry(motion, boards.sides):
            exact.append(turn)
        elif miss < NEARLY:
            near.append(turn)
    return exact, near


def _look_alikes(boards: _Plain, faced: BoolArray) -> tuple[list[Turn] | None, int | None]:
    """The largest groups of boards that look like others, and how many boards are none."""
    count = len(boards.names)
    if count > _MOST_BOARDS:
        return None, None
    if count == 1:
        return [], 1
    groups: dict[frozenset[int], Turn] = {}
    looked: set[tuple[int, ...]] = set()
    views = np.unique(faced, axis=0)
    for base in range(count):
        matrix, shift = boards.motions(base)
        landings = [boards.landing(matrix, shift, board) for board in range(count)]
        error = np.stack([one for one, _ in landings], axis=1)
        place = np.stack([one for _, one in landings], axis=1)
        for own, places in zip(error < ALIKE, place, strict=True):
            # One and the same motion comes up with each board that it moves to a board.
            key = tuple(np.where(own, places, -1).tolist())
            if key in looked:
                continue
            looked.add(key)
            if own.all() and _makes_no_difference(boards, places):
                continue
            for group in _seen_at_once(own, views):
                if any(frozenset(group) < other for other in groups):
                    continue
                motion, miss = _fitted(boards, group, places[group])
                turn = _turn(boards, group, places[group], motion, miss)
                known = groups.get(frozenset(group))
                # A board that could be another one says more than one that could be turned.
                if known is None or set(known.boards) == set(known.onto):
                    groups[frozenset(group)] = turn
    largest = [group for group in groups if not any(group < other for other in groups)]
    maximal = [groups[group] for group in sorted(largest, key=lambda g: (-len(g), sorted(g)))]
    return maximal, 1 + max((len(turn.boards) for turn in maximal), default=0)


def _makes_no_difference(boards: _Plain, places: IntArray) -> bool:
    """Whether all boards, moved to these places, are a symmetry of the object, or nearly."""
    motion, error = _fitted(boards, range(len(boards.names)), places)
    return error < NEARLY or is_symmetry(motion, boards.sides)


def _seen_at_once(own: BoolArray, faced: BoolArray) -> list[list[int]]:
    """The largest groups of some boards (B,) that face one of the eyes (E, B) together."""
    together = {frozenset(np.flatnonzero(row).tolist()) for row in np.unique(faced & own, axis=0)}
    largest = [group for group in together if group and not any(group < o for o in together)]
    return sorted(sorted(group) for group in largest)


def _fitted(boards: _Plain, group: Sequence[int], places: IntArray) -> tuple[Similarity, float]:
    """The motion of some boards onto their places that fits best, and its error in squares."""
    there = np.stack([boards.places[b][p] for b, p in zip(group, places, strict=True)])
    motion = similarity(boards.outline[list(group)].reshape(-1, 3), there.reshape(-1, 3))
    sides = [boards.side[b][p] for b, p in zip(group, places, strict=True)]
    return motion, motion.error / float(boards.sides.square[sides].min())


def _turn(
    boards: _Plain, group: Sequence[int], places: IntArray, motion: Similarity, error: float
) -> Turn:
    covered = [boards.side[b][p] // 4 for b, p in zip(group, places, strict=True)]
    angle, axis = _angle_axis(motion.rotation)
    middle = boards.outline[list(group)].reshape(-1, 3).mean(axis=0)
    # Of the points that the motion moves along its axis only, the one nearest to the middle.
    moves = motion.scale * motion.rotation - np.eye(3)
    across = np.eye(3) - np.outer(axis, axis)
    to_middle = np.linalg.pinv(moves @ across, rcond=1e-6) @ (motion.shift + moves @ middle)
    return Turn(
        boards=tuple(boards.names[b] for b in group),
        onto=tuple(boards.names[b] for b in covered),
        angle_deg=float(np.degrees(angle)),
        axis=axis,
        point=middle - to_middle,
        error=error,
    )


def _angle_axis(rotation: FloatArray) -> tuple[float, FloatArray]:
    """Angle, 0 to π, and unit axis of a rotation (3, 3); (0, 0, 1) where there is no turn.

    Of the two axes of a half turn the one whose first entry, that is not 0, is positive.
    """
    sine = 0.5 * np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    angle = float(np.arctan2(np.linalg.norm(sine), (np.trace(rotation) - 1) / 2))
    if angle < 1e-9:
        return 0.0, np.array([0.0, 0.0, 1.0])
    # The symmetric part is cos + (1 - cos) · axis axisᵀ: well-conditioned up to a half turn.
    symmetric = (rotation + rotation.T) / 2
    axis = np.linalg.eigh(symmetric)[1][:, 2]
    if angle < np.pi - 1e-6:
        axis = axis * np.sign(axis @ sine)
    else:
        axis = axis * np.sign(axis[np.abs(axis) > 1e-6][0])
    return angle, np.where(np.abs(axis) < 1e-12, 0.0, axis)


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
    """(E, B) which boards turn their faces to each of many eyes around and in the object."""
    k = np.arange(_EYE_DIRECTIONS)
    z = 1 - (2 * k + 1) / _EYE_DIRECTIONS
    around = k * np.pi * (3 - np.sqrt(5))  # the golden angle spreads directions evenly
    across = np.sqrt(1 - z * z)
    way = np.stack([across * np.cos(around), across * np.sin(around), z], axis=-1)
    middle = (world.min(axis=0) + world.max(axis=0)) / 2
    diagonal = float(np.linalg.norm(np.ptp(world, axis=0)))
    eyes = middle + diagonal * (np.array(_EYE_DISTANCES)[:, None, None] * way).reshape(-1, 3)
    eyes = np.concatenate([middle[None], eyes])
    to_eye = eyes[:, None] - _middles(boards)
    height = (to_eye * _normals(boards)).sum(axis=-1)
    faced: BoolArray = height > _FLATTEST * np.linalg.norm(to_eye, axis=-1)
    return faced


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
