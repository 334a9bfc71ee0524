"""Sub-pixel position of saddle points: a weighted quadratic fitted to the pixels themselves."""

import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.types import BoolArray, FloatArray

_ITERATIONS = 8
_CONVERGED = 0.02  # px: the crossing fit starts from here and does the rest


def fit_saddles(
    image: npt.NDArray[np.generic],
    pixel: FloatArray,
    half: FloatArray,
    travel: FloatArray | None = None,
) -> tuple[FloatArray, BoolArray]:
    """Move (N, 2) pixels to the saddle point of a quadratic fitted in a window around each.

    The weights (1 - u^2)(1 - v^2) follow the estimate with sub-pixel precision while the data
    are whole pixels, so no interpolation is involved and a point-symmetric corner has no bias.

    Args:
        image: (H, W) grey levels, any number type.
        pixel: (N, 2) start.
        half: (N,) half-size of the window, pixels, at least 1.5.
        travel: (N,) how far the result may lie from the start; default max(1.5, half).

    Returns:
        (N, 2) the saddle points, and (N,) whether it converged on one within the allowed travel.

    """
    count = len(pixel)
    result = np.array(pixel, float).reshape(count, 2)
    ok = np.zeros(count, bool)
    half = np.broadcast_to(np.asarray(half, float), (count,))
    limit = np.maximum(1.5, half) if travel is None else np.broadcast_to(travel, (count,))
    half_width = np.ceil(half + 0.5).astype(int)
    for radius in np.unique(half_width):
        rows = np.nonzero(half_width == radius)[0]
        result[rows], ok[rows] = _fit(image, result[rows], half[rows], limit[rows], int(radius))
    return result, ok


def _fit(
    image: npt.NDArray[np.generic],
    start: FloatArray,
    half: FloatArray,
    travel: FloatArray,
    radius: int,
) -> tuple[FloatArray, BoolArray]:
    size = 2 * radius + 1
    height, width = image.shape
    offsets = np.arange(-radius, radius + 1)
    pixel = start.copy()
    ok = np.zeros(len(start), bool)
    active = np.arange(len(start))
    if min(height, width) < size:
        return pixel, ok
    windows = np.lib.stride_tricks.sliding_window_view(image, (size, size))
    for _ in range(_ITERATIONS):
        centre = np.rint(pixel[active]).astype(int)
        inside = (
            (centre[:, 0] >= radius)
            & (centre[:, 1] >= radius)
            & (centre[:, 0] < width - radius)
            & (centre[:, 1] < height - radius)
            & (np.hypot(*(pixel[active] - start[active]).T) <= travel[active])
        )
        active, centre = active[inside], centre[inside]
        if not len(active):
            break
        patch = windows[centre[:, 1] - radius, centre[:, 0] - radius].astype(float)
        away = offsets + (centre - pixel[active])[..., None]
        move, saddle = _take_newton_step(patch, away, half[active])
        length = np.hypot(move[:, 0], move[:, 1])
        # A long step means that the quadratic does not describe the window: damp it.
        move *= np.minimum(1.0, 0.75 * half[active] / np.maximum(length, 1e-9))[:, None]
        pixel[active[saddle]] += move[saddle]
        done = saddle & (length < _CONVERGED)
        ok[active[done]] = True
        active = active[saddle & ~done]
    ok &= np.hypot(*(pixel - start).T) <= travel
    return pixel, ok


def _take_newton_step(
    patch: FloatArray, away: FloatArray, half: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """One weighted fit: patches (N, n, n), offsets (N, 2, n) -> steps (N, 2), saddles (N,).

    The weight is a product, so products of polynomials that are orthogonal along x and along y
    are orthogonal in the plane, and each coefficient is a mean of its own.
    """
    u = away / half[:, None, None]
    weight = np.maximum(1 - u * u, 0)
    total = weight.sum(-1)
    mean = (weight * u).sum(-1) / total
    first = u - mean[..., None]
    weighted = weight * first
    power = (weighted * first).sum(-1)
    lean = (weighted * u * u).sum(-1) / power
    second = u * u - lean[..., None] * first
    second -= ((weight * second).sum(-1) / total)[..., None]
    basis = np.stack([weight, weighted, weight * second], axis=2)
    norm = np.stack([total, power, (basis[:, :, 2] * second).sum(-1)], axis=-1)
    # factor[n, j, i] belongs to polynomial j along y times polynomial i along x.
    factor = basis[:, 1] @ patch @ basis[:, 0].transpose(0, 2, 1)
    factor /= norm[:, 1, :, None] * norm[:, 0, None, :]
    a, b, c = factor[:, 0, 2], factor[:, 1, 1], factor[:, 2, 0]
    d = factor[:, 0, 1] - lean[:, 0] * a - mean[:, 1] * b
    e = factor[:, 1, 0] - lean[:, 1] * c - mean[:, 0] * b
    determinant = 4 * a * c - b * b
    safe = np.where(determinant < 0, determinant, -1.0)
    step = np.stack([(b * e - 2 * c * d) / safe, (b * d - 2 * a * e) / safe], -1)
    return step * half[:, None], determinant < 0
