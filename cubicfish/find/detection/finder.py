"""Photo -> grids of sub-pixel checkerboard corners: a ladder of scales, from the coarse end.

The photo is searched reduced (`search.py`), where a board costs least, and where what blurs or
bleeds at full size does neither. Finer scales are searched as a whole only where boards are still
missing, and otherwise where pieces of small squares were seen. Then each grid is followed to finer
scales (`follow.py`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cubicfish.find.detection.follow import SAME, SMALL_PX, follow, in_order, size_of
from cubicfish.find.detection.grids import FoundGrids
from cubicfish.find.detection.ladder import Box, Ladder, join_boxes
from cubicfish.find.detection.medians import median
from cubicfish.find.detection.nearby import nearest
from cubicfish.find.detection.pyramid import (
    CLOSE,
    SMALLEST_SIDE,
    build_pyramid,
    enlarged,
    reduced,
)
from cubicfish.find.detection.search import (
    NOTHING_SEEN,
    SearchResult,
    Seen,
    is_beyond_chance_among,
    search,
)
from cubicfish.types import FloatArray

# A piece of a board is searched for this far around: times its own extent, squares at least.
_AROUND, _LEAST_AROUND = 1.0, 8
# What is no more squares away from a grid's corners is beside it.
_BESIDE = 1.5
# A grid is another one when it has fewer of its corners in common with those that are known.
_MOST_SHARED = 0.5
# A part of a board that has this share of its corners shows that it was seen: what else of it there
# is lies beside.
_GOOD_PART = 0.125


def find_grids(
    image: npt.NDArray[np.generic], boards: Sequence[tuple[int, int]] = ()
) -> FoundGrids:
    """Find all checkerboard grids, whole or in part, in a grey photo.

    Boards may be cut by the photo's border, the image circle or each other, bent by a fisheye
    lens beyond 180 degrees, dim or bright, blurred, or burnt so that dark squares no longer touch.
    Squares may be 6 px small, or 4 px where pieces of them are seen. In a photo of more than
    :data:`~.ladder.MOST_PIXELS` these are pixels of the reduced photo that is searched. Memory
    beyond the photo's own stays under 1 GB.

    Args:
        image: (H, W) grey levels, uint8, uint16 or float.
        boards: (columns, rows) of the inner corners of each board that may be there. Until all
            are seen, finer scales are searched for them as a whole; then they are searched no more.

    """
    height, width = image.shape
    size = (width, height)
    if min(height, width) < SMALLEST_SIDE:
        return FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=size)
    ladder = Ladder(image=image)
    sizes = [in_order(board) for board in boards]
    found, refused = _search_scales(ladder, sizes)
    followed = (follow(ladder, one, sizes) for one in found)
    grids = sorted((grid for grid in followed if grid is not None), key=lambda grid: -len(grid))
    return FoundGrids(grids=tuple(grids), refused=refused, image_size=size)


def _search_scales(
    ladder: Ladder, sizes: Sequence[tuple[int, int]]
) -> tuple[list[Seen], FloatArray]:
    """Grids, each at the coarsest scale that shows it, and candidates (N, 2) of none, pixels."""
    zoom, result = _search_coarse(ladder)
    found = list(result.grids)
    refused = enlarged(result.refused.pixel, zoom)
    boxes = _choose_boxes(ladder, [result], zoom, found)
    for finer in ladder.finer(zoom):
        if _are_all_seen(found, sizes):
            break
        # A board of tiny squares shows nothing at a coarse scale, but pieces at the photo's own.
        if finer == CLOSE or (found and not sizes):
            results = [_search_box(ladder, box, finer) for box in boxes]
        else:
            results = [search(ladder.at(finer), finer, [one.at(finer) for one in found])]
            if not found:
                refused = enlarged(results[0].refused.pixel, finer)
        for part in results:
            likely = [one for one in part.grids if _is_beyond_chance(one, finer / zoom, result)]
            found += _find_new(found, likely)
        boxes = _choose_boxes(ladder, results, finer, found)
    return found, refused


def _search_coarse(ladder: Ladder) -> tuple[float, SearchResult]:
    """What the photo shows at its coarsest zoom, or at twice that where only this shows grids."""
    zoom: float = ladder.coarsest
    result = search(ladder.at(zoom), zoom)
    if result.grids or not ladder.is_possible(2 * zoom):
        return zoom, result
    coarser = search(ladder.at(2 * zoom), 2 * zoom)
    # Chance had a try for each crossing that the finer scale shows.
    kept = [one for one in coarser.grids if _is_beyond_chance(one, 2.0, result)]
    return (2 * zoom, replace(coarser, grids=kept)) if kept else (zoom, result)


def _search_box(ladder: Ladder, box: Box, zoom: float) -> SearchResult:
    """What a part of a photo shows, in pixels of the whole photo at a zoom."""
    step = max(1, int(zoom))
    left, top = box.left // step * step, box.top // step * step
    small = reduced(ladder.image[top : box.bottom, left : box.right], zoom)
    if min(small.shape) < SMALLEST_SIDE:
        return NOTHING_SEEN
    pyramid = build_pyramid(small)
    gain = ladder.at(zoom).gain / pyramid.gain
    return search(pyramid, zoom).moved(np.array([left, top]) / zoom, gain)


def _is_beyond_chance(seen: Seen, zoom: float, everywhere: SearchResult) -> bool:
    """Judge a grid that a part or a reduced photo shows by what the whole photo shows besides."""
    return is_beyond_chance_among(seen.lattice, everywhere.refused, zoom)


def _choose_boxes(
    ladder: Ladder, results: Sequence[SearchResult], zoom: float, found: Sequence[Seen]
) -> list[Box]:
    """Where searches at a zoom saw pieces of squares too small to be sure of, far from any grid.

    What is beside a grid is found by its growth.
    """
    boxes = []
    for piece in [piece for result in results for piece in result.pieces]:
        side = median(nearest(piece, piece, 2)[0][:, 1])
        pixel = enlarged(piece, zoom)
        if side < SMALL_PX and not any(_is_beside(pixel, one) for one in found):
            margin = max(_AROUND * float(np.ptp(piece, axis=0).max()), _LEAST_AROUND * side)
            boxes.append(Box.around(pixel, zoom * margin, ladder.image.shape))
    return join_boxes(boxes)


def _is_beside(pixel: FloatArray, one: Seen) -> bool:
    """Whether some pixels (N, 2) of the photo lie within a grid or next to it."""
    distance, index = nearest(pixel, one.pixel, 1)
    return bool((distance[:, 0] < _BESIDE * one.side[index[:, 0]]).any())


def _find_new(found: Sequence[Seen], more: Sequence[Seen]) -> list[Seen]:
    """Those of some grids that are not found yet."""
    if not found:
        return list(more)
    known = np.concatenate([one.pixel for one in found])
    return [
        one for one in more
        if (nearest(one.pixel, known, 1)[0][:, 0] < SAME * one.side).mean() < _MOST_SHARED
    ]  # fmt: skip


def _are_all_seen(found: Sequence[Seen], sizes: Sequence[tuple[int, int]]) -> bool:
    """Whether some boards are among the grids: all corners of each, or a good part of as many."""
    if not sizes:
        return False
    seen = (size_of(one.lattice) for one in found)
    whole = Counter(size for size in seen if size is not None)
    least = _GOOD_PART * min(columns * rows for columns, rows in sizes)
    parts = sum(int(one.lattice.known.sum()) >= least for one in found)
    return parts >= len(sizes) or not Counter(sizes) - whole
