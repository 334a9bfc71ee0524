"""Target, lens and pose -> the photo that the lens would take, ray by ray.

From the light on a sensor to the grey levels of a photo go exposure, blur, blooming and noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.angles import angle_from_axis
from cubicfish_cli.rendering.pose import Pose, rotation_matrix
from cubicfish_cli.rendering.truth import MARGIN_SQUARES, Plate, nearest, plates
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray, IntArray

_WHITE_LEVEL = 240.0  # of light 1 at exposure 1
_DARK_LEVEL = 6.0  # what a sensor reads where no light comes
_FULL = 255.0
# Over how many pixels the light that a full pixel cannot hold falls by a factor of e, and how far
# it is followed.
_SPILL_PX, _SPILL_REACH_PX = 0.8, 9
Unproject = Callable[[FloatArray], FloatArray]
Background = Callable[[FloatArray], FloatArray]
Starts = Callable[[FloatArray], FloatArray]

# Shares of the light that are thrown back.
INK, PAPER, _BACK = 0.07, 0.92, 0.45
# Light from above and from one side, so that boards at right angles differ in brightness.
_LIGHT = np.array([0.36, 0.48, 0.8])
AMBIENT = 0.6
_RAYS_PER_BLOCK = 50_000  # fits a processor cache
_NOTHING, _BLACK = -1, -2  # what a ray shows where there is no board, and outside the field


def sensed(
    light: FloatArray, *, exposure: float, blur: float, noise: float, seed: int | Sequence[int]
) -> npt.NDArray[np.uint8]:
    """What a sensor makes of light (height, width) -> grey levels (height, width) uint8.

    Args:
        light: 1 is what white paper throws back when it is lit well.
        exposure: factor on the light. From about 1.15 on white paper is burnt out, and the more
            it is, the farther it bleeds into dark squares: see :func:`bloomed`.
        blur: standard deviation of the lens's blur, pixels.
        noise: standard deviation of the sensor's noise, grey levels.
        seed: of the noise.

    """
    level = _DARK_LEVEL + light * exposure * (_WHITE_LEVEL - _DARK_LEVEL)
    if blur > 0:
        level = np.asarray(cv2.GaussianBlur(level, (0, 0), blur), float)
    level = bloomed(level)
    if noise > 0:
        level += np.random.default_rng(seed).normal(0.0, noise, level.shape)
    return np.clip(np.rint(level), 0, 255).astype(np.uint8)


def bloomed(level: FloatArray) -> FloatArray:
    """Grey levels (height, width) of a sensor whose pixels overflow into their neighbours.

    What a pixel has above 255 goes to the pixels around it, less and less by exp(-distance/0.8 px),
    the same on all sides. A straight edge between white and dark moves into the dark by as much as
    the logarithm of the overflow, so that dark squares that meet at a corner come apart by a gap
    whose middle is the corner still. Where nothing is above 255 nothing changes.
    """
    over = level - _FULL
    if not (over > 0).any():
        return level
    reach = np.arange(-_SPILL_REACH_PX, _SPILL_REACH_PX + 1.0)
    spill = np.exp(-np.hypot(reach[:, None], reach) / _SPILL_PX)
    spill /= spill.sum()
    received = cv2.filter2D(np.maximum(over, 0), -1, spill, borderType=cv2.BORDER_REFLECT)
    return np.asarray(np.minimum(level, _FULL) + received, float)


def plain_background(directions: FloatArray) -> FloatArray:
    """An even grey all around: world directions (N, 3) -> brightness (N,)."""
    return np.full(len(directions), 0.4)


def room_background(directions: FloatArray) -> FloatArray:
    """A plain room far away: world directions (N, 3) -> brightness (N,), smooth on each wall."""
    size = np.abs(directions)
    wall = np.argmax(size, axis=1)
    positive = np.take_along_axis(directions, wall[:, None], axis=1)[:, 0] > 0
    level = np.array([[0.30, 0.36], [0.33, 0.40], [0.22, 0.50]])[wall, positive.astype(int)]
    nearness = np.take_along_axis(size, wall[:, None], axis=1)[:, 0]
    slope = 0.08 * directions @ np.array([0.5, -0.4, 0.76])
    return level * (0.7 + 0.3 * nearness) + slope


def render(
    target: Target,
    lens_unproject: Unproject,
    camera_from_world: Pose,
    image_size: tuple[int, int],
    *,
    supersample: int = 4,
    noise: float = 2.0,
    blur: float = 0.5,
    vignetting: float = 0.4,
    exposure: float = 1.0,
    light_from: npt.ArrayLike = _LIGHT,
    background: Background = room_background,
    margin: float = MARGIN_SQUARES,
    edges_only: bool = False,
    seed: int | Sequence[int] = 0,
    ray_starts: Starts | None = None,
) -> npt.NDArray[np.uint8]:
    """Render a grey photo of the target -> (height, width) uint8.

    Each pixel is the mean of ``supersample``² rays over its area, so a printed edge lies
    exactly where the lens puts it. Memory is bounded: rows are done in blocks.

    Args:
        target: the calibration target; boards that are seen from behind are plain grey.
        lens_unproject: pixels (N, 2) -> rays in the camera frame (N, 3), NaN outside the
            lens's field, which stays black.
        camera_from_world: rotation vector and translation.
        image_size: (width, height).
        supersample: sub-samples per pixel along x and along y.
        noise: standard deviation of the sensor's noise, grey levels.
        blur: standard deviation of the lens's blur, pixels.
        vignetting: share of the light that is lost at 90° from the axis.
        exposure: 1 is a well-lit photo, 0.2 a dark one; above 1.15 paper is burnt out and bleeds
            into dark squares, see :func:`cubicfish_cli.rendering.render.bloomed`.
        light_from: (3,) unit world direction in which the lamp is; shadows are not cast.
        background: world directions (N, 3) -> brightness (N,) where no board is.
        margin: white paper around each print, squares.
        edges_only: sub-sample only the pixels beside which something else is seen, several times
            faster. Elsewhere a pixel is one ray, so that seams of the background stay hard.
        seed: of the noise; the same arguments give the same photo.
        ray_starts: for a lens that is not central: rays (N, 3) -> where on its axis each starts,
            z (N,) in the target's units. What is seen of the background does not depend on it.

    Raises:
        TargetError: a board of a kind that cannot be drawn.

    """
    seen = plates(target, camera_from_world, margin=margin)
    lamp = np.asarray(light_from, float)
    world_from_camera = rotation_matrix(camera_from_world[0]).T

    def light_of(pixel: FloatArray) -> tuple[FloatArray, IntArray]:
        rays = lens_unproject(pixel)
        light, shown = np.zeros(len(rays)), np.full(len(rays), _BLACK)
        lit = ~np.isnan(rays).any(axis=1)
        light[lit], shown[lit] = _light(
            rays[lit], seen, world_from_camera, background, vignetting, lamp, ray_starts
        )
        return light, shown

    if edges_only:
        photo, shown = _sampled(light_of, image_size, 1)
        _smooth_edges(photo, shown, light_of, supersample)
    else:
        photo, _ = _sampled(light_of, image_size, supersample)
    return sensed(photo, exposure=exposure, blur=blur, noise=noise, seed=seed)


def _sampled(
    light_of: Callable[[FloatArray], tuple[FloatArray, IntArray]],
    image_size: tuple[int, int],
    supersample: int,
) -> tuple[FloatArray, IntArray]:
    """Light and, with one ray per pixel, what is shown: (height, width) each, in blocks of rows."""
    width, height = image_size
    offset = _offsets(supersample)
    x = (np.arange(width)[:, None] + offset).ravel()
    photo = np.empty((height, width))
    shown = np.full((height, width), _NOTHING)
    rows_per_block = max(1, _RAYS_PER_BLOCK // (len(x) * supersample))
    for top in range(0, height, rows_per_block):
        rows = np.arange(top, min(height, top + rows_per_block))
        y = (rows[:, None] + offset).ravel()
        pixel = np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1).reshape(-1, 2)
        light, here = light_of(pixel)
        photo[rows] = light.reshape(len(rows), supersample, width, supersample).mean(axis=(1, 3))
        if supersample == 1:
            shown[rows] = here.reshape(len(rows), width)
    return photo, shown


def _smooth_edges(
    photo: FloatArray,
    shown: IntArray,
    light_of: Callable[[FloatArray], tuple[FloatArray, IntArray]],
    supersample: int,
) -> None:
    """Sub-sample, in place, the pixels that have a neighbour which shows something else."""
    framed = np.pad(shown, 1, mode="edge")
    height, width = shown.shape
    edge = np.zeros(shown.shape, bool)
    for down in range(3):
        for right in range(3):
            edge |= framed[down : down + height, right : right + width] != shown
    row, column = np.nonzero(edge)
    offset = _offsets(supersample)
    within = np.stack(np.meshgrid(offset, offset), axis=-1).reshape(-1, 2)
    pixels_per_block = max(1, _RAYS_PER_BLOCK // len(within))
    for first in range(0, len(row), pixels_per_block):
        block = slice(first, first + pixels_per_block)
        middle = np.stack([column[block], row[block]], axis=-1)
        light, _ = light_of((middle[:, None] + within).reshape(-1, 2))
        photo[row[block], column[block]] = light.reshape(-1, len(within)).mean(axis=1)


def _offsets(supersample: int) -> FloatArray:
    """Where the rays of a pixel are, along either axis, relative to its middle."""
    return (np.arange(supersample) + 0.5) / supersample - 0.5


def _light(
    rays: FloatArray,
    seen: list[Plate],
    world_from_camera: FloatArray,
    background: Background,
    vignetting: float,
    lamp: FloatArray,
    ray_starts: Starts | None,
) -> tuple[FloatArray, IntArray]:
    """Light of rays (N, 3) -> (N,), and a number for what each shows (N,)."""
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    index, _, position = nearest(seen, rays, None if ray_starts is None else ray_starts(rays))
    light, shown = np.empty(len(rays)), 2 * index
    light[index < 0] = background(rays[index < 0] @ world_from_camera.T)
    for i, plate in enumerate(seen):
        here = index == i
        outward = -(plate.board_from_camera @ world_from_camera.T)[2]
        if plate.faces_camera:
            dark = plate.face.is_dark(position[here])
            thrown = np.where(dark, INK, PAPER)
            shown[here] += dark
        else:
            thrown, outward = np.full(int(here.sum()), _BACK), -outward
        light[here] = thrown * (AMBIENT + (1 - AMBIENT) * max(0.0, float(outward @ lamp)))
    light *= vignette(angle_from_axis(rays), vignetting)
    return light, np.where(index < 0, _NOTHING, shown)


def vignette(angle: FloatArray, vignetting: float) -> FloatArray:
    """The share of the light that arrives at angles from the axis (...,), radians."""
    return np.asarray(1.0 - vignetting * np.minimum((angle / radians(90.0)) ** 4, 1.2))
