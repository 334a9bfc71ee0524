"""Photos of known truth: a target through any lens, from given or chosen poses.

Photos are rendered ray by ray. Exposure, blur, blooming and noise turn the light on the sensor into
grey levels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import radians

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.angles import angle_from_axis
from cubicfish.errors import TargetError
from cubicfish.scene.truth import Pose, nearest, plates, rotation_matrix
from cubicfish.scene.views import WholeLens, choose_views, sample_views
from cubicfish.target.target import Target
from cubicfish.types import FloatArray

# Rays to 1e-7: a thousandth of a pixel of a lens with 10,000 pixels per radian, in half the memory.
FloatArray32 = npt.NDArray[np.float32]

_PIXELS_PER_BLOCK = 200_000
_SUPERSAMPLE = 4
# So many views to choose from for each photo, and at least so many in all.
_VIEWS_PER_PHOTO, _FEWEST_VIEWS, _MOST_VIEWS = 15, 120, 1500
# Towards the lamp, camera frame: over the photographer's left shoulder.
LAMP = np.array([-0.35, -0.5, -0.79])


@dataclass(frozen=True, eq=False)
class RayGrid:
    """A lens as a table: the ray of each pixel's middle and its slopes along x and y.

    Within a pixel the ray is taken as linear, which is off by some thousandths of a pixel at most.

    Attributes:
        ray: (height, width, 3), NaN outside the lens's field.
        by_x, by_y: (height, width, 3) change a pixel.

    """

    ray: FloatArray32
    by_x: FloatArray32
    by_y: FloatArray32

    @classmethod
    def of(cls, unproject: Unproject, image_size: tuple[int, int]) -> RayGrid:
        """Tabulate ``unproject`` for photos of ``image_size`` (width, height)."""
        width, height = image_size
        ray = np.empty((height, width, 3), np.float32)
        for rows, pixel in _list_rows_of_pixels(image_size, _PIXELS_PER_BLOCK):
            ray[rows] = unproject(pixel.reshape(-1, 2)).reshape(-1, width, 3)
        return cls(ray=ray, by_x=_measure_slope(ray, axis=1), by_y=_measure_slope(ray, axis=0))

    def __call__(self, pixel: FloatArray) -> FloatArray:
        """Turn pixels (N, 2) of the photo into rays (N, 3)."""
        height, width = self.ray.shape[:2]
        place = np.clip(np.rint(pixel).astype(np.intp), 0, (width - 1, height - 1))
        flat = place[:, 1] * width + place[:, 0]
        off = pixel - place
        rays = self.ray.reshape(-1, 3)[flat].astype(float)
        rays += off[:, :1] * self.by_x.reshape(-1, 3)[flat]
        rays += off[:, 1:] * self.by_y.reshape(-1, 3)[flat]
        return rays


def _measure_slope(ray: FloatArray32, axis: int) -> FloatArray32:
    """Change a pixel; from one side where the other is outside the field, else none."""
    behind = np.diff(ray, axis=axis, prepend=np.float32(np.nan))
    ahead = np.diff(ray, axis=axis, append=np.float32(np.nan))
    ahead = np.where(np.isnan(ahead), behind, ahead)
    behind = np.where(np.isnan(behind), ahead, behind)
    return np.nan_to_num((ahead + behind) / 2)


def _list_rows_of_pixels(
    image_size: tuple[int, int], most: int
) -> Iterator[tuple[slice, FloatArray]]:
    """Yield blocks of rows, of at most ``most`` pixels, and their pixels (rows, width, 2)."""
    width, height = image_size
    step = max(1, most // width)
    for top in range(0, height, step):
        y, x = np.mgrid[top : min(height, top + step), :width]
        yield slice(top, top + step), np.stack([x, y], axis=-1).astype(float)


def chosen_poses(
    target: Target, lens: WholeLens, image_size: tuple[int, int], count: int, *, seed: int = 0
) -> list[Pose]:
    """Choose poses of ``count`` photos that fill the field from varied sides and distances.

    Raises:
        TargetError: the target cannot be drawn, or cannot be seen so often.

    """
    wanted = min(max(_FEWEST_VIEWS, _VIEWS_PER_PHOTO * count), max(_MOST_VIEWS, count))
    views = sample_views(target, lens, image_size, wanted, seed=seed)
    if len(views) < count:
        raise TargetError(
            f"only {len(views)} poses were found from which this camera sees a whole board with "
            f"squares large enough to be found, and {count} are wanted: use boards with fewer and "
            "larger squares, a camera with more pixels or a wider field, or poses of your own"
        )
    return [view.pose for view in choose_views(views, lens, image_size, count)]


@dataclass(frozen=True, kw_only=True)
class Look:
    """The sensor of simulated photos.

    Attributes:
        noise: standard deviation of the sensor's noise, grey levels of 255.
        blur: standard deviation of the lens's blur, pixels.
        vignetting: share of the light that is lost 90° from the axis.
        exposure: 1 is a well-lit photo, 0.2 a dark one, and above 1.15 white paper bleeds.
        seed: of the noise.

    """

    noise: float = 2.0
    blur: float = 0.7
    vignetting: float = 0.4
    exposure: float = 1.0
    seed: int = 0


_WHITE_LEVEL = 240.0  # of light 1 at exposure 1
_DARK_LEVEL = 6.0  # what a sensor reads where no light comes
_FULL = 255.0
# Over how many pixels the light that a full pixel cannot hold falls by a factor of e, and how far
# it is followed.
_SPILL_PX, _SPILL_RADIUS_PX = 0.8, 9
Unproject = Callable[[FloatArray], FloatArray]
Background = Callable[[FloatArray], FloatArray]
Starts = Callable[[FloatArray], FloatArray]

# Shares of the light that are reflected.
INK, PAPER, _BACK = 0.07, 0.92, 0.45
# Light from above and from one side, so that boards at right angles differ in brightness.
_LIGHT = np.array([0.36, 0.48, 0.8])
AMBIENT = 0.6
_RAYS_PER_BLOCK = 50_000  # fits a processor cache
_NOTHING, _BLACK = -1, -2  # the label of rays that meet no board, and of those outside the field


def sensed(
    light: FloatArray, *, exposure: float, blur: float, noise: float, seed: int | Sequence[int]
) -> npt.NDArray[np.uint8]:
    """Turn light (height, width) into a sensor's grey levels (height, width) uint8.

    Args:
        light: 1 is that of well-lit white paper.
        exposure: factor on the light. From about 1.15 on white paper is burnt out, and bleeds
            the farther into dark squares the larger the factor: see :func:`bloomed`.
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
    """Let grey levels (height, width) above 255 overflow into neighbouring pixels.

    The excess spreads by exp(-distance/0.8 px), the same on all sides. A straight edge between
    white and dark moves into the dark with the logarithm of the overflow, so that dark squares that
    meet at a corner come apart by a gap with the corner still in its middle. Where nothing is above
    255 nothing changes.
    """
    over = level - _FULL
    if not (over > 0).any():
        return level
    offset = np.arange(-_SPILL_RADIUS_PX, _SPILL_RADIUS_PX + 1.0)
    spill = np.exp(-np.hypot(offset[:, None], offset) / _SPILL_PX)
    spill /= spill.sum()
    received = cv2.filter2D(np.maximum(over, 0), -1, spill, borderType=cv2.BORDER_REFLECT)
    return np.asarray(np.minimum(level, _FULL) + received, float)


def room_background(directions: FloatArray) -> FloatArray:
    """Return the brightness (N,) of a plain room far away in world directions (N, 3)."""
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
    supersample: int = _SUPERSAMPLE,
    noise: float = 2.0,
    blur: float = 0.5,
    vignetting: float = 0.4,
    exposure: float = 1.0,
    light_from: npt.ArrayLike = _LIGHT,
    background: Background = room_background,
    seed: int | Sequence[int] = 0,
    ray_starts: Starts | None = None,
) -> npt.NDArray[np.uint8]:
    """Render a grey photo of the target -> (height, width) uint8.

    A pixel whose neighbour shows something else is the mean of ``supersample``² rays over its area,
    so that a printed edge lies exactly where the lens puts it; any other pixel is one ray. Rows are
    rendered in blocks, which bounds the memory.

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
            into dark squares, see :func:`cubicfish.scene.photos.bloomed`.
        light_from: (3,) unit world direction in which the lamp is; shadows are not cast.
        background: world directions (N, 3) -> brightness (N,) where no board is.
        seed: of the noise; the same arguments give the same photo.
        ray_starts: for a lens that is not central: rays (N, 3) -> where on its axis each starts,
            z (N,) in the target's units. What is seen of the background does not depend on it.

    Raises:
        TargetError: a board of a kind that cannot be drawn.

    """
    seen = plates(target, camera_from_world)
    lamp = np.asarray(light_from, float)
    world_from_camera = rotation_matrix(camera_from_world[0]).T

    def light_of(pixel: FloatArray) -> tuple[FloatArray, npt.NDArray[np.intp]]:
        """Light of pixels (N, 2), and a number for what each shows."""
        rays = lens_unproject(pixel)
        inside = ~np.isnan(rays).any(axis=1)
        rays = rays[inside] / np.linalg.norm(rays[inside], axis=1, keepdims=True)
        starts = None if ray_starts is None else ray_starts(rays)
        index, _, position = nearest(seen, rays, starts)
        lit, what = np.empty(len(rays)), np.where(index < 0, _NOTHING, 2 * index)
        lit[index < 0] = background(rays[index < 0] @ world_from_camera.T)
        for number, plate in enumerate(seen):
            here = index == number
            facing = -(plate.board_from_camera @ world_from_camera.T)[2] @ lamp
            if plate.faces_camera:
                dark = plate.face.is_dark(position[here])
                thrown = np.where(dark, INK, PAPER)
                what[here] += dark
            else:
                thrown, facing = np.full(int(here.sum()), _BACK), -facing
            lit[here] = thrown * (AMBIENT + (1 - AMBIENT) * max(0.0, float(facing)))
        light, shown = np.zeros(len(pixel)), np.full(len(pixel), _BLACK)
        light[inside] = lit * vignette(angle_from_axis(rays), vignetting)
        shown[inside] = what
        return light, shown

    width, height = image_size
    light, shown = np.empty((height, width)), np.empty((height, width), np.intp)
    for rows, pixel in _list_rows_of_pixels(image_size, _RAYS_PER_BLOCK):
        own = light_of(pixel.reshape(-1, 2))
        light[rows], shown[rows] = (values.reshape(-1, width) for values in own)
    _smooth_edges(light, shown, light_of, supersample)
    return sensed(light, exposure=exposure, blur=blur, noise=noise, seed=seed)


def _smooth_edges(
    photo: FloatArray,
    shown: npt.NDArray[np.intp],
    light_of: Callable[[FloatArray], tuple[FloatArray, npt.NDArray[np.intp]]],
    supersample: int,
) -> None:
    """Sub-sample, in place, the pixels that have a neighbour which shows something else."""
    around = np.ones((3, 3), np.uint8)
    number = shown.astype(np.int16)
    row, column = np.nonzero(cv2.dilate(number, around) != cv2.erode(number, around))
    offset = (np.arange(supersample) + 0.5) / supersample - 0.5
    within = np.stack(np.meshgrid(offset, offset), axis=-1).reshape(-1, 2)
    pixels_per_block = max(1, _RAYS_PER_BLOCK // len(within))
    for first in range(0, len(row), pixels_per_block):
        block = slice(first, first + pixels_per_block)
        middle = np.stack([column[block], row[block]], axis=-1)
        light, _ = light_of((middle[:, None] + within).reshape(-1, 2))
        photo[row[block], column[block]] = light.reshape(-1, len(within)).mean(axis=1)


def vignette(angle: FloatArray, vignetting: float) -> FloatArray:
    """Return the share of the light that arrives at angles from the axis (...,), radians."""
    return np.asarray(1.0 - vignetting * np.minimum((angle / radians(90.0)) ** 4, 1.2))
