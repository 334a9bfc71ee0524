"""From the labelings of one photo that could be to names that may be relied on."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from cubicfish.find.detection.grids import Grid
from cubicfish.find.identification.allowed_offsets import (
    AllowedOffsets,
    find_allowed_offsets,
)
from cubicfish.find.identification.ends import Ends, clearly_more, doubtful_rims
from cubicfish.find.identification.identified import Decided
from cubicfish.find.identification.search import Labelings
from cubicfish.geometry import similarity
from cubicfish.target.placement import SAME, Placement
from cubicfish.types import BoolArray, FloatArray, IntArray

# Below this ratio of the runner-up's RMS to the winner's a name is not settled.
CLEAR_RATIO = 1.3
# No RMS is taken to be smaller than this: what is below is not what tells labelings apart.
_NOISE_FLOOR_PX = 0.05
# A rival that has no place for a grid which the winner places well misses it by this share of
# the distance of neighbouring corners: a grid that is none of the boards hardly fits by chance.
_LEFT_OUT_STEPS = 0.5
# Part of a board that may slide is kept only if its corners are at least one in so many.
_LEAST_SHARE = 3
# Labelings cost the same up to this factor where a symmetry is exact.
_SAME_COST = 1.001
# No solid has more rotations than the cube's 24: more places than that are not symmetries.
_MOST_SYMMETRIES = 24


@dataclass(frozen=True, kw_only=True, eq=False)
class Decision:
    """The names of one photo's grids.

    Attributes:
        verdict: for each grid.
        side: (G,) side of its place, -1 where it has none.
        offset: (G, 2).
        ratio: (G,) RMS of the best labeling that differs in this grid over the chosen one's,
            both over the grids in which they differ; inf without a rival.
        rms_px: (G,) of the chosen labeling, pixels; NaN where there is none.
        rotation, translation: (3, 3), (3,) camera_from_world of the chosen labeling; NaN
            without one.

    """

    verdict: tuple[Decided, ...]
    side: IntArray
    offset: IntArray
    ratio: FloatArray
    rms_px: FloatArray
    rotation: FloatArray
    translation: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Photo:
    """What deciding needs of a photo."""

    grids: Sequence[Grid]
    sides: Placement

    def world(self, grid: int, side: int, offset: IntArray) -> FloatArray:
        """World points (4, 3) of the grid's bounding cells: they fix its place."""
        low, high = self.grids[grid].cells.min(axis=0), self.grids[grid].cells.max(axis=0)
        ends = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
        form = self.sides.world_from_grid(np.array([side]), offset[None])[0]
        return np.column_stack([ends, np.ones(4)]) @ form.T

    def worlds(self, side: IntArray, offset: IntArray) -> FloatArray:
        return np.concatenate([self.world(g, int(side[g]), offset[g]) for g in _list_named(side)])

    def span(self, grid: int, side: int, offset: IntArray) -> tuple[IntArray, IntArray]:
        """The first and the last column and row (2,) that a grid has on its board."""
        cells = self.grids[grid].cells
        corners = np.array([cells.min(axis=0), cells.max(axis=0)])
        ends = self.sides.board_cells(side, offset, corners)
        return ends.min(axis=0), ends.max(axis=0)

    def covered(self, side: IntArray, offset: IntArray) -> tuple[tuple[int, ...], ...]:
        """For each grid with a place, its board and the cells that it covers there."""
        parts = []
        for g in _list_named(side):
            first, last = self.span(g, int(side[g]), offset[g])
            parts.append((int(self.sides.board[side[g]]), *first.tolist(), *last.tolist()))
        return tuple(parts)

    def whole_count(self, side: IntArray) -> int:
        """How many grids fill a board of their side's size without a gap."""
        count = 0
        for g in _list_named(side):
            first, last = self.span(g, int(side[g]), np.zeros(2, np.intp))
            extent = last - first + 1
            full = len(self.grids[g]) == extent.prod()
            count += full and bool((extent == self.sides.size[side[g]]).all())
        return count

    def symmetric(self, labelings: Labelings, first: int, second: int) -> bool:
        """Whether a symmetry of the whole target takes one labeling to the other."""
        motion = similarity(
            self.worlds(*_place(labelings, first)), self.worlds(*_place(labelings, second))
        )
        return self.sides.landing(motion.scale * motion.rotation, motion.shift) is not None

    def most_upright(self, labelings: Labelings, among: Iterable[int]) -> int:
        """Of labelings that look alike: the least turned in the photo, then the most central.

        A board that is longer one way and alone is the same whichever side is called x. So its
        long side is to run to the right or down, and what is left is decided along it too.
        """

        def order(k: int) -> tuple[float, ...]:
            side, offset = _place(labelings, k)
            off = self.off_middle(side, offset)
            along, across = off.sum(axis=0).tolist()
            shift = {None: (), 0: (along, across), 1: (across, -along)}[self.long_axis]
            upright = -round(self.uprightness(side, offset))
            return upright, float(np.abs(off).sum()), *shift, k

        return min(among, key=order)

    @property
    def long_axis(self) -> int | None:
        """0 or 1, the axis of the longer side of a board that is alone; else None."""
        columns, rows = self.sides.size[0].tolist()
        return None if len(self.sides.board) != 4 or columns == rows else int(rows > columns)

    def off_middle(self, side: IntArray, offset: IntArray) -> FloatArray:
        """(G, 2) squares from the middles of boards to those of the grids on them."""
        spans = [self.span(g, int(side[g]), offset[g]) for g in _list_named(side)]
        middle = np.sum(spans, axis=1) / 2
        return np.asarray(middle - (self.sides.size[side[side >= 0]] - 1) / 2)

    def uprightness(self, side: IntArray, offset: IntArray) -> float:
        """How far columns run to the right and rows down in the photo, over all grids.

        Of a lone board, how far its long side runs to the right and down.
        """
        total = 0.0
        for g in _list_named(side):
            grid = self.grids[g]
            cells = self.sides.board_cells(int(side[g]), offset[g], grid.cells)
            cells = cells - cells.mean(axis=0)
            if self.long_axis is not None:
                cells = cells[:, self.long_axis, None]
            total += float(np.sum(cells * (grid.pixel - grid.pixel.mean(axis=0))))
        return total

    def list_apart(self, labelings: Labelings) -> list[int]:
        """The labelings in which no two grids claim the same corner of a board."""
        near = np.zeros(len(labelings), bool)
        board = self.sides.board[labelings.side]
        spans = [self.spans(g, labelings) for g in range(len(self.grids))]
        for one, other in combinations(range(len(self.grids)), 2):
            (first, last), (start, end) = spans[one], spans[other]
            meet = (first <= end).all(axis=1) & (start <= last).all(axis=1)
            both = (labelings.side[:, [one, other]] >= 0).all(axis=1)
            near |= both & meet & (board[:, one] == board[:, other])
        return [
            k for k in range(len(labelings))
            if not (near[k] and self.overlap(*_place(labelings, k)))
        ]  # fmt: skip

    def spans(self, grid: int, labelings: Labelings) -> tuple[IntArray, IntArray]:
        """As :meth:`span` for each of K labelings (K, 2); of no meaning where it has no place."""
        cells = self.grids[grid].cells
        corners = np.array([cells.min(axis=0), cells.max(axis=0)])
        turn = np.swapaxes(self.sides.matrix[labelings.side[:, grid]], 1, 2)
        ends = corners @ turn + labelings.offset[:, None, grid]
        return ends.min(axis=1), ends.max(axis=1)

    def overlap(self, side: IntArray, offset: IntArray) -> bool:
        """Whether two grids claim the same corner of a board."""
        cells = []
        for g in _list_named(side):
            own = self.sides.board_cells(int(side[g]), offset[g], self.grids[g].cells)
            cells.append(np.insert(own, 0, self.sides.board[side[g]], axis=1))
        claimed = np.concatenate(cells)
        return len(np.unique(claimed, axis=0)) < len(claimed)


def decide(
    grids: Sequence[Grid], sides: Placement, labelings: Labelings, ends: Sequence[Ends]
) -> Decision | None:
    """Choose among labelings that name at least two grids; None when there are none.

    A grid's name is settled when every labeling that gives it another one is worse by
    :data:`CLEAR_RATIO` over the grids in which the two differ, or promises clearly more corners
    that are not there. Labelings congruent to the best are no rivals as long as a symmetry of
    the whole target relates them: the most upright one in the photo is taken. If they are
    slides, of which no end seen decides, or boards alike, the grids are left out.

    Args:
        grids: the photo's grids.
        sides: the target's boards.
        labelings: best first.
        ends: what is known of each grid's ends.

    """
    photo = _Photo(grids=grids, sides=sides)
    apart = photo.list_apart(labelings)
    if not apart:
        return None
    labelings = labelings[np.array(apart)]
    counts = np.array([len(grid) for grid in grids])
    missing = _count_missing(labelings, sides, ends)
    alike = _find_congruent_to_best(photo, labelings)
    same, decided = _reduce_by_symmetry(photo, labelings, alike, missing.sum(axis=1))
    cheapest = labelings.cost[same].min()
    chosen = photo.most_upright(
        labelings, [k for k in same if labelings.cost[k] <= _SAME_COST * cheapest]
    )

    named = labelings.side[chosen] >= 0
    left_out = counts * np.square([_LEFT_OUT_STEPS * grid.step for grid in grids])
    ratio = np.full(len(grids), np.inf)
    for k in sorted(set(range(len(labelings))) - set(alike)):
        # The symmetry's image that the rival shares most names with is the one to compare with.
        nearest = min(same, key=lambda m: counts[_find_differing(labelings, m, k)].sum())
        differs = _find_differing(labelings, nearest, k)
        if not differs.any():
            continue
        if clearly_more(missing[k][differs].sum(), int(missing[nearest][differs].sum())):
            continue
        own = labelings.grid_cost[chosen][differs].sum()
        own = max(own, counts[differs].sum() * _NOISE_FLOOR_PX**2)
        runner_up = np.where(named & (labelings.side[k] < 0), left_out, labelings.grid_cost[k])
        excess = max(0.0, runner_up.sum() - labelings.cost[chosen])
        ratio[differs] = np.minimum(ratio[differs], np.sqrt((own + excess) / own))
    verdict = np.full(len(grids), Decided.NO_FIT, object)
    verdict[named] = Decided.AMBIGUOUS
    if decided:
        verdict[named & (ratio >= CLEAR_RATIO)] = Decided.NAMED
    else:
        verdict[named] = _explain_undecided(photo, labelings[np.array(same)])
    return Decision(
        verdict=tuple(verdict),
        side=labelings.side[chosen],
        offset=labelings.offset[chosen],
        ratio=ratio,
        rms_px=np.where(named, np.sqrt(labelings.grid_cost[chosen] / counts), np.nan),
        rotation=labelings.rotation[chosen],
        translation=labelings.translation[chosen],
    )


def _count_missing(labelings: Labelings, sides: Placement, ends: Sequence[Ends]) -> IntArray:
    """(K, G) promised corners that are not seen."""
    missing = np.zeros(labelings.side.shape, np.intp)
    for grid, one in enumerate(ends):
        rows = np.flatnonzero(labelings.side[:, grid] >= 0)
        missing[rows, grid] = one.missing(
            sides, labelings.side[rows, grid], labelings.offset[rows, grid]
        )
    return missing


def _reduce_by_symmetry(
    photo: _Photo, labelings: Labelings, alike: list[int], missing: IntArray
) -> tuple[list[int], bool]:
    """Of labelings that look alike, those that may be chosen, and whether they are one.

    They are one when the symmetries of the target relate all of them. If not, all that the ends
    leave are returned.
    """
    wholes = np.array([photo.whole_count(labelings.side[k]) for k in alike])
    # A grid that fills a board's size without a gap is that board, not a part of a larger one.
    alike = [k for k, count in zip(alike, wholes, strict=True) if count == wholes.max()]
    best = min(alike, key=lambda k: (missing[k], k))
    left = [k for k in alike if not clearly_more(missing[k], int(missing[best]))]
    if len(left) > _MOST_SYMMETRIES:
        return left, False
    same = [k for k in left if photo.symmetric(labelings, best, k)]
    decided = len(same) == len(left)
    return (same if decided else left), decided


def decide_alone(
    grid: Grid, sides: Placement, allowed: AllowedOffsets, ends: Ends | None
) -> Decision:
    """Name a grid that nothing else in the photo helps to place.

    All places of one plane look alike, from another camera position. So only its size, its
    colours and its ends speak: a grid that fills a board is that board, and a place that is the
    only one left, up to the target's symmetries, is taken.
    """
    photo = _Photo(grids=[grid], sides=sides)
    side, offset = allowed.places()
    places = _make_without_pose(side, offset)
    # Which of several boards it is cannot rest on what is not seen; nor can anything when most
    # of the board is hidden, since what hides a board looks like its end.
    one_board = len(sides.board) == 4
    missing = np.zeros(len(side), np.intp)
    if ends is not None and one_board and 2 * len(grid) >= sides.size[0].prod():
        missing = ends.missing(sides, side, offset)
    same, decided = _reduce_by_symmetry(photo, places, list(range(len(side))), missing)
    chosen = photo.most_upright(places, same)
    verdict = Decided.NAMED if decided else _explain_undecided(photo, places[np.array(same)])
    row = slice(chosen, chosen + 1)
    return replace(unnamed(1), verdict=(verdict,), side=side[row], offset=offset[row])


def rim_in_doubt(grid: Grid, sides: Placement, board: int, ends: Ends | None) -> bool:
    """Whether a grid may lie a line further along its board, one of its lines being a stray.

    Few corners speak for that line, and the board may go on at the other side: there it is cut.
    """
    allowed = find_allowed_offsets(grid.cells, grid.parity, sides)
    for rim in doubtful_rims(grid):
        side, offset = find_allowed_offsets(grid.cells[~rim], grid.parity, sides).places()
        runner_up = (sides.board[side] == board) & ~allowed.allows(side, offset)
        if ends is not None:
            gaps = int(ends.table[0, 0, 0, 0])  # within the grid, wherever it lies
            runner_up &= ~clearly_more(ends.missing(sides, side, offset) - gaps, 0)
        if runner_up.any():
            return True
    return False


def _explain_undecided(photo: _Photo, left: Labelings) -> Decided:
    """What grids are for which several labelings are ``left``.

    Those that may slide are kept only on a board that is alone, and seen well.
    """
    covered = [photo.covered(*_place(left, k)) for k in range(len(left))]
    boards = {tuple(board for board, *_ in one) for one in covered}
    if len(boards) == len(set(covered)) > 1:  # other boards, but never further along one
        return Decided.TWIN
    corners = sum(len(photo.grids[grid]) for grid in _list_named(left.side[0]))
    sides = photo.sides
    if len(sides.board) == 4 and _LEAST_SHARE * corners >= sides.size[0].prod():
        return Decided.CONVENTION
    return Decided.SLIDE


def unnamed(count: int) -> Decision:
    """Of so many grids that fit nowhere."""
    return Decision(
        verdict=(Decided.NO_FIT,) * count,
        side=np.full(count, -1, np.intp),
        offset=np.zeros((count, 2), np.intp),
        ratio=np.full(count, np.inf),
        rms_px=np.full(count, np.nan),
        rotation=np.full((3, 3), np.nan),
        translation=np.full(3, np.nan),
    )


def _make_without_pose(side: IntArray, offset: IntArray) -> Labelings:
    count = len(side)
    return Labelings(
        side=side[:, None],
        offset=offset[:, None],
        rotation=np.full((count, 3, 3), np.nan),
        translation=np.full((count, 3), np.nan),
        pivot=np.full((count, 3), np.nan),
        grid_cost=np.zeros((count, 1)),
    )


def _list_named(side: IntArray) -> list[int]:
    """The grids that a labeling gives a place."""
    return [int(grid) for grid in np.flatnonzero(side >= 0)]


def _place(labelings: Labelings, k: int) -> tuple[IntArray, IntArray]:
    return labelings.side[k], labelings.offset[k]


def _find_differing(labelings: Labelings, own: int, other: int) -> BoolArray:
    """(G,) the grids that labeling ``own`` names otherwise than ``other``."""
    moved = (labelings.offset[own] != labelings.offset[other]).any(axis=1)
    return (labelings.side[own] >= 0) & ((labelings.side[own] != labelings.side[other]) | moved)


def _find_congruent_to_best(photo: _Photo, labelings: Labelings) -> list[int]:
    """The best labeling and those that no photo tells from it."""
    best = photo.worlds(*_place(labelings, 0))
    named = labelings.side[0] >= 0
    square = float(photo.sides.square[labelings.side[0][named]].min())
    counts = np.array([len(grid) for grid in photo.grids])
    floor = counts[named].sum() * _NOISE_FLOOR_PX**2
    near = labelings.cost <= CLEAR_RATIO**2 * (labelings.cost[0] + floor)
    near &= ((labelings.side >= 0) == named).all(axis=1)
    return [0] + [
        int(k)
        for k in np.flatnonzero(near)[1:]
        if similarity(photo.worlds(*_place(labelings, int(k))), best).error < SAME * square
    ]
