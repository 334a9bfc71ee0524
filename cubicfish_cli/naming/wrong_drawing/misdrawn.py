"""Why grids fit no place on the target: the photos or the drawing with one thing put right.

If many grids fit nowhere, in all photos or in some, they are named again as they would be were the
photos mirrored, or the drawing wrong in one of the ways in which drawings are. What explains
nearly all is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from cubicfish_cli.detection.grids import Grid
from cubicfish_cli.detection.photo_as import grid_in_mirror
from cubicfish_cli.fitting.diagnosis.finding import Cause, Finding, listed
from cubicfish_cli.naming.decide import Verdict
from cubicfish_cli.naming.name_grids import FEWEST_CORNERS, GridReport, Naming, name_again
from cubicfish_cli.naming.refusals import HOW_MIRRORED
from cubicfish_cli.target import Board, FirstSquare, Target

IntArray = npt.NDArray[np.intp]

# So much of the corners must fit nowhere before anything is tried, and so much must fit after it.
_LOST = 0.15
_FITS = 0.9
# What is tried later must explain so much more of the corners.
_CLEARLY = 0.02
# Photos that take part: those that show most.
_PHOTOS = 6
_MOST_BOARDS = 6
_UNITS = {25.4: "inches for millimetres", 10.0: "centimetres for millimetres"}
_NO_PLACE = (Verdict.NO_FIT, Verdict.NOT_PLANE, Verdict.TOO_LARGE, Verdict.COLOURS)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Trial:
    """One thing put right: the target to name with, the photos, and which are taken as mirrored."""

    finding: Finding
    target: Target
    photos: IntArray
    mirrored: IntArray


def misdrawn(naming: Naming, target: Target) -> Finding | None:
    """What is likely wrong with photos or drawing, as the grids that fit nowhere show it.

    Args:
        naming: what became of the grids.
        target: the object that they were named by.

    Returns:
        None where most grids have a place, or nothing simple explains why they have none.

    """
    boards = [board for board in target.boards if board.points is None]
    named, lost = _counts(naming.grids)
    odd = np.flatnonzero(lost > _LOST * (named + lost))
    if not len(odd) or not 2 <= len(boards) <= _MOST_BOARDS:
        return None
    large = [_large(own) for own in naming.found]
    images, width = naming.corners.images, naming.corners.image_size[0]

    def named_by(trial: _Trial) -> IntArray:
        """Corners of each photo of the trial that have a place, with that put right."""
        own = [
            tuple(grid_in_mirror(grid, width) for grid in large[photo])
            if photo in trial.mirrored
            else large[photo]
            for photo in trial.photos
        ]
        return _counts(name_again(naming, trial.photos, trial.target, own).grids)[0]

    fullest = np.argsort(-(named + lost), kind="stable")
    some = _some_mirrored(target, odd, fullest, images)
    if some is not None:
        total = _sizes(large, some.photos)
        again = named_by(some)
        # Each of them by itself: one that shows something else does not speak for the others.
        right = np.where(np.isin(some.photos, odd), total, named[some.photos])
        if (again > _FITS * right).all():
            return _with_evidence(some, named, again.sum(), total.sum())
    if lost.sum() <= _LOST * (named + lost).sum():
        return None
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
        return None
    return _with_evidence(best[1], named, best[0] * total.sum(), total.sum())


def _sizes(grids: Sequence[Sequence[Grid]], photos: IntArray) -> IntArray:
    """Corners of each of some photos."""
    return np.array([sum(len(grid) for grid in grids[photo]) for photo in photos], np.intp)


def _with_evidence(trial: _Trial, named: IntArray, again: float, total: float) -> Finding:
    evidence = (
        f"{100 * named[trial.photos].sum() / total:.0f} % of the corners have a place on the "
        f"target as it is, and {100 * again / total:.0f} % with that put right"
    )
    return replace(trial.finding, evidence=evidence)


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
    finding = _finding(
        "mirrored",
        f"{listed(names, 'photos')}: mirrored",
        "use photos as the sensor made them",
        images=names,
    )
    return _Trial(
        finding=finding,
        target=target,
        photos=np.sort(np.concatenate([tried, others])),
        mirrored=odd,
    )


def _trials(target: Target, chosen: IntArray) -> Iterator[_Trial]:
    none = np.zeros(0, np.intp)
    yield _Trial(
        finding=_finding(
            "mirrored",
            *(
                ("no photo is mirrored", "take mirrored: true out of target.yaml")
                if target.mirrored
                else (
                    "all photos are mirrored",
                    "use photos as the sensor made them, not as a video call shows them; if the "
                    f"camera looks into a mirror, {HOW_MIRRORED}",
                )
            ),
        ),
        target=target,
        photos=chosen,
        mirrored=chosen,
    )
    for what, cause, changed, boards in _drawings(target):
        finding = replace(
            _finding(cause, what, "correct target.yaml and run it again"), boards=boards
        )
        yield _Trial(finding=finding, target=changed, photos=chosen, mirrored=none)


def _finding(cause: Cause, what: str, do: str, images: tuple[str, ...] = ()) -> Finding:
    return Finding(cause=cause, level="bad", what=what, evidence="", do=do, images=images)


def _drawings(target: Target) -> Iterator[tuple[str, Cause, Target, tuple[str, ...]]]:
    """The drawing with one thing put right: in words, its kind, the drawing, the boards."""
    plain = [index for index, board in enumerate(target.boards) if board.points is None]
    changes = {index: list(_changes(target.boards[index])) for index in plain}
    for index in plain:
        name = target.boards[index].name
        for what, cause, board in changes[index]:
            yield f"board {name}: {what}", cause, target.with_boards({index: board}), (name,)
    for number in range(min(len(own) for own in changes.values())):
        every = {index: changes[index][number] for index in plain}
        if len({what for what, _, _ in every.values()}) > 1:
            first = next(iter(every.values()))[0]
            what = f"all boards: {first.partition(':')[0]}"
        else:
            what = f"all boards: {next(iter(every.values()))[0]}"
        cause = next(iter(every.values()))[1]
        names = tuple(target.boards[index].name for index in plain)
        yield what, cause, target.with_boards({i: one[2] for i, one in every.items()}), names
    for one, other in combinations(plain, 2):
        a, b = target.boards[one], target.boards[other]
        exchanged = {one: _placed(a, b), other: _placed(b, a)}
        yield (
            f"the places of boards {a.name} and {b.name} are exchanged",
            "board_names",
            target.with_boards(exchanged),
            (a.name, b.name),
        )


def _changes(board: Board) -> Iterator[tuple[str, Cause, Board]]:
    size = f"corners: [{board.columns}, {board.rows}] for [{board.rows}, {board.columns}]"
    yield (
        f"rows and columns are exchanged: {size}",
        "board_order",
        replace(board, columns=board.rows, rows=board.columns),
    )
    if board.has_squares:
        other: FirstSquare = "light" if board.first_square == "dark" else "dark"
        drawn = board.in_mirror() if board.mirrored else board
        says = "light" if drawn.first_square == "dark" else "dark"
        yield (
            f"its squares are dark where target.yaml has light ones: first_square: {says}",
            "board_order",
            replace(board, first_square=other),
        )
    yield "y_axis points the other way round", "board_order", replace(board, y_axis=-board.y_axis)
    yield "x_axis points the other way round", "board_order", replace(board, x_axis=-board.x_axis)
    yield (
        "x_axis and y_axis point the other way round",
        "board_order",
        replace(board, x_axis=-board.x_axis, y_axis=-board.y_axis),
    )
    last = board.world_points(board.columns - 1, 0)
    yield (
        "columns run the other way round: origin is at their other end",
        "board_order",
        replace(board, origin=last, x_axis=-board.x_axis),
    )
    for ratio, words in _UNITS.items():
        for factor in (ratio, 1 / ratio):
            yield (
                f"its square is {ratio:g} times too {'small' if factor > 1 else 'large'}: {words}, "
                "or the reverse",
                "board_square",
                replace(board, square=board.square * factor),
            )


def _placed(board: Board, other: Board) -> Board:
    return replace(board, origin=other.origin, x_axis=other.x_axis, y_axis=other.y_axis)
