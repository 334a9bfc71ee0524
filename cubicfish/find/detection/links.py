"""Links between corners along the edges of squares, and the pieces that they make: grids' seeds."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from cubicfish.find.detection.corners import XCorners
from cubicfish.find.detection.lattice import Lattice
from cubicfish.find.detection.nearby import nearest
from cubicfish.find.detection.pyramid import Pyramid
from cubicfish.types import BoolArray, FloatArray, IntArray

# The four nearest corners along the arms are among this many even when markers inside the
# squares add some corners of their own.
_NEIGHBOURS = 28
# Half octaves of pixels. A corner of this radius (8 px) is also compared with those of no smaller
# radius: where squares are large, each marker adds corners by the dozen, of small radius.
_FAR = 6
_POINTING = np.radians(28)  # an arm may point that far past the neighbour: edges are bent
# How much dearer a link is for each radian by which its edge is no arc, as an edge of a square is
# under any lens; one that leads off to a marker in the square is not.
_NO_ARC = 4.0
_CONTRAST_RATIO = 3.0
# Where an edge is looked at: this far along it and, of its length, to either side. Edges that meet
# at 27 degrees or more are then not mixed up.
ALONG_EDGE = np.linspace(0.2, 0.8, 7)
ASIDE, LEAST_ASIDE = 0.1, 1.2  # of the length, px
# The same where white bleeds, and how much dearer such a link is: no other is left for it.
_FAR_ASIDE, _BLEEDING = 0.22, 1e3
# Of the corner's contrast: what an edge shows, in the middle of its samples and at worst.
EDGE_MEDIAN, EDGE_LEAST = 0.30, 0.10
# Step of arm 0, 1, 2, 3 of a corner that is not rotated: clockwise on screen.
_DIRECTIONS = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])


def _find_links(pyramid: Pyramid, corners: XCorners) -> IntArray:
    """Link corners whose arms point at each other along a visible edge.

    An arm is called 4 * corner + its number there: (N, 4) says to which each leads, or -1.

    Brightness left and right of an edge swaps at every X-corner, so an arm with its bright
    side clockwise (even) must meet one with its bright side counter-clockwise (odd): a link
    cannot jump over a corner.
    """
    count = len(corners.pixel)
    if count < 4:
        return np.full((count, 4), -1)
    p, q = _find_neighbours(corners)
    towards = (corners.pixel[q] - corners.pixel[p]).T.copy()
    direction = np.arctan2(towards[1], towards[0])
    arm_p, miss_p = _find_pointing_arm(corners.angle[p], direction)
    rows = np.flatnonzero(np.abs(miss_p) < _POINTING)
    p, q, arm_p, miss_p, direction = p[rows], q[rows], arm_p[rows], miss_p[rows], direction[rows]
    arm_q, miss_q = _find_pointing_arm(corners.angle[q], direction + np.pi)
    rows = np.flatnonzero((np.abs(miss_q) < _POINTING) & ((arm_p + arm_q) % 2 == 1))
    # Most pairs have come twice, from either end.
    pair, first = np.unique(p[rows] * count + q[rows], return_index=True)
    p, q, rows = pair // count, pair % count, rows[first]
    arm_p, arm_q, miss_p, miss_q = arm_p[rows], arm_q[rows], miss_p[rows], miss_q[rows]
    start, end = corners.pixel[p].T, corners.pixel[q].T
    length = np.hypot(*(end - start))
    # The ends of an arc miss the chord alike, to opposite sides.
    cost = length * (1 + np.abs(miss_p) + np.abs(miss_q) + _NO_ARC * np.abs(miss_p + miss_q))
    scale = np.minimum(corners.contrast[p], corners.contrast[q])
    scale *= np.where(arm_p % 2 == 0, 1, -1)
    # Points and tangents at the ends of each edge (4, 2, N).
    tangent = (
        length * _make_unit(corners.angle[p, arm_p]),
        -length * _make_unit(corners.angle[q, arm_q]),
    )
    ends = np.stack([start, end, *tangent])
    difference = _measure_edge(pyramid, ends, length, ASIDE) / scale
    seen = edge_is_seen(difference)
    # Where white bleeds the dark squares draw back from the line between their corners.
    rest = np.flatnonzero(~seen)
    far = _measure_edge(pyramid, ends[..., rest], length[rest], _FAR_ASIDE)
    difference[:, rest] = far / scale[rest]
    seen[rest] = edge_is_seen(difference[:, rest])
    cost[rest] *= _BLEEDING
    cost /= np.clip(difference.min(0), EDGE_LEAST, 1.0)  # an edge that is seen all along is one
    p, q, arm_p, arm_q, cost = p[seen], q[seen], arm_p[seen], arm_q[seen], cost[seen]
    ends_of, back = (p, q), (arm_p, arm_q)
    return _keep_mutual(
        count,
        *(
            np.concatenate(both)
            for both in (ends_of, ends_of[::-1], back, back[::-1], (cost, cost))
        ),
    )


def _find_neighbours(corners: XCorners) -> tuple[IntArray, IntArray]:
    """Pairs of near corners whose contrasts are alike, the lower index first; most come twice.

    Corners look for neighbours among those that are not much weaker, octave by octave of
    contrast, and once more among those whose pattern reaches as far as theirs: otherwise the
    many weak corners of texture and noise, and the small ones of markers, would crowd out the
    true neighbours.
    """
    octave = np.floor(np.log2(np.maximum(corners.contrast, 1e-3))).astype(int)
    size = np.rint(2 * np.log2(np.maximum(corners.radius, 1.0))).astype(int)
    pairs = []
    for level in np.unique(octave):
        here, there = octave == level, octave >= level
        pairs.append(_find_nearest(corners, here, there))
        for far in np.unique(size[here & (size >= _FAR)]):
            pairs.append(_find_nearest(corners, here & (size == far), there & (size >= far)))
    p, q, length = (np.concatenate(part) for part in zip(*pairs, strict=True))
    ratio = corners.contrast[q] / corners.contrast[p]
    near = (p != q) & (length > 2.0) & (ratio < _CONTRAST_RATIO) & (ratio > 1 / _CONTRAST_RATIO)
    p, q = p[near], q[near]
    return np.minimum(p, q), np.maximum(p, q)


def _find_nearest(
    corners: XCorners, here: BoolArray, there: BoolArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """The nearest of some corners to each of some: pairs of indices, and their distances."""
    of, among = np.nonzero(here)[0], np.nonzero(there)[0]
    length, index = nearest(corners.pixel[of], corners.pixel[among], _NEIGHBOURS + 1)
    return np.repeat(of, index.shape[1]), among[index.ravel()], length.ravel()


def edge_is_seen(difference: FloatArray) -> BoolArray:
    """Judge (7, N) differences across N edges, relative to the corner's contrast."""
    clear = np.count_nonzero(difference > EDGE_MEDIAN, axis=0)  # more than half: the median is
    return np.asarray((clear > len(difference) // 2) & (difference.min(0) > EDGE_LEAST))


def edge_difference(
    pyramid: Pyramid, points: FloatArray, aside: FloatArray, length: FloatArray
) -> FloatArray:
    """Brightness on one side of a curve minus that on the other.

    Args:
        pyramid: the photo.
        points: (2, K, N) points of each curve, pixels.
        aside: (2, K, N) or (2, 1, N) from the curve to where its first side is measured, pixels.
        length: (N,) distance of the curve's ends, pixels.

    Returns:
        (K, N) grey levels.

    """
    count = points.shape[1]
    both = pyramid.sample_columns(np.concatenate([points + aside, points - aside], axis=1), length)
    return both[:count].astype(float) - both[count:]


def _make_unit(angle: FloatArray) -> FloatArray:
    return np.stack([np.cos(angle), np.sin(angle)])


def _find_pointing_arm(angles: FloatArray, direction: FloatArray) -> tuple[IntArray, FloatArray]:
    """The arm that points best, and by how much it misses, signed."""
    miss = angles - direction[:, None]
    miss -= 2 * np.pi * np.rint(miss / (2 * np.pi))
    arm = np.abs(miss).argmin(1)
    return arm, miss[np.arange(len(arm)), arm]


# Points of a cubic Hermite curve, and its tangents, along the edge: factors (K, 4) of its start,
# its end, and the tangents there.
_T = ALONG_EDGE
_HERMITE = np.stack(
    [1 + _T**2 * (2 * _T - 3), _T**2 * (3 - 2 * _T), _T * (1 - _T) ** 2, -(_T**2) * (1 - _T)],
    axis=1,
)
_SLOPE = np.stack(
    [-6 * _T * (1 - _T), 6 * _T * (1 - _T), (1 - _T) * (1 - 3 * _T), _T * (3 * _T - 2)], axis=1
)


def _measure_edge(
    pyramid: Pyramid, ends: FloatArray, length: FloatArray, aside: float
) -> FloatArray:
    """Difference (K, N) across the cubic Hermite curves with such ends (4, 2, N).

    These are start, end, and the tangents there, as long as the curve's chord, pixels.
    """
    flat, shape = ends.reshape(4, -1), (len(_T), *ends.shape[1:])
    points = (_HERMITE @ flat).reshape(shape).swapaxes(0, 1)
    tangent = (_SLOPE @ flat).reshape(shape)
    x, y = tangent[:, 0], tangent[:, 1]
    offset = np.maximum(aside * length, LEAST_ASIDE) / np.maximum(np.hypot(x, y), 1e-9)
    # Clockwise of the curve.
    return edge_difference(pyramid, points, np.stack([-y * offset, x * offset]), length)


def _keep_mutual(
    count: int, p: IntArray, q: IntArray, arm_p: IntArray, arm_q: IntArray, cost: FloatArray
) -> IntArray:
    """Keep the cheapest link of each arm where it is the cheapest for the other end too."""
    order = np.lexsort((q, cost))
    start, end = (4 * p + arm_p)[order], (4 * q + arm_q)[order]
    best = np.full(4 * count, -1)
    best[start[::-1]] = end[::-1]  # the last to write is the cheapest
    linked = best >= 0
    linked[linked] = best[best[linked]] == np.nonzero(linked)[0]
    best[~linked] = -1
    return best.reshape(count, 4)


def _keep_squares(links: IntArray) -> IntArray:
    """Keep the links that are a side of a closed square: texture rarely closes any."""
    # A row more, so that broken walks end there.
    ends = np.concatenate([links, np.full((1, 4), -1)]).ravel()
    start = np.arange(links.size)
    at, closed = start, np.ones(links.size, bool)
    for _ in range(4):
        arrive = ends[at]
        closed &= arrive >= 0
        at = arrive // 4 * 4 + (arrive - 1) % 4  # from there on by the arm to the left
    closed &= at == start
    # A link is the side of two squares, one seen from either end.
    back = (ends >= 0)[:-4]
    back[back] = closed[ends[:-4][back]]
    return np.where((closed | back).reshape(links.shape), links, -1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """One connected piece.

    Attributes:
        corner: (N,) indices of the corners.
        cells: (N, 2) their integer coordinates.
        parity: +1 when the square (0, 0)..(1, 1) is bright, else -1.

    """

    corner: IntArray
    cells: IntArray
    parity: int

    def lattice(self, corners: XCorners) -> Lattice:
        """The grid that it is the beginning of."""
        pixel, contrast = corners.pixel[self.corner], corners.contrast[self.corner]
        return Lattice.from_cells(self.cells, pixel, contrast, self.parity)


def find_patches(pyramid: Pyramid, corners: XCorners) -> list[Patch]:
    """Pieces of corners that links in closed squares connect, the seeds of grids; largest first.

    Pieces of the same size come in the order of their corners' summed strengths.

    A corner that is reached with two different coordinates stays where it was first put, a
    second corner in the same cell is left out; growing repairs either.
    """
    links = _keep_squares(_find_links(pyramid, corners))
    strength = corners.contrast * corners.radius
    linked = np.flatnonzero((links >= 0).any(1)).tolist()
    ends = dict(zip(linked, links[linked].tolist(), strict=True))
    steps = [tuple(step) for step in _DIRECTIONS.tolist()]
    visited: set[int] = set()
    patches = []
    for first in linked:
        if first in visited:
            continue
        # Arm a of a corner with rotation r points along _DIRECTIONS[(r + a) % 4].
        place: dict[tuple[int, int], int] = {(0, 0): first}
        state = {first: (0, 0, 0)}
        visited.add(first)
        queue = deque([first])
        while queue:
            here = queue.popleft()
            i, j, rotation = state[here]
            for a, end in enumerate(ends[here]):
                there, arrival = divmod(end, 4)
                if there < 0 or there in visited:
                    continue
                direction = (rotation + a) % 4
                cell = (i + steps[direction][0], j + steps[direction][1])
                if cell in place:
                    continue
                visited.add(there)
                place[cell] = there
                state[there] = (*cell, (direction + 2 - arrival) % 4)
                queue.append(there)
        members = np.fromiter(state, int, len(state))
        coordinates = np.array([state[member] for member in state])
        # Arms are counted from one with its bright side clockwise: even arms lead along a
        # bright sector, so an even rotation means that the quadrant (+i, +j) is bright.
        bright = (coordinates[:, 2] % 2 == 0) == (coordinates[:, :2].sum(1) % 2 == 0)
        patches.append(
            Patch(
                corner=members,
                cells=coordinates[:, :2],
                parity=1 if 2 * bright.sum() >= len(bright) else -1,
            )
        )
    return sorted(patches, key=lambda p: (-len(p.corner), -float(strength[p.corner].sum())))
