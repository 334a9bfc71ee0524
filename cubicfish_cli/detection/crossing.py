"""Sub-pixel position of corners: two blurred edges that cross, fitted to the pixels themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.grids import BoolArray, FloatArray, IntArray
from cubicfish_cli.detection.lattice import LocalFit

_ROUNDS = 8
_CONVERGED = 1e-3  # px: the last step of a fit that ended early
_STILL_MOVING = 0.05  # px: a fit whose last step was longer has not found its minimum
# A pixel averages light over its area: no edge is sharper than that (1/sqrt(12) px, and a little
# more for the shape of tanh).
_SHARPEST = 0.35
# How far a fit may turn an edge against the local grid (radians) and how the blur may differ
# from one pixel (logarithm): weak prior knowledge that keeps hardly determined fits in place.
_TURN_SPREAD, _BLUR_SPREAD, _SHIFT_SPREAD = 0.15, 0.7, 1.0
_LOG_BLUR = np.log(0.8)
# Windows end before the next edge: in sides, along each axis of the grid.
_WITHIN = 0.45


@dataclass(frozen=True, kw_only=True, eq=False)
class Crossings:
    """Result of :func:`fit_crossings`, one row a corner.

    Attributes:
        pixel: (N, 2) where the two edges cross.
        ok: (N,) the fit converged within the allowed travel.
        level: (N, 4) grey levels of the quadrants (+,+), (-,+), (-,-), (+,-) at the corner.
        blur: (N, 2) standard deviation of the blur across the edges along j and along i, px.
        misfit: (N,) RMS of what the model does not explain, grey levels.
        spread: (N,) predicted standard deviation of the position for noise of ``misfit``, px.

    """

    pixel: FloatArray
    ok: BoolArray
    level: FloatArray
    blur: FloatArray
    misfit: FloatArray
    spread: FloatArray

    def bright(self, sign: IntArray) -> FloatArray:
        """Levels (N, 2) of the squares that should be bright: (+,+), (-,-) where sign is +1."""
        return np.where((sign > 0)[:, None], self.level[:, 0::2], self.level[:, 1::2])

    def dark(self, sign: IntArray) -> FloatArray:
        """Levels (N, 2) of the squares that should be dark."""
        return np.where((sign > 0)[:, None], self.level[:, 1::2], self.level[:, 0::2])

    def contrast(self, sign: IntArray) -> FloatArray:
        """Mean bright minus mean dark level (N,), grey levels."""
        return self.bright(sign).mean(1) - self.dark(sign).mean(1)


def fit_crossings(
    image: npt.NDArray[np.generic],
    pixel: FloatArray,
    fit: LocalFit,
    half: FloatArray,
    noise: float,
) -> Crossings:
    """Fit ``c0 + c1 U + c2 V + c3 U V`` with two blurred steps U, V across the grid's own lines.

    The lines are bent as the grid is (``fit.bend``), so curved edges do not pull the result;
    four free grey levels make it blind to shadows and light that falls off across the corner.

    Args:
        image: (H, W) grey levels, any number type.
        pixel: (N, 2) start, within about half a pixel.
        fit: local shape of the grid around each corner.
        half: (N,) half-size of the window, pixels.
        noise: standard deviation of the pixel noise, grey levels.

    """
    count = len(pixel)
    out = Crossings(
        pixel=np.array(pixel, float),
        ok=np.zeros(count, bool),
        level=np.zeros((count, 4)),
        blur=np.ones((count, 2)),
        misfit=np.zeros(count),
        spread=np.full(count, np.inf),
    )
    reach = np.ceil(half).astype(int)
    for radius in np.unique(reach):
        rows = np.nonzero(reach == radius)[0]
        _fit(image, out, rows, fit, half[rows], int(radius), noise)
    return out


def _fit(
    image: npt.NDArray[np.generic],
    out: Crossings,
    rows: npt.NDArray[np.intp],
    fit: LocalFit,
    half: FloatArray,
    radius: int,
    noise: float,
) -> None:
    height, width = image.shape
    centre = np.rint(out.pixel[rows]).astype(int)
    inside = (centre >= radius).all(1) & (centre < (width - radius, height - radius)).all(1)
    rows, centre, half = rows[inside], centre[inside], half[inside]
    if not len(rows):
        return
    start = out.pixel[rows]
    offsets = np.arange(-radius, radius + 1)
    y, x = (part.ravel() for part in np.meshgrid(offsets, offsets, indexing="ij"))
    value = image[centre[:, 1:] + y, centre[:, :1] + x].astype(float)
    apart = np.stack([x + (centre[:, :1] - start[:, :1]), y + (centre[:, 1:] - start[:, 1:])], -1)

    step, bend = fit.step[rows], fit.bend[rows]
    inverse = np.linalg.inv(step)
    cell = apart @ inverse.transpose(0, 2, 1)
    for _ in range(2):
        di, dj = cell[..., 0], cell[..., 1]
        second = np.stack([0.5 * di * di, di * dj, 0.5 * dj * dj], -1) @ bend.transpose(0, 2, 1)
        cell = (apart - second) @ inverse.transpose(0, 2, 1)
    length = np.hypot(step[:, 0], step[:, 1])
    area = np.abs(np.linalg.det(step))
    # Distances across an edge and along it, pixels: axis 0 crosses the edge that runs along j.
    across = cell * (area[:, None] / length[:, ::-1])[:, None]
    along = cell[..., ::-1] * length[:, None, ::-1]
    radial = (apart**2).sum(-1) / (half[:, None] + 0.5) ** 2
    weight = np.maximum(1 - radial, 0)
    weight = np.minimum(1.0, 2 * weight)
    weight *= np.clip((_WITHIN - np.abs(cell).max(-1)) / 0.1, 0, 1)

    n = len(rows)
    shape = np.zeros((n, 6))  # shift u, shift v, turn u, turn v, log blur u, log blur v
    shape[:, 4:] = _LOG_BLUR
    scale = max(noise, 0.3)
    prior = np.array([_SHIFT_SPREAD] * 2 + [_TURN_SPREAD] * 2 + [_BLUR_SPREAD] * 2)
    expected = np.array([0, 0, 0, 0, _LOG_BLUR, _LOG_BLUR])
    levels = np.zeros((n, 4))
    covariance = np.zeros((n, 2, 2))
    done = np.zeros(n, bool)
    sqrt_weight = np.sqrt(weight)
    for round_ in range(_ROUNDS):
        own = np.exp(2 * shape[:, None, 4:])
        blur = np.sqrt(_SHARPEST**2 + own)
        growth = own / blur**2  # d log blur / d shape
        z = (across - shape[:, None, :2] - shape[:, None, 2:4] * along) / blur
        t = np.tanh(0.8 * z)
        slope = 0.8 * (1 - t * t)
        u, v = t[..., 0], t[..., 1]
        basis = np.stack([np.ones_like(u), u, v, u * v], -1) * sqrt_weight[..., None]
        target = value * sqrt_weight
        normal = basis.transpose(0, 2, 1) @ basis + 1e-6 * np.eye(4)
        levels = np.linalg.solve(normal, basis.transpose(0, 2, 1) @ target[..., None])[..., 0]
        residual = target - (basis @ levels[..., None])[..., 0]
        by_u = (levels[:, 1:2] + levels[:, 3:4] * v) * slope[..., 0] * sqrt_weight
        by_v = (levels[:, 2:3] + levels[:, 3:4] * u) * slope[..., 1] * sqrt_weight
        columns = np.stack(
            [
                -by_u / blur[..., 0],
                -by_v / blur[..., 1],
                -by_u * along[..., 0] / blur[..., 0],
                -by_v * along[..., 1] / blur[..., 1],
                -by_u * z[..., 0] * growth[..., 0],
                -by_v * z[..., 1] * growth[..., 1],
            ],
            -1,
        )
        # Kaufman's variable projection: the levels follow the shape.
        columns -= basis @ np.linalg.solve(normal, basis.transpose(0, 2, 1) @ columns)
        used = np.maximum(weight.sum(1) - 10, 1)
        sigma = np.sqrt(np.maximum((residual**2).sum(1) / used, scale**2))
        inner = columns.transpose(0, 2, 1) @ columns / (sigma**2)[:, None, None]
        inner += np.diag(1 / prior**2)
        right = (columns.transpose(0, 2, 1) @ residual[..., None])[..., 0] / (sigma**2)[:, None]
        right += (expected - shape) / prior**2
        move = np.linalg.solve(inner, right[..., None])[..., 0]
        move = np.clip(move, [-0.7, -0.7, -0.3, -0.3, -0.5, -0.5], [0.7, 0.7, 0.3, 0.3, 0.5, 0.5])
        if round_ < _ROUNDS - 1:
            shape += move
        done = np.abs(move[:, :2]).max(1) < _STILL_MOVING
        if np.abs(move[:, :2]).max() < _CONVERGED:
            break
    covariance = np.linalg.inv(inner)[:, :2, :2]
    # Where the turned, shifted edges cross.
    lean = length.prod(1) / area
    ru, rv = shape[:, 2] * lean, shape[:, 3] * lean
    su = (shape[:, 0] + ru * shape[:, 1]) / (1 - ru * rv)
    sv = (shape[:, 1] + rv * shape[:, 0]) / (1 - ru * rv)
    q = np.stack([su, sv], -1) / (area[:, None] / length[:, ::-1])
    second = np.stack([0.5 * q[:, 0] ** 2, q[:, 0] * q[:, 1], 0.5 * q[:, 1] ** 2], -1)
    out.pixel[rows] = start + (step @ q[..., None])[..., 0] + (bend @ second[..., None])[..., 0]
    out.ok[rows] = done & (np.abs(ru * rv) < 0.5)
    signs = np.array([(1, 1, 1, 1), (1, -1, 1, -1), (1, -1, -1, 1), (1, 1, -1, -1)])
    out.level[rows] = levels @ signs.T
    out.blur[rows] = blur[:, 0]
    out.misfit[rows] = np.sqrt((residual**2).sum(1) / np.maximum(weight.sum(1) - 10, 1))
    out.spread[rows] = np.sqrt(0.5 * (covariance[:, 0, 0] + covariance[:, 1, 1])) * lean
