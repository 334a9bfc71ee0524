"""Grey photo -> float image pyramid with an estimate of its noise, and sampling from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.grids import Float32Array
from cubicfish.find.detection.medians import median
from cubicfish.types import FloatArray

# Side of the smallest level: below it there is no room for a ring test.
SMALLEST_SIDE = 24
_MOST_HALVINGS = 6
# Standard deviation, pixels, at full size: just enough that a photo sharpened by its camera is not
# undersampled for the sub-pixel fit.
SMOOTHING = 0.5
# Zoom of a second search at twice the photo's size: windows and rings that cannot be smaller than
# some pixels then fit into squares, margins of markers and modules half as large.
CLOSE = 0.5
# Noise is estimated from about so many places: to half a percent.
_NOISE_SAMPLES = 60_000
# cv2.remap takes no more columns than fit a short; fewer stay in the processor's cache.
_MOST_COLUMNS = 4_000


class Levels(Sequence[Float32Array]):
    """The images of a pyramid, each made when it is first looked at."""

    def __init__(self, image: Float32Array) -> None:
        """Take a float32 image (H, W); halvings stop as :func:`build_pyramid` says."""
        side, self._count = min(image.shape), 1
        while self._count <= _MOST_HALVINGS and side >= 2 * SMALLEST_SIDE:
            side, self._count = (side + 1) // 2, self._count + 1
        self._halves = [image]
        self._smoothed: Float32Array | None = None

    def __len__(self) -> int:
        """Return how many there are, made or not."""
        return self._count

    @overload
    def __getitem__(self, index: int) -> Float32Array: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Float32Array, ...]: ...
    def __getitem__(self, index: int | slice) -> Float32Array | tuple[Float32Array, ...]:
        """Return an image, and make it where it is not there yet."""
        if isinstance(index, slice):
            return tuple(self[k] for k in range(*index.indices(self._count)))
        if not 0 <= index < self._count:
            raise IndexError(index)
        if index == 0:
            if self._smoothed is None:
                smooth = cv2.GaussianBlur(self._halves[0], (5, 5), SMOOTHING)
                self._smoothed = np.asarray(smooth, np.float32)
            return self._smoothed
        while len(self._halves) <= index:
            self._halves.append(np.asarray(cv2.pyrDown(self._halves[-1]), np.float32))
        return self._halves[index]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pyramid:
    """A photo at full size and at halves of it; pixel x of level k lies at ``x * 2**k``.

    Attributes:
        levels: float32 images, grey levels 0..255; level 0 is lightly smoothed (SMOOTHING),
            the others by the pyramid's own low-pass filter.
        noise: standard deviation of the pixel noise before smoothing, in the same grey levels.
        gain: grey level of the pyramid / grey level of the photo.

    """

    levels: Sequence[Float32Array]
    noise: float
    gain: float

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of level 0, pixels."""
        height, width = self.levels[0].shape
        return width, height

    def inside(self, pixel: FloatArray, margin: float) -> npt.NDArray[np.bool_]:
        """Tell which of (N, 2) pixels lie at least ``margin`` inside the photo."""
        width, height = self.size
        return (
            (pixel[:, 0] >= margin)
            & (pixel[:, 1] >= margin)
            & (pixel[:, 0] <= width - 1 - margin)
            & (pixel[:, 1] <= height - 1 - margin)
        )

    def levels_of(self, step: FloatArray) -> npt.NDArray[np.intp]:
        """Levels (N,) at which square sides (N,) of the photo are 24 to 48 px, if any are."""
        level = np.frexp(np.maximum(step, 1.0) / 24.0)[1] - 1
        return np.asarray(np.clip(level, 0, len(self.levels) - 1), np.intp)

    def sample(self, points: FloatArray, step: FloatArray) -> Float32Array:
        """Sample (N, ..., 2) pixels, each row at the level that suits its square side (N,).

        Returns (N, ...).
        """
        places = points.reshape(len(points), int(np.prod(points.shape[1:-1])), 2).T
        return self.sample_columns(places, step).T.reshape(points.shape[:-1])

    def sample_columns(self, points: FloatArray, step: FloatArray) -> Float32Array:
        """Sample at x and y (2, K, N) of K points of each of N squares of side ``step`` (N,).

        The level keeps a square at 24 to 48 px, so that large squares are averaged and small
        ones are seen at full size. Returns (K, N).
        """
        level = self.levels_of(step)
        first = int(level.min(initial=0))
        if (level == first).all():
            return bilinear(self.levels[first], points, 2.0**-first)
        result = np.empty(points.shape[1:], np.float32)
        for k in np.flatnonzero(np.bincount(level)).tolist():
            rows = np.flatnonzero(level == k)
            result[:, rows] = bilinear(self.levels[k], points[:, :, rows], 2.0**-k)
        return result


def bilinear(image: Float32Array, points: FloatArray, scale: float = 1.0) -> Float32Array:
    """Sample an image at ``scale`` times x and y (2, K, N) -> (K, N); the border goes on outwards.

    Positions are taken to 1/32 px (cv2.remap), enough for tests of brightness; sub-pixel
    fits read the pixels themselves.
    """
    at = np.empty(points.shape, np.float32)
    np.multiply(points, scale, out=at, casting="same_kind")
    result = np.empty(points.shape[1:], np.float32)
    for first in range(0, points.shape[2], _MOST_COLUMNS):
        x, y = at[:, :, first : first + _MOST_COLUMNS]
        result[:, first : first + _MOST_COLUMNS] = cv2.remap(
            image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
    return result


def estimate_noise(image: npt.NDArray[np.generic]) -> float:
    """Standard deviation of white pixel noise: the median of a Laplacian-like filter.

    The filter (Immerkaer, "Fast noise variance estimation", 1996) is blind to planes and to
    straight edges; the median instead of the mean makes it blind to texture too. Areas that
    are cut off to black or white would pull it to zero, so they do not count.
    """
    if min(image.shape) < 3:
        return 0.0
    every = max(1, round(np.sqrt(image.size / _NOISE_SAMPLES)))
    height, width = image.shape
    above, here, below = (
        np.asarray(image[y : height - 2 + y : every], np.float32) for y in range(3)
    )
    down = above - 2 * here + below
    left, middle, right = (down[:, x : width - 2 + x : every] for x in range(3))
    filtered = left - 2 * middle + right
    sampled = np.abs(filtered)
    counted = sampled[sampled > 0]
    if counted.size < 0.05 * sampled.size:
        return 0.0
    return median(counted) / (0.6745 * 6.0)


def build_pyramid(grey: npt.NDArray[np.generic]) -> Pyramid:
    """Build the pyramid of a 2-D uint8, uint16 or float image.

    Levels stop at six halvings or when a side would fall under 24 px. The photo's
    brightest value becomes 255; what is not finite becomes 0.
    """
    image = np.asarray(grey, np.float32)
    if not np.issubdtype(grey.dtype, np.integer):
        image = np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0)
    low, high = float(image.min()), float(image.max())
    gain = 255.0 / (high - low) if high > low else 1.0
    if low < 0 or not np.issubdtype(grey.dtype, np.integer) or high > 255:
        image = (image - low) * gain
    else:
        gain = 1.0
    quantum = gain if np.issubdtype(grey.dtype, np.integer) else gain * (high - low) / 65_535
    # Rounding to whole grey levels is noise of 1/sqrt(12) of a level; 0.5 to be on the safe side.
    noise = max(estimate_noise(image), 0.5 * quantum)
    return Pyramid(levels=Levels(image), noise=noise, gain=gain)


def measure_noise(grey: npt.NDArray[np.generic]) -> tuple[float, float]:
    """Noise and gain of the pyramid of a photo, which is not made where its pixels are bytes."""
    if grey.dtype == np.uint8:
        return max(estimate_noise(grey), 0.5), 1.0
    pyramid = build_pyramid(grey)
    return pyramid.noise, pyramid.gain


def reduced(image: npt.NDArray[np.generic], zoom: float) -> npt.NDArray[np.generic]:
    """Reduce a photo by a whole factor, each pixel the mean of zoom x zoom; CLOSE doubles it."""
    if zoom == 1:
        return image
    block = max(round(zoom), 1)
    height, width = image.shape[0] // block * block, image.shape[1] // block * block
    source: npt.NDArray[np.uint8 | np.uint16 | np.float32]
    source = np.asarray(image[:height, :width])
    if source.dtype not in (np.uint8, np.uint16, np.float32):
        source = source.astype(np.float32)
    size = round(width / zoom), round(height / zoom)
    how = cv2.INTER_AREA if zoom > 1 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(source, size, interpolation=how))


def enlarged(pixel: FloatArray, zoom: float) -> FloatArray:
    """Pixels of a photo that was reduced -> pixels of the photo itself."""
    return (pixel + 0.5) * zoom - 0.5
