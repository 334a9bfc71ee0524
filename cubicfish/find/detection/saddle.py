"""Sub-pixel position of saddle points: a weighted quadratic fitted to the pixels themselves."""

import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.windows import group_windows
from cubicfish.types import BoolArray, FloatArray

_ITERATIONS = 8
_CONVERGED = 0.02  # px: the crossing fit starts from here and does the rest


def fit_saddles(
    image: npt.NDArray[np.generic],
    pixel: FloatArray,
    half: FloatArray,
    travel: FloatArray | None = None,
    limits: FloatArray | None = None,
) -> tuple[FloatArray, BoolArray]:
    """Move (N, 2) pixels to the saddle point of a quadratic fitted in a window around each.

    The weights (1 - u^2)(1 - v^2) follow the estimate with sub-pixel precision while the data
    are whole pixels, so no interpolation is involved and a point-symmetric corner has no bias.

    Args:
        image: (H, W) grey levels, any number type.
        pixel: (N, 2) start.
        half: (N,) half-size of the window, pixels, at least 1.5.
        travel: (N,) how far the result may lie from the start; default max(1.5, half).
        limits: (N, 4) smallest x and y and largest x and y that windows may reach; None: all of
            the image.

    Returns:
        (N, 2) the saddle points, and (N,) whether it converged on one within the allowed travel.

    """
    count = len(pixel)
    result = np.array(pixel, float).reshape(count, 2)
    ok = np.zeros(count, bool)
    half = np.broadcast_to(np.asarray(half, float), (count,))
    height, width = image.shape
    radius = np.ceil(half + 0.5)
    state = np.empty((_HIGH.stop, count))
    state[_AT] = state[_START] = result.T
    state[_HALF] = half
    state[_TRAVEL] = np.maximum(1.5, half) if travel is None else travel
    within = np.array([[0], [0], [width - 1], [height - 1]]) if limits is None else limits.T
    state[_LOW], state[_HIGH] = within[:2] + radius, within[2:] - radius
    largest = (min(height, width) - 1) // 2
    for size, rows in group_windows(np.minimum(radius, largest).astype(int)):
        result[rows], ok[rows] = _fit(image, state[:, rows], size)
    return result, ok


# Rows of what is known of the points that are fitted: estimate, start, half-size of the window, how
# far the estimate may go, and the smallest and the largest places of the window's middle pixel.
_AT, _START, _HALF, _TRAVEL = slice(0, 2), slice(2, 4), 4, 5
_LOW, _HIGH = slice(6, 8), slice(8, 10)


def _fit(
    image: npt.NDArray[np.generic], state: FloatArray, radius: int
) -> tuple[FloatArray, BoolArray]:
    """The saddle points (N, 2) of some points, and whether they are any (N,).

    Points run along rows, so that the loops of numpy go over many points, not over the few pixels
    of a window.
    """
    size = 2 * radius + 1
    pixel, travel = state[_AT].T.copy(), state[_TRAVEL]
    start, ok = pixel.copy(), np.zeros(len(pixel), bool)
    height, width = image.shape
    offsets = np.arange(-radius, radius + 1.0)[:, None]
    most = np.array([[width - 1 - radius], [height - 1 - radius]])
    windows = np.lib.stride_tricks.sliding_window_view(image, (size, size))
    windows = windows.transpose(2, 3, 0, 1)
    active = np.arange(len(pixel))
    for _ in range(_ITERATIONS):
        centre = np.rint(state[_AT])
        x, y = state[_AT] - state[_START]
        inside = ((centre >= state[_LOW]) & (centre <= state[_HIGH])).all(0)
        inside &= np.hypot(x, y) <= state[_TRAVEL]
        if not inside.all():
            active, centre, state = active[inside], centre[:, inside], state[:, inside]
            if not len(active):
                break
        # A wider window than the point's own need not lie around its middle.
        centre = np.minimum(np.maximum(centre, radius), most).astype(int)
        x, y = centre - radius
        patch = np.ascontiguousarray(windows[:, :, y, x], float)
        away = offsets + (centre - state[_AT])[:, None]
        half = state[_HALF]
        move, saddle = _take_newton_step(patch, away / half)
        move *= half
        length = np.hypot(move[0], move[1])
        # A long step means that the quadratic does not describe the window: damp it.
        move *= np.minimum(1.0, 0.75 * half / np.maximum(length, 1e-9))
        state[_AT] += np.where(saddle, move, 0.0)
        pixel[active] = state[_AT].T
        done = saddle & (length < _CONVERGED)
        going = saddle & ~done
        if not going.all():
            ok[active[done]] = True
            active, state = active[going], state[:, going]
            if not len(active):
                break
    ok &= np.hypot(*(pixel - start).T) <= travel
    return pixel, ok


def _take_newton_step(patch: FloatArray, u: FloatArray) -> tuple[FloatArray, BoolArray]:
    """One weighted fit, in half windows.

    Patches (n, n, N) and the places (2, n, N) of their columns and of their rows -> steps (2, N),
    saddles (N,).

    The weight is a product, so products of polynomials that are orthogonal along x and along y
    are orthogonal in the plane, and each coefficient is a mean of its own.
    """
    square = u * u
    power = np.empty((3, *u.shape))  # times 1, u, u^2
    weight = np.maximum(1 - square, 0, out=power[0])
    np.multiply(weight, u, out=power[1])
    np.multiply(weight, square, out=power[2])
    zeroth, first, second = power.sum(2)
    third = np.einsum("anm,anm->am", power[2], u)
    fourth = np.einsum("anm,anm->am", power[2], square)
    # The polynomials are 1, u - mean, and u^2 - lean (u - mean) - level.
    mean, level = first / zeroth, second / zeroth
    norm_1 = second - mean * first
    skew = third - mean * second
    lean = skew / norm_1
    norm_2 = fourth - lean * skew - level * second
    # part[j, i] belongs to power j along y times power i along x.
    along = np.einsum("yxm,ixm->iym", patch, power[:, 0])
    part = np.einsum("iym,jym->jim", along, power[:, 1])
    # Both axes at once: the squares' factors a and c, the mixed one's b, the linear ones' d and e.
    whole, linear, other = part[0, 0], part[[0, 1], [1, 0]], zeroth[::-1]
    squares = part[[0, 2], [2, 0]] - lean * linear + (lean * mean - level) * whole
    squares /= other * norm_2
    linear -= mean * whole
    b = (part[1, 1] - mean[0] * part[1, 0] - mean[1] * linear[0]) / (norm_1[0] * norm_1[1])
    slopes = linear / (other * norm_1) - lean * squares - mean[::-1] * b
    determinant = 4 * squares[0] * squares[1] - b * b
    safe = np.where(determinant < 0, determinant, -1.0)
    step = (b * slopes[::-1] - 2 * squares[::-1] * slopes) / safe
    return step, determinant < 0
