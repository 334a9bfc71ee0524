"""X-corners: saddles of brightness at every scale that pass the ring test, what grids grow from.

The ring test asks whether the brightness around a point alternates dark, bright, dark, bright.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.types import BoolArray, FloatArray, IntArray
from cubicfish_cli.corners.detection.grids import Float32Array, Rows
from cubicfish_cli.corners.detection.nearby import nearest
from cubicfish_cli.corners.detection.pyramid import Pyramid, bilinear
from cubicfish_cli.corners.detection.saddle import fit_saddles

# Two rings an octave. The smallest fits into squares of 6 px seen at 45 degrees; the largest
# is where the next level of the pyramid has its middle.
RADII = (2.0, 2.8, 4.0, 5.6, 8.0, 11.3)
_SAMPLES = 48
_TURN = 2 * np.pi
_SMALLEST_SECTOR = np.radians(18)  # as the response threshold of the candidates
_OPPOSITE = np.radians(32)  # bent edges: opposite arms need not be quite in line
_CONSISTENT = np.radians(25)  # from one ring to the next
_SYMMETRY = 0.55  # correlation of the ring with itself after half a turn
# The same as few samples without smoothing show it.
_FEW_SAMPLES, _LIKELY_SYMMETRY = 16, 0.35
_BLOCK = 4_000  # points at a time, so that their samples stay in the processor's cache
# Ideal sharp corners of perpendicular edges respond with 4/pi^2 = 0.41, and with the squared
# sine of the angle between the edges when it is not a right angle; blur of the lens that equals
# the filter's scale divides by 4. 0.04 keeps perpendicular corners at a blur of 1.5 times the
# scale (the next scale takes over before) and sharp ones down to an angle of 18 degrees.
RESPONSE_THRESHOLD = 0.04
# Two scales an octave of the pyramid.
SCALES = (1.0, 1.6)
# Filters run band by band, so that what they hand on stays in the processor's cache.
_BAND_PIXELS = 150_000
# A ring's span (largest minus smallest of 48 smoothed samples) reaches about 4 sigma of what
# noise is left after smoothing (a third of the pixel noise) in flat regions; 3 pixel sigmas are
# twice that.
_NOISE_CONTRAST = 3.0
# Beyond this many only the clearest are kept: a bound on time and memory for textures.
MOST_CORNERS = 8_000
# The same for what is looked at more closely at one scale: saddles, of which texture has one in
# thirty pixels and the corners of boards are among the strongest, and those that look like corners
# on rings, of which a tenth becomes corners of grids at most.
_MOST_SADDLES = 100_000
_MOST_RINGED, _MOST_FITTED = 3 * MOST_CORNERS, 2 * MOST_CORNERS


@dataclass(frozen=True, kw_only=True, eq=False)
class XCorners(Rows):
    """Points that look like X-corners, each on its own.

    Attributes:
        pixel: (N, 2) sub-pixel position at full size.
        angle: (N, 4) directions of the four edges ("arms"), radians, clockwise on screen
            (x right, y down), starting with one whose clockwise side is bright.
        radius: (N,) the largest ring of an unbroken run of good ones, pixels at full size.
        contrast: (N,) brightest minus darkest value on that ring, grey levels.

    """

    pixel: FloatArray
    angle: FloatArray
    radius: FloatArray
    contrast: FloatArray


def _wrap(angle: FloatArray) -> FloatArray:
    return (angle + np.pi) % _TURN - np.pi


def measure_contrast(image: Float32Array, pixel: FloatArray) -> FloatArray:
    """Contrast (N,) of a few samples on the second ring; 0 where half a turn changes it much.

    What passes all rings passes this, and of what else responds as a saddle (edges, noise,
    texture) it leaves a fifth, for a fifth of a ring's cost.
    """
    contrast = np.zeros(len(pixel))
    for start in range(0, len(pixel), _BLOCK):
        rows = slice(start, start + _BLOCK)
        ring = _sample_circle(image, pixel[rows], RADII[1], _FEW_SAMPLES)
        contrast[rows] = ring.max(1) - ring.min(1)
        contrast[rows][_measure_symmetry(ring) < _LIKELY_SYMMETRY] = 0
    return contrast


def check_rings(
    image: Float32Array, pixel: FloatArray, least_contrast: float
) -> tuple[XCorners, IntArray]:
    """Test rings of growing radius around (N, 2) pixels of a lightly smoothed image.

    Returns:
        Where the second ring passed, and agrees with the smallest if that passed, what the rings
        show; and which of the points these are.

    """
    blocks = []
    for start in range(0, max(len(pixel), 1), _BLOCK):
        shown, ok = _check_rings(image, pixel[start : start + _BLOCK], least_contrast)
        blocks.append((shown.select(ok), start + np.flatnonzero(ok)))
    shown_in, rows = zip(*blocks, strict=True)
    return XCorners.joined(shown_in), np.concatenate(rows)


def _check_rings(
    image: Float32Array, pixel: FloatArray, least_contrast: float
) -> tuple[XCorners, BoolArray]:
    count = len(pixel)
    ok = np.zeros(count, bool)
    angle = np.zeros((count, 4))
    radius = np.zeros(count)
    contrast = np.zeros(count)
    # All that come out have passed the second ring: it sorts out most of a texture before the
    # others are looked at.
    second = _check_ring(image, pixel, RADII[1], least_contrast)
    active = np.nonzero(second[0])[0]
    for k, r in enumerate(RADII):
        if not len(active):
            break
        if k == 1:
            good, arms, spread = (part[active] for part in second)
        else:
            good, arms, spread = _check_ring(image, pixel[active], r, least_contrast)
        seen = ok[active]
        # Arms 0 and 2 are alike, so the order may be turned by half against the last ring.
        change = np.abs(_wrap(arms - angle[active])).max(-1)
        turned = np.roll(arms, 2, axis=-1)
        change_turned = np.abs(_wrap(turned - angle[active])).max(-1)
        arms = np.where((seen & (change_turned < change))[:, None], turned, arms)
        good &= ~seen | (np.minimum(change, change_turned) < _CONSISTENT)
        rows = active[good]
        ok[rows], angle[rows], radius[rows], contrast[rows] = True, arms[good], r, spread[good]
        # Blur may hide the pattern on the very smallest ring only.
        active = active if k == 0 else rows
        if k == 1:
            ok[:] = False
            ok[rows] = True
    return XCorners(pixel=pixel, angle=angle % _TURN, radius=radius, contrast=contrast), ok


def _sample_circle(
    image: Float32Array, pixel: FloatArray, radius: float, count: int
) -> Float32Array:
    """Brightness (N, count) on a circle around each pixel, clockwise from its right."""
    phi = np.arange(count) * (_TURN / count)
    circle = radius * np.stack([np.cos(phi), np.sin(phi)])
    points = pixel.T[:, :, None] + circle[:, None]
    return bilinear(image, np.moveaxis(points, 0, -1))


def _measure_symmetry(ring: Float32Array) -> Float32Array:
    """Correlation (N,) of rings with themselves after half a turn."""
    centred = ring - ring.mean(1, keepdims=True)
    half = ring.shape[1] // 2
    product = 2 * np.einsum("ni,ni->n", centred[:, :half], centred[:, half:])
    power = np.einsum("ni,ni->n", centred, centred)
    return np.asarray(product / np.maximum(power, 1e-9), np.float32)


def _check_ring(
    image: Float32Array, pixel: FloatArray, radius: float, least_contrast: float
) -> tuple[BoolArray, FloatArray, FloatArray]:
    raw = _sample_circle(image, pixel, radius, _SAMPLES)
    ring = raw + np.roll(raw, 1, axis=1)
    ring += np.roll(raw, -1, axis=1)
    ring /= 3
    high, low = ring.max(1), ring.min(1)
    ring -= (0.5 * (high + low))[:, None]
    spread = (high - low).astype(float)
    bright = ring > 0
    change = bright != np.roll(bright, -1, axis=1)
    good = (np.count_nonzero(change, axis=1) == 4) & (spread > least_contrast)
    arms = np.zeros((len(pixel), 4))
    rows = np.nonzero(good)[0]
    if not len(rows):
        return good, arms, spread
    ring = ring[rows]
    before = np.nonzero(change[rows])[1].reshape(-1, 4)
    a = np.take_along_axis(ring, before, 1)
    b = np.take_along_axis(ring, (before + 1) % _SAMPLES, 1)
    crossing = (before + a / (a - b)) * (_TURN / _SAMPLES)
    # Clockwise from arm 0 it must get bright.
    rising = a[:, 0] <= 0
    crossing = np.where(rising[:, None], crossing, np.roll(crossing, -1, axis=1))
    sector = (np.roll(crossing, -1, axis=1) - crossing) % _TURN
    sound = sector.min(1) > _SMALLEST_SECTOR
    sound &= np.abs(sector[:, 0] + sector[:, 1] - np.pi) < _OPPOSITE
    sound &= np.abs(sector[:, 1] + sector[:, 2] - np.pi) < _OPPOSITE
    good[rows] = sound & (_measure_symmetry(ring) > _SYMMETRY)
    arms[rows] = crossing
    return good, arms, spread


def saddle_response(image: Float32Array, scale: float, noise: float) -> tuple[Float32Array, ...]:
    """Minus the determinant of the Hessian at ``scale`` px over the local variance.

    Division by the variance in a (5 scale + 1) px box makes dim and bright boards alike;
    ``noise`` (grey levels) keeps flat regions from responding. Returns the response and the
    three second derivatives xx, xy, yy of the smoothed image, then the smoothed image.
    """
    size = 2 * int(np.ceil(3 * scale)) + 1
    smooth = cv2.GaussianBlur(image, (size, size), scale)
    xx = cv2.Sobel(smooth, cv2.CV_32F, 2, 0, ksize=3, scale=0.25)
    yy = cv2.Sobel(smooth, cv2.CV_32F, 0, 2, ksize=3, scale=0.25)
    xy = cv2.Sobel(smooth, cv2.CV_32F, 1, 1, ksize=3, scale=0.25)
    box = 2 * round(2.5 * scale) + 1
    mean = cv2.boxFilter(image, cv2.CV_32F, (box, box))
    square = cv2.sqrBoxFilter(image, cv2.CV_32F, (box, box))
    variance = np.asarray(cv2.subtract(square, cv2.multiply(mean, mean)), np.float32)
    np.maximum(variance, 0, out=variance)
    np.add(variance, noise * noise, out=variance, casting="same_kind")
    determinant = cv2.subtract(cv2.multiply(xy, xy), cv2.multiply(xx, yy))
    response = cv2.divide(determinant, variance, scale=scale**4)
    return tuple(np.asarray(part, np.float32) for part in (response, xx, xy, yy, smooth))


def find_saddles(image: Float32Array, scale: float, noise: float) -> tuple[FloatArray, FloatArray]:
    """Find local maxima of the saddle response of one image at one scale, in pixels.

    Returns:
        (N, 2) positions, one Newton step from the strongest response, and (N,) contrast-invariant
        strength, 0.41 for a sharp perpendicular corner.

    """
    height, width = image.shape
    # The half widths of all filters together: smoothing, second derivatives or variance, local
    # maximum.
    halo = int(np.ceil(3 * scale)) + 1 + round(1.2 * scale)
    rows = max(_BAND_PIXELS // width, 4 * halo)
    parts = []
    for top in range(2, height - 2, rows):
        bottom = min(top + rows, height - 2)
        first = max(0, top - halo)
        part = _find_in_rows(
            image[first : bottom + halo], scale, noise, top - first, bottom - first
        )
        part[:, 1] += first
        parts.append(part)
    found = np.concatenate(parts)
    return found[:, :2], found[:, 2]


def _find_in_rows(
    image: Float32Array, scale: float, noise: float, top: int, bottom: int
) -> FloatArray:
    """x, y and response (N, 3) of the saddles whose strongest pixel lies in these rows."""
    response, xx, xy, yy, smooth = saddle_response(image, scale, noise)
    window = 2 * round(1.2 * scale) + 1
    peak = cv2.dilate(response, np.ones((window, window), np.uint8))
    np.maximum(peak, RESPONSE_THRESHOLD, out=peak)
    found = cv2.compare(response[top:bottom, 2:-2], peak[top:bottom, 2:-2], cv2.CMP_GE)
    places = cv2.findNonZero(found)
    if places is None:
        return np.zeros((0, 3))
    x, y = places.reshape(-1, 2).T + np.array([[2], [top]])
    gx = 0.5 * (smooth[y, x + 1] - smooth[y, x - 1])
    gy = 0.5 * (smooth[y + 1, x] - smooth[y - 1, x])
    hxx, hxy, hyy = xx[y, x], xy[y, x], yy[y, x]
    determinant = hxx * hyy - hxy * hxy  # negative where there is a response
    dx = (hxy * gy - hyy * gx) / determinant
    dy = (hxy * gx - hxx * gy) / determinant
    near = np.hypot(dx, dy) < 2.0 * scale
    return np.stack([x + dx, y + dy, response[y, x]], axis=-1)[near].astype(float)


def find_corners(pyramid: Pyramid) -> XCorners:
    """Search all levels of the pyramid from fine to coarse; a finer find hides a coarser one."""
    parts: list[XCorners] = []
    for level, image in enumerate(pyramid.levels):
        zoom = 2**level
        noise = max(pyramid.noise / zoom, 0.5)
        for scale in SCALES:
            part = _find_at_scale(image, scale, noise, _mask_near(parts, zoom, image.shape))
            parts.append(replace(part, pixel=part.pixel * zoom, radius=part.radius * zoom))
    found = XCorners.joined(parts)
    return found.select(_find_best(found.contrast * np.sqrt(found.radius), MOST_CORNERS))


def _mask_near(parts: list[XCorners], zoom: int, shape: tuple[int, ...]) -> npt.NDArray[np.uint8]:
    """Mask at a level of the pyramid of what lies within 2 px (of that level) of a found corner."""
    taken = np.zeros(shape, np.uint8)
    for part in parts:
        column, row = np.rint(part.pixel / zoom).astype(int).T
        taken[np.clip(row, 0, shape[0] - 1), np.clip(column, 0, shape[1] - 1)] = 1
    return np.asarray(cv2.dilate(taken, np.ones((5, 5), np.uint8)))


def _find_at_scale(
    image: Float32Array, scale: float, noise: float, taken: npt.NDArray[np.uint8]
) -> XCorners:
    """The corners of one level of the pyramid, in its own pixels, that are not ``taken``."""
    pixel, response = find_saddles(image, scale, noise)
    height, width = image.shape
    pixel = np.clip(pixel, 0, (width - 1, height - 1))
    column, row = np.rint(pixel).astype(int).T
    free = np.flatnonzero(taken[row, column] == 0)
    free = free[_find_best(response[free], _MOST_SADDLES)]
    likely = measure_contrast(image, pixel[free])
    candidates = np.flatnonzero(likely)
    chosen = free[candidates[_find_best(likely[candidates], _MOST_RINGED)]]
    rings, ok = check_rings(image, pixel[chosen], _NOISE_CONTRAST * noise)
    best = _find_best(rings.contrast * np.sqrt(rings.radius), _MOST_FITTED)
    rings, response = rings.select(best), response[chosen][ok[best]]
    found, near = fit_saddles(image, rings.pixel, np.full(len(best), max(2.0, 1.6 * scale)))
    rings, response = replace(rings, pixel=found).select(near), response[near]
    separation = np.clip(0.6 * rings.radius, 2, 5)
    return rings.select(_find_strongest(rings.pixel, response * np.sqrt(rings.radius), separation))


def _find_best(score: FloatArray, most: int) -> npt.NDArray[np.intp]:
    """Indices of the ``most`` best scores, in the order in which they came."""
    if len(score) <= most:
        return np.arange(len(score))
    return np.sort(np.argsort(-score, kind="stable")[:most])


def _find_strongest(
    pixel: FloatArray, score: FloatArray, radius: FloatArray
) -> npt.NDArray[np.bool_]:
    """Which points have no stronger one within their radius (equal ones: the first stays)."""
    if len(pixel) < 2:
        return np.ones(len(pixel), bool)
    distance, index = nearest(pixel, pixel, 6)
    here = np.arange(len(pixel))[:, None]
    stronger = (score[index] > score[:, None]) | ((score[index] == score[:, None]) & (index < here))
    beaten = (distance < radius[:, None]) & stronger & (index != here)
    return ~beaten.any(1)
