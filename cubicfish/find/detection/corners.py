"""X-corners: saddles of brightness at every scale that pass the ring test, what grids grow from.

The ring test asks whether the brightness around a point alternates dark, bright, dark, bright.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.grids import Float32Array, Rows
from cubicfish.find.detection.nearby import nearest
from cubicfish.find.detection.pyramid import Pyramid
from cubicfish.find.detection.saddle import fit_saddles
from cubicfish.types import BoolArray, FloatArray, IntArray

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
_NEAR = np.ones((5, 5), np.uint8)  # what a corner hides of its surroundings at coarser scales
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


def _places_on_circle(count: int, more: int = 0) -> FloatArray:
    """(2, count + 2 more) places on the unit circle, clockwise from its right; some twice."""
    turn = np.arange(-more, count + more) % count * (_TURN / count)
    return np.stack([np.cos(turn), np.sin(turn)])


# Rings are smoothed over three samples, so the last comes before the first and the first again.
_RING_PLACES, _FEW_PLACES = _places_on_circle(_SAMPLES, 1), _places_on_circle(_FEW_SAMPLES)


def _wrap(angle: FloatArray) -> FloatArray:
    return (angle + np.pi) % _TURN - np.pi


def measure_contrast(
    image: Float32Array, pixel: FloatArray, limits: FloatArray | None = None
) -> FloatArray:
    """Contrast (N,) of a few samples on the second ring; 0 where half a turn changes it much.

    What passes all rings passes this, and of what else responds as a saddle (edges, noise,
    texture) it leaves a fifth, for a fifth of a ring's cost. ``limits`` as in :func:`check_rings`.
    """
    contrast = np.zeros(len(pixel))
    for start in range(0, len(pixel), _BLOCK):
        rows = slice(start, start + _BLOCK)
        ring = _sample_circle(image, pixel[rows], RADII[1], _FEW_PLACES, _take(limits, rows))
        contrast[rows] = ring.max(0) - ring.min(0)
        contrast[rows][_measure_symmetry(ring) < _LIKELY_SYMMETRY] = 0
    return contrast


def check_rings(
    image: Float32Array,
    pixel: FloatArray,
    least_contrast: FloatArray | float,
    limits: FloatArray | None = None,
) -> tuple[XCorners, IntArray]:
    """Test rings of growing radius around (N, 2) pixels of a lightly smoothed image.

    Args:
        image: grey levels.
        pixel: (N, 2).
        least_contrast: of a ring, grey levels; for all, or (N,) for each.
        limits: (N, 4) smallest x and y and largest x and y of the part of the image that a
            point belongs to, whose border is repeated outwards; None: all of the image.

    Returns:
        Where the second ring passed, and agrees with the smallest if that passed, what the rings
        show; and which of the points these are.

    """
    least_contrast = np.broadcast_to(np.asarray(least_contrast, float), len(pixel))
    blocks = []
    for start in range(0, max(len(pixel), 1), _BLOCK):
        rows = slice(start, start + _BLOCK)
        shown, ok = _check_rings(image, pixel[rows], least_contrast[rows], _take(limits, rows))
        blocks.append((shown.select(ok), start + np.flatnonzero(ok)))
    shown_in, found = zip(*blocks, strict=True)
    return XCorners.joined(shown_in), np.concatenate(found)


def _take(limits: FloatArray | None, rows: IntArray | slice) -> FloatArray | None:
    return None if limits is None else limits[rows]


def _check_rings(
    image: Float32Array, pixel: FloatArray, least_contrast: FloatArray, limits: FloatArray | None
) -> tuple[XCorners, BoolArray]:
    count = len(pixel)
    ok = np.zeros(count, bool)
    angle = np.zeros((count, 4))
    radius = np.zeros(count)
    contrast = np.zeros(count)
    # All that come out have passed the second ring: it sorts out most of a texture before the
    # others are looked at.
    second = _check_ring(image, pixel, RADII[1], least_contrast, limits)
    active = np.nonzero(second[0])[0]
    for k, r in enumerate(RADII):
        if not len(active):
            break
        if k == 1:
            good, arms, spread = (part[active] for part in second)
        else:
            good, arms, spread = _check_ring(
                image, pixel[active], r, least_contrast[active], _take(limits, active)
            )
        seen = ok[active]
        # Arms 0 and 2 are alike, so the order may be turned by half against the last ring.
        off = arms - angle[active]
        change = np.abs(_wrap(off)).max(-1)
        off[:, :2] += arms[:, 2:] - arms[:, :2]
        off[:, 2:] += arms[:, :2] - arms[:, 2:]
        change_turned = np.abs(_wrap(off)).max(-1)
        turned = seen & (change_turned < change)
        arms[turned] = arms[turned][:, [2, 3, 0, 1]]
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
    image: Float32Array,
    pixel: FloatArray,
    radius: float,
    places: FloatArray,
    limits: FloatArray | None,
) -> Float32Array:
    """Brightness (K, N) at places (2, K) of a circle around each pixel.

    Points run along rows, so that what is done to all samples of a point is done to many at once.
    """
    at = np.empty((2, places.shape[1], len(pixel)), np.float32)
    for axis in (0, 1):
        centre, circle = pixel[:, axis], radius * places[axis, :, None]
        np.add(centre, circle, out=at[axis], casting="same_kind")
        if limits is not None:
            np.clip(
                at[axis], limits[:, axis], limits[:, 2 + axis], out=at[axis], casting="same_kind"
            )
    if not len(pixel):
        return at[0]
    sampled = cv2.remap(image, at[0], at[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(sampled, np.float32)


def _measure_symmetry(ring: Float32Array) -> Float32Array:
    """Correlation (N,) of rings (K, N) with themselves after half a turn."""
    centred = ring - ring.mean(0)
    half = len(ring) // 2
    product = 2 * (centred[:half] * centred[half:]).sum(0)
    centred *= centred
    return np.asarray(product / np.maximum(centred.sum(0), 1e-9), np.float32)


def _check_ring(
    image: Float32Array,
    pixel: FloatArray,
    radius: float,
    least_contrast: FloatArray,
    limits: FloatArray | None,
) -> tuple[BoolArray, FloatArray, FloatArray]:
    raw = _sample_circle(image, pixel, radius, _RING_PLACES, limits)
    ring = raw[:-2] + raw[1:-1]
    ring += raw[2:]
    ring /= 3
    high, low = ring.max(0), ring.min(0)
    ring -= 0.5 * (high + low)
    spread = (high - low).astype(float)
    bright = ring > 0
    change = np.empty_like(bright)
    np.not_equal(bright[:-1], bright[1:], out=change[:-1])
    np.not_equal(bright[-1], bright[0], out=change[-1])
    good = (change.view(np.uint8).sum(0, dtype=np.uint8) == 4) & (spread > least_contrast)
    arms = np.zeros((len(pixel), 4))
    rows = np.nonzero(good)[0]
    if not len(rows):
        return good, arms, spread
    ring = ring[:, rows]
    before = np.nonzero(change.T[rows])[1].reshape(-1, 4)
    here = np.arange(len(rows))[:, None]
    a, b = ring[before, here], ring[(before + 1) % _SAMPLES, here]
    crossing = (before + a / (a - b)) * (_TURN / _SAMPLES)
    # Clockwise from arm 0 it must get bright.
    falling = a[:, 0] > 0
    crossing[falling] = crossing[falling][:, [1, 2, 3, 0]]
    sector = (crossing[:, [1, 2, 3, 0]] - crossing) % _TURN
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
    square = cv2.boxFilter(cv2.multiply(image, image), cv2.CV_32F, (box, box))
    cv2.multiply(mean, mean, dst=mean)
    variance = cv2.addWeighted(square, 1.0, mean, -1.0, noise * noise, dst=square)
    determinant = cv2.multiply(xy, xy)
    cv2.subtract(determinant, cv2.multiply(xx, yy, dst=mean), dst=determinant)
    response = cv2.divide(determinant, variance, dst=determinant, scale=scale**4)
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
    inner = response[top:bottom, 2:-2]
    found = (inner >= peak[top:bottom, 2:-2]) & (inner >= RESPONSE_THRESHOLD)
    y, x = np.divmod(np.flatnonzero(found), inner.shape[1])
    y, x = y + top, x + 2
    gx = 0.5 * (smooth[y, x + 1] - smooth[y, x - 1])
    gy = 0.5 * (smooth[y + 1, x] - smooth[y - 1, x])
    hxx, hxy, hyy = xx[y, x], xy[y, x], yy[y, x]
    determinant = hxx * hyy - hxy * hxy  # negative where there is a response
    dx = (hxy * gy - hyy * gx) / determinant
    dy = (hxy * gx - hxx * gy) / determinant
    near = np.hypot(dx, dy) < 2.0 * scale
    return np.stack([x + dx, y + dy, response[y, x]], axis=-1)[near].astype(float)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """A level of the pyramid, looked at on one scale.

    Attributes:
        image: the level.
        zoom: pixels of the photo in one of its own.
        scale: pixels of its own.
        noise: grey levels.
        corner: where x and y of its first pixel lie on the sheet that it is part of.

    """

    image: Float32Array
    zoom: int
    scale: float
    noise: float
    corner: tuple[int, int]

    @property
    def limits(self) -> FloatArray:
        """(4,) smallest x and y and largest x and y on its sheet."""
        height, width = self.image.shape
        x, y = self.corner
        return np.array([x, y, x + width - 1, y + height - 1], float)


def find_corners(pyramid: Pyramid) -> XCorners:
    """Search all levels of the pyramid from fine to coarse; a finer find hides a coarser one."""
    whole, *others = pyramid.levels
    # The levels after the first are small: what they cost is calls, so they go together.
    sheet, corners = _lay_out(others)
    searches = [
        _Search(
            image=image, zoom=2**k, scale=scale, noise=max(pyramid.noise / 2**k, 0.5), corner=corner
        )
        for k, (image, corner) in enumerate(zip(pyramid.levels, [(0, 0), *corners], strict=True))
        for scale in SCALES
    ]
    parts: list[XCorners] = []
    for search in searches[: len(SCALES)]:
        parts += _find_on_sheet(whole, [search], parts)
    if others:
        parts += _find_on_sheet(sheet, searches[len(SCALES) :], parts)
    found = XCorners.joined(parts)
    return found.select(_find_best(found.contrast * np.sqrt(found.radius), MOST_CORNERS))


def _lay_out(images: list[Float32Array]) -> tuple[Float32Array, list[tuple[int, int]]]:
    """Lay images, each half as large as the last, on one sheet: it, and their first pixels' x, y.

    The second lies to the right of the first, the others below it.
    """
    if not images:
        return np.zeros((0, 0), np.float32), []
    height, width = images[0].shape
    corners, y = [(0, 0)], 0
    for image in images[1:]:
        corners.append((width, y))
        y += len(image)
    wide = max(x + image.shape[1] for image, (x, _) in zip(images, corners, strict=True))
    sheet = np.zeros((max(height, y), wide), np.float32)
    for image, (x, y) in zip(images, corners, strict=True):
        sheet[y : y + image.shape[0], x : x + image.shape[1]] = image
    return sheet, corners


def _mask_near(parts: list[XCorners], zoom: int, shape: tuple[int, ...]) -> npt.NDArray[np.uint8]:
    """Mask at a level of the pyramid of what lies within 2 px (of that level) of a found corner."""
    taken = np.zeros(shape, np.uint8)
    for part in parts:
        column, row = np.rint(part.pixel / zoom).astype(int).T
        taken[np.clip(row, 0, shape[0] - 1), np.clip(column, 0, shape[1] - 1)] = 1
    return np.asarray(cv2.dilate(taken, _NEAR))


def _is_free(search: _Search, pixel: FloatArray, parts: list[XCorners]) -> BoolArray:
    """Which pixels (N, 2) of a level no corner hides that has been found."""
    if not len(pixel):
        return np.zeros(0, bool)
    taken = _mask_near(parts, search.zoom, search.image.shape)
    column, row = np.rint(pixel).astype(int).T
    return np.asarray(taken[row, column] == 0)


def _find_on_sheet(
    sheet: Float32Array, searches: list[_Search], found: list[XCorners]
) -> list[XCorners]:
    """The corners of some levels that nothing hides which was found before, in the photo's pixels.

    All are tested together, as if none hid another; those that one search finds then hide what
    the next ones found.
    """
    places, responses = [], []
    for search in searches:
        pixel, response = find_saddles(search.image, search.scale, search.noise)
        height, width = search.image.shape
        pixel = np.clip(pixel, 0, (width - 1, height - 1))
        free = np.flatnonzero(_is_free(search, pixel, found))
        free = free[_find_best(response[free], _MOST_SADDLES)]
        places.append(pixel[free] + search.corner)
        responses.append(response[free])
    of = np.repeat(np.arange(len(searches)), [len(part) for part in places])
    pixel, response = np.concatenate(places), np.concatenate(responses)
    limits = np.array([search.limits for search in searches])
    alone = len(searches) == 1  # the sheet ends where the level does
    likely = measure_contrast(sheet, pixel, None if alone else limits[of])
    chosen = _find_best_of_each(of, likely, np.flatnonzero(likely), _MOST_RINGED)
    of, pixel, response = of[chosen], pixel[chosen], response[chosen]
    least = np.array([_NOISE_CONTRAST * search.noise for search in searches])[of]
    rings, rows = check_rings(sheet, pixel, least, None if alone else limits[of])
    score = rings.contrast * np.sqrt(rings.radius)
    best = _find_best_of_each(of[rows], score, np.arange(len(rows)), _MOST_FITTED)
    rings, rows = rings.select(best), rows[best]
    of, start, response = of[rows], pixel[rows], response[rows]
    half = np.array([max(2.0, 1.6 * search.scale) for search in searches])[of]
    moved, near = fit_saddles(sheet, start, half, limits=None if alone else limits[of])
    rings = replace(rings, pixel=moved)
    result: list[XCorners] = []
    for k, search in enumerate(searches):
        rows = np.flatnonzero(near & (of == k))
        if k:
            rows = rows[_is_free(search, start[rows] - search.corner, result)]
        part = rings.select(rows)
        separation = np.clip(0.6 * part.radius, 2, 5)
        score = response[rows] * np.sqrt(part.radius)
        part = part.select(_find_strongest(part.pixel, score, separation))
        pixel = (part.pixel - search.corner) * search.zoom
        result.append(replace(part, pixel=pixel, radius=part.radius * search.zoom))
    return result


def _find_best_of_each(of: IntArray, score: FloatArray, rows: IntArray, most: int) -> IntArray:
    """The ``most`` best of the rows of each group ``of`` (N,), in the order in which they came."""
    if len(rows) <= most:
        return rows
    groups = (rows[of[rows] == k] for k in np.unique(of[rows]))
    return np.concatenate([group[_find_best(score[group], most)] for group in groups])


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
