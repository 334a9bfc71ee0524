"""Sub-pixel refinement of corners whose place and local shape are known."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.grids import BoolArray, Float32Array, FloatArray, IntArray
from cubicfish_cli.detection.lattice import LocalFit
from cubicfish_cli.detection.nearby import nearest
from cubicfish_cli.detection.pyramid import Pyramid, build_pyramid
from cubicfish_cli.detection.saddle import SaddleFit, fit_saddles
from cubicfish_cli.detection.squares import Quadrants, quadrants
from cubicfish_cli.detection.verify import whole_corners

# Half-size of the window, pixels. Edges on a fisheye photo are bent, so a window much larger
# than the blur is biased; one under 2 px has too few pixels for six unknowns.
SMALLEST_HALF, USUAL_HALF = 2.0, 2.5
WIDER_HALVES = (3.5, 4.5, 6.0)
_OF_SIDE = 0.2
# Rise of a sharp corner within the window / contrast is 0.5 to 0.6. Below this the window lies
# within the blur, where noise is all that a small one measures.
_BLURRED = 0.12
_TRAVEL = 0.1  # of the side


def refine_pixels(
    image: Float32Array, pixel: FloatArray, side: FloatArray, contrast: FloatArray
) -> SaddleFit:
    """Fit saddles with the smallest window that the blur allows.

    Args:
        image: (H, W) lightly smoothed grey levels.
        pixel: (N, 2) start, within about a tenth of a side.
        side: (N,) shorter side of the squares around, pixels.
        contrast: (N,) bright minus dark, grey levels of ``image``.

    """
    half = np.clip(_OF_SIDE * side, SMALLEST_HALF, USUAL_HALF)
    travel = np.maximum(1.5, _TRAVEL * side)
    result = fit_saddles(image, pixel, half, travel)
    for wider in WIDER_HALVES:
        rows = (result.curvature < _BLURRED * contrast) | ~result.ok
        rows &= _OF_SIDE * side >= 0.8 * wider
        if not rows.any():
            break
        again = fit_saddles(image, pixel[rows], np.full(int(rows.sum()), wider), travel[rows])
        rows[rows] = again.ok
        result.pixel[rows] = again.pixel[again.ok]
        result.curvature[rows] = again.curvature[again.ok]
        result.ok[rows] = True
    return result


def refine_corners(
    image: npt.NDArray[np.generic] | Pyramid,
    pixel: FloatArray,
    jacobians: FloatArray,
    sign: IntArray | None = None,
) -> tuple[FloatArray, BoolArray]:
    """Move predicted corners to where the photo has them, and tell which are really there.

    The same sub-pixel method and the same tests as in :func:`~.finder.find_grids`.

    Args:
        image: (H, W) grey photo, or the pyramid built from it.
        pixel: (N, 2) predictions, within about a tenth of a square.
        jacobians: (N, 2, 2) columns dp/di and dp/dj: pixels a step along the grid's i and j.
        sign: (N,) +1 where the square between the steps +i and +j is bright, -1 where it is
            dark; None takes what the photo shows.

    Returns:
        (N, 2) refined pixels (the prediction itself where not ok) and (N,) ok.

    """
    pyramid = image if isinstance(image, Pyramid) else build_pyramid(image)
    pixel = np.asarray(pixel, float).reshape(-1, 2)
    refined, good = pixel.copy(), np.zeros(len(pixel), bool)
    side = np.hypot(jacobians[:, 0], jacobians[:, 1]).min(1)
    usable = pyramid.inside(pixel, 2.0) & (side > 2.0) & np.isfinite(side)
    rows = np.nonzero(usable)[0]
    if not len(rows):
        return refined, good
    fit = LocalFit(
        pixel=pixel[rows],
        step=jacobians[rows],
        bend=np.zeros((len(rows), 2, 3)),
        neighbours=np.full(len(rows), 4),
        side=side[rows],
        sound=np.ones(len(rows), bool),
    )
    guess = np.ones(len(rows), int) if sign is None else np.asarray(sign)[rows]
    square = quadrants(pyramid, pixel[rows], fit, guess)
    if sign is None:
        guess = np.where(square.contrast < 0, -1, 1)
        square = quadrants(pyramid, pixel[rows], fit, guess)
    found = refine_pixels(
        pyramid.levels[0], pixel[rows], side[rows], np.maximum(square.contrast, 0.0)
    )
    square = quadrants(pyramid, found.pixel, fit, guess)
    ok = found.ok & _like_the_others(square, found, pixel[rows], pyramid.noise)
    refined[rows[ok]], good[rows[ok]] = found.pixel[ok], True
    return refined, good


def _like_the_others(
    square: Quadrants, found: SaddleFit, pixel: FloatArray, noise: float
) -> BoolArray:
    _, index = nearest(pixel, pixel, 12)
    return whole_corners(
        square,
        found.curvature,
        np.median(square.contrast[index], axis=1),
        np.median(found.curvature[index], axis=1),
        noise,
    )
