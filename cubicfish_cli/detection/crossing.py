"""Sub-pixel position of corners: two blurred edges that cross, fitted to the pixels themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.grids import BoolArray, FloatArray, IntArray
from cubicfish_cli.detection.lattice import LocalFit

_ROUNDS = 12
_CONVERGED = 2e-3  # px: the last step of a fit that is done; steps shrink tenfold near the end
_BLUR_CONVERGED = 0.1  # logarithm
_STILL_MOVING = 0.05  # px: a fit whose last step was longer has not found its minimum
# A pixel averages light over its area: no edge is sharper than that (1/sqrt(12) px, and a little
# more for the shape of tanh).
_SHARPEST = 0.35
_TANH = 0.8  # tanh(0.8 z) has the slope of the Gaussian's own step at its middle
# Shift (px), turn (radians) and logarithm of the blur (px) of both edges: weak prior knowledge
# that keeps hardly determined fits in place, and the longest single step.
_PRIOR_MEAN = np.array([0.0, 0.0, 0.0, 0.0, np.log(0.8), np.log(0.8)])
_PRIOR_SPREAD = np.array([1.0, 1.0, 0.3, 0.3, 0.8, 0.8])
_LONGEST_STEP = np.array([0.7, 0.7, 0.3, 0.3, 0.7, 0.7])
# Windows end before the next edge, fading out: in sides, along each axis of the grid.
_WITHIN, _FADE = 0.45, 0.1

_FIELDS = ("pixel", "ok", "level", "blur", "turn", "misfit", "spread")


@dataclass(frozen=True, kw_only=True, eq=False)
class Crossings:
    """Result of :func:`fit_crossings`, one row a corner.

    Attributes:
        pixel: (N, 2) where the two edges cross.
        ok: (N,) the fit converged within the allowed travel.
        level: (N, 4) grey levels of the quadrants (+,+), (-,+), (-,-), (+,-) at the corner.
        blur: (N, 2) standard deviation of the blur across the edges along j and along i, px.
        turn: (N,) largest angle of an edge against the grid's own line, radians.
        misfit: (N,) RMS of what the model does not explain, grey levels.
        spread: (N,) predicted standard deviation of the position for noise of ``misfit``, px.

    """

    pixel: FloatArray
    ok: BoolArray
    level: FloatArray
    blur: FloatArray
    turn: FloatArray
    misfit: FloatArray
    spread: FloatArray

    def select(self, rows: BoolArray | IntArray) -> Crossings:
        """Take some rows."""
        return Crossings(**{name: getattr(self, name)[rows] for name in _FIELDS})

    def replace(self, rows: IntArray, other: Crossings) -> None:
        """Put other results in the place of some rows."""
        for name in _FIELDS:
            getattr(self, name)[rows] = getattr(other, name)

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
        turn=np.zeros(count),
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
    rows: IntArray,
    fit: LocalFit,
    half: FloatArray,
    radius: int,
    noise: float,
) -> None:
    """Fit the corners of some rows, all with windows of (2 radius + 1) pixels, into ``out``."""
    height, width = image.shape
    centre = np.rint(out.pixel[rows]).astype(int)
    inside = (centre >= radius).all(1) & (centre < (width - radius, height - radius)).all(1)
    inside &= fit.sound[rows]
    rows, centre, half = rows[inside], centre[inside], half[inside]
    if not len(rows):
        return
    frame = _frame(out.pixel[rows], centre, fit.select(rows), half, radius)
    offset = frame.offset
    value = image[centre[:, 1:] + offset[:, 1], centre[:, :1] + offset[:, 0]].astype(float)
    state = _minimise(value, frame, max(noise, 0.3))

    # Where the turned, shifted edges cross.
    turn = state.shape[:, 2:4] * frame.lean[:, None]
    shift = state.shape[:, :2]
    closing = 1 - turn[:, 0] * turn[:, 1]
    distance = (shift + turn * shift[:, ::-1]) / closing[:, None]
    q = distance / frame.height
    second = np.stack([0.5 * q[:, 0] ** 2, q[:, 0] * q[:, 1], 0.5 * q[:, 1] ** 2], -1)
    out.pixel[rows] += (fit.step[rows] @ q[..., None])[..., 0]
    out.pixel[rows] += (fit.bend[rows] @ second[..., None])[..., 0]
    out.ok[rows] = (state.last_move < _STILL_MOVING) & (closing > 0.5)
    signs = np.array([(1, 1, 1, 1), (1, -1, 1, -1), (1, -1, -1, 1), (1, 1, -1, -1)])
    out.level[rows] = state.levels @ signs.T
    blur = state.shape[:, 4:].copy()  # taken out of its array: angles.py says why
    out.blur[rows] = np.hypot(_SHARPEST, np.exp(blur))
    out.turn[rows] = np.abs(state.shape[:, 2:4]).max(1)
    out.misfit[rows] = state.misfit
    covariance = np.linalg.inv(state.normal)
    out.spread[rows] = frame.lean * np.sqrt(0.5 * (covariance[:, 0, 0] + covariance[:, 1, 1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Frame:
    """The windows of n corners, K pixels each, in the grid's own bent coordinates."""

    offset: IntArray  # (K, 2) pixels from the window's middle
    across: FloatArray  # (n, K, 2) distance from the edge along j and from the edge along i, px
    along: FloatArray  # (n, K, 2) place along those edges, px
    root_weight: FloatArray  # (n, K)
    height: FloatArray  # (n, 2) distance between neighbouring edges, px
    lean: FloatArray  # (n,) 1 / sine of the angle between the edges

    def select(self, rows: BoolArray) -> _Frame:
        return _Frame(
            offset=self.offset,
            across=self.across[rows],
            along=self.along[rows],
            root_weight=self.root_weight[rows],
            height=self.height[rows],
            lean=self.lean[rows],
        )


def _frame(
    start: FloatArray, centre: IntArray, fit: LocalFit, half: FloatArray, radius: int
) -> _Frame:
    side = np.arange(-radius, radius + 1)
    offset = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    # Corners of the square window lie beyond the round one.
    offset = offset[(offset**2).sum(1) <= (half.max() + 1) ** 2]
    apart = offset + (centre - start)[:, None]
    inverse = np.linalg.inv(fit.step).transpose(0, 2, 1)
    cell = apart @ inverse
    for _ in range(2):
        di, dj = cell[..., 0], cell[..., 1]
        bent = np.stack([0.5 * di * di, di * dj, 0.5 * dj * dj], -1)
        cell = (apart - bent @ fit.bend.transpose(0, 2, 1)) @ inverse
    length = np.hypot(fit.step[:, 0], fit.step[:, 1])
    area = np.abs(np.linalg.det(fit.step))
    height = area[:, None] / length[:, ::-1]
    weight = np.clip(2 - 2 * (apart**2).sum(-1) / (half[:, None] + 0.5) ** 2, 0, 1)
    weight *= np.clip((_WITHIN - np.abs(cell).max(-1)) / _FADE, 0, 1)
    return _Frame(
        offset=offset,
        across=cell * height[:, None],
        along=(cell * length[:, None])[..., ::-1],
        root_weight=np.sqrt(weight),
        height=height,
        lean=length.prod(1) / area,
    )


@dataclass(kw_only=True, eq=False)
class _State:
    """Best fit so far of n corners."""

    shape: FloatArray  # (n, 6) shift u, v (px), turn u, v (radians), log blur u, v
    levels: FloatArray  # (n, 4) c0..c3
    cost: FloatArray  # (n,)
    misfit: FloatArray  # (n,) grey levels
    normal: FloatArray  # (n, 6, 6)
    right: FloatArray  # (n, 6)
    last_move: FloatArray  # (n,) px


def _minimise(value: FloatArray, frame: _Frame, noise: float) -> _State:
    """Levenberg-Marquardt on all corners at once; those that are done no longer take part."""
    count = len(value)
    state = _State(
        shape=np.tile(_PRIOR_MEAN, (count, 1)),
        levels=np.zeros((count, 4)),
        cost=np.full(count, np.inf),
        misfit=np.zeros(count),
        normal=np.tile(np.eye(6), (count, 1, 1)),
        right=np.zeros((count, 6)),
        last_move=np.full(count, np.inf),
    )
    # The spread of the levels keeps the weight of the prior in scale before the fit is good.
    sigma2 = np.full(count, noise**2)
    damping = np.full(count, 1e-3)
    active = np.arange(count)
    trial = state.shape.copy()
    for round_ in range(_ROUNDS):
        levels, residual, columns = _model(trial[active], value, frame)
        squares = (residual**2).sum(1)
        misfit2 = squares / np.maximum((frame.root_weight**2).sum(1) - 10, 1)
        if round_ in (1, 4):  # the misfit tells by now how well the model can do
            sigma2[active] = np.maximum(misfit2, noise**2)
            state.cost[active] = np.inf
        away = (_PRIOR_MEAN - trial[active]) / _PRIOR_SPREAD
        cost = squares / sigma2[active] + (away**2).sum(1)
        better = cost < state.cost[active]
        rows = active[better]
        columns = columns[better] / np.sqrt(sigma2[rows])[:, None, None]
        scaled = residual[better] / np.sqrt(sigma2[rows])[:, None]
        state.shape[rows] = trial[rows]
        state.levels[rows] = levels[better]
        state.cost[rows] = cost[better]
        state.misfit[rows] = np.sqrt(misfit2[better])
        state.normal[rows] = columns.transpose(0, 2, 1) @ columns + np.diag(_PRIOR_SPREAD**-2.0)
        state.right[rows] = (columns.transpose(0, 2, 1) @ scaled[..., None])[..., 0]
        state.right[rows] += away[better] / _PRIOR_SPREAD
        now = damping[active]
        damping[active] = np.where(better, np.maximum(0.2 * now, 1e-4), np.maximum(10 * now, 0.3))

        normal = state.normal[active]
        damped = normal + damping[active, None, None] * normal * np.eye(6)
        move = np.linalg.solve(damped, state.right[active][..., None])[..., 0]
        move = np.clip(move, -_LONGEST_STEP, _LONGEST_STEP)
        trial[active] = state.shape[active] + move
        state.last_move[active] = np.abs(move[:, :2]).max(1)
        going = state.last_move[active] > _CONVERGED
        going |= np.abs(move[:, 4:]).max(1) > _BLUR_CONVERGED
        if not going.all():
            active, value, frame = active[going], value[going], frame.select(going)
        if not len(active):
            break
    return state


def _model(
    shape: FloatArray, value: FloatArray, frame: _Frame
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Levels (n, 4) that fit best, weighted residuals (n, K) and derivatives (n, K, 6)."""
    own = np.exp(2 * shape[:, None, 4:])
    blur = np.sqrt(_SHARPEST**2 + own)
    z = (frame.across - shape[:, None, :2] - shape[:, None, 2:4] * frame.along) / blur
    step = np.tanh(_TANH * z)
    u, v = step[..., 0], step[..., 1]
    basis = np.stack([np.ones_like(u), u, v, u * v], -1) * frame.root_weight[..., None]
    normal = basis.transpose(0, 2, 1) @ basis + 1e-6 * np.eye(4)
    target = value * frame.root_weight
    levels = np.linalg.solve(normal, basis.transpose(0, 2, 1) @ target[..., None])
    residual = target - (basis @ levels)[..., 0]
    c = levels[:, 1:, 0]
    slope = _TANH * (1 - step * step) / blur
    slope[..., 0] *= (c[:, :1] + c[:, 2:] * v) * frame.root_weight
    slope[..., 1] *= (c[:, 1:2] + c[:, 2:] * u) * frame.root_weight
    columns = -np.concatenate([slope, slope * frame.along, slope * z * (own / blur)], -1)
    # Kaufman's variable projection: the levels follow the shape.
    columns -= basis @ np.linalg.solve(normal, basis.transpose(0, 2, 1) @ columns)
    best = np.asarray(levels[..., 0], np.float64)
    return best, residual, np.asarray(columns, np.float64)
