"""Candidates of all scales that pass the ring test, merged: the corners that grids grow from."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.candidates import SCALES, find_saddles
from cubicfish_cli.detection.grids import Float32Array
from cubicfish_cli.detection.nearby import nearest
from cubicfish_cli.detection.pyramid import Pyramid
from cubicfish_cli.detection.ring import check_rings, glance
from cubicfish_cli.detection.saddle import fit_saddles
from cubicfish_cli.types import FloatArray

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

# Positions, arm angles, radii, contrasts.
_Part = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class XCorners:
    """Points that look like X-corners, each on its own.

    Attributes:
        pixel: (N, 2) sub-pixel position at full size.
        angle: (N, 4) directions of the arms, see :class:`~.ring.Rings`.
        radius: (N,) how far the pattern reaches, pixels at full size.
        contrast: (N,) bright minus dark, grey levels.

    """

    pixel: FloatArray
    angle: FloatArray
    radius: FloatArray
    contrast: FloatArray


def find_corners(pyramid: Pyramid) -> XCorners:
    """Search all levels of the pyramid from fine to coarse; a finer find hides a coarser one."""
    parts: list[_Part] = []
    for level, image in enumerate(pyramid.levels):
        zoom = 2**level
        noise = max(pyramid.noise / zoom, 0.5)
        for scale in SCALES:
            taken = _near(parts, zoom, image.shape)
            part = _at_scale(image, scale, noise, taken)
            if part is not None:
                pixel, angle, radius, contrast = part
                parts.append((pixel * zoom, angle, radius * zoom, contrast))
    if not parts:
        none = np.zeros(0)
        return XCorners(pixel=np.zeros((0, 2)), angle=np.zeros((0, 4)), radius=none, contrast=none)
    pixel, angle, radius, contrast = (np.concatenate(part) for part in zip(*parts, strict=True))
    best = _first(contrast * np.sqrt(radius), MOST_CORNERS)
    pixel, angle, radius, contrast = pixel[best], angle[best], radius[best], contrast[best]
    return XCorners(pixel=pixel, angle=angle, radius=radius, contrast=contrast)


def _near(parts: list[_Part], zoom: int, shape: tuple[int, ...]) -> npt.NDArray[np.uint8]:
    """Mask at a level of the pyramid of what lies within 2 px (of that level) of a found corner."""
    taken = np.zeros(shape, np.uint8)
    for pixel, *_ in parts:
        column, row = np.rint(pixel / zoom).astype(int).T
        taken[np.clip(row, 0, shape[0] - 1), np.clip(column, 0, shape[1] - 1)] = 1
    return np.asarray(cv2.dilate(taken, np.ones((5, 5), np.uint8)))


def _at_scale(
    image: Float32Array, scale: float, noise: float, taken: npt.NDArray[np.uint8]
) -> _Part | None:
    saddles = find_saddles(image, scale, noise)
    if not len(saddles.pixel):
        return None
    height, width = image.shape
    pixel = np.clip(saddles.pixel, 0, (width - 1, height - 1))
    column, row = np.rint(pixel).astype(int).T
    free = taken[row, column] == 0
    pixel, response = pixel[free], saddles.response[free]
    strongest = _first(response, _MOST_SADDLES)
    pixel, response = pixel[strongest], response[strongest]
    likely = glance(image, pixel)
    candidates = np.flatnonzero(likely)
    candidates = candidates[_first(likely[candidates], _MOST_RINGED)]
    if not len(candidates):
        return None
    pixel, response = pixel[candidates], response[candidates]
    rings = check_rings(image, pixel, _NOISE_CONTRAST * noise)
    good = np.flatnonzero(rings.ok)
    good = good[_first((rings.contrast * np.sqrt(rings.radius))[good], _MOST_FITTED)]
    fit = fit_saddles(image, pixel[good], np.full(len(good), max(2.0, 1.6 * scale)))
    radius, response = rings.radius[good][fit.ok], response[good][fit.ok]
    keep = _strongest(fit.pixel[fit.ok], response * np.sqrt(radius), np.clip(0.6 * radius, 2, 5))
    return (
        fit.pixel[fit.ok][keep],
        rings.angle[good][fit.ok][keep],
        radius[keep],
        rings.contrast[good][fit.ok][keep],
    )


def _first(score: FloatArray, most: int) -> npt.NDArray[np.intp]:
    """Indices of the ``most`` best scores, in the order in which they came."""
    if len(score) <= most:
        return np.arange(len(score))
    return np.sort(np.argsort(-score, kind="stable")[:most])


def _strongest(pixel: FloatArray, score: FloatArray, radius: FloatArray) -> npt.NDArray[np.bool_]:
    """Which points have no stronger one within their radius (equal ones: the first stays)."""
    if len(pixel) < 2:
        return np.ones(len(pixel), bool)
    distance, index = nearest(pixel, pixel, 6)
    here = np.arange(len(pixel))[:, None]
    stronger = (score[index] > score[:, None]) | ((score[index] == score[:, None]) & (index < here))
    beaten = (distance < radius[:, None]) & stronger & (index != here)
    return ~beaten.any(1)
