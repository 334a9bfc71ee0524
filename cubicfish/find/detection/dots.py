"""A grid of dots, which is not read but named.

Dots are filled ellipses that stand alone, dark on light or light on dark. Those of a grid have
others like them on opposite sides, at equal distances.
"""

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.nearby import nearest
from cubicfish.find.detection.pyramid import Pyramid, bilinear
from cubicfish.types import BoolArray, FloatArray, IntArray

# A dot has so many pixels at least, and its outline is this round once it is stretched to a circle:
# 1 is an ellipse, 0.91 a regular hexagon, 0.79 any parallelogram.
_LEAST_AREA, _ROUND = 20, 0.92
# No longer than this: a dot that is seen from aside, and no stroke.
_LONG = 4.0
# A pixel is dark, or light, that differs from the mean around it by so many times the noise, within
# these shares of the photo's contrast. Around it is this part of the photo's shorter side.
_CLEAR, _CONTRAST, _AROUND = 5.0, (0.1, 0.3), 8
# A grid has as many dots as the smallest that are sold, 4x11 or 7x6, have in half of them.
_LEAST_DOTS = 20
# How light it is halfway between neighbours, from the dot (0) to the middle of the cell (1): 0.5
# where squares of a chequerboard touch, which blur makes into dots, and 1 between dots.
_LIGHT_BETWEEN = 0.7
# Neighbours that are looked at, how far off the opposite one may be (of the distance), and how
# alike their areas are.
_NEIGHBOURS, _OPPOSITE, _LIKE = 5, 0.2, 2.0


def count_dots(pyramid: Pyramid) -> int:
    """How many dots lie in a grid, in a photo of half a million pixels or so; 0 where none do."""
    image = np.clip(np.rint(pyramid.levels[0]), 0, 255).astype(np.uint8)
    low, high = np.percentile(image[::3, ::3], [1, 99])
    # In a drawing without noise all that is there is estimated from edges.
    least = np.clip(_CLEAR * pyramid.noise, *(np.array(_CONTRAST) * (high - low)))
    block = max(3, min(image.shape) // _AROUND) | 1
    counts = []
    for side in (image, 255 - image):
        mean = cv2.boxFilter(side, -1, (block, block))
        spots = np.asarray(cv2.subtract(mean, side) > least, np.uint8)
        counts.append(_count_in_grid(side, *_find_ellipses(spots)))
    return max(counts)


def _find_ellipses(spots: npt.NDArray[np.uint8]) -> tuple[FloatArray, FloatArray]:
    """Middles (N, 2) and areas (N,) of the spots that are filled ellipses, pixels."""
    contours, tree = cv2.findContours(spots, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    found = []
    height, width = spots.shape
    for contour, (*_, child, parent) in zip(contours, [] if tree is None else tree[0], strict=True):
        if parent >= 0 or child >= 0 or cv2.contourArea(contour) < _LEAST_AREA:
            continue
        outline = contour[:, 0].astype(float)
        if (outline.min(0) < 1).any() or (outline.max(0) > (width - 2, height - 2)).any():
            continue
        moments = cv2.moments(contour)
        area, middle = moments["m00"], np.array([moments["m10"], moments["m01"]]) / moments["m00"]
        spread = (
            np.array([[moments["mu20"], moments["mu11"]], [moments["mu11"], moments["mu02"]]])
            / area
        )
        sizes, axes = np.linalg.eigh(spread)
        if sizes[0] <= 0 or sizes[1] > _LONG**2 * sizes[0]:
            continue
        circle = (outline - middle) @ axes / np.sqrt(sizes)
        hull = cv2.convexHull(circle.astype(np.float32))
        length = cv2.arcLength(hull, closed=True)
        inside = area / np.sqrt(sizes.prod())
        if 4 * np.pi * min(cv2.contourArea(hull), inside) > _ROUND * length**2:
            found.append((*middle, area))
    table = np.array(found).reshape(-1, 3)
    return table[:, :2], table[:, 2]


def _count_in_grid(side: npt.NDArray[np.uint8], place: FloatArray, area: FloatArray) -> int:
    """How many of the dark spots of a picture are dots that hang together in a grid."""
    if len(place) < _LEAST_DOTS:
        return 0
    paired, towards, beside = find_opposite_pairs(place, area, _NEIGHBOURS)
    inner = paired.sum(1) >= 2
    # Those at the rim have others beyond them on one side only.
    in_grid = inner.copy()
    in_grid[beside[inner][paired[inner]]] = True
    count = int(in_grid.sum())
    if count < max(_LEAST_DOTS, len(place) // 2):
        return 0
    spot, step = place[np.nonzero(paired)[0]], towards[paired]
    aside = 0.5 * np.stack([step - step[:, ::-1] * (1, -1), step + step[:, ::-1] * (1, -1)])
    dark, between = (_sample(side, spot + share * step) for share in (0.0, 0.5))
    light = np.maximum(*(_sample(side, spot + one) for one in aside)) - dark
    clear = light > 0
    share = (between - dark)[clear] / light[clear]
    return count if clear.any() and np.median(share) > _LIGHT_BETWEEN else 0


def _sample(side: npt.NDArray[np.uint8], pixel: FloatArray) -> FloatArray:
    return np.asarray(bilinear(np.asarray(side, np.float32), pixel.T[:, None])[0], float)


def find_opposite_pairs(
    place: FloatArray, area: FloatArray, count: int
) -> tuple[BoolArray, FloatArray, IntArray]:
    """Which neighbours of spots have their counterparts on the other side.

    Args:
        place: (N, 2) middles of the spots, more than one.
        area: (N,) their areas.
        count: neighbours K that each is asked for, itself among them.

    Returns:
        (N, K - 1) whether the neighbour is as large and has an opposite one; (N, K - 1, 2) where
        it is from the spot; (N, K - 1) which spot it is.

    """
    distance, index = nearest(place, place, count)
    beside = index[:, 1:]
    like = np.abs(np.log(area[beside] / area[:, None])) < np.log(_LIKE)
    towards = place[beside] - place[:, None]
    across = nearest((place[:, None] - towards).reshape(-1, 2), place, 1)[0].reshape(len(place), -1)
    return like & (across < _OPPOSITE * distance[:, 1:]), towards, beside
