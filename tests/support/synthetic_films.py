"""Rendered films of known truth: a target moved by hand in front of a camera.

The sensor reads its rows one after the other and each for as long as the shutter is open: what
moves is bent and blurred by its own motion, not by a filter. Boards are drawn from textures, many
times faster than ray by ray; background and lamp stand still with the camera.

Hand motion for rendered films: from place to place, with pauses and tremor.

A hand goes from rest to rest along the smoothest way, which is least jerk (Flash and Hogan, 1985).
It sways slowly and trembles at some hertz all the while.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import numpy.typing as npt

from cubicfish import FloatArray, Target
from cubicfish.models import angle_from_axis
from cubicfish.scene.faces import board_face
from cubicfish.scene.photos import (
    AMBIENT,
    INK,
    LAMP,
    PAPER,
    Look,
    RayGrid,
    chosen_poses,
    room_background,
    sensed,
    vignette,
)
from cubicfish.scene.truth import (
    MARGIN_SQUARES,
    Pose,
    project_corners,
    rotation_matrix,
)
from cubicfish.scene.views import WanderingPupil, WholeLens
from cubicfish.target import Board

Float32Array = npt.NDArray[np.float32]

# A place to carry the target to for so many seconds of film, and the fewest there are.
_SECONDS_PER_PLACE, _FEWEST_PLACES = 1.6, 4
# Moments of an exposure, each a little beside the others within the pixel.
_MOMENTS = 4
# Points of the plane with least discrepancy (Roberts, 2018), their middle that of the pixel.
_BESIDE = (np.arange(_MOMENTS)[:, None] * np.array([0.7548776662, 0.5698402910])) % 1
_BESIDE -= _BESIDE.mean(axis=0)
# Poses are worked out so often while a frame is read out; between two they go straight.
_NODES = 5
_TEXELS, _INK_SAMPLES = 1600, 2  # of a texture's longer side, and of a texel's
_LEAST_TEXTURE = 64
_OUTLINE = 24  # points per side of a board's outline
_FRAME_PX = 3
_OUTSIDE = -1e4  # a texel that is not there
_ROUNDS = 4
# As cameras compress: about half a bit per pixel where things move.
_COMPRESSED = {"crf": "20", "preset": "veryfast", "g": "30"}


@dataclass(frozen=True, kw_only=True)
class FilmOptions:
    """How a film is taken.

    Attributes:
        rate: frames per second.
        shutter_ms: for how long each row gathers light, milliseconds.
        readout_ms: how long after the first row the last one is read, milliseconds; 0 is a global
            shutter.

    """

    rate: float = 30.0
    shutter_ms: float = 8.0
    readout_ms: float = 15.0

    @property
    def open_s(self) -> float:
        """How long each row is open, seconds."""
        return self.shutter_ms / 1000

    @property
    def readout_s(self) -> float:
        """How long after the first row the last one begins, seconds."""
        return self.readout_ms / 1000


def _middle(taken: FilmOptions, frame: int, row: npt.ArrayLike, rows: int) -> FloatArray:
    """The middle of the exposure of rows of a frame, seconds."""
    late = taken.open_s / 2 + _share(row, rows) * taken.readout_s
    return np.asarray(frame / taken.rate + late)


def _share(row: npt.ArrayLike, rows: int) -> FloatArray:
    return np.clip(np.asarray(row, float) / rows, 0.0, 1.0)


def hand_path(
    target: Target,
    lens: WholeLens,
    image_size: tuple[int, int],
    seconds: float,
    *,
    seed: int = 0,
) -> HandPath:
    """A way of the target that fills the field, from varied sides and distances.

    Raises:
        TargetError: the target cannot be drawn, or cannot be seen so often.

    """
    places = max(_FEWEST_PLACES, round(seconds / _SECONDS_PER_PLACE))
    poses = chosen_poses(target, lens, image_size, places, seed=seed)
    world = target.corners()[3]
    middle = (world.min(axis=0) + world.max(axis=0)) / 2
    return HandPath.through(poses, middle, seconds, seed=seed)


@dataclass(frozen=True, kw_only=True, eq=False)
class Film:
    """A film of a target that a hand moves. Boards are rendered flat.

    Attributes:
        target: what is shown.
        lens: through which it is seen.
        image_size: (width, height) of the frames, pixels.
        path: where the target is at every moment.
        taken: when rows gather light.

    Raises:
        TargetError: by its methods, of a board of a kind that cannot be drawn.

    """

    target: Target
    lens: WholeLens
    image_size: tuple[int, int]
    path: HandPath
    taken: FilmOptions

    def frames(self, count: int, look: Look) -> Iterator[npt.NDArray[np.uint8]]:
        """Render ``count`` frames one by one: (height, width) grey levels."""
        scene = _Scene(self.target.with_flat_boards(), self.lens, self.image_size, look.vignetting)
        for number in range(count):
            yield sensed(
                scene.light(self.path, self.taken, number),
                exposure=look.exposure,
                blur=look.blur,
                noise=look.noise,
                seed=(look.seed, number),
            )

    def pose(self, frame: int) -> Pose:
        """camera_from_world in the middle of a frame's exposure, of its middle row."""
        turn, moved = self.path.at(float(_middle(self.taken, frame, 0.5, 1)))
        return np.asarray(cv2.Rodrigues(turn)[0], float).ravel(), moved

    def corners(self, frame: int) -> tuple[npt.NDArray[np.intp], FloatArray]:
        """Visible corners of a frame, numbered as the target's (N,), and their pixels (N, 2).

        Each is where it was when its own row was exposed.
        """
        seen = project_corners(self.target, self.lens, self.pose(frame), self.image_size)
        shown = np.flatnonzero(seen.visible)
        begin, step = _nodes(self.taken, frame)
        poses = [self.path.at(begin + step * node) for node in range(_NODES)]
        stack = np.stack([np.column_stack([turn, moved]) for turn, moved in poses])
        world, pixel = seen.world[shown], seen.pixel[shown]
        for _ in range(_ROUNDS):
            at = _middle(self.taken, frame, pixel[:, 1], self.image_size[1])
            own = _between(stack, (at - begin) / step)
            points = np.einsum("nij,nj->ni", own[:, :, :3], world) + own[:, :, 3]
            pixel = self.lens.project(points)
        there = np.isfinite(pixel).all(axis=1)
        return shown[there], pixel[there]

    def write(self, path: Path, count: int, look: Look) -> None:
        """Write ``count`` frames as an H.264 film; its sides must be even."""
        with av.open(str(path), "w") as container:
            rate = Fraction(self.taken.rate).limit_denominator(1001)
            stream: Any = container.add_stream("libx264", rate=rate, options=_COMPRESSED)
            stream.width, stream.height = self.image_size
            stream.pix_fmt = "yuv420p"
            for picture in self.frames(count, look):
                frame = av.VideoFrame.from_ndarray(picture, format="gray")
                container.mux(stream.encode(frame.reformat(format="yuv420p")))
            container.mux(stream.encode(None))


def _nodes(taken: FilmOptions, frame: int) -> tuple[float, float]:
    """When the poses of a frame are worked out: the first time, and from each to the next."""
    whole = taken.readout_s + taken.open_s
    return frame / taken.rate, max(whole, 1e-6) / (_NODES - 1)


def _between(stack: FloatArray, at: FloatArray) -> FloatArray:
    """Matrices (nodes, ...) at places (N,) between the nodes -> (N, ...)."""
    first = np.clip(np.floor(at).astype(int), 0, len(stack) - 2)
    share = (at - first).reshape(-1, *[1] * (stack.ndim - 1))
    return np.asarray(stack[first] * (1 - share) + stack[first + 1] * share)


class _Scene:
    """What stays the same from frame to frame."""

    def __init__(
        self, target: Target, lens: WholeLens, image_size: tuple[int, int], vignetting: float
    ) -> None:
        self._size, self._lens = image_size, lens
        rays = RayGrid.of(lens.unproject, image_size)
        self._rays = [
            np.ascontiguousarray(np.moveaxis(part, -1, 0))
            for part in (rays.ray, rays.by_x, rays.by_y)
        ]
        self._starts = None
        if isinstance(lens, WanderingPupil):
            self._starts = lens.ray_starts(rays.ray.astype(float)).astype(np.float32)
        unit = rays.ray / np.linalg.norm(rays.ray, axis=-1, keepdims=True)
        seen = np.isfinite(unit).all(axis=-1)
        self._dim = np.where(seen, vignette(angle_from_axis(unit.astype(float)), vignetting), 0.0)
        back = np.zeros(seen.shape)
        # The room's walls as they stand around a camera that looks along one of them.
        back[seen] = room_background(unit[seen].astype(float))
        self._back = back * self._dim
        self._seen = seen
        self._plates = [_Plate(board) for board in target.boards]

    def light(self, path: HandPath, taken: FilmOptions, frame: int) -> FloatArray:
        """Light on the sensor (height, width)."""
        begin, step = _nodes(taken, frame)
        poses = [path.at(begin + step * node) for node in range(_NODES)]
        light = self._back.copy()
        shown = [
            (plate, *box)
            for plate in sorted(self._plates, key=lambda plate: -plate.away(poses[_NODES // 2]))
            if (box := self._box(plate, poses)) is not None
        ]
        if not shown:
            return light
        top, bottom = min(one[1] for one in shown), max(one[2] for one in shown)
        left, right = min(one[3] for one in shown), max(one[4] for one in shown)
        part = np.s_[top:bottom, left:right]
        level = (self._back[part] / np.maximum(self._dim[part], 1e-9)).astype(np.float32)
        total = np.zeros(level.shape, np.float32)
        for moment in range(_MOMENTS):
            across, down = _BESIDE[moment]
            now = level.copy()
            for plate, first, last, one, other in shown:
                own = np.s_[first:last, one:other]
                x, y, z = (
                    ray[own] + np.float32(across) * by_x[own] + np.float32(down) * by_y[own]
                    for ray, by_x, by_y in zip(*self._rays, strict=True)
                )
                at = taken.readout_s * _share(np.arange(first, last), self._size[1])
                at += taken.open_s * (moment + 0.5) / _MOMENTS
                plate.draw(
                    now[first - top : last - top, one - left : other - left],
                    poses,
                    at / step,
                    (x, y, z),
                    None if self._starts is None else self._starts[own],
                )
            total += now
        light[part] = np.where(self._seen[part], self._dim[part] * total / _MOMENTS, 0.0)
        return light

    def _box(
        self, plate: _Plate, poses: list[tuple[FloatArray, FloatArray]]
    ) -> tuple[int, int, int, int] | None:
        """Rows and columns, top, bottom, left and right, that a plate may be seen in."""
        pixel = np.concatenate(
            [
                self._lens.project(plate.outline @ turn.T + moved)
                for turn, moved in (poses[0], poses[_NODES // 2], poses[-1])
            ]
        )
        width, height = self._size
        known = np.isfinite(pixel).all(axis=1)
        if not known.any():
            return None
        if not known.all():
            return 0, height, 0, width
        left, top = np.clip(np.floor(pixel.min(axis=0)).astype(int) - _FRAME_PX, 0, None)
        right, bottom = np.ceil(pixel.max(axis=0)).astype(int) + _FRAME_PX + 1
        right, bottom = min(int(right), width), min(int(bottom), height)
        return (int(top), bottom, int(left), right) if left < right and top < bottom else None


class _Plate:
    """A board as textures, each half as fine as the one before."""

    def __init__(self, board: Board) -> None:
        print_ = board_face(board, margin=MARGIN_SQUARES)
        lower, upper = np.array(print_.lower), np.array(print_.upper)
        extent = upper - lower
        self._texel = float(extent.max()) / _TEXELS
        size = np.maximum(np.rint(extent / self._texel).astype(int), 1)
        self._lower = lower
        fine = _INK_SAMPLES
        x, y = (
            low + (np.arange(count * fine) + 0.5) * self._texel / fine
            for low, count in zip(lower, size, strict=True)
        )
        ink = np.empty((size[1], size[0]), np.float32)
        for row in range(size[1]):
            own = y[row * fine : (row + 1) * fine]
            dark = print_.is_dark(np.stack(np.broadcast_arrays(x, own[:, None]), axis=-1))
            ink[row] = dark.reshape(fine, size[0], fine).mean(axis=(0, 2))
        self._axes = board.axes
        self._origin = np.asarray(board.origin, float)
        levels: list[npt.NDArray[Any]] = [PAPER + (INK - PAPER) * ink]
        while min(levels[-1].shape) > 2 * _LEAST_TEXTURE:
            height, width = levels[-1].shape
            # An odd row or column would shift what follows by half a texel.
            even = np.pad(levels[-1], ((0, height % 2), (0, width % 2)), mode="edge")
            half = (even.shape[1] // 2, even.shape[0] // 2)
            levels.append(cv2.resize(even, half, interpolation=cv2.INTER_AREA))
        # What is seen, and how much of it: beyond the paper nothing.
        self._levels = [np.dstack([np.pad(one, 1), np.pad(np.ones_like(one), 1)]) for one in levels]
        side = np.linspace(0, 1, _OUTLINE)
        low, high = np.zeros(_OUTLINE), np.ones(_OUTLINE)
        around = np.concatenate(
            [
                np.column_stack(pair)
                for pair in ((side, low), (side, high), (low, side), (high, side))
            ]
        )
        plane = lower + around * extent
        self.outline: FloatArray = self._origin + plane @ self._axes[:2]
        """(N, 3) points around the plate, world."""

    def away(self, pose: tuple[FloatArray, FloatArray]) -> float:
        """How far its middle is from the camera."""
        turn, moved = pose
        return float(np.linalg.norm(turn @ self.outline.mean(axis=0) + moved))

    def draw(
        self,
        light: Float32Array,
        poses: list[tuple[FloatArray, FloatArray]],
        at: FloatArray,
        ray: tuple[Float32Array, Float32Array, Float32Array],
        start: Float32Array | None,
    ) -> None:
        """Draw it, in place, over what the rays of a part of the picture see.

        Args:
            light: (h, w) what they see so far.
            poses: at each node of the frame.
            at: (h,) when each row is exposed, in nodes.
            ray: x, y and z, each (h, w).
            start: (h, w) where rays begin on the axis; None for a central lens.

        """
        # A ray's point d·ray + start is x·a + y·b + t of the board's axes and place: solved for x,
        # y and 1, what comes third says how far it is.
        sides = np.stack(
            [
                np.column_stack(
                    [turn @ self._axes[0], turn @ self._axes[1], turn @ self._origin + moved]
                )
                for turn, moved in poses
            ]
        )
        from_ray = np.linalg.inv(_between(sides, at)).astype(np.float32)
        turn, moved = poses[len(poses) // 2]
        outward = -turn @ self._axes[2]
        if float(outward @ (turn @ self._origin + moved)) >= 0:
            return  # a hand shows the face
        lit = np.float32(AMBIENT + (1 - AMBIENT) * max(0.0, float(outward @ LAMP)))
        rows = from_ray[:, :, :, None]
        across, down, depth = (
            rows[:, i, 0] * ray[0] + rows[:, i, 1] * ray[1] + rows[:, i, 2] * ray[2]
            for i in range(3)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            if start is None:
                far = 1 / depth
                x, y = across * far, down * far
            else:
                far = (1 - start * rows[:, 2, 2]) / depth
                x = across * far + start * rows[:, 0, 2]
                y = down * far + start * rows[:, 1, 2]
            hit = far > 0
        level = self._level(x, y, hit)
        texel = self._texel * 2**level
        # Half a texel to the middle of the first, and one for the frame of nothing.
        texture = self._levels[level]
        x = np.where(hit, (x - np.float32(self._lower[0])) / texel + 0.5, _OUTSIDE)
        y = np.where(hit, (y - np.float32(self._lower[1])) / texel + 0.5, _OUTSIDE)
        seen = cv2.remap(
            texture,
            np.clip(x, _OUTSIDE, -_OUTSIDE).astype(np.float32),
            np.clip(y, _OUTSIDE, -_OUTSIDE).astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=0,
        )
        light *= 1 - seen[..., 1]
        light += lit * seen[..., 0]

    def _level(self, x: Float32Array, y: Float32Array, hit: npt.NDArray[np.bool_]) -> int:
        """The texture whose texels are about as large as pixels."""
        here = hit[:, 1:] & hit[:, :-1]
        x1, y1 = self._lower + self._texel * np.array(self._levels[0].shape[1::-1])
        here &= (x[:, 1:] > self._lower[0]) & (x[:, 1:] < x1)
        here &= (y[:, 1:] > self._lower[1]) & (y[:, 1:] < y1)
        if not here.any():
            return 0
        step = np.hypot(np.diff(x, axis=1)[here], np.diff(y, axis=1)[here])
        texels = float(np.quantile(step, 0.25)) / self._texel
        return int(np.clip(np.floor(np.log2(max(texels, 1.0))), 0, len(self._levels) - 1))


# Degrees a second of a move in the mean, the way through the picture and the turn added up.
_SPEED_DEG = 70.0
_SHORTEST_MOVE, _LONGEST_PAUSE = 0.4, 0.7  # seconds, before all times are scaled to the film's
# Sway and tremor: hertz, and degrees of the way to the target and of its turn.
_WAVES = ((0.4, 0.5, 1.0), (1.1, 0.2, 0.5), (4.0, 0.02, 0.06), (8.5, 0.008, 0.025))


@dataclass(frozen=True, kw_only=True, eq=False)
class HandPath:
    """Where the target is at every moment.

    Attributes:
        middle: (3,) the world point that is carried.
        begin, end: (M,) seconds of each move; between two moves is a pause.
        turn: (M + 1, 3, 3) camera_from_world rotations at the places between.
        way: (M + 1, 3) unit vectors to the target's middle, camera frame.
        distance: (M + 1,) of the middle.
        phase: (waves, 5) of sway and tremor.

    """

    middle: FloatArray
    begin: FloatArray
    end: FloatArray
    turn: FloatArray
    way: FloatArray
    distance: FloatArray
    phase: FloatArray

    @classmethod
    def through(
        cls, poses: Sequence[Pose], middle: FloatArray, seconds: float, *, seed: int = 0
    ) -> HandPath:
        """A way through all of the poses, each to one near it, in so many seconds.

        Args:
            poses: camera_from_world, at least two.
            middle: (3,) the target's middle, world.
            seconds: how long it takes.
            seed: of pauses, sway and tremor.

        """
        turn = np.stack([rotation_matrix(rotation) for rotation, _ in poses])
        place = turn @ middle + np.stack([np.asarray(moved, float) for _, moved in poses])
        distance = np.linalg.norm(place, axis=1)
        way = place / distance[:, None]
        apart = _angles(way @ way.T) + _angles((np.einsum("aij,bij->ab", turn, turn) - 1) / 2)
        order = _near_ones_first(apart)
        turn, way, distance = turn[order], way[order], distance[order]
        random = np.random.default_rng(seed)
        moving = np.maximum(
            _SHORTEST_MOVE, np.degrees(apart[order[:-1], order[1:]]) / _SPEED_DEG
        ) * random.uniform(0.7, 1.4, len(order) - 1)
        pause = random.uniform(0.05, _LONGEST_PAUSE, len(order) - 1)
        scale = seconds / float(moving.sum() + pause.sum())
        end = scale * np.cumsum(moving + pause)
        return cls(
            middle=np.asarray(middle, float),
            begin=end - scale * moving,
            end=end,
            turn=turn,
            way=way,
            distance=distance,
            phase=random.uniform(0, 2 * np.pi, (len(_WAVES), 5)),
        )

    def at(self, seconds: float) -> tuple[FloatArray, FloatArray]:
        """camera_from_world at a moment: rotation (3, 3) and translation (3,)."""
        move = min(int(np.searchsorted(self.end, seconds)), len(self.end) - 1)
        begin, end = self.begin[move], self.end[move]
        gone = float(np.clip((seconds - begin) / (end - begin), 0.0, 1.0))
        share = gone**3 * (10 - 15 * gone + 6 * gone**2)
        swing = np.zeros(5)
        for (hertz, of_way, of_turn), phase in zip(_WAVES, self.phase, strict=True):
            wave = np.radians([of_way, of_way, of_turn, of_turn, of_turn])
            swing += wave * np.sin(2 * np.pi * hertz * seconds + phase)
        first, last = self.turn[move], self.turn[move + 1]
        turn = rotation_matrix(share * _vector(last @ first.T)) @ first
        across = np.cross(self.way[move], self.way[move + 1])
        length = float(np.linalg.norm(across))
        angle = float(np.arctan2(length, self.way[move] @ self.way[move + 1]))
        axis = across / length if length > 1e-9 else np.zeros(3)
        way = rotation_matrix([*swing[:2], 0.0]) @ rotation_matrix(share * angle * axis)
        away = self.distance[move] ** (1 - share) * self.distance[move + 1] ** share
        turn = rotation_matrix(swing[2:]) @ turn
        return turn, away * (way @ self.way[move]) - turn @ self.middle


def _angles(cosine: FloatArray) -> FloatArray:
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _vector(rotation: FloatArray) -> FloatArray:
    """The rotation vector of a matrix; of half a turn one of both."""
    return np.asarray(cv2.Rodrigues(rotation)[0], float).ravel()


def _near_ones_first(apart: FloatArray) -> npt.NDArray[np.intp]:
    """An order in which each is followed by the nearest of those that are left."""
    order = [0]
    left = set(range(1, len(apart)))
    while left:
        order.append(min(left, key=lambda other: (apart[order[-1], other], other)))
        left.remove(order[-1])
    return np.array(order)
