"""The room that the sample photos show: a desk with the target on it, ray by ray, in colour.

All of it is made up here: wood, wallpaper, a window, shelves, a mug, books. Lengths are mm in the
target's frame, light is linear, and 1 is what white paper throws back in full light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.scene.faces import Face, board_face
from cubicfish.target.boards.board import Board
from cubicfish.target.target import Target

FloatArray = npt.NDArray[np.float64]
Paint = Callable[[FloatArray], FloatArray]
Hit = tuple[FloatArray, FloatArray, FloatArray]
"""Distance along rays (N,), inf for none; outward normal (N, 3); place on the surface (N, 2)."""

WALLS = (np.array([-1400.0, -1100.0, -760.0]), np.array([2300.0, 2100.0, 1750.0]))
DESK = (np.array([-330.0, -260.0, -36.0]), np.array([780.0, 620.0, -6.0]))
# Light comes from a window in the wall at the greatest x, and from a lamp over the desk.
WINDOW = (np.array([2290.0, -300.0, 150.0]), np.array([2290.0, 1100.0, 1350.0]))
LAMP = (np.array([150.0, 700.0, 900.0]), np.array([350.0, 900.0, 940.0]))
_SKY, _BULB = np.array([0.58, 0.66, 0.78]), np.array([0.66, 0.53, 0.37])
_FROM_ABOVE, _FROM_BELOW = np.array([0.36, 0.37, 0.40]), np.array([0.26, 0.22, 0.18])
_INK, _PAPER = np.array([0.035, 0.035, 0.04]), np.array([0.80, 0.80, 0.78])
# Backs of books.
_BACKS = (
    (0.42, 0.08, 0.06), (0.07, 0.14, 0.34), (0.08, 0.26, 0.14), (0.55, 0.50, 0.38),
    (0.50, 0.33, 0.08), (0.10, 0.10, 0.11), (0.30, 0.14, 0.09), (0.16, 0.34, 0.40),
)  # fmt: skip
_CREASE_MM = 30.0  # how far the dimness goes where two boards meet
_NEAR = 0.05  # mm: a surface does not shade itself


def even(*colour: float) -> Paint:
    """One colour all over."""
    return lambda place: np.broadcast_to(np.array(colour), (len(place), 3))


def picture(texture: npt.NDArray[np.float32], mm: float) -> Paint:
    """A tile (rows, columns, 3), ``mm`` wide, laid over a surface again and again."""
    per_mm = texture.shape[1] / mm
    framed = cv2.copyMakeBorder(texture, 0, 1, 0, 1, cv2.BORDER_WRAP)

    def paint(place: FloatArray) -> FloatArray:
        x, y = (place * per_mm).T
        x, y = np.mod(x, texture.shape[1]), np.mod(y, texture.shape[0])
        rows = 1 << 14  # cv2.remap takes pictures of fewer than 2^15 rows
        out = np.empty((len(place), 3))
        for first in range(0, len(place), rows):
            part = slice(first, first + rows)
            at = x[part, None].astype(np.float32), y[part, None].astype(np.float32)
            out[part] = cv2.remap(framed, *at, cv2.INTER_LINEAR)[:, 0]
        return out

    return paint


def tinted(colour: tuple[float, ...], shade: FloatArray) -> npt.NDArray[np.float32]:
    """A tile (rows, columns, 3) of a colour that is lighter by shares (rows, columns)."""
    return (np.array(colour) * (1 + shade[..., None])).astype(np.float32)


def cloud(random: np.random.Generator, shape: tuple[int, int], *grains: float) -> FloatArray:
    """Noise that wraps around, the sum of some grain sizes in pixels, about 0 and up to 1."""
    total = np.zeros(shape)
    for grain in grains:
        white = random.normal(size=shape)
        frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(shape[1]), np.fft.fftfreq(shape[0])))
        soft = np.fft.ifft2(np.fft.fft2(white) * np.exp(-((frequency * grain * 2.5) ** 2))).real
        total += soft / np.abs(soft).max()
    return total / len(grains)


def wood(random: np.random.Generator, colour: tuple[float, ...], planks: int) -> FloatArray:
    """Planks along x, each with its own shade and grain."""
    side = 768
    grain = cloud(random, (side, side), 1.5, 4)
    stretched = np.fft.ifft(
        np.fft.fft(grain, axis=1) * np.exp(-((np.fft.fftfreq(side) * 160) ** 2)), axis=1
    ).real
    row = np.arange(side)
    plank = row * planks // side
    shade = 1 + 0.16 * random.uniform(-1, 1, planks)[plank]
    rings = np.sin((row[:, None] + 60 * cloud(random, (side, side), 140)) / 5.0)
    light = shade[:, None] * (1 + 0.9 * stretched / np.abs(stretched).max() * 0.35 + 0.06 * rings)
    light[(row * planks) % side < planks] *= 0.45
    return (light[..., None] * np.array(colour)).astype(np.float32)


def wallpaper(random: np.random.Generator) -> FloatArray:
    """Broad stripes with leaves on every other one, on rough paper."""
    side = 512
    y, x = np.mgrid[:side, :side]
    stripe = (x * 4 // side) % 2
    colour = np.where(stripe[..., None], [0.52, 0.58, 0.55], [0.60, 0.64, 0.58])
    for _ in range(46):
        at, angle = random.uniform(0, side, 2), random.uniform(0, np.pi)
        dx, dy = (
            (x - at[0] + side / 2) % side - side / 2,
            (y - at[1] + side / 2) % side - side / 2,
        )
        along, across = (
            dx * np.cos(angle) + dy * np.sin(angle),
            dy * np.cos(angle) - dx * np.sin(angle),
        )
        leaf = np.clip(2 - 2 * ((along / 26) ** 2 + (across / 9) ** 2), 0, 1)
        tint = np.array([0.30, 0.44, 0.36]) * random.uniform(0.8, 1.3)
        colour = colour + leaf[..., None] * 0.75 * (tint - colour)
    return (colour * (1 + 0.10 * cloud(random, (side, side), 1, 5))[..., None]).astype(np.float32)


def shelves(random: np.random.Generator) -> FloatArray:
    """Rows of books, as a tile of 1,200 mm."""
    side = 600
    tile = np.empty((side, side, 3), np.float32)
    tile[:] = (0.07, 0.05, 0.04)
    for bottom in range(0, side, 150):
        tile[bottom : bottom + 9] = (0.34, 0.22, 0.13)
        x = 4
        while x < side - 8:
            wide, tall = int(random.integers(7, 26)), int(random.integers(88, 132))
            back = np.array(_BACKS[random.integers(len(_BACKS))], np.float32)
            shade = back * np.float32(random.uniform(0.6, 1.3))
            round_back = 0.55 + 0.45 * np.sin(np.linspace(0.3, 2.8, wide))[None, :, None]
            part = tile[bottom + 9 : bottom + 9 + tall, x : x + wide]
            part[:] = (shade * round_back)[:, : part.shape[1]]
            part[tall // 5 : tall // 5 + 4] = 0.5 * part[tall // 5 : tall // 5 + 4] + 0.3
            x += wide + int(random.integers(0, 3)) + (14 if random.random() < 0.08 else 0)
    return tile


@dataclass(frozen=True, kw_only=True, eq=False)
class Block:
    """A box, turned by ``turn`` radians about the upright through its middle; hit from outside."""

    lower: FloatArray
    upper: FloatArray
    paint: Paint
    turn: float = 0.0
    inside: bool = False

    def hit(self, start: FloatArray, ray: FloatArray) -> Hit:
        """See :data:`Hit`."""
        middle = (self.lower + self.upper) / 2
        half = (self.upper - self.lower) / 2
        c, s = np.cos(self.turn), np.sin(self.turn)
        turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        distance = np.full(len(ray), np.inf)
        normal, place = np.zeros(ray.shape), np.zeros((len(ray), 2))
        # Most rays go past a small thing: no more is done for them.
        off, reach = start - middle, np.linalg.norm(half)
        past = (off**2).sum(axis=1) - (off * ray).sum(axis=1) ** 2 > reach**2
        near = np.flatnonzero(~past)
        start, ray = off[near] @ turn.T, ray[near] @ turn.T
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (-half - start) / ray, (half - start) / ray
        enter, leave = np.minimum(one, other), np.maximum(one, other)
        first = np.maximum(np.maximum(enter[:, 0], enter[:, 1]), enter[:, 2])
        last = np.minimum(np.minimum(leave[:, 0], leave[:, 1]), leave[:, 2])
        met = (last > _NEAR) if self.inside else (first < last) & (first > _NEAR)
        near, start, ray = near[met], start[met], ray[met]
        where, bounds = (last[met], leave[met]) if self.inside else (first[met], enter[met])
        axis, rows = (bounds == where[:, None]).argmax(axis=1), np.arange(len(near))
        facing = np.zeros(ray.shape)
        facing[rows, axis] = -np.sign(ray[rows, axis])
        at = start + where[:, None] * ray + half
        across = np.array([[1, 2], [0, 2], [0, 1]])[axis]
        distance[near], normal[near] = where, facing @ turn
        place[near] = np.take_along_axis(at, across, axis=1)
        return distance, normal, place


def block(
    lower: tuple[float, ...], upper: tuple[float, ...], paint: Paint, turn: float = 0.0
) -> Block:
    """A box of such corners."""
    return Block(lower=np.array(lower), upper=np.array(upper), paint=paint, turn=turn)


@dataclass(frozen=True, kw_only=True, eq=False)
class Ball:
    """A sphere."""

    middle: FloatArray
    radius: float
    paint: Paint

    def hit(self, start: FloatArray, ray: FloatArray) -> Hit:
        """See :data:`Hit`."""
        off = start - self.middle
        along = (off * ray).sum(axis=1)
        root = along**2 - (off**2).sum(axis=1) + self.radius**2
        distance = -along - np.sqrt(np.maximum(root, 0))
        distance = np.where((root > 0) & (distance > _NEAR), distance, np.inf)
        normal = (off + np.where(np.isfinite(distance), distance, 0)[:, None] * ray) / self.radius
        around = np.arctan2(normal[:, 1], normal[:, 0]), np.arcsin(np.clip(normal[:, 2], -1, 1))
        return distance, normal, self.radius * np.stack(around, axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Drum:
    """An upright cylinder with a lid, its middle at the bottom."""

    foot: FloatArray
    radius: float
    height: float
    paint: Paint

    def hit(self, start: FloatArray, ray: FloatArray) -> Hit:
        """See :data:`Hit`."""
        off = start - self.foot
        a = (ray[:, :2] ** 2).sum(axis=1)
        b = (off[:, :2] * ray[:, :2]).sum(axis=1)
        root = b**2 - a * ((off[:, :2] ** 2).sum(axis=1) - self.radius**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            side = (-b - np.sqrt(np.maximum(root, 0))) / a
            lid = (self.height - off[:, 2]) / ray[:, 2]
        high = off[:, 2] + side * ray[:, 2]
        on_side = (root > 0) & (side > _NEAR) & (high > 0) & (high < self.height)
        at_lid = off[:, :2] + np.nan_to_num(lid)[:, None] * ray[:, :2]
        on_lid = (lid > _NEAR) & (np.hypot(*at_lid.T) < self.radius) & ~on_side
        distance = np.where(on_side, side, np.where(on_lid, lid, np.inf))
        at = off + np.where(np.isfinite(distance), distance, 0)[:, None] * ray
        round_it = np.column_stack([at[:, :2] / self.radius, np.zeros(len(at))])
        normal = np.where(on_side[:, None], round_it, [0.0, 0.0, 1.0])
        place = np.stack([self.radius * np.arctan2(at[:, 1], at[:, 0]), at[:, 2]], axis=-1)
        return distance, normal, place


class Sheet:
    """A board of the target: paper on both sides, printed on one."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.face: Face = board_face(board, margin=0.4)
        self.axes = np.stack([board.x_axis, board.y_axis, np.cross(board.x_axis, board.y_axis)])

    def hit(self, start: FloatArray, ray: FloatArray) -> Hit:
        """See :data:`Hit`."""
        off, along = (start - self.board.origin) @ self.axes.T, ray @ self.axes.T
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = -off[:, 2] / along[:, 2]
            place = off[:, :2] + distance[:, None] * along[:, :2]
            met = (distance > _NEAR) & self.face.covers(place)
        normal = -np.sign(along[:, 2:]) * self.axes[2]
        return np.where(met, distance, np.inf), normal, np.where(met[:, None], place, 0.0)

    def paint(self, place: FloatArray) -> FloatArray:
        """The print."""
        return np.where(self.face.is_dark(place)[:, None], _INK, _PAPER)


class Room:
    """All that can be seen.

    Args:
        target: the boards, on the desk.
        seed: of the textures and of where on window and lamp light comes from.

    """

    def __init__(self, target: Target, *, seed: int = 0) -> None:
        random = np.random.default_rng(seed)
        oak, walnut = wood(random, (0.40, 0.26, 0.15), 5), wood(random, (0.30, 0.17, 0.09), 8)
        self.sheets = [Sheet(board) for board in target.boards]
        plaster = np.array([0.76, 0.75, 0.72]) * (
            1 + 0.12 * cloud(random, (512, 512), 2, 60)[..., None]
        )
        plaster = plaster.astype(np.float32)
        paper, books = picture(wallpaper(random), 420), picture(shelves(random), 1200)
        cover = cloud(random, (256, 256), 2, 20)
        red, blue = (
            tinted((0.42, 0.06, 0.05), 0.25 * cover),
            tinted((0.06, 0.14, 0.36), 0.25 * cover),
        )
        orange = tinted((0.62, 0.30, 0.05), 0.2 * cover)
        glaze = np.full((64, 256, 3), (0.62, 0.60, 0.52), np.float32)
        glaze[22:42] = (0.10, 0.30, 0.34)
        self.walls = Block(lower=WALLS[0], upper=WALLS[1], paint=even(0, 0, 0), inside=True)
        self._wall_paints = {
            (0, 1): paper, (0, -1): paper, (1, 1): paper, (1, -1): books,
            (2, 1): picture(walnut, 900), (2, -1): picture(plaster, 1500),
        }  # fmt: skip
        leaves = tinted((0.09, 0.25, 0.06), 0.9 * cloud(random, (256, 256), 3, 8))
        clay, on = even(0.5, 0.16, 0.1), DESK[1][2]
        self.things: list[Block | Ball | Drum] = [
            Block(lower=DESK[0], upper=DESK[1], paint=picture(oak, 700)),
            # Two books, a mug, a ball, a box and a plant.
            block((330, -60, on), (520, 85, on + 34), picture(red, 150), turn=0.35),
            block((345, -50, on + 34), (505, 70, on + 58), picture(blue, 150), turn=0.1),
            Drum(foot=np.array([395.0, 240, on]), radius=41, height=96, paint=picture(glaze, 257)),
            Ball(middle=np.array([250.0, 330, on + 36]), radius=36, paint=picture(orange, 60)),
            block((60, 300, on), (130, 370, on + 70), even(0.10, 0.36, 0.16), turn=0.6),
            Drum(foot=np.array([-120.0, 420, on]), radius=55, height=150, paint=clay),
            Ball(middle=np.array([-120.0, 420, on + 225]), radius=105, paint=picture(leaves, 160)),
            # A cupboard, a stool and two pictures on the walls.
            block((-900, 1700, -760), (-350, 2100, 300), picture(oak, 500)),
            block((1500, 900, -760), (2000, 1500, -320), picture(red, 150)),
            block((-1400, 150, 500), (-1380, 850, 1050), picture(_painting(random), 700)),
            block((300, -1100, 420), (1000, -1080, 1000), picture(_painting(random), 700)),
        ]  # fmt: skip
        self._random = random

    def light(self, start: FloatArray, rays: FloatArray, *, by_lamp: bool) -> FloatArray:
        """Rays (N, 3) of unit length from a point (3,) -> light (N, 3).

        Either the window or the lamp shines, twice as bright as it is: half of all rays are for
        each.
        """
        start = np.broadcast_to(start, rays.shape)
        distance, normal, shade = self._seen(start, rays)
        at = start + distance[:, None] * rays + normal * 0.2
        above = (1 + normal[:, 2:]) / 2
        received = above * _FROM_ABOVE + (1 - above) * _FROM_BELOW
        received = received * self._openness(at)[:, None]
        (low, high), colour = (LAMP, _BULB) if by_lamp else (WINDOW, _SKY)
        way = self._random.uniform(low, high, at.shape) - at
        far = np.linalg.norm(way, axis=1)
        facing = np.maximum((normal * way).sum(axis=1) / far, 0.0)
        near = np.linalg.norm((low + high) / 2 - (150, 120, 60)) / np.maximum(far, 500)
        facing[facing > 0] *= self._reaches(at[facing > 0], way[facing > 0])
        received = received + 2 * (facing * np.minimum(near, 2.0))[:, None] * colour
        return np.where(shade[:, 3:] > 0, shade[:, :3], shade[:, :3] * received)

    def _seen(
        self, start: FloatArray, rays: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance (N,), normal (N, 3), and colour with whether it shines by itself (N, 4)."""
        distance, normal, place = self.walls.hit(start, rays)
        shade = np.zeros((len(rays), 4))
        at = start + distance[:, None] * rays
        for (axis, side), paint in self._wall_paints.items():
            here = normal[:, axis] * side > 0.5
            shade[here, :3] = paint(place[here])
        glass = (normal[:, 0] < -0.5) & (
            (at[:, 1:] > WINDOW[0][1:]) & (at[:, 1:] < WINDOW[1][1:])
        ).all(1)
        bar = (np.abs(at[:, 1] - 400) < 28) | (np.abs(at[:, 2] - 850) < 22)
        shade[glass & bar, :3] = 0.6
        sky = glass & ~bar
        high = np.clip((at[sky, 2:] - 150) / 1200, 0, 1)
        shade[sky, :3] = high * np.array([0.85, 1.0, 1.2]) + (1 - high) * (0.6, 0.72, 0.5)
        shade[sky, 3] = 1
        for thing in (*self.things, *self.sheets):
            reached, facing, on = thing.hit(start, rays)
            nearer = np.flatnonzero(reached < distance)
            distance[nearer], normal[nearer] = reached[nearer], facing[nearer]
            shade[nearer, :3], shade[nearer, 3] = thing.paint(on[nearer]), 0
        return distance, normal, shade

    def _reaches(self, at: FloatArray, way: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether nothing is between points (N, 3) and the light at the end of ``way``."""
        free = np.ones(len(at), bool)
        far = np.linalg.norm(way, axis=1)
        for thing in (*self.things, *self.sheets):
            free[free] = thing.hit(at[free], way[free] / far[free, None])[0] > far[free]
        return free

    def _openness(self, at: FloatArray) -> FloatArray:
        """How much of the room's light comes into corners of the target and under the desk."""
        near_corner = (at > -20).all(axis=1) & (at[:, 0] < 290) & (at[:, 1] < 260)
        crease = np.prod(1 - 0.45 * np.exp(-np.abs(at) / _CREASE_MM), axis=1) / 0.55
        below = np.where(at[:, 2] < DESK[0][2], 0.6, 1.0)
        return np.where(near_corner, crease, below)


def _painting(random: np.random.Generator) -> FloatArray:
    """A picture of hills, framed."""
    side = 256
    y, x = np.mgrid[:side, :side]
    canvas = np.empty((side, side, 3))
    canvas[:] = np.array([0.35, 0.55, 0.75])
    for level, tint in (
        (150, (0.30, 0.40, 0.42)),
        (110, (0.22, 0.34, 0.20)),
        (60, (0.40, 0.34, 0.10)),
    ):
        waves = np.zeros(x.shape)
        for _ in range(3):
            tall, long, start = random.uniform((4, 14, 0), (16, 50, 6))
            waves += tall * np.sin(x / long + start)
        canvas[y < level + waves] = tint
    edge = np.minimum(np.minimum(x, side - 1 - x), np.minimum(y, side - 1 - y))
    canvas[edge < 14] = (0.12, 0.08, 0.05)
    return canvas.astype(np.float32)
