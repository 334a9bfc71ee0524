"""Grey photo -> float image pyramid with an estimate of its noise, and sampling from it."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.corners.detection.grids import Float32Array

# Side of the smallest level: below it there is no room for a ring test.
SMALLEST_SIDE = 24
_MOST_HALVINGS = 6
# Standard deviation, pixels, at full size: just enough that a photo sharpened by its camera is not
# undersampled for the sub-pixel fit.
SMOOTHING = 0.5
# Zoom of a second search at twice the photo's size: windows and rings that cannot be smaller than
# some pixels then fit into squares, margins of markers and modules half as large.
CLOSE = 0.5
# cv2.remap takes no more rows than fit a short.
_MOST_ROWS = 30_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Pyramid:
    """A photo at full size and at halves of it; pixel x of level k lies at ``x * 2**k``.

    Attributes:
        levels: float32 images, grey levels 0..255; level 0 is lightly smoothed (SMOOTHING),
            the others by the pyramid's own low-pass filter.
        noise: standard deviation of the pixel noise before smoothing, in the same grey levels.
        gain: grey level of the pyramid / grey level of the photo.

    """

    levels: tuple[Float32Array, ...]
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
        level = np.log2(np.maximum(step, 1.0) / 24.0).astype(np.intp)
        return np.clip(level, 0, len(self.levels) - 1)

    def sample(self, points: FloatArray, step: FloatArray) -> Float32Array:
        """Sample (N, ..., 2) pixels, each row at the level that suits its square side (N,).

        The level keeps a square at 24 to 48 px, so that large squares are averaged and small
        ones are seen at full size. Returns (N, ...).
        """
        level = self.levels_of(step)
        result = np.empty(points.shape[:-1], np.float32)
        for k in np.unique(level):
            rows = level == k
            result[rows] = bilinear(self.levels[k], points[rows] / 2.0**k)
        return result


def bilinear(image: Float32Array, points: FloatArray) -> Float32Array:
    """Sample an image at (..., 2) pixels; the border is repeated outwards.

    Positions are taken to 1/32 px (cv2.remap), enough for tests of brightness; sub-pixel
    fits read the pixels themselves.
    """
    shape = points.shape[:-1]
    count = points.size // 2
    if not count:
        return np.zeros(shape, np.float32)
    columns = max(64, -(-count // _MOST_ROWS))
    rows = -(-count // columns)
    x, y = np.zeros((2, rows * columns), np.float32)
    x[:count], y[:count] = points[..., 0].ravel(), points[..., 1].ravel()
    x, y = x.reshape(rows, columns), y.reshape(rows, columns)
    sampled = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(sampled, np.float32).reshape(-1)[:count].reshape(shape)


def estimate_noise(image: Float32Array) -> float:
    """Standard deviation of white pixel noise: the median of a Laplacian-like filter.

    The filter (Immerkaer, "Fast noise variance estimation", 1996) is blind to planes and to
    straight edges; the median instead of the mean makes it blind to texture too. Areas that
    are cut off to black or white would pull it to zero, so they do not count.
    """
    if min(image.shape) < 3:
        return 0.0
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    filtered = np.abs(cv2.filter2D(image, -1, kernel))[1:-1, 1:-1]
    every = max(1, int(np.sqrt(filtered.size / 250_000)))
    sampled = filtered[::every, ::every]
    counted = sampled[sampled > 0]
    if counted.size < 0.05 * sampled.size:
        return 0.0
    return float(np.median(counted)) / (0.6745 * 6.0)


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
    levels = [np.asarray(cv2.GaussianBlur(image, (5, 5), SMOOTHING), np.float32)]
    half = image
    while len(levels) <= _MOST_HALVINGS and min(half.shape) >= 2 * SMALLEST_SIDE:
        half = np.asarray(cv2.pyrDown(half), np.float32)
        levels.append(half)
    return Pyramid(levels=tuple(levels), noise=noise, gain=gain)


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
