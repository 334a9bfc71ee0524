"""Why a photo shows no grid."""

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.codes import Code
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.corners.detection.accept import USUAL_BLUR, is_regular
from cubicfish_cli.corners.detection.corners import find_corners
from cubicfish_cli.corners.detection.grids import Float32Array, FoundGrids
from cubicfish_cli.corners.detection.growth import clean
from cubicfish_cli.corners.detection.ladder import MOST_PIXELS
from cubicfish_cli.corners.detection.links import find_patches
from cubicfish_cli.corners.detection.nearby import nearest
from cubicfish_cli.corners.detection.pyramid import (
    SMALLEST_SIDE,
    Pyramid,
    build_pyramid,
    estimate_noise,
    reduced,
)
from cubicfish_cli.corners.detection.refine import refine_pixels

# Of the range of the photo's number type: brightest and darkest that 99 % of the pixels keep to.
_DARK, _BRIGHT = 0.08, 0.97
_FLAT = 8  # times the noise: less between dark and bright is no pattern
# Squares of a grid must be at least this large to be found.
_SMALLEST_SQUARE = 6
# From half of a photo's size to an eighth the steepest slopes grow fourfold, pixel for pixel, where
# an edge is far wider than a pixel, and stay alike where it is sharp; the middle means 3 px.
_SLOPE_GROWTH = 2.0
# Directions in which slopes are looked at. Where no edge lies across one, only shades are left of
# it, which are soft in a sharp photo too: slopes below this share of the steepest.
_DIRECTIONS, _LEAST_EDGE = 12, 0.25
# Dark squares that no longer touch: how many, how full of their own rectangle, how long at most.
_LEAST_SPOTS, _FULL, _LONG, _LEAST_AREA = 8, 0.7, 2.5, 9


def explain_no_grids(image: npt.NDArray[np.generic], found: FoundGrids) -> Finding:
    """What is wrong with a photo in which no grid was found.

    Args:
        image: (H, W) grey levels.
        found: what :func:`~.finder.find_grids` found in it.

    """
    height, width = image.shape
    if min(height, width) < SMALLEST_SIDE:
        return Finding(code=Code.PHOTO_TOO_SMALL, figures={"width": width, "height": height})
    zoom = 1
    while height * width > MOST_PIXELS * zoom * zoom:
        zoom *= 2
    small = np.asarray(reduced(image, zoom))
    full = float(np.iinfo(small.dtype).max) if np.issubdtype(small.dtype, np.integer) else None
    sample = small[:: max(1, height // 500), :: max(1, width // 500)]
    low, high = np.percentile(sample, [1, 99])
    if full is not None and high < _DARK * full:
        return Finding(code=Code.TOO_DARK)
    too_bright = full is not None and low > _BRIGHT * full
    if high <= low and not too_bright:
        return Finding(code=Code.NO_PATTERN)
    pyramid = build_pyramid(small)
    faint = (high - low) * pyramid.gain < _FLAT * pyramid.noise
    if faint and not too_bright and _is_noise(pyramid):
        return Finding(code=Code.LOW_CONTRAST)
    if full is not None and _are_dark_squares_apart(small >= _BRIGHT * full):
        return Finding(code=Code.TOO_BRIGHT, case="burnt")
    side, blur = _measure_unaccepted(pyramid)
    if side < _SMALLEST_SQUARE:
        figures = {"side_px": side * zoom, "least_px": _SMALLEST_SQUARE * zoom}
        return Finding(code=Code.SQUARES_TOO_SMALL, figures=figures)
    if too_bright:
        return Finding(code=Code.TOO_BRIGHT)
    if blur > USUAL_BLUR * side or _is_nothing_sharp(pyramid):
        return Finding(code=Code.BLURRED)
    if len(found.refused) == 0:
        return Finding(code=Code.NO_CORNER)
    return Finding(code=Code.NO_CHECKERBOARD)


def _measure_unaccepted(pyramid: Pyramid) -> tuple[float, float]:
    """Side and blur, px, of the squares of the largest regular patch; (inf, 0) without any."""
    corners = find_corners(pyramid)
    for patch in find_patches(pyramid, corners)[:1]:
        lattice = patch.lattice(corners)
        clean(lattice)
        cells = lattice.cells()
        if is_regular(lattice, cells):
            fit = lattice.fit(cells)
            found = refine_pixels(pyramid, lattice.at(cells), fit)
            return float(np.median(fit.side)), float(np.median(found.blur.max(1)))
    return np.inf, 0.0


def _is_noise(pyramid: Pyramid) -> bool:
    """Tell whether what the noise was estimated from fades at half the size, unlike texture."""
    return len(pyramid.levels) > 1 and estimate_noise(pyramid.levels[1]) < 0.5 * pyramid.noise


def _is_nothing_sharp(pyramid: Pyramid) -> bool:
    """Tell whether even the sharpest edges of a photo are several pixels wide.

    Where the camera moved, those along its motion are sharp all the same: each direction counts.
    """
    if len(pyramid.levels) < 4:
        return False
    small, smallest = _find_steepest(pyramid.levels[1]), _find_steepest(pyramid.levels[3])
    edges = smallest > _LEAST_EDGE * max(small.max(), smallest.max())
    return bool((smallest > _SLOPE_GROWTH * small)[edges].any())


def _find_steepest(level: Float32Array) -> FloatArray:
    """(_DIRECTIONS,) the steepest slopes towards directions that share half a turn."""
    along, down = (cv2.Sobel(level, cv2.CV_32F, 1 - k, k, ksize=3) for k in (0, 1))
    turns = np.pi / _DIRECTIONS * np.arange(_DIRECTIONS)
    slopes = (np.cos(turn) * along + np.sin(turn) * down for turn in turns)
    return np.array([np.percentile(np.abs(slope), 99.9) for slope in slopes])


def _are_dark_squares_apart(burnt: npt.NDArray[np.bool_]) -> bool:
    """Tell whether dark squares stand alone in burnt-out white as those of a chequerboard would.

    Each has others like it on opposite sides, at equal distances, and these lie beyond its
    corners. Windows in a wall lie beyond each other's sides; letters are neither full nor alike.
    """
    # Components, each with its holes: what stands in a hole is a component of its own.
    dark = (~burnt).astype(np.uint8)
    contours, tree = cv2.findContours(dark, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    spots = []
    for contour, (*_, parent) in zip(contours, [] if tree is None else tree[0], strict=True):
        if parent >= 0:
            continue
        (x, y), (width, height), degrees = cv2.minAreaRect(contour)
        full = cv2.contourArea(contour) >= max(_LEAST_AREA, _FULL * width * height)
        if full and 1 / _LONG < width / height < _LONG:
            spots.append((x, y, np.radians(degrees), width * height))
    if len(spots) < _LEAST_SPOTS:
        return False
    place, turn, area = np.split(np.array(spots), [2, 3], axis=1)
    distance, index = nearest(place, place, 5)
    like = np.abs(np.log(area[index[:, 1:], 0] / area)) < np.log(2.0)
    towards = place[index[:, 1:]] - place[:, None]
    across = nearest((place[:, None] - towards).reshape(-1, 2), place, 1)[0].reshape(len(spots), -1)
    paired = like & (across < 0.2 * distance[:, 1:])
    corner = np.arctan2(towards[..., 1], towards[..., 0]) - turn
    off: FloatArray = np.abs((corner + 0.25 * np.pi) % (0.5 * np.pi) - 0.25 * np.pi)
    return bool(
        (paired.sum(1) >= 2).sum() >= _LEAST_SPOTS // 2 and np.median(off[paired]) > np.pi / 6
    )
