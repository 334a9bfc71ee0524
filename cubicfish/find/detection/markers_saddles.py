"""X-corners near predictions that are too far off for a fit to lead from them to the corner."""

import numpy as np

from cubicfish.find.detection.corners import SCALES, check_rings, find_saddles
from cubicfish.find.detection.grids import Float32Array
from cubicfish.find.detection.pyramid import Pyramid
from cubicfish.find.detection.saddle import fit_saddles
from cubicfish.types import FloatArray, IntArray

# What filters and rings need around the places where corners may be, pixels.
_HALO = 10
_RING_NOISE = 3.0  # as of the corners of a whole photo


def corners_near(
    pyramid: Pyramid, pixel: FloatArray, travel: FloatArray, side: FloatArray
) -> tuple[FloatArray, IntArray]:
    """X-corners, as :func:`~.corners.find_corners` finds them, in boxes of a photo.

    Args:
        pyramid: the photo.
        pixel: (N, 2) middles of the boxes.
        travel: (N,) half their sides, pixels.
        side: (N,) side of a square there, which says at which size the photo is looked at.

    Returns:
        (M, 2) pixels, and (M,) which box each was found in.

    """
    places, boxes = [np.zeros((0, 2))], [np.zeros(0, np.intp)]
    levels = pyramid.levels_of(side)
    for level in np.unique(levels).tolist():
        rows = np.flatnonzero(levels == level)
        zoom = 2.0**level
        image = pyramid.levels[level]
        noise = max(pyramid.noise / zoom, 0.5)
        place, box = _find_in_boxes(image, pixel[rows] / zoom, travel[rows] / zoom, noise)
        rings, passed = check_rings(image, place, _RING_NOISE * noise)
        place, found = fit_saddles(image, rings.pixel, np.full(len(passed), 2.0))
        places.append(zoom * place[found])
        boxes.append(rows[box[passed[found]]])
    return np.concatenate(places), np.concatenate(boxes)


def _find_in_boxes(
    image: Float32Array, pixel: FloatArray, travel: FloatArray, noise: float
) -> tuple[FloatArray, IntArray]:
    """Saddles (M, 2) in boxes, and (M,) which box each is in: all boxes as one picture."""
    half = int(np.ceil(travel.max())) + _HALO
    size = 2 * half + 1
    middle = np.rint(pixel).astype(int)
    row, column = (middle[:, axis, None] + np.arange(-half, half + 1) for axis in (1, 0))
    row, column = row.clip(0, image.shape[0] - 1), column.clip(0, image.shape[1] - 1)
    boxes = image[row[:, :, None], column[:, None]].reshape(-1, size)
    place = np.concatenate([find_saddles(boxes, scale, noise)[0] for scale in SCALES])
    box = (np.rint(place[:, 1]) // size).astype(np.intp)
    box = box.clip(0, len(pixel) - 1)
    away = place - half - np.stack([np.zeros(len(box)), box * size], axis=-1)
    place = middle[box] + away
    near = (np.abs(place - pixel[box]) <= travel[box, None]).all(axis=1)
    return place[near], box[near]
