"""Why grids fit no place on the target: the photos or the drawing with one thing put right.

If many grids fit nowhere, in all photos or in some, they are named again as they would be were the
photos mirrored, or the drawing wrong in one of the ways in which drawings are. What explains
nearly all is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from cubicfish_cli.boards.board import Board, FirstSquare
from cubicfish_cli.detection.grids import Grid, grid_in_mirror
from cubicfish_cli.diagnosis.evidence import GridEvidence
from cubicfish_cli.diagnosis.object_faults import AXES
from cubicfish_cli.identification.decide import Decided
from cubicfish_cli.identification.identified import FEWEST_CORNERS, GridReport
from cubicfish_cli.identification.name_grids import name_again
from cubicfish_cli.target import Target
from cubicfish_cli.types import IntArray
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# So much of the corners must fit nowhere before anything is tried, and so much must fit after it.
_LOST = 0.15
_FITS = 0.9
# What is tried later must explain so much more of the corners.
_CLEARLY = 0.02
# Photos that take part: those that show most.
_PHOTOS = 6
_MOST_BOARDS = 6
_UNITS = {25.4: "inches_for_mm", 10.0: "cm_for_mm"}
# The order of several boards, where their sizes or colours differ.
_IN_GENERAL = {"exchanged_size": "exchanged", "colours": "some_colours"}
_bad = partial(Finding, severity=Severity.BAD)
_NO_PLACE = (Decided.NO_FIT, Decided.NOT_PLANE, Decided.TOO_LARGE, Decided.COLOURS)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Trial:
    """One thing put right: the target to name with, and which photos are taken as mirrored."""

    finding: Finding
    target: Target
    mirrored: IntArray = field(default_factory=lambda: np.zeros(0, np.intp))


def misdrawn(evidence: GridEvidence) -> list[Finding]:
    """What is likely wrong with photos or drawing, as the grids that fit nowhere show it.

    Nothing where most grids have a place, or nothing simple explains why they have none.
    """
    identified, target = evidence.identified, evidence.target
    boards = [board for board in target.boards if board.points is None]
    named, lost = _counts(identified.grids)
    odd = np.flatnonzero(lost > _LOST * (named + lost))
    if not len(odd) or not 2 <= len(boards) <= _MOST_BOARDS:
        return []
    large = [_large(own) for own in identified.found]
    sizes = np.array([sum(map(len, own)) for own in large], np.intp)
    width = identified.corners.image_size[0]

    def named_by(trial: _Trial, photos: IntArray) -> IntArray:
        """Corners of each of some photos that have a place, with that put right."""
        own = [
            tuple(grid_in_mirror(grid, width) for grid in large[photo])
            if photo in trial.mirrored
            else large[photo]
            for photo in photos
        ]
        return _counts(name_again(identified, photos, trial.target, own).grids)[0]

    def told(trial: _Trial, photos: IntArray, again: float) -> list[Finding]:
        total = sizes[photos].sum()
        shares = {"before": float(named[photos].sum() / total), "after": float(again / total)}
        figures = {**trial.finding.figures, **shares}
        return [replace(trial.finding, because="put_right", figures=figures)]

    fullest = np.argsort(-(named + lost), kind="stable")
    if 2 * len(odd) < len(fullest):
        names = tuple(identified.corners.images[photo] for photo in odd)
        finding = _bad(code=Code.MIRRORED, case="some_grids", images=names)
        some = _Trial(finding=finding, target=target, mirrored=odd)
        is_odd = np.isin(fullest, odd)
        photos = np.sort(np.concatenate([fullest[one][:_PHOTOS] for one in (is_odd, ~is_odd)]))
        again = named_by(some, photos)
        # Each of them by itself: one that shows something else does not speak for the others.
        right = np.where(np.isin(photos, odd), sizes[photos], named[photos])
        if (again > _FITS * right).all():
            return told(some, photos, again.sum())
    if lost.sum() <= _LOST * (named + lost).sum():
        return []
    chosen = np.sort(fullest[:_PHOTOS])
    if not lost[chosen].any():
        chosen = np.flatnonzero(lost)[:_PHOTOS]
    total = sizes[chosen].sum()
    best: tuple[float, _Trial] | None = None
    for trial in _trials(target, chosen):
        share = named_by(trial, chosen).sum() / total
        if share > _FITS and (best is None or share > best[0] + _CLEARLY):
            best = (share, trial)
        if best is not None and best[0] >= 1 - _CLEARLY:
            break
    return [] if best is None else told(best[1], chosen, best[0] * total)


def _counts(reports: Sequence[Sequence[GridReport]]) -> tuple[IntArray, IntArray]:
    """For each photo, corners of grids with a place, and of those that fit nowhere."""
    large = [[grid for grid in own if grid.corners >= FEWEST_CORNERS] for own in reports]
    named = [sum(grid.corners for grid in own if grid.named) for own in large]
    lost = [sum(grid.corners for grid in own if grid.verdict in _NO_PLACE) for own in large]
    return np.array(named, np.intp), np.array(lost, np.intp)


def _large(grids: Sequence[Grid]) -> tuple[Grid, ...]:
    return tuple(grid for grid in grids if len(grid) >= FEWEST_CORNERS)


def _trials(target: Target, photos: IntArray) -> Iterator[_Trial]:
    case = "none" if target.mirrored else "all_grids"
    yield _Trial(finding=_bad(code=Code.MIRRORED, case=case), target=target, mirrored=photos)
    plain = [index for index, board in enumerate(target.boards) if board.points is None]
    changes = [list(_changes(target.boards[index])) for index in plain]
    for index, own in zip(plain, changes, strict=True):
        for code, figures, board in own:
            yield _redrawn(target, code, {**figures, "which": "one"}, {index: board})
    for every in zip(*changes, strict=False):
        code, figures, _ = every[0]
        if any(other != figures for _, other, _ in every):
            figures = {**figures, "order": _IN_GENERAL[figures["order"]]}
        boards = (board for *_, board in every)
        redrawn = dict(zip(plain, boards, strict=True))
        yield _redrawn(target, code, {**figures, "which": "all"}, redrawn)
    for one, other in combinations(plain, 2):
        a, b = target.boards[one], target.boards[other]
        yield _Trial(
            finding=_bad(code=Code.BOARD_NAMES, case="places", boards=(a.name, b.name)),
            target=target.with_boards({one: _placed(a, b), other: _placed(b, a)}),
        )


def _redrawn(
    target: Target, code: Code, figures: Mapping[str, Any], boards: Mapping[int, Board]
) -> _Trial:
    names = tuple(board.name for board in boards.values())
    finding = _bad(code=code, case="grids", boards=names, figures=figures)
    return _Trial(finding=finding, target=target.with_boards(boards))


def _changes(board: Board) -> Iterator[tuple[Code, dict[str, Any], Board]]:
    """One thing of a board put right: what was wrong, the figures of that, and the board."""

    def order(key: str, **changed: Any) -> tuple[Code, dict[str, Any], Board]:
        size = {"columns": board.columns, "rows": board.rows} if "columns" in changed else {}
        return Code.BOARD_ORDER, {"order": key, **size}, replace(board, **changed)

    yield order("exchanged_size", columns=board.rows, rows=board.columns)
    if board.has_squares:
        other: FirstSquare = "light" if board.first_square == "dark" else "dark"
        drawn = board.in_mirror() if board.mirrored else board
        says = "light" if drawn.first_square == "dark" else "dark"
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


def _placed(board: Board, other: Board) -> Board:
    return replace(board, origin=other.origin, x_axis=other.x_axis, y_axis=other.y_axis)
