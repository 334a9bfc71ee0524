"""What is wrong with a drawing, by comparing it with the object as it was measured.

Hypotheses from the simplest on: corners counted in another order, names of boards exchanged, a
wrong square, a wrong place. The first that explains the difference is believed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from cubicfish_cli.boards.board import Board
from cubicfish_cli.geometry import similarity
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray

_Numbers = npt.NDArray[Any]
_Order = Callable[[_Numbers, _Numbers, int, int], tuple[_Numbers, _Numbers]]
# Column and row of the corner that the drawing means, from those in the table. C and R are how
# many the drawing has.
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
"""The eight ways to count a board's corners, by their keys in words/catalogue.toml."""
COUNTED = tuple(ORDERS)[1:7]
"""Those of them that one photo's corners may be in, where others are in none."""
EXCHANGED = ("exchanged", "a_quarter_turn", "a_quarter_turn_back", "exchanged_backwards")
"""Orders that a drawing with rows and columns exchanged may have."""
AXES: Mapping[str, Callable[[Board], Board]] = {
    "x_axis": lambda board: replace(board, x_axis=-board.x_axis),
    "y_axis": lambda board: replace(board, y_axis=-board.y_axis),
    "both_axes": lambda board: replace(board, x_axis=-board.x_axis, y_axis=-board.y_axis),
}
"""Axes that are drawn the other way round from corner (0, 0), by their keys: the board as meant."""

Kind = Literal["order", "names", "mirror", "square", "squares", "place", "square_and_place"]

# A hypothesis is believed when it leaves no more than this of the difference (RMS).
_EXPLAINED = 1 / 3
# In another order or under other names a board is off by much more than by this share of the
# object; a drawing whose boards are nearer to their places has no such fault.
_FAR = 0.02
_LARGEST_RATIO = 2000.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Fault:
    """What is likely wrong with a drawing.

    Attributes:
        kind: which hypothesis.
        boards: indices of the boards that it is about.
        order: how corners are counted, for ``order``.
        ratio: real squares over the drawing's, for ``square``, ``squares`` and the like.
        shift: how far a board's middle is from its place, in the target's units.
        turn_deg: how far a board is turned from its place.
        before, after: RMS difference from the measured object as drawn and corrected, in the
            target's units.
        points: (corners, 3) where the corners really are, for each board that was measured, in
            the drawing's frame.

    """

    kind: Kind
    boards: tuple[int, ...]
    order: str = ""
    ratio: float = 1.0
    shift: float = 0.0
    turn_deg: float = 0.0
    before: float
    after: float
    points: dict[int, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grid:
    """The corners of one board that are compared."""

    index: int
    board: Board
    measured: FloatArray

    def drawn(self, order: str = "as_it_is", *, on: Board | None = None) -> FloatArray:
        """Where its corners are by the drawing, or were they counted so, or those of a board."""
        column, row = self.board.places()
        if order in AXES:
            return flat_points(AXES[order](self.board), column, row)
        counted = ORDERS[order](column, row, self.board.columns, self.board.rows)
        return flat_points(on or self.board, *counted)


def object_fault(target: Target, measured: Mapping[int, FloatArray]) -> Fault | None:
    """The simplest fault of the drawing that explains where the corners were measured.

    Args:
        target: the drawing.
        measured: for boards by index, (rows * columns, 3) where their corners are, row by row,
            in any frame and unit.

    Returns:
        None where the drawing is right, or nothing simple explains the difference.

    """
    grids = [
        _Grid(index=index, board=target.boards[index], measured=points)
        for index, points in sorted(measured.items())
        if target.boards[index].points is None
    ]
    if len(grids) < 2:
        return None
    before = _difference([grid.drawn() for grid in grids], grids)
    size = float(np.linalg.norm(np.ptp(np.concatenate([grid.drawn() for grid in grids]), axis=0)))
    if before < 1e-9 * size:
        return None
    simple = _Search(grids, before)
    elsewhere, resized = partial(_elsewhere, scaled=False), partial(_elsewhere, scaled=True)
    for level in (_other_orders, _squares, elsewhere, resized):
        if level is _other_orders and before < _FAR * size:
            continue
        found = [fault for fault in level(simple) if fault.after <= _EXPLAINED * before]
        if found:
            return min(found, key=lambda fault: fault.after)
    return None


@dataclass(frozen=True, eq=False)
class _Search:
    grids: list[_Grid]
    before: float


def flat_points(board: Board, column: npt.NDArray[Any], row: npt.NDArray[Any]) -> FloatArray:
    """World points of a board that is as flat as drawn, also beyond its edges."""
    plane = board.plane_points(column, row)
    return np.asarray(board.origin + plane[:, :1] * board.x_axis + plane[:, 1:] * board.y_axis)


def _difference(drawn: list[FloatArray], grids: list[_Grid], *, mirror: bool = False) -> float:
    """RMS distance of the measured corners from drawn ones, in the drawing's units."""
    goal = np.concatenate(drawn)
    source = np.concatenate([grid.measured for grid in grids]) * ([1, 1, -1] if mirror else 1)
    miss = similarity(source, goal)(source) - goal
    return float(np.sqrt(np.mean(np.sum(miss**2, axis=1))))


def _fault(
    search: _Search,
    kind: Kind,
    drawn: list[FloatArray],
    boards: tuple[int, ...],
    **more: Any,
) -> Fault:
    return Fault(
        **more,
        kind=kind,
        boards=boards,
        before=search.before,
        after=_difference(drawn, search.grids, mirror=kind == "mirror"),
        points={grid.index: points for grid, points in zip(search.grids, drawn, strict=True)},
    )


def _other_orders(search: _Search) -> Iterator[Fault]:
    grids = search.grids
    everyone = tuple(grid.index for grid in grids)
    drawn = [grid.drawn() for grid in grids]
    yield _fault(search, "mirror", drawn, everyone)
    orders = [*list(ORDERS)[1:], *AXES]
    for order in orders:
        yield _fault(search, "order", [grid.drawn(order) for grid in grids], everyone, order=order)
    for number, grid in enumerate(grids):
        for order in orders:
            changed = [*drawn[:number], grid.drawn(order), *drawn[number + 1 :]]
            yield _fault(search, "order", changed, (grid.index,), order=order)
    for one, other in combinations(range(len(grids)), 2):
        changed = list(drawn)
        changed[one] = grids[one].drawn(on=grids[other].board)
        changed[other] = grids[other].drawn(on=grids[one].board)
        boards = (grids[one].index, grids[other].index)
        yield _fault(search, "names", changed, boards)


def _resized(grid: _Grid, ratio: float) -> FloatArray:
    """The board with other squares, corner (0, 0) where it is drawn."""
    return np.asarray(grid.board.origin + ratio * (grid.drawn() - grid.board.origin))


def _squares(search: _Search) -> Iterator[Fault]:
    # Only here, since it takes a tenth of a second to load and few calibrations come this far.
    from scipy.optimize import minimize_scalar

    grids = search.grids
    drawn = [grid.drawn() for grid in grids]

    def best(resized: Callable[[float], list[FloatArray]], around: float) -> float:
        def miss(log_ratio: float) -> float:
            return _difference(resized(float(np.exp(log_ratio))), grids) / np.exp(
                max(log_ratio, 0.0)
            )

        tried = np.log(around) + np.linspace(-0.3, 0.3, 13)
        middle = float(tried[np.argmin([miss(value) for value in tried])])
        found = minimize_scalar(
            miss, bounds=(middle - 0.06, middle + 0.06), method="bounded", options={"xatol": 1e-8}
        )
        return float(np.exp(found.x))

    sizes = np.array([_size_ratio(grid) for grid in grids])
    for number, grid in enumerate(grids):
        others = np.delete(sizes, number)

        def one_resized(ratio: float, number: int = number) -> list[FloatArray]:
            return [*drawn[:number], _resized(grids[number], ratio), *drawn[number + 1 :]]

        ratio = best(one_resized, float(sizes[number] / np.median(others)))
        if not 1 / _LARGEST_RATIO < ratio < _LARGEST_RATIO:
            continue
        yield _fault(search, "square", one_resized(ratio), (grid.index,), ratio=ratio)

    def all_resized(ratio: float) -> list[FloatArray]:
        return [_resized(grid, ratio) for grid in grids]

    for around in (1.0, 25.4, 1 / 25.4, 10.0, 0.1):
        ratio = best(all_resized, around)
        everyone = tuple(grid.index for grid in grids)
        yield _fault(search, "squares", all_resized(ratio), everyone, ratio=ratio)


def _size_ratio(grid: _Grid) -> float:
    drawn = grid.drawn()
    return float(
        np.linalg.norm(grid.measured - grid.measured.mean(axis=0))
        / np.linalg.norm(drawn - drawn.mean(axis=0))
    )


def _elsewhere(search: _Search, *, scaled: bool) -> Iterator[Fault]:
    """Each board by itself elsewhere, by where the others put it."""
    grids = search.grids
    for number, grid in enumerate(grids):
        others = [*grids[:number], *grids[number + 1 :]]
        goal = np.concatenate([other.drawn() for other in others])
        seen = similarity(np.concatenate([other.measured for other in others]), goal)(grid.measured)
        drawn = grid.drawn()
        motion = similarity(drawn, seen, scaled=scaled)
        moved = motion(drawn)
        middle = drawn.mean(axis=0)
        cosine = (np.trace(motion.rotation) - 1) / 2
        changed = [moved if one is grid else one.drawn() for one in grids]
        yield _fault(
            search,
            "square_and_place" if scaled else "place",
            changed,
            (grid.index,),
            ratio=motion.scale,
            shift=float(np.linalg.norm(motion(middle) - middle)),
            turn_deg=float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1)))),
        )
