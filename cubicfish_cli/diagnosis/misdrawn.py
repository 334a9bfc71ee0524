"""Why grids fit no place on the target: the photos or the drawing with one thing put right.

If many grids fit nowhere, in all photos or in some, they are named again as they would be were the
photos mirrored, or the drawing wrong in one of the ways in which drawings are. What explains
nearly all is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cubicfish_cli.boards.board import Board, FirstSquare
from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.detection.photo_as import grid_in_mirror
from cubicfish_cli.diagnosis.evidence import GridEvidence
from cubicfish_cli.identification.decide import Decided
from cubicfish_cli.identification.identified import FEWEST_CORNERS, GridReport
from cubicfish_cli.identification.name_grids import name_again
from cubicfish_cli.target import Target
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

IntArray = npt.NDArray[np.intp]

# So much of the corners must fit nowhere before anything is tried, and so much must fit after it.
_LOST = 0.15
_FITS = 0.9
# What is tried later must explain so much more of the corners.
_CLEARLY = 0.02
# Photos that take part: those that show most.
_PHOTOS = 6
_MOST_BOARDS = 6
_UNITS = {25.4: "inches_for_mm", 10.0: "cm_for_mm"}
_NO_PLACE = (Decided.NO_FIT, Decided.NOT_PLANE, Decided.TOO_LARGE, Decided.COLOURS)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Trial:
    """One thing put right: the target to name with, the photos, and which are taken as mirrored."""

    finding: Finding
    target: Target
    photos: IntArray
    mirrored: IntArray


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
    images, width = identified.corners.images, identified.corners.image_size[0]

    def named_by(trial: _Trial) -> IntArray:
        """Corners of each photo of the trial that have a place, with that put right."""
        own = [
            tuple(grid_in_mirror(grid, width) for grid in large[photo])
            if photo in trial.mirrored
            else large[photo]
            for photo in trial.photos
        ]
        return _counts(name_again(identified, trial.photos, trial.target, own).grids)[0]

    fullest = np.argsort(-(named + lost), kind="stable")
    some = _some_mirrored(target, odd, fullest, images)
    if some is not None:
        total = _sizes(large, some.photos)
        again = named_by(some)
        # Each of them by itself: one that shows something else does not speak for the others.
        right = np.where(np.isin(some.photos, odd), total, named[some.photos])
        if (again > _FITS * right).all():
            return [_with_evidence(some, named, again.sum(), total.sum())]
    if lost.sum() <= _LOST * (named + lost).sum():
        return []
    chosen = np.sort(fullest[:_PHOTOS])
    if not lost[chosen].any():
        chosen = np.flatnonzero(lost)[:_PHOTOS]
    total = _sizes(large, chosen)
    best: tuple[float, _Trial] | None = None
    for trial in _trials(target, chosen):
        share = named_by(trial).sum() / total.sum()
        if share > _FITS and (best is None or share > best[0] + _CLEARLY):
            best = (share, trial)
        if best is not None and best[0] >= 1 - _CLEARLY:
            break
    if best is None:
        return []
    return [_with_evidence(best[1], named, best[0] * total.sum(), total.sum())]


def _sizes(grids: Sequence[Sequence[Grid]], photos: IntArray) -> IntArray:
    """Corners of each of some photos."""
    return np.array([sum(len(grid) for grid in grids[photo]) for photo in photos], np.intp)


def _with_evidence(trial: _Trial, named: IntArray, again: float, total: float) -> Finding:
    figures = {
        **trial.finding.figures,
        "before": float(named[trial.photos].sum() / total),
        "after": float(again / total),
    }
    return replace(trial.finding, because="put_right", figures=figures)


def _counts(reports: Sequence[Sequence[GridReport]]) -> tuple[IntArray, IntArray]:
    """For each photo, corners of grids with a place, and of those that fit nowhere."""
    large = [[grid for grid in own if grid.corners >= FEWEST_CORNERS] for own in reports]
    named = [sum(grid.corners for grid in own if grid.named) for own in large]
    lost = [sum(grid.corners for grid in own if grid.verdict in _NO_PLACE) for own in large]
    return np.array(named, np.intp), np.array(lost, np.intp)


def _large(grids: Sequence[Grid]) -> tuple[Grid, ...]:
    return tuple(grid for grid in grids if len(grid) >= FEWEST_CORNERS)


def _some_mirrored(
    target: Target, odd: IntArray, fullest: IntArray, images: Sequence[str]
) -> _Trial | None:
    """That photos with lost grids are mirrored, where most photos have none."""
    if 2 * len(odd) >= len(fullest):
        return None
    names = tuple(images[photo] for photo in odd)
    others = fullest[~np.isin(fullest, odd)][:_PHOTOS]
    tried = fullest[np.isin(fullest, odd)][:_PHOTOS]
    finding = _finding(Code.MIRRORED, "some_grids", images=names)
    return _Trial(
        finding=finding,
        target=target,
        photos=np.sort(np.concatenate([tried, others])),
        mirrored=odd,
    )


def _trials(target: Target, chosen: IntArray) -> Iterator[_Trial]:
    none = np.zeros(0, np.intp)
    yield _Trial(
        finding=_finding(Code.MIRRORED, "none" if target.mirrored else "all_grids"),
        target=target,
        photos=chosen,
        mirrored=chosen,
    )
    for finding, changed in _drawings(target):
        yield _Trial(finding=finding, target=changed, photos=chosen, mirrored=none)


def _finding(
    code: Code,
    case: str,
    figures: Mapping[str, Any] | None = None,
    boards: tuple[str, ...] = (),
    images: tuple[str, ...] = (),
) -> Finding:
    return Finding(
        code=code,
        case=case,
        severity=Severity.BAD,
        figures=figures or {},
        boards=boards,
        images=images,
    )


def _drawings(target: Target) -> Iterator[tuple[Finding, Target]]:
    """The drawing with one thing put right: what was wrong, and the drawing."""
    plain = [index for index, board in enumerate(target.boards) if board.points is None]
    changes = {index: list(_changes(target.boards[index])) for index in plain}
    for index in plain:
        for change in changes[index]:
            figures = {**change.figures, "which": "one"}
            name = target.boards[index].name
            yield (
                _finding(change.code, "grids", figures, (name,)),
                target.with_boards({index: change.board}),
            )
    names = tuple(target.boards[index].name for index in plain)
    for every in zip(*changes.values(), strict=False):
        first = every[0]
        alike = all(change.figures == first.figures for change in every)
        own = first.figures if alike else {**first.figures, "order": first.in_general}
        yield (
            _finding(first.code, "grids", {**own, "which": "all"}, names),
            target.with_boards(
                {index: change.board for index, change in zip(plain, every, strict=True)}
            ),
        )
    for one, other in combinations(plain, 2):
        a, b = target.boards[one], target.boards[other]
        yield (
            _finding(Code.BOARD_NAMES, "places", boards=(a.name, b.name)),
            target.with_boards({one: _placed(a, b), other: _placed(b, a)}),
        )


class _Change(NamedTuple):
    """One thing of a board put right.

    Attributes:
        code: what was wrong.
        figures: the figures of that.
        board: the board as it would be right.
        in_general: the order, where that of other boards has other figures.

    """

    code: Code
    figures: dict[str, Any]
    board: Board
    in_general: str = ""


def _changes(board: Board) -> Iterator[_Change]:
    def order(key: str, in_general: str = "", /, **changed: Any) -> _Change:
        size = {"columns": board.columns, "rows": board.rows} if changed.get("columns") else {}
        own = replace(board, **changed)
        return _Change(Code.BOARD_ORDER, {"order": key, **size}, own, in_general)

    yield order("exchanged_size", "exchanged", columns=board.rows, rows=board.columns)
    if board.has_squares:
        other: FirstSquare = "light" if board.first_square == "dark" else "dark"
        drawn = board.in_mirror() if board.mirrored else board
        says = "light" if drawn.first_square == "dark" else "dark"
        colours = order("colours", "some_colours", first_square=other)
        yield colours._replace(figures={**colours.figures, "first_square": says})
    yield order("y_axis", y_axis=-board.y_axis)
    yield order("x_axis", x_axis=-board.x_axis)
    yield order("both_axes", x_axis=-board.x_axis, y_axis=-board.y_axis)
    last = board.world_points(board.columns - 1, 0)
    yield order("other_end", origin=last, x_axis=-board.x_axis)
    for ratio, mixed in _UNITS.items():
        for factor in (ratio, 1 / ratio):
            figures = {"times": ratio, "small": factor > 1, "units_mixed": mixed}
            resized = replace(board, square=board.square * factor)
            yield _Change(Code.BOARD_SQUARE, figures, resized)


def _placed(board: Board, other: Board) -> Board:
    return replace(board, origin=other.origin, x_axis=other.x_axis, y_axis=other.y_axis)
