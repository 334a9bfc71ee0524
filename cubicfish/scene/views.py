"""Where a camera may stand to see a target well: sampled poses, and a choice that fills the field.

Poses come from a low-discrepancy sequence (Roberts 2018, the generalised golden ratio) over the
side from which the target is seen, the distance, the place in the picture and the roll. Those that
show too few whole boards, or squares too small to be found, are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from cubicfish.errors import TargetError
from cubicfish.models.cubic import CubicCamera
from cubicfish.scene.faces import marker_ink
from cubicfish.scene.truth import (
    AnyLens,
    Pose,
    TrueCorners,
    camera_points,
    pose_of_matrix,
    project_corners,
    rotation_matrix,
)
from cubicfish.target.boards.board import Board
from cubicfish.target.target import Target
from cubicfish.types import FloatArray

# Squares below these many pixels are hard to find, and so are markers' modules.
_SQUARE_PX, _MODULE_PX = 10.0, 2.6
# So many sides of a board's squares may be smaller, as a share.
_SMALL = 0.05
# Shares of the target's diagonal: how near and far to stand, and how far from a board's plane.
_NEAREST, _FARTHEST, _CLEARANCE = 0.3, 2.0, 0.1
# Boards are seen at a slant of up to 75° between the way to them and their normal.
_LEAST_COSINE = 0.26
_TRIES_PER_VIEW = 40
_GRID = (48, 36)
_CELLS = 8  # along the photo's shorter side, as coverage is counted
# How much being unlike the views before counts beside filling the field.
_VARIETY = 0.15


class WholeLens(AnyLens, Protocol):
    """A lens that also knows the ray of each pixel."""

    def unproject(self, pixel: npt.ArrayLike, /) -> FloatArray:
        """Turn pixels (..., 2) into unit rays (..., 3), camera frame; NaN outside the field."""


@runtime_checkable
class WanderingPupil(Protocol):
    """A lens whose rays do not all start in one point."""

    def ray_starts(self, rays: FloatArray) -> FloatArray:
        """Return where rays (..., 3) of ``unproject`` start: z (...) on the axis, points' units."""


@dataclass(frozen=True, kw_only=True)
class NearLens:
    """A camera for points whose distance counts, in its units.

    Attributes:
        camera: the camera.

    """

    camera: CubicCamera

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Project points in the camera frame (..., 3) to pixels (..., 2), NaN outside the field."""
        return self.camera.project(points, near=True)

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """Turn pixels (..., 2) into unit directions (..., 3) of rays from :meth:`ray_starts`."""
        return self.camera.unproject(pixel)

    def ray_starts(self, rays: FloatArray) -> FloatArray:
        """See :class:`WanderingPupil`."""
        return self.camera.pupil_shift(rays)


@dataclass(frozen=True, kw_only=True, eq=False)
class Viewpoint:
    """A pose and what is seen from there.

    Attributes:
        pose: camera_from_world.
        seen: the corners of the whole target.
        whole: how many boards are seen whole, with squares large enough to be found.
        front: (3,) unit vector, camera frame: where the visible boards look, each as much as it
            has visible corners.

    """

    pose: Pose
    seen: TrueCorners
    whole: int
    front: FloatArray

    @property
    def pixel(self) -> FloatArray:
        """(N, 2) pixels of the visible corners."""
        return self.seen.pixel[self.seen.visible]

    @property
    def middle(self) -> FloatArray:
        """(3,) middle of the visible corners in the camera frame."""
        return self.seen.camera[self.seen.visible].mean(axis=0)

    @property
    def away(self) -> FloatArray:
        """(N,) how far each visible corner is from the camera, in the target's units."""
        return np.linalg.norm(self.seen.camera[self.seen.visible], axis=1)

    @property
    def direction(self) -> FloatArray:
        """(3,) unit ray to where the target is in the picture: the mean of its corners' rays."""
        points = self.seen.camera[self.seen.visible]
        mean = (points / np.linalg.norm(points, axis=1, keepdims=True)).mean(axis=0)
        return mean / np.linalg.norm(mean)

    def points(self, world: npt.ArrayLike) -> FloatArray:
        """Turn world points (..., 3) into points in the camera frame (..., 3)."""
        return camera_points(self.pose, world)


@dataclass(frozen=True, kw_only=True)
class Distances:
    """How near and how far to stand, in the target's units.

    Attributes:
        near, far: of the visible corners, in the median.
        nearest: of the nearest visible corner.

    """

    near: float
    far: float
    nearest: float

    def holds(self, view: Viewpoint) -> bool:
        """Return whether a view is from there."""
        away = view.away
        return self.near <= float(np.median(away)) <= self.far and away.min() >= self.nearest


def view_from(
    target: Target, lens: AnyLens, pose: Pose, image_size: tuple[int, int]
) -> Viewpoint | None:
    """Return the view from a pose; None if no corner is visible.

    Raises:
        TargetError: a board of a kind that cannot be drawn.

    """
    seen = project_corners(target, lens, pose, image_size)
    if not seen.visible.any():
        return None
    counts = np.bincount(seen.board[seen.visible], minlength=len(target.boards))
    outward = -np.stack([board.axes[2] for board in target.boards])
    front = rotation_matrix(pose[0]) @ (counts @ outward)
    middle = seen.camera[seen.visible].mean(axis=0)
    length = float(np.linalg.norm(front))
    return Viewpoint(
        pose=pose,
        seen=seen,
        whole=_count_whole_boards(target, seen),
        front=front / length if length > 0 else -middle / np.linalg.norm(middle),
    )


def sample_views(
    target: Target,
    lens: WholeLens,
    image_size: tuple[int, int],
    count: int,
    *,
    seed: int = 0,
    within: Distances | None = None,
) -> list[Viewpoint]:
    """Sample up to ``count`` views of the target, spread over field, sides, distances, rolls.

    Each shows at least one whole board (at least half of the most that can be seen at once), with
    squares large enough to be found. A target whose boards can all be seen at once, such as the
    inside of a box, is seen from before all of them only: the rest is behind a wall.

    Args:
        target: the calibration target; its boards are taken as flat.
        lens: the camera.
        image_size: (width, height), pixels.
        count: how many views to look for.
        seed: of the sequence; the same arguments give the same views.
        within: how near and far to stand; None for all that the target and the camera allow.

    Raises:
        TargetError: a board of a kind that cannot be drawn.

    """
    target = target.with_flat_boards()
    rays = _compute_field(lens, image_size)
    thing = _Thing.of(target)
    near, far = _find_distances(thing, rays, image_size)
    if within is not None:
        # No corner is farther from the middle of the target than this.
        near = max(near, within.near - thing.diagonal / 2)
        far = min(far, within.far + thing.diagonal / 2)
    if near > far:
        return []
    places = _make_sequence(_TRIES_PER_VIEW * count, 6, seed)
    distance = near * (far / near) ** places[:, 2:3].copy()  # a copy: angles.py says why
    eyes = thing.middle + _map_to_sphere(places[:, :2]) * distance
    aims, allowed = thing.aims(eyes)
    column, row = (
        np.minimum((places[:, 3 + axis] * side).astype(int), side - 1)
        for axis, side in enumerate(_GRID)
    )
    way = rays[row, column]
    allowed &= np.isfinite(way[:, 0])
    kept = np.flatnonzero(allowed)
    turns = _compute_turns(aims[kept] - eyes[kept], way[kept], 2 * np.pi * places[kept, 5])
    kept, turns = _find_with_board_inside(thing, lens, image_size, kept, turns, eyes[kept])
    views: list[Viewpoint] = []
    most = 1
    for index, turn in zip(kept, turns, strict=True):
        view = view_from(target, lens, pose_of_matrix(turn, eyes[index]), image_size)
        if view is None or not view.whole or not (within is None or within.holds(view)):
            continue
        most = max(most, view.whole)
        views.append(view)
        if sum(2 * view.whole >= most for view in views) == count:
            break
    return [view for view in views if 2 * view.whole >= most]


def choose_views(
    views: Sequence[Viewpoint], lens: WholeLens, image_size: tuple[int, int], count: int
) -> list[Viewpoint]:
    """Choose the ``count`` views that fill the field best, each unlike the others, in order.

    Greedy: every further view adds most corners to cells of the picture that have few.
    """
    cell = min(image_size) / _CELLS
    columns, rows = (int(np.ceil(side / cell)) for side in image_size)
    x, y = ((np.arange(n) + 0.5) * cell - 0.5 for n in (columns, rows))
    middle = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    field = np.isfinite(lens.unproject(middle)[:, 0])
    hits = []
    for view in views:
        place = np.clip(np.floor((view.pixel + 0.5) / cell).astype(int), 0, (columns - 1, rows - 1))
        hits.append(np.bincount(place[:, 1] * columns + place[:, 0], minlength=columns * rows))
    corners = np.array(hits).reshape(len(views), -1)[:, field].astype(float)
    traits = np.array([_compute_traits(view) for view in views]).reshape(len(views), -1)
    total = np.zeros(corners.shape[1])
    apart = np.full(len(views), 1.0)
    chosen: list[int] = []
    while len(chosen) < min(count, len(views)):
        gain = (np.log1p((total + corners) / 4) - np.log1p(total / 4)).sum(axis=1)
        score = gain / max(gain.max(), 1e-300) + _VARIETY * apart
        score[chosen] = -np.inf
        best = int(np.argmax(score))
        chosen.append(best)
        total += corners[best]
        away = np.linalg.norm(traits - traits[best], axis=1)
        apart = np.minimum(apart, away)
    return [views[index] for index in chosen]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Thing:
    """What of a target decides from where it can be seen."""

    boards: tuple[Board, ...]
    middles: FloatArray
    ends: FloatArray
    outward: FloatArray
    corners: FloatArray
    middle: FloatArray
    diagonal: float
    largest: float

    @classmethod
    def of(cls, target: Target) -> _Thing:
        boards = target.boards
        for board in boards:
            if board.points is not None:
                raise TargetError(
                    f"board {board.name!r} is a list of points: nobody knows from which side it is "
                    "seen; poses can be sampled for boards of other types"
                )
        world = target.corners()[3]
        ends = [board.outline() for board in boards]
        # A corner is seen where half a square around it is.
        around = [
            four + board.square * (Board.AROUND_SQUARE - 0.5) @ board.axes[:2]
            for four, board in zip(ends, boards, strict=True)
        ]
        return cls(
            boards=boards,
            middles=np.array(
                [b.world_points((b.columns - 1) / 2, (b.rows - 1) / 2) for b in boards]
            ),
            ends=np.concatenate(around),
            outward=-np.stack([board.axes[2] for board in boards]),
            corners=np.array([board.columns * board.rows for board in boards], float),
            middle=(world.min(axis=0) + world.max(axis=0)) / 2,
            diagonal=float(np.linalg.norm(np.ptp(world, axis=0))),
            largest=max(float(np.linalg.norm(four[2] - four[0])) for four in ends),
        )

    def aims(self, eyes: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return where cameras at ``eyes`` (N, 3) look (N, 3), and which may stand there (N,)."""
        to_eye = eyes[:, None] - self.middles
        height = (to_eye * self.outward).sum(axis=-1)
        faced = height > _CLEARANCE * self.diagonal
        faced &= height > _LEAST_COSINE * np.linalg.norm(to_eye, axis=-1)
        before_all = (height > _CLEARANCE * self.diagonal).all(axis=1)
        allowed = faced.any(axis=1)
        if before_all.any():
            allowed &= before_all
        weight = faced * self.corners
        total = np.maximum(weight.sum(axis=1, keepdims=True), 1)
        return weight @ self.middles / total, allowed


def _compute_field(lens: WholeLens, image_size: tuple[int, int]) -> FloatArray:
    """Return rays over the photo (rows, columns, 3), NaN outside the field."""
    columns, rows = _GRID
    width, height = image_size
    x = (np.arange(columns) + 0.5) / columns * width - 0.5
    y = (np.arange(rows) + 0.5) / rows * height - 0.5
    return lens.unproject(np.stack(np.meshgrid(x, y), axis=-1))


def _find_distances(
    thing: _Thing, rays: FloatArray, image_size: tuple[int, int]
) -> tuple[float, float]:
    """Return the range of distances from which the target is seen whole and sharply enough.

    The nearest is beyond the farthest where it cannot.
    """
    turn = np.linalg.norm(np.diff(rays, axis=1), axis=-1)
    if not np.isfinite(turn).any():
        return _NEAREST * thing.diagonal, _FARTHEST * thing.diagonal
    radians_per_pixel = float(np.nanmedian(turn)) * _GRID[0] / image_size[0]
    sharp = max(
        board.square / (_find_least_px(board) * radians_per_pixel) for board in thing.boards
    )
    half_field = min(0.5 * min(image_size) * radians_per_pixel, np.radians(60.0))
    near = max(_NEAREST * thing.diagonal, 0.4 * thing.largest / np.tan(half_field))
    return near, min(max(_FARTHEST * thing.diagonal, 2 * near), sharp)


def _find_least_px(board: Board) -> float:
    """Return pixels that a square must have for its corner, or its marker, to be found."""
    if board.markers is None:
        return _SQUARE_PX
    modules = len(marker_ink(board.markers, np.zeros(1, np.intp), board.marker_borders[0])[0])
    return max(_SQUARE_PX, _MODULE_PX * modules * board.square / board.markers.side)


def _count_whole_boards(target: Target, seen: TrueCorners) -> int:
    """Count the boards with all corners visible and nearly all squares large enough."""
    start = 0
    whole = 0
    for board in target.boards:
        own = slice(start, start + board.columns * board.rows)
        start = own.stop
        if board.points is not None or not seen.visible[own].all():
            continue
        grid = seen.pixel[own].reshape(board.rows, board.columns, 2)
        step = board.per_cell  # the gaps between tags may be small
        sides = [grid[:, 1::step] - grid[:, :-1:step], grid[1::step] - grid[:-1:step]]
        length = np.concatenate([np.hypot(side[..., 0], side[..., 1]).ravel() for side in sides])
        small = np.count_nonzero(length < _find_least_px(board))
        whole += bool(small <= _SMALL * (len(length) - 1))
    return whole


def _find_with_board_inside(
    thing: _Thing,
    lens: AnyLens,
    image_size: tuple[int, int],
    kept: npt.NDArray[np.intp],
    turns: FloatArray,
    eyes: FloatArray,
) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """Return which cameras (N,), with rotations (N, 3, 3), see half a square beyond a board's ends.

    A quick look, before that at all corners.
    """
    points = (turns[:, None] @ (thing.ends[None] - eyes[:, None])[..., None])[..., 0]
    pixel = lens.project(points)
    with np.errstate(invalid="ignore"):
        inside = ((pixel > -0.5) & (pixel < np.array(image_size) - 0.5)).all(axis=-1)
    whole = inside.reshape(len(kept), len(thing.boards), 4).all(axis=-1).any(axis=-1)
    return kept[whole], turns[whole]


def _compute_traits(view: Viewpoint) -> FloatArray:
    """Return what tells views apart: the side that is seen (3,), and the distance, of order 1."""
    distance = np.linalg.norm(view.middle)
    way = rotation_matrix(view.pose[0]).T @ (view.middle / distance)
    return np.append(way, 0.7 * np.log(distance))


def _compute_turns(forward: FloatArray, ray: FloatArray, roll: FloatArray) -> FloatArray:
    """Return rotations (N, 3, 3) from world to camera that take ``forward`` to ``ray``, rolled."""
    world, camera = _make_frames(forward), _make_frames(ray)
    turn = np.zeros((len(roll), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(roll)
    turn[:, 1, 0] = np.sin(roll)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1
    return camera.transpose(0, 2, 1) @ turn @ world


def _make_frames(forward: FloatArray) -> FloatArray:
    """Return (N, 3, 3) rows: two unit vectors across ``forward`` (N, 3), and its own direction."""
    forward = forward / np.linalg.norm(forward, axis=-1, keepdims=True)
    across = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward), axis=-1)])
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    return np.stack([across, np.cross(forward, across), forward], axis=1)


def _map_to_sphere(places: FloatArray) -> FloatArray:
    """Map (N, 2) in the unit square to (N, 3) unit vectors, evenly spread."""
    z = 2 * places[:, 0] - 1
    across, turn = np.sqrt(1 - z * z), 2 * np.pi * places[:, 1]
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1)


def _make_sequence(count: int, dimensions: int, seed: int) -> FloatArray:
    """Return (count, dimensions) points of the R sequence in the unit cube, shifted by the seed."""
    ratio = 2.0
    for _ in range(50):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    step = ratio ** -np.arange(1.0, dimensions + 1)
    shift = np.random.default_rng(seed).uniform(size=dimensions)
    return (shift + np.arange(1, count + 1)[:, None] * step) % 1.0
