"""What is wrong with the nominal target (target.yaml), judged by the measured target.

Hypotheses are tried from the simplest on: corners counted in another order, names of boards
exchanged, a wrong square, a wrong place. The first that explains the difference is accepted.

The module also finds why grids fit no place on the target. If many grids fit nowhere, in all photos
or in some, they are named again as if the photos were mirrored, or with one thing of the nominal
target put right that is often wrong. What explains nearly all of them is reported.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish.diagnosis.evidence import GridEvidence
from cubicfish.find.detection.grids import Grid, grid_in_mirror
from cubicfish.find.identification.identified import (
    FEWEST_CORNERS,
    Decided,
    GridReport,
    Identified,
)
from cubicfish.geometry import Similarity, similarity
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.target.boards.board import Board, FirstSquare
from cubicfish.target.target import Target
from cubicfish.types import FloatArray, IntArray

_Numbers = npt.NDArray[Any]
_Order = Callable[[_Numbers, _Numbers, int, int], tuple[_Numbers, _Numbers]]
# Column and row of the corner that the nominal target means, from those in the table. C and R are
# the numbers of columns and rows of the nominal board.
ORDERS: Mapping[str, _Order] = {
    "as_it_is": lambda c, r, C, R: (c, r),
    "columns_backwards": lambda c, r, C, R: (C - 1 - c, r),
    "rows_backwards": lambda c, r, C, R: (c, R - 1 - r),
    "half_a_turn": lambda c, r, C, R: (C - 1 - c, R - 1 - r),
    "exchanged": lambda c, r, C, R: (r, c),
    "a_quarter_turn": lambda c, r, C, R: (R - 1 - r, c),
    "a_quarter_turn_back": lambda c, r, C, R: (r, C - 1 - c),
    "exchanged_backwards": lambda c, r, C, R: (R - 1 - r, C - 1 - c),
}
"""The eight ways to count a board's corners, by their names in findings."""
COUNTED = tuple(ORDERS)[1:7]
"""Those of them in which a single photo's corners may be counted, where others are counted
rightly."""
EXCHANGED = ("exchanged", "a_quarter_turn", "a_quarter_turn_back", "exchanged_backwards")
"""Orders of corners in a nominal target whose rows and columns may be exchanged."""
AXES: Mapping[str, Callable[[Board], Board]] = {
    "x_axis": lambda board: replace(board, x_axis=-board.x_axis),
    "y_axis": lambda board: replace(board, y_axis=-board.y_axis),
    "both_axes": lambda board: replace(board, x_axis=-board.x_axis, y_axis=-board.y_axis),
}
"""Axes that are given the other way round from corner (0, 0), by their keys: the board as meant."""

# A hypothesis is accepted if it leaves no more than this share of the difference (RMS).
_EXPLAINED = 1 / 3
# In another order or under other names a board is off by much more than this share of the target; a
# nominal target whose boards are nearer to their places has no such fault.
_FAR = 0.02
_LARGEST_RATIO = 2000.0
# The best ratio of squares is within this factor of a rough one.
_NEAR_RATIO = 2.0
_EXACTLY = 1e-8  # as a share of it
_GOLDEN = (5**0.5 - 1) / 2
_MIXED_UNITS = {25.4: "inches_mm", 10.0: "cm_mm", 1000.0: "m_mm", 2.54: "inches_cm"}
# By whether all boards are meant, and whether units are mixed up.
_SQUARE_CASES = {
    (False, False): "",
    (False, True): "units",
    (True, False): "all",
    (True, True): "all_units",
}
# By whether either of two boards may be meant, and whether its squares are off too.
_PLACE_CASES = {
    (False, False): "",
    (False, True): "and_square",
    (True, False): "of_two",
    (True, True): "of_two_and_square",
}
_bad = partial(Finding, severity=Severity.BAD)


@dataclass(frozen=True, kw_only=True, eq=False)
class Fault:
    """What is likely wrong with a nominal target.

    Attributes:
        finding: the finding, without the evidence.
        before, after: RMS difference of the nominal target from the measured one, as given and
            corrected, in the target's units.
        points: (corners, 3) the real places of the corners, for each board that was measured, in
            the nominal target's frame.

    """

    finding: Finding
    before: float
    after: float
    points: dict[int, FloatArray]


def object_fault(target: Target, measured: Mapping[int, FloatArray]) -> Fault | None:
    """Find the simplest fault of the nominal target that explains where the corners were measured.

    Args:
        target: the nominal target.
        measured: for boards by index, (rows * columns, 3) the measured corners, row by row, in any
            frame and unit.

    Returns:
        The fault; None where the nominal target is right, or nothing simple explains the
        difference.

    """
    boards = {i: target.boards[i] for i in sorted(measured) if target.boards[i].points is None}
    if len(boards) < 2:
        return None
    seen = _Measured(
        target=target,
        boards=boards,
        nominal={index: flat_points(board, *board.places()) for index, board in boards.items()},
        measured=measured,
    )
    before = seen.difference(seen.nominal)
    size = float(np.linalg.norm(np.ptp(np.concatenate(list(seen.nominal.values())), axis=0)))
    if before < 1e-9 * size:
        return None
    for level in (_try_orders, _try_squares, _try_places, partial(_try_places, scaled=True)):
        if level is _try_orders and before < _FAR * size:
            continue
        found = []
        for finding, changed in level(seen):
            points = {**seen.nominal, **changed}
            after = seen.difference(points, mirror=finding.code == Code.MIRRORED)
            if after <= _EXPLAINED * before:
                found.append(Fault(finding=finding, before=before, after=after, points=points))
        if found:
            return min(found, key=lambda fault: fault.after)
    return None


def flat_points(board: Board, column: _Numbers, row: _Numbers) -> FloatArray:
    """World points of a board that is flat as it is nominally, also beyond its edges."""
    plane = board.plane_points(column, row)
    return np.asarray(board.origin + plane[:, :1] * board.x_axis + plane[:, 1:] * board.y_axis)


_Hypotheses = Iterator[tuple[Finding, dict[int, FloatArray]]]
"""What may be wrong, and the places of the boards' corners in that case."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Measured:
    """The boards that are compared, and their corners, nominal and measured."""

    target: Target
    boards: dict[int, Board]
    nominal: dict[int, FloatArray]
    measured: Mapping[int, FloatArray]

    def difference(self, nominal: Mapping[int, FloatArray], *, mirror: bool = False) -> float:
        """RMS distance of the measured corners from nominal ones, in the nominal target's units.

        The measured ones are turned, moved and scaled to be as near to the nominal ones as can be.
        """
        source = np.concatenate([self.measured[index] for index in self.boards])
        source = source * ([1, 1, -1] if mirror else 1)
        goal = np.concatenate([nominal[index] for index in self.boards])
        miss = similarity(source, goal)(source) - goal
        return float(np.sqrt(np.mean(np.sum(miss**2, axis=1))))

    def names(self, boards: Sequence[int]) -> tuple[str, ...]:
        return tuple(self.boards[index].name for index in boards)

    def every(self, boards: Sequence[int]) -> bool:
        return len(boards) == len(self.target.boards)


def _try_orders(seen: _Measured) -> _Hypotheses:
    yield _bad(code=Code.MIRRORED, case="target"), {}
    everyone = tuple(seen.boards)
    for boards in (everyone, *((index,) for index in everyone)):
        oblong = [one for one in map(seen.boards.get, boards) if one and one.columns != one.rows]
        size = {"columns": oblong[0].columns, "rows": oblong[0].rows} if oblong else {}
        which = "all" if seen.every(boards) else "one"
        for order in [*list(ORDERS)[1:], *AXES]:
            order_name = (
                ("exchanged_size" if oblong else "exchanged") if order in EXCHANGED else order
            )
            finding = _bad(
                code=Code.BOARD_ORDER,
                boards=seen.names(boards),
                figures={**size, "order": order_name, "which": which},
            )
            yield finding, {index: _place_as_counted(seen.boards[index], order) for index in boards}
    for one, other in combinations(everyone, 2):
        a, b = seen.boards[one], seen.boards[other]
        changed = {one: flat_points(b, *a.places()), other: flat_points(a, *b.places())}
        yield _bad(code=Code.BOARD_NAMES, boards=(a.name, b.name)), changed


def _place_as_counted(board: Board, order: str) -> FloatArray:
    """The places of a board's corners if they are counted, or its axes meant, in another way."""
    column, row = board.places()
    if order in AXES:
        return flat_points(AXES[order](board), column, row)
    return flat_points(board, *ORDERS[order](column, row, board.columns, board.rows))


def _try_squares(seen: _Measured) -> _Hypotheses:
    """Try other squares, with corner (0, 0) of each board where it is nominally."""
    ratios: dict[tuple[int, ...], float] = {
        (index,): _place_by_others(seen, index, scaled=True).scale for index in seen.boards
    }
    # All squares together, by the distances between the boards' first corners.
    own = [similarity(seen.nominal[index], seen.measured[index]) for index in seen.boards]
    first = np.array([board.origin for board in seen.boards.values()])
    there = np.concatenate([one(at[None]) for one, at in zip(own, first, strict=True)])
    apart = [np.linalg.norm(at - at[:, None], axis=-1).sum() for at in (first, there)]
    if apart[1] > 0:
        scale = float(np.mean([one.scale for one in own]))
        ratios[tuple(seen.boards)] = scale * float(apart[0] / apart[1])
    for boards, start in ratios.items():
        ratio, changed = _fit_ratio(seen, boards, start)
        if not 1 / _LARGEST_RATIO < ratio < _LARGEST_RATIO:
            continue
        sizes, units = sorted({seen.boards[index].square for index in boards}), seen.target.units
        times = max(ratio, 1 / ratio)
        mixed = next(
            (mix for known, mix in _MIXED_UNITS.items() if abs(times / known - 1) < 0.02), ""
        )
        figures = {
            "off": ratio - 1,
            "times": times,
            "real": ", ".join(f"{ratio * size:.4g} {units} for {size:g}" for size in sizes),
        }
        finding = _bad(
            code=Code.BOARD_SQUARE,
            case=_SQUARE_CASES[seen.every(boards), bool(mixed)],
            boards=seen.names(boards),
            figures={**figures, **({"units_mixed": mixed} if mixed else {})},
        )
        yield finding, changed


def _fit_ratio(
    seen: _Measured, boards: Sequence[int], start: float
) -> tuple[float, dict[int, FloatArray]]:
    """The best ratio of squares, near a rough one, and the places of the corners with it."""

    def resize(ratio: float) -> dict[int, FloatArray]:
        origin = {index: seen.boards[index].origin for index in boards}
        return {index: at + ratio * (seen.nominal[index] - at) for index, at in origin.items()}

    def miss(ratio: float) -> float:
        return seen.difference({**seen.nominal, **resize(ratio)})

    # Golden section: the minimum lies between the ends, and both inner points are known.
    low, high = start / _NEAR_RATIO, start * _NEAR_RATIO
    inner = [high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)]
    missed = [miss(one) for one in inner]
    while high - low > _EXACTLY * start:
        if missed[0] < missed[1]:
            high, new = inner[1], inner[1] - _GOLDEN * (inner[1] - low)
            inner, missed = [new, inner[0]], [miss(new), missed[0]]
        else:
            low, new = inner[0], inner[0] + _GOLDEN * (high - inner[0])
            inner, missed = [inner[1], new], [missed[1], miss(new)]
    ratio = (low + high) / 2
    return ratio, resize(ratio)


def _place_by_others(seen: _Measured, board: int, *, scaled: bool) -> Similarity:
    """The motion from where a board is nominally to where it is, by where the others put it."""
    others = [index for index in seen.boards if index != board]
    source, goal = (np.concatenate([at[i] for i in others]) for at in (seen.measured, seen.nominal))
    there = similarity(source, goal)(seen.measured[board])
    return similarity(seen.nominal[board], there, scaled=scaled)


def _try_places(seen: _Measured, *, scaled: bool = False) -> _Hypotheses:
    """Try another place for each board by itself, by where the others put it."""
    case = _PLACE_CASES[len(seen.boards) == 2, scaled]
    for index, nominal in seen.nominal.items():
        motion = _place_by_others(seen, index, scaled=scaled)
        middle = nominal.mean(axis=0)
        cosine = (np.trace(motion.rotation) - 1) / 2
        finding = _bad(
            code=Code.BOARD_PLACE,
            case=case,
            boards=seen.names([index]),
            figures={
                "shift": float(np.linalg.norm(motion(middle) - middle)),
                "turn_deg": float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1)))),
                "units": seen.target.units,
                "off": motion.scale - 1,
                "both": list(seen.names(list(seen.boards))),
            },
        )
        yield finding, {index: motion(nominal)}


# The share of corners that must fit nowhere before anything is tried, and that must fit after it.
_LOST = 0.15
_FITS = 0.9
# A later hypothesis must explain so much more of the corners.
_CLEARLY = 0.02
# Number of photos that take part: those that show most.
_PHOTOS = 6
_MOST_BOARDS = 6
_UNITS = {25.4: "inches_for_mm", 10.0: "cm_for_mm"}
# The order of several boards that differ in sizes or colours.
_IN_GENERAL = {"exchanged_size": "exchanged", "colours": "some_colours"}
_NO_PLACE = (Decided.NO_FIT, Decided.NOT_PLANE, Decided.TOO_LARGE, Decided.COLOURS)


def find_wrong_layout(evidence: GridEvidence) -> list[Finding]:
    """Find what is likely wrong with photos or nominal target, by the grids that fit nowhere.

    The list is empty where most grids have a place, or nothing simple explains why they have none.
    """
    target, seen = evidence.target, _Photos.of(evidence.identified)
    boards = [board for board in target.boards if board.points is None]
    odd = np.flatnonzero(seen.lost > _LOST * (seen.named + seen.lost))
    if not len(odd) or not 2 <= len(boards) <= _MOST_BOARDS:
        return []
    if 2 * len(odd) < len(seen.lost):
        mirrored = _find_mirrored_photos(seen, target, odd)
        if mirrored:
            return mirrored
    if seen.lost.sum() <= _LOST * (seen.named + seen.lost).sum():
        return []
    return _find_layout(seen, target)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Photos:
    """Grids of all photos that are large enough to say anything.

    Attributes:
        identified: what became of all grids.
        large: for each photo, its large grids.
        named, lost: for each photo, how many of their corners have a place, and fit nowhere.

    """

    identified: Identified
    large: Sequence[tuple[Grid, ...]]
    named: IntArray
    lost: IntArray

    @classmethod
    def of(cls, identified: Identified) -> _Photos:
        """Those among all grids."""
        named, lost = _count_named(identified.grids)
        large = [_keep_large(own) for own in identified.found]
        return cls(identified=identified, large=large, named=named, lost=lost)

    @property
    def fullest(self) -> IntArray:
        """The photos, those that show most first."""
        return np.argsort(-(self.named + self.lost), kind="stable")

    def corners(self, photos: IntArray) -> IntArray:
        """How many corners the grids of photos have."""
        return np.array([sum(map(len, self.large[photo])) for photo in photos], np.intp)

    def name_with(self, target: Target, photos: IntArray, mirrored: IntArray) -> IntArray:
        """Count the corners of photos that have a place on a target, some of them mirrored."""
        from cubicfish.find.identification.name_grids import name_again  # for photos alone

        width = self.identified.corners.image_size[0]
        own = [
            tuple(grid_in_mirror(grid, width) for grid in self.large[photo])
            if photo in mirrored
            else self.large[photo]
            for photo in photos
        ]
        return _count_named(name_again(self.identified, photos, target, own).grids)[0]

    def put_right(self, finding: Finding, photos: IntArray, again: IntArray) -> Finding:
        """Report what of photos has a place once a thing is put right: so many corners again."""
        total = self.corners(photos).sum()
        before, after = float(self.named[photos].sum() / total), float(again.sum() / total)
        figures = {**finding.figures, "before": before, "after": after}
        return replace(finding, because="put_right", figures=figures)


def _find_mirrored_photos(seen: _Photos, target: Target, odd: IntArray) -> list[Finding]:
    """Find that the odd photos, fewer than half of all, are mirrored and the others are not."""
    names = tuple(seen.identified.corners.images[photo] for photo in odd)
    is_odd = np.isin(seen.fullest, odd)
    photos = np.sort(np.concatenate([seen.fullest[one][:_PHOTOS] for one in (is_odd, ~is_odd)]))
    again = seen.name_with(target, photos, odd)
    # Each of them by itself: a photo that shows something else does not speak for the others.
    right = np.where(np.isin(photos, odd), seen.corners(photos), seen.named[photos])
    if not (again > _FITS * right).all():
        return []
    finding = _bad(code=Code.MIRRORED, case="some_grids", images=names)
    return [seen.put_right(finding, photos, again)]


def _find_layout(seen: _Photos, target: Target) -> list[Finding]:
    """Find the one thing that, put right, gives nearly all corners of full photos a place."""
    chosen = np.sort(seen.fullest[:_PHOTOS])
    if not seen.lost[chosen].any():
        chosen = np.flatnonzero(seen.lost)[:_PHOTOS]
    total = seen.corners(chosen).sum()
    best: list[Finding] = []
    most = _FITS
    for finding, other in _try_layouts(target):
        mirrored = chosen if finding.code == Code.MIRRORED else chosen[:0]
        again = seen.name_with(other, chosen, mirrored)
        share = float(again.sum() / total)
        if share > most:
            best, most = [seen.put_right(finding, chosen, again)], share + _CLEARLY
        if most >= 1:
            break
    return best


def _count_named(reports: Sequence[Sequence[GridReport]]) -> tuple[IntArray, IntArray]:
    """For each photo, count the corners of grids with a place, and of grids that fit nowhere."""
    large = [[grid for grid in own if grid.corners >= FEWEST_CORNERS] for own in reports]
    named = [sum(grid.corners for grid in own if grid.named) for own in large]
    lost = [sum(grid.corners for grid in own if grid.verdict in _NO_PLACE) for own in large]
    return np.array(named, np.intp), np.array(lost, np.intp)


def _keep_large(grids: Sequence[Grid]) -> tuple[Grid, ...]:
    return tuple(grid for grid in grids if len(grid) >= FEWEST_CORNERS)


def _try_layouts(target: Target) -> Iterator[tuple[Finding, Target]]:
    """Put one thing right: yield what was wrong, and the target to name corners with."""
    yield _bad(code=Code.MIRRORED, case="none" if target.mirrored else "all_grids"), target
    plain = [index for index, board in enumerate(target.boards) if board.points is None]
    changes = [list(_change_board(target.boards[index])) for index in plain]
    for index, own in zip(plain, changes, strict=True):
        for change in own:
            yield _redraw(target, "one", {index: change})
    # The same change to all: boards without squares have fewer.
    by_kind = [{_kind_of(change): change for change in own} for own in changes]
    for kind in by_kind[0] if by_kind else ():
        if all(kind in own for own in by_kind):
            every = (own[kind] for own in by_kind)
            yield _redraw(target, "all", dict(zip(plain, every, strict=True)))
    for one, other in combinations(plain, 2):
        a, b = target.boards[one], target.boards[other]
        finding = _bad(code=Code.BOARD_NAMES, case="places", boards=(a.name, b.name))
        yield finding, target.with_boards({one: _swap_place(a, b), other: _swap_place(b, a)})


_Change = tuple[Code, dict[str, Any], Board]
"""What was wrong with a board, the figures of that, and the board put right."""


def _kind_of(change: _Change) -> tuple[Any, ...]:
    """What a change has in common with the same one of another board, which has other sizes."""
    code, figures, _ = change
    return (code, *(figures.get(key) for key in ("order", "times", "small", "units_mixed")))


def _redraw(target: Target, which: str, changes: Mapping[int, _Change]) -> tuple[Finding, Target]:
    """Apply the same change to one board, or to all."""
    code, figures, _ = next(iter(changes.values()))
    if any(other != figures for _, other, _ in changes.values()):
        figures = {**figures, "order": _IN_GENERAL[figures["order"]]}
    boards = {index: board for index, (*_, board) in changes.items()}
    names = tuple(board.name for board in boards.values())
    figures = {**figures, "which": which}
    return _bad(code=code, case="grids", boards=names, figures=figures), target.with_boards(boards)


def _change_board(board: Board) -> Iterator[_Change]:
    """Put one thing of a board right."""

    def order(key: str, **changed: Any) -> _Change:
        size = {"columns": board.columns, "rows": board.rows} if "columns" in changed else {}
        return Code.BOARD_ORDER, {"order": key, **size}, replace(board, **changed)

    yield order("exchanged_size", columns=board.rows, rows=board.columns)
    if board.has_squares:
        other: FirstSquare = "light" if board.first_square == "dark" else "dark"
        nominal = board.in_mirror() if board.mirrored else board
        says = "light" if nominal.first_square == "dark" else "dark"
        code, figures, own = order("colours", first_square=other)
        yield code, {**figures, "first_square": says}, own
    for key in ("y_axis", "x_axis", "both_axes"):
        yield Code.BOARD_ORDER, {"order": key}, AXES[key](board)
    last = board.world_points(board.columns - 1, 0)
    yield order("other_end", origin=last, x_axis=-board.x_axis)
    for ratio, mixed in _UNITS.items():
        for factor in (ratio, 1 / ratio):
            figures = {"times": ratio, "small": factor > 1, "units_mixed": mixed}
            resized = replace(board, square=board.square * factor)
            yield Code.BOARD_SQUARE, figures, resized


def _swap_place(board: Board, other: Board) -> Board:
    return replace(board, origin=other.origin, x_axis=other.x_axis, y_axis=other.y_axis)
