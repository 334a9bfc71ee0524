"""Ring test: does the brightness around a point alternate dark, bright, dark, bright?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cubicfish_cli.detection.grids import Float32Array
from cubicfish_cli.detection.pyramid import bilinear
from cubicfish_cli.types import BoolArray, FloatArray

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


@dataclass(frozen=True, kw_only=True, eq=False)
class Rings:
    """Result of :func:`check_rings`, one row a point.

    Attributes:
        ok: (N,) whether the second ring passed, and agrees with the smallest if that passed.
        angle: (N, 4) directions of the four edges ("arms"), radians, clockwise on screen
            (x right, y down), starting with one whose clockwise side is bright.
        radius: (N,) the largest ring of an unbroken run of good ones, pixels.
        contrast: (N,) brightest minus darkest value on that ring.

    """

    ok: BoolArray
    angle: FloatArray
    radius: FloatArray
    contrast: FloatArray


def _wrapped(angle: FloatArray) -> FloatArray:
    return (angle + np.pi) % _TURN - np.pi


def glance(image: Float32Array, pixel: FloatArray) -> FloatArray:
    """Contrast (N,) of a few samples on the second ring; 0 where half a turn changes it much.

    What passes all rings passes this, and of what else responds as a saddle (edges, noise,
    texture) it leaves a fifth, for a fifth of a ring's cost.
    """
    contrast = np.zeros(len(pixel))
    for start in range(0, len(pixel), _BLOCK):
        rows = slice(start, start + _BLOCK)
        ring = _samples(image, pixel[rows], RADII[1], _FEW_SAMPLES)
        contrast[rows] = ring.max(1) - ring.min(1)
        contrast[rows][_symmetry(ring) < _LIKELY_SYMMETRY] = 0
    return contrast


def check_rings(image: Float32Array, pixel: FloatArray, least_contrast: float) -> Rings:
    """Test rings of growing radius around (N, 2) pixels of a lightly smoothed image."""
    blocks = [
        _check_rings(image, pixel[start : start + _BLOCK], least_contrast)
        for start in range(0, max(len(pixel), 1), _BLOCK)
    ]
    return Rings(
        ok=np.concatenate([rings.ok for rings in blocks]),
        angle=np.concatenate([rings.angle for rings in blocks]),
        radius=np.concatenate([rings.radius for rings in blocks]),
        contrast=np.concatenate([rings.contrast for rings in blocks]),
    )


def _check_rings(image: Float32Array, pixel: FloatArray, least_contrast: float) -> Rings:
    count = len(pixel)
    ok = np.zeros(count, bool)
    angle = np.zeros((count, 4))
    radius = np.zeros(count)
    contrast = np.zeros(count)
    # All that come out have passed the second ring: it sorts out most of a texture before the
    # others are looked at.
    second = _ring(image, pixel, RADII[1], least_contrast)
    active = np.nonzero(second[0])[0]
    for k, r in enumerate(RADII):
        if not len(active):
            break
        if k == 1:
            good, arms, spread = (part[active] for part in second)
        else:
            good, arms, spread = _ring(image, pixel[active], r, least_contrast)
        seen = ok[active]
        # Arms 0 and 2 are alike, so the order may be turned by half against the last ring.
        change = np.abs(_wrapped(arms - angle[active])).max(-1)
        turned = np.roll(arms, 2, axis=-1)
        change_turned = np.abs(_wrapped(turned - angle[active])).max(-1)
        arms = np.where((seen & (change_turned < change))[:, None], turned, arms)
        good &= ~seen | (np.minimum(change, change_turned) < _CONSISTENT)
        rows = active[good]
        ok[rows], angle[rows], radius[rows], contrast[rows] = True, arms[good], r, spread[good]
        # Blur may hide the pattern on the very smallest ring only.
        active = active if k == 0 else rows
        if k == 1:
            ok[:] = False
            ok[rows] = True
    return Rings(ok=ok, angle=angle % _TURN, radius=radius, contrast=contrast)


def _samples(image: Float32Array, pixel: FloatArray, radius: float, count: int) -> Float32Array:
    """Brightness (N, count) on a circle around each pixel, clockwise from its right."""
    phi = np.arange(count) * (_TURN / count)
    circle = radius * np.stack([np.cos(phi), np.sin(phi)])
    points = pixel.T[:, :, None] + circle[:, None]
    return bilinear(image, np.moveaxis(points, 0, -1))


def _symmetry(ring: Float32Array) -> Float32Array:
    """Correlation (N,) of rings with themselves after half a turn."""
    centred = ring - ring.mean(1, keepdims=True)
    half = ring.shape[1] // 2
    product = 2 * np.einsum("ni,ni->n", centred[:, :half], centred[:, half:])
    power = np.einsum("ni,ni->n", centred, centred)
    return np.asarray(product / np.maximum(power, 1e-9), np.float32)


def _ring(
    image: Float32Array, pixel: FloatArray, radius: float, least_contrast: float
) -> tuple[BoolArray, FloatArray, FloatArray]:
    raw = _samples(image, pixel, radius, _SAMPLES)
    wide = np.concatenate([raw[:, -1:], raw, raw[:, :1]], axis=1)
    ring = wide[:, 1:-1] + wide[:, :-2]
    ring += wide[:, 2:]
    ring /= 3
    high, low = ring.max(1), ring.min(1)
    ring -= (0.5 * (high + low))[:, None]
    spread = (high - low).astype(float)
    bright = ring > 0
    change = np.empty_like(bright)
    np.not_equal(bright[:, :-1], bright[:, 1:], out=change[:, :-1])
    np.not_equal(bright[:, -1], bright[:, 0], out=change[:, -1])
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
    good[rows] = sound & (_symmetry(ring) > _SYMMETRY)
    arms[rows] = crossing
    return good, arms, spread
