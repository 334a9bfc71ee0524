"""Sub-pixel position of corners: two blurred edges that cross, fitted to the pixels themselves.

Where white is overexposed it bleeds: dark squares shrink, and those that meet at a corner stop
touching. Every edge then is a pair of half edges, moved apart to either side by half the gap, and
the corner's place is the middle of the gap. As long as the light spills alike to all sides that is
where the edges of the print cross, whatever the gap: half a turn about the corner takes the picture
to itself, so the gap (like turn and blur, even under that half turn) has no say in the shift (odd).
What bias is left comes from light that spills to one side only: all corners of a photo, and so
its image centre, move by as much, and none of the shape of the lens is lost.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.grids import Float32Array, Rows
from cubicfish.find.detection.lattice import LocalFit
from cubicfish.find.detection.windows import group_windows
from cubicfish.types import BoolArray, FloatArray, IntArray

ROUNDS = 12
_CONVERGED = 2e-3  # px: the last step of a fit that is done; steps shrink tenfold near the end
_BLUR_CONVERGED = 0.1  # logarithm
_STILL_MOVING = 0.05  # px: a fit whose last step was longer has not found its minimum
# A pixel averages light over its area: no edge is sharper than that (1/sqrt(12) px, and a little
# more for the shape of tanh).
_SHARPEST = 0.35
_TANH = 0.8  # tanh(0.8 z) has the slope of the Gaussian's own step at its middle
# Shift (px), turn (radians) and logarithm of the blur (px) of both edges, and half the gap between
# the dark squares (px): weak prior knowledge that keeps hardly determined fits in place, and the
# longest single step.
_GAP_SPREAD = 2.0
_PRIOR_MEAN = np.array([0.0, 0.0, 0.0, 0.0, np.log(0.8), np.log(0.8), 0.0])
_PRIOR_SPREAD = np.array([1.0, 1.0, 0.3, 0.3, 0.8, 0.8, 0.5 * _GAP_SPREAD])
_LONGEST_STEP = np.array([0.7, 0.7, 0.3, 0.3, 0.7, 0.7, 0.7])
_UNKNOWNS = len(_PRIOR_MEAN)
_STEEPEST = 40.0  # logistic functions of more are 0 or 1
# Windows end before the next edge, fading out: in sides, along each axis of the grid.
_WITHIN, _FADE = 0.45, 0.1
_MOST_PULL = 0.1  # of the blur: how far blur draws a corner along a bent grid at most


@dataclass(frozen=True, kw_only=True, eq=False)
class Crossings(Rows):
    """Result of :func:`fit_crossings`, one row per corner.

    Attributes:
        pixel: (N, 2) where the two edges cross.
        ok: (N,) the fit converged within the allowed travel.
        level: (N, 4) grey levels of the quadrants (+,+), (-,+), (-,-), (+,-) at the corner.
        blur: (N, 2) standard deviation of the blur across the edges along j and along i, px.
        turn: (N,) largest angle of an edge against the grid's own line, radians.
        gap: (N,) distance along either edge between the dark squares that meet there, px: more
            than 0 where they do not touch, less where they overlap.
        misfit: (N,) RMS of what the model does not explain, grey levels.
        spread: (N,) predicted standard deviation of the position for noise of ``misfit``, px.

    """

    pixel: FloatArray
    ok: BoolArray
    level: FloatArray
    blur: FloatArray
    turn: FloatArray
    gap: FloatArray
    misfit: FloatArray
    spread: FloatArray

    def replace(self, rows: IntArray, other: Crossings) -> None:
        """Put other results in the place of some rows."""
        for one in fields(self):
            getattr(self, one.name)[rows] = getattr(other, one.name)

    def bright(self, sign: IntArray) -> FloatArray:
        """Levels (N, 2) of the squares that should be bright: (+,+), (-,-) where sign is +1."""
        return np.where((sign > 0)[:, None], self.level[:, 0::2], self.level[:, 1::2])

    def dark(self, sign: IntArray) -> FloatArray:
        """Levels (N, 2) of the squares that should be dark."""
        return np.where((sign > 0)[:, None], self.level[:, 1::2], self.level[:, 0::2])

    def contrast(self, sign: IntArray) -> FloatArray:
        """Mean bright minus mean dark level (N,), grey levels."""
        return self.bright(sign).mean(1) - self.dark(sign).mean(1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Gaps(Rows):
    """What is known of N gaps: mean and standard deviation (N,), pixels."""

    mean: FloatArray
    spread: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Quiet(Rows):
    """How far the bright squares at N corners are clean: markers stand inside.

    Attributes:
        sign: (N,) +1 where the quadrants (+,+) and (-,-) are bright, else -1.
        steps: (N,) distance from both edges from which on there may be ink, steps of the grid.

    """

    sign: IntArray
    steps: FloatArray


def fit_crossings(
    image: npt.NDArray[np.generic],
    pixel: FloatArray,
    fit: LocalFit,
    half: FloatArray,
    noise: float,
    *,
    rows: IntArray | None = None,
    gap: Gaps | None = None,
    quiet: Quiet | None = None,
    rounds: int = ROUNDS,
) -> Crossings:
    """Fit four quadrants, divided by blurred steps across the grid's own lines.

    The lines are bent as the grid is (``fit.bend``), so curved edges do not pull the result;
    four free grey levels make it blind to shadows and light that falls off across the corner, a
    free gap between the dark ones to how far the bright ones spill over.

    Args:
        image: (H, W) grey levels, any number type.
        pixel: (N, 2) start, within about half a pixel.
        fit: local shape of the grid around each corner.
        half: (N,) half-size of the window, pixels.
        noise: standard deviation of the pixel noise, grey levels.
        rows: which of these corners are fitted; None: all.
        gap: what is known of their gaps beforehand; None: about none, 2 px at most.
        quiet: how much of the squares at all N is clean; None: all of it.
        rounds: steps at most.

    """
    if rows is not None:
        pixel, fit, half = pixel[rows], fit.select(rows), half[rows]
        quiet = None if quiet is None else quiet.select(rows)
    count = len(pixel)
    if gap is None:
        gap = Gaps(mean=np.zeros(count), spread=np.full(count, _GAP_SPREAD))
    out = Crossings(
        pixel=np.array(pixel, float),
        ok=np.zeros(count, bool),
        level=np.zeros((count, 4)),
        blur=np.ones((count, 2)),
        turn=np.zeros(count),
        gap=np.zeros(count),
        misfit=np.zeros(count),
        spread=np.full(count, np.inf),
    )
    noise = max(noise, 0.3)
    height, width = image.shape
    centre, half_width = np.rint(out.pixel).astype(int), np.ceil(half).astype(int)
    inside = (centre >= half_width[:, None]).all(1) & fit.sound
    inside &= (centre < (width, height) - half_width[:, None]).all(1)
    reach = half.copy()  # of the round windows, but for one pixel: alike for those of one size
    for radius in np.unique(half_width[inside]):
        reach[half_width == radius] = half[inside & (half_width == radius)].max()
    fitted = np.flatnonzero(inside)
    for radius, group in group_windows(half_width[fitted]):
        some = fitted[group]
        local, within = fit.select(some), None if quiet is None else quiet.select(some)
        sizes = np.stack([half[some], reach[some]])
        frame = _make_frame(image, out.pixel[some], centre[some], local, sizes, radius, within)
        state = _minimise(frame, noise, gap.select(some), rounds)
        _enter(out, some, local, state, noise)
    return out


def _enter(out: Crossings, rows: IntArray, local: LocalFit, state: _State, noise: float) -> None:
    """Enter what the fits of some rows came to."""
    length, height = _measure_sides(local)
    lean = length[:, 0] / height[:, 0]  # 1 / sine of the angle between the edges

    # Where the turned, shifted edges cross.
    turn = state.shape[:, 2:4] * lean[:, None]
    shift = state.shape[:, :2]
    closing = 1 - turn[:, 0] * turn[:, 1]
    distance = (shift + turn * shift[:, ::-1]) / closing[:, None]
    q = distance / height
    second = np.stack([0.5 * q[:, 0] ** 2, q[:, 0] * q[:, 1], 0.5 * q[:, 1] ** 2], -1)
    out.pixel[rows] += (local.step @ q[..., None])[..., 0]
    out.pixel[rows] += (local.bend @ second[..., None])[..., 0]
    out.ok[rows] = (state.last_move < _STILL_MOVING) & (closing > 0.5)
    out.level[rows] = state.levels
    blur = state.shape[:, 4:6].copy()  # taken out of its array: angles.py says why
    out.blur[rows] = np.hypot(_SHARPEST, np.exp(blur))
    out.pixel[rows] -= _compute_blur_pull(local, out.blur[rows])
    out.turn[rows] = np.abs(state.shape[:, 2:4]).max(1)
    out.gap[rows] = 2 * state.shape[:, 6]
    out.misfit[rows] = state.misfit
    final = np.maximum(state.misfit, noise)[:, None, None]
    prior = (1 / _PRIOR_SPREAD) ** 2 * np.eye(_UNKNOWNS)
    covariance = np.linalg.inv(state.data / final**2 + prior)
    out.spread[rows] = lean * np.sqrt(0.5 * (covariance[:, 0, 0] + covariance[:, 1, 1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Frame(Rows):
    """The windows of n corners, K pixels each, in the grid's own bent coordinates."""

    value: Float32Array  # (n, K) grey levels, times the weight
    across: Float32Array  # (n, 2, K) distance from the edge along j and from the edge along i, px
    along: Float32Array  # (n, 2, K) place along those edges, px
    weight: Float32Array  # (n, K) root of the weight


def _make_frame(
    image: npt.NDArray[np.generic],
    start: FloatArray,
    centre: IntArray,
    fit: LocalFit,
    sizes: FloatArray,
    radius: int,
    quiet: Quiet | None,
) -> _Frame:
    """The windows of corners of some half-sizes, which reach so far: two rows of ``sizes``."""
    half, reach = sizes
    side = np.arange(-radius, radius + 1)
    offset = np.stack(np.meshgrid(side, side)).reshape(2, -1)
    # Corners of the square window lie beyond the round one.
    away = (offset**2).sum(0)
    keep = away <= (reach.max() + 1) ** 2
    offset, away = offset[:, keep], away[keep]
    height, width = image.shape
    row = np.clip(centre[:, 1:] + offset[1], 0, height - 1)
    value = image[row, np.clip(centre[:, :1] + offset[0], 0, width - 1)].astype(float)
    apart = offset + (centre - start)[:, :, None]
    inverse = np.linalg.inv(fit.step)
    cell = inverse @ apart
    for _ in range(2):
        di, dj = cell[:, 0], cell[:, 1]
        bent = np.stack([0.5 * di * di, di * dj, 0.5 * dj * dj], 1)
        cell = inverse @ (apart - fit.bend @ bent)
    length, apart_px = _measure_sides(fit)
    weight = np.clip(2 - 2 * (apart**2).sum(1) / (half[:, None] + 0.5) ** 2, 0, 1)
    weight[away > (reach[:, None] + 1) ** 2] = 0
    weight *= np.clip((_WITHIN - np.abs(cell).max(1)) / _FADE, 0, 1)
    if quiet is not None:
        bright = quiet.sign[:, None] * cell[:, 0] * cell[:, 1] > 0
        left = ((quiet.steps[:, None, None] - np.abs(cell)) * apart_px[:, :, None]).max(1)  # px
        weight *= np.where(bright, np.clip(left + 0.5, 0, 1), 1)
    weight = np.sqrt(weight)
    return _Frame(
        value=(value * weight).astype(np.float32),
        across=(cell * apart_px[:, :, None]).astype(np.float32),
        along=(cell * length[:, :, None])[:, ::-1].astype(np.float32),
        weight=weight.astype(np.float32),
    )


def _compute_blur_pull(fit: LocalFit, blur: FloatArray) -> FloatArray:
    """How far blur (n, 2) moves corners (n, 2) where the grid is bent, pixels.

    To first order blur adds half its variance times the Laplacian, and that of the grid's own
    coordinates is not zero where lines are bent or their distances grow: corners are drawn to
    where squares are larger, and edges to the inside of their bends.
    """
    inverse = np.linalg.inv(fit.step)
    metric = inverse @ inverse.transpose(0, 2, 1)
    way = np.stack([metric[:, 0, 0], 2 * metric[:, 0, 1], metric[:, 1, 1]], axis=-1)
    half_variance = 0.25 * np.square(blur).sum(axis=1)
    pull = half_variance[:, None] * (fit.bend @ way[..., None])[..., 0]
    # Where it is a good part of the blur the first order does not hold, nor is the bend known.
    length = np.hypot(pull[:, 0], pull[:, 1])
    most = _MOST_PULL * blur.mean(axis=1)
    return np.asarray(pull * np.minimum(1, most / np.maximum(length, 1e-9))[:, None])


def _measure_sides(fit: LocalFit) -> tuple[FloatArray, FloatArray]:
    """Lengths (n, 2) of the steps along i and j, and distances of neighbouring edges, px."""
    length = np.hypot(fit.step[:, 0], fit.step[:, 1])
    area = np.abs(np.linalg.det(fit.step))
    return length, area[:, None] / length[:, ::-1]


@dataclass(frozen=True, kw_only=True, eq=False)
class _State(Rows):
    """Best fit so far of n corners, what is fitted to beside the pixels, and what is tried next."""

    shape: FloatArray  # (n, 7) shift u, v (px), turn u, v (radians), log blur u, v, half gap (px)
    levels: FloatArray  # (n, 4) grey levels of the quadrants (+,+), (-,+), (-,-), (+,-)
    cost: FloatArray  # (n,)
    misfit: FloatArray  # (n,) grey levels
    data: (
        FloatArray  # (n, 7, 7) the pixels' part of the normal equations, for noise of 1 grey level
    )
    right: FloatArray  # (n, 7) the same
    last_move: FloatArray  # (n,) px
    mean: FloatArray  # (n, 7) of the prior
    spread: FloatArray  # (n, 7)
    dark_first: BoolArray  # (n,)
    freedom: FloatArray  # (n,) pixels, less what is fitted
    # The spread of the levels keeps the weight of the prior in scale before the fit is good.
    sigma2: FloatArray  # (n,)
    damping: FloatArray  # (n,)
    trial: FloatArray  # (n, 7) the next shape to try

    def put(self, rows: IntArray | BoolArray, other: _State) -> None:
        """Put the fits of some rows in their place."""
        for one in fields(self):
            getattr(self, one.name)[rows] = getattr(other, one.name)


def _minimise(frame: _Frame, noise: float, gap: Gaps, rounds: int) -> _State:
    """Levenberg-Marquardt on all corners at once; those that are done no longer take part."""
    count = len(frame.value)
    mean, spread = np.tile(_PRIOR_MEAN, (count, 1)), np.tile(_PRIOR_SPREAD, (count, 1))
    mean[:, 6], spread[:, 6] = 0.5 * gap.mean, 0.5 * gap.spread
    state = _State(
        shape=mean.copy(),
        levels=np.zeros((count, 4)),
        cost=np.full(count, np.inf),
        misfit=np.zeros(count),
        data=np.zeros((count, _UNKNOWNS, _UNKNOWNS)),
        right=np.zeros((count, _UNKNOWNS)),
        last_move=np.full(count, np.inf),
        mean=mean,
        spread=spread,
        dark_first=_is_dark_first(frame),
        freedom=np.maximum((frame.weight**2).sum(1) - 11, 1),
        sigma2=np.full(count, noise**2),
        damping=np.full(count, 1e-3),
        trial=mean.copy(),
    )
    active, done = np.arange(count), state
    for round_ in range(rounds):
        going = _take_round(frame, state, round_ in (1, 4), noise)
        if going.all():
            continue
        done.put(active[~going], state.select(~going))
        active, frame, state = active[going], frame.select(going), state.select(going)
        if not len(active):
            break
    done.put(active, state)
    return done


def _take_round(frame: _Frame, state: _State, tells: bool, noise: float) -> BoolArray:
    """Try the next shapes, keep what is better, and choose the next: where it moves on (n,).

    ``tells``: the misfit tells by now how well the model can do.
    """
    levels, squares, data, right = _fit_levels(state.trial, state.dark_first, frame)
    misfit2 = squares / state.freedom
    if tells:
        state.sigma2[:] = np.maximum(misfit2, noise**2)
        state.cost[:] = np.inf
    cost = squares / state.sigma2 + np.square((state.mean - state.trial) / state.spread).sum(1)
    better = cost < state.cost
    found = (state.trial, levels, cost, np.sqrt(misfit2), data, right)
    kept = (state.shape, state.levels, state.cost, state.misfit, state.data, state.right)
    for old, new in zip(kept, found, strict=True):
        if better.all():
            old[:] = new
        else:
            old[better] = new[better]
    now = state.damping
    now[:] = np.where(better, np.maximum(0.2 * now, 1e-4), np.maximum(10 * now, 0.3))

    normal = state.data / state.sigma2[:, None, None]
    diagonal = np.einsum("nii->ni", normal)
    diagonal += state.spread**-2.0
    diagonal *= 1 + now[:, None]
    wanted = state.right / state.sigma2[:, None] + (state.mean - state.shape) / state.spread**2
    move = np.linalg.solve(normal, wanted[..., None])[..., 0]
    move = np.clip(move, -_LONGEST_STEP, _LONGEST_STEP)
    np.add(state.shape, move, out=state.trial)
    size = np.abs(move)
    state.last_move[:] = size[:, :2].max(1)
    return np.asarray((state.last_move > _CONVERGED) | (size[:, 4:6].max(1) > _BLUR_CONVERGED))


def _is_dark_first(frame: _Frame) -> BoolArray:
    """Tell where the quadrants (+,+) and (-,-) are darker than the others, on the whole (n,)."""
    weight = frame.weight
    mean = (weight * frame.value).sum(1) / np.maximum((weight**2).sum(1), 1e-9)
    above = frame.value - mean[:, None] * weight
    side = np.sign(frame.across[:, 0] * frame.across[:, 1])
    return np.asarray((weight * side * above).sum(1) < 0)


def _fit_levels(
    shape: FloatArray, dark_first: BoolArray, frame: _Frame
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Levels (n, 4) that fit best, squared residuals (n,), normal equations (n, 7, 7) and (n, 7).

    Two opposite quadrants draw back by half the gap from both edges, the dark ones where the gap
    is positive and the bright ones where it is negative. With logistic steps the share of the two
    others at a point is again a logistic function of both distances, and without a gap the shares
    are the products of the steps across either edge.
    """
    shape = shape.astype(np.float32)  # to a millionth of a pixel, in half the time
    half_gap = shape[:, 6]
    # The quadrants that draw back lie at (+,+) and (-,-) once the second axis is turned.
    turned = np.where(dark_first == (half_gap >= 0), np.float32(1), np.float32(-1))
    own = np.exp(2 * shape[:, 4:6, None])
    blur2 = _SHARPEST**2 + own
    steep = 2 * _TANH / np.sqrt(blur2)
    weight = frame.weight
    # What is multiplied with each other: slopes, residual, basis and value.
    rows = np.empty((len(shape), _UNKNOWNS + 6, weight.shape[1]), np.float32)
    slopes, residual = rows[:, :_UNKNOWNS], rows[:, _UNKNOWNS]
    basis = rows[:, _UNKNOWNS + 1 : -1]
    rows[:, -1] = frame.value
    z = frame.along * -shape[:, 2:4, None]
    z += frame.across
    z -= shape[:, :2, None]
    z *= steep
    np.clip(z, -_STEEPEST, _STEEPEST, out=z)
    z[:, 1] *= turned[:, None]
    back = np.minimum(np.abs(half_gap)[:, None, None] * steep, _STEEPEST)
    away, bar = np.exp(-z), np.exp(back)
    plus, minus = 1 / (1 + away * bar), away / (away + bar)  # steps up to the two quadrants
    first, third = plus[:, 0] * plus[:, 1], minus[:, 0] * minus[:, 1]
    fourth = away[:, 1] / (away[:, 1] + away[:, 0])
    rest = (1 - first - third) * weight
    first *= weight
    third *= weight
    basis[:, 0], basis[:, 2] = first, third
    np.multiply(rest, fourth, out=basis[:, 3])
    np.subtract(rest, basis[:, 3], out=basis[:, 1])
    products = (basis @ rows[:, _UNKNOWNS + 1 :].swapaxes(1, 2)).astype(float)
    inverse = np.linalg.inv(products[..., :4] + 1e-6 * np.eye(4))
    levels = inverse @ products[..., 4:]
    fitted = levels.astype(np.float32)
    np.subtract(frame.value, (fitted.swapaxes(1, 2) @ basis)[:, 0], out=residual)
    one, two, three, four = fitted.transpose(1, 0, 2)
    between = two + (four - two) * fourth
    of_plus = ((one - between) * first)[:, None] * (1 - plus)
    of_minus = ((three - between) * third)[:, None] * (1 - minus)
    sharing = (four - two) * basis[:, 3] * (1 - fourth)
    gap_slope = of_plus + of_minus
    slope = of_plus
    slope -= of_minus
    slope[:, 0] += sharing
    slope[:, 1] -= sharing
    z *= slope
    z -= gap_slope * back
    np.multiply(z, own / blur2, out=slopes[:, 4:6])
    gap_slope *= steep * np.where(half_gap >= 0, np.float32(1), np.float32(-1))[:, None, None]
    np.add(gap_slope[:, 0], gap_slope[:, 1], out=slopes[:, 6])
    steep[:, 1] *= turned[:, None]
    np.multiply(slope, steep, out=slopes[:, :2])
    np.multiply(slopes[:, :2], frame.along, out=slopes[:, 2:4])
    best = levels[..., 0]
    best = np.where(turned[:, None] > 0, best, best[:, ::-1])
    products = (rows[:, : _UNKNOWNS + 1] @ rows[:, :-1].swapaxes(1, 2)).astype(float)
    squares, right = products[:, _UNKNOWNS, _UNKNOWNS], -products[:, :_UNKNOWNS, _UNKNOWNS]
    # Kaufman's variable projection: the levels follow the shape, and the residuals hold nothing
    # that other levels would explain.
    shared = products[:, :_UNKNOWNS, _UNKNOWNS + 1 :]
    data = products[:, :_UNKNOWNS, :_UNKNOWNS] - shared @ inverse @ shared.swapaxes(1, 2)
    return best, squares, data, right
