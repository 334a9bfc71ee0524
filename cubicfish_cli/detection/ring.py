"""Ring test: does the brightness around a point alternate dark, bright, dark, bright?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cubicfish_cli.detection.grids import BoolArray, Float32Array, FloatArray
from cubicfish_cli.detection.pyramid import bilinear

# Two rings an octave. The smallest fits into squares of 6 px seen at 45 degrees; the largest
# is where the next level of the pyramid has its middle.
RADII = (2.0, 2.8, 4.0, 5.6, 8.0, 11.3)
_SAMPLES = 48
_TURN = 2 * np.pi
_SMALLEST_SECTOR = np.radians(18)  # as the response threshold of the candidates
_OPPOSITE = np.radians(32)  # bent edges: opposite arms need not be quite in line
_CONSISTENT = np.radians(25)  # from one ring to the next
_SYMMETRY = 0.55  # correlation of the ring with itself after half a turn


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


def check_rings(image: Float32Array, pixel: FloatArray, least_contrast: float) -> Rings:
    """Test rings of growing radius around (N, 2) pixels of a lightly smoothed image."""
    count = len(pixel)
    ok = np.zeros(count, bool)
    angle = np.zeros((count, 4))
    radius = np.zeros(count)
    contrast = np.zeros(count)
    phi = np.arange(_SAMPLES) * (_TURN / _SAMPLES)
    circle = np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    # All that come out have passed the second ring: it sorts out most of a texture before the
    # others are looked at.
    active = np.nonzero(_ring(image, pixel, RADII[1] * circle, least_contrast)[0])[0]
    for k, r in enumerate(RADII):
        good, arms, spread = _ring(image, pixel[active], r * circle, least_contrast)
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


def _ring(
    image: Float32Array, pixel: FloatArray, circle: FloatArray, least_contrast: float
) -> tuple[BoolArray, FloatArray, FloatArray]:
    raw = bilinear(image, pixel[:, None] + circle)
    wide = np.concatenate([raw[:, -1:], raw, raw[:, :1]], axis=1)
    ring = wide[:, 1:-1] + wide[:, :-2]
    ring += wide[:, 2:]
    ring /= 3
    high, low = ring.max(1), ring.min(1)
    ring -= (0.5 * (high + low))[:, None]
    spread = (high - low).astype(float)
    bright = ring > 0
    change = bright != np.roll(bright, -1, axis=1)
    good = (change.sum(1) == 4) & (spread > least_contrast)
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
    centred = ring - ring.mean(1, keepdims=True)
    power = (centred * centred).sum(1)
    half = _SAMPLES // 2
    product = 2 * (centred[:, :half] * centred[:, half:]).sum(1)
    sound &= product > _SYMMETRY * power
    good[rows] = sound
    arms[rows] = crossing
    return good, arms, spread
