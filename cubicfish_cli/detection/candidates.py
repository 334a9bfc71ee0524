"""Candidates: pixels whose neighbourhood is a saddle of brightness, at every scale."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cubicfish_cli.detection.grids import Float32Array
from cubicfish_cli.types import FloatArray

# Ideal sharp corners of perpendicular edges respond with 4/pi^2 = 0.41, and with the squared
# sine of the angle between the edges when it is not a right angle; blur of the lens that equals
# the filter's scale divides by 4. 0.04 keeps perpendicular corners at a blur of 1.5 times the
# scale (the next scale takes over before) and sharp ones down to an angle of 18 degrees.
RESPONSE_THRESHOLD = 0.04
# Two scales an octave of the pyramid.
SCALES = (1.0, 1.6)
# Filters run band by band, so that what they hand on stays in the processor's cache.
_BAND_PIXELS = 150_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Saddles:
    """Saddle points of one image at one scale.

    Attributes:
        pixel: (N, 2) position, one Newton step from the strongest response.
        response: (N,) contrast-invariant strength, 0.41 for a sharp perpendicular corner.

    """

    pixel: FloatArray
    response: FloatArray


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


def find_saddles(image: Float32Array, scale: float, noise: float) -> Saddles:
    """Find local maxima of the saddle response; ``scale`` and the result are in pixels."""
    height, width = image.shape
    # Every filter's reach together: smoothing, second derivatives or variance, local maximum.
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
    found = np.concatenate(parts) if parts else np.zeros((0, 3))
    return Saddles(pixel=found[:, :2], response=found[:, 2])


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
