"""What is said when no corner can be named, or hardly one: what was seen, and what to do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from cubicfish_cli.naming.decide import Verdict
from cubicfish_cli.naming.name_grids import FEWEST_CORNERS, GridReport, Naming
from cubicfish_cli.naming.wrong_drawing.count import Count
from cubicfish_cli.target import Board, Target

HOW_MIRRORED = "say mirrored: true at the top of target.yaml"
"""What to do where the camera looks into a mirror."""

WHY = {
    Verdict.AMBIGUOUS: "several places on the target fit nearly as well",
    Verdict.SLIDE: "no end of a board is seen, so it could be anywhere along it",
    Verdict.TWIN: "it could be any of several boards that look alike",
    Verdict.NO_FIT: "fits no place on the target",
    Verdict.TOO_LARGE: "larger than every board of the target",
    Verdict.COLOURS: "its squares are light where those of the board are dark",
    Verdict.NOT_PLANE: "its corners are no plane of squares",
}
_CHECK = "check corners, square, origin and axes of the boards in the target file"
_MORE = "take photos that show two boards, or a board with its ends"
ADVICE = {
    Verdict.AMBIGUOUS: _MORE,
    Verdict.SLIDE: _MORE,
    Verdict.TWIN: "take photos that show these boards together",
    Verdict.NO_FIT: _CHECK,
    Verdict.TOO_LARGE: "if it is a board of the object, correct its corners in the target file",
    Verdict.COLOURS: "check first_square of the boards in target.yaml, and whether the photo is "
    f"mirrored; if the camera looks into a mirror, {HOW_MIRRORED}",
    Verdict.NOT_PLANE: _CHECK,
}
# Photos of another object show the same grid again and again, and so much of its corners is
# larger than every board where it is a larger one.
_COMMON = 0.5
_FEWEST_PHOTOS = 2


def nothing_named(naming: Naming, target: Target) -> str:
    """Why none of the grids, of which there is at least one, could be named."""
    grids = [grid for own in naming.grids for grid in own]
    boards = grid_boards(target)
    if _is_another_object(naming, target):
        return another_object(naming, target)
    largest = max(grids, key=lambda grid: grid.corners)
    photos = sum(bool(own) for own in naming.grids)
    for board in boards:
        if sorted(largest.size) == sorted((board.columns - 1, board.rows - 1)):
            return _counted_squares(board, 1)
    why = Counter(grid.verdict for grid in grids).most_common(1)[0][0]
    says = ", ".join(f"{board.columns}x{board.rows}" for board in boards[:6])
    return (
        f"found {len(grids)} grid{'s' * (len(grids) != 1)} of up to {_times(largest.size)} "
        f"inner corners in {_photos(photos)}, but none can be placed on the target ({says}): "
        f"{WHY[why]}; {ADVICE[why]}"
    )


def counted_squares(naming: Naming, target: Target) -> str | None:
    """What to say when photo after photo shows one board whole, one corner smaller both ways."""
    boards = grid_boards(target)
    if len(boards) != 1:
        return None
    columns, rows = sorted((boards[0].columns, boards[0].rows))
    largest = [max(own, key=len) for own in naming.found if own]
    sizes = [tuple(sorted((np.ptp(grid.cells, axis=0) + 1).tolist())) for grid in largest]
    counted = (columns - 1, rows - 1)
    whole = sum(
        size == counted and len(grid) == size[0] * size[1]
        for grid, size in zip(largest, sizes, strict=True)
    )
    larger = any(size[0] > counted[0] or size[1] > counted[1] for size in sizes)
    if whole and 2 * whole >= len(largest) and not larger:
        return _counted_squares(boards[0], whole)
    return None


def wrong_object(naming: Naming, counts: Sequence[Count], target: Target) -> str | None:
    """What to say when corners have names, but those of another object's boards.

    Args:
        naming: the names.
        counts: what photos show of boards' sizes.
        target: the object.

    """
    boards = grid_boards(target)
    if len(boards) == 1:
        off = [
            np.abs(np.subtract(count.size, (boards[0].columns, boards[0].rows))) for count in counts
        ]
        return another_object(naming, target) if any(one.sum() > 1 for one in off) else None
    grids = [grid for own in naming.grids for grid in own if grid.corners >= FEWEST_CORNERS]
    corners = sum(grid.corners for grid in grids)
    beyond = sum(grid.corners for grid in grids if grid.verdict is Verdict.TOO_LARGE)
    together = sum(sum(grid.named for grid in own) > 1 for own in naming.grids)
    seen = sum(bool(own) for own in naming.grids)
    if beyond > _COMMON * corners and together < _COMMON * seen:
        return another_object(naming, target)
    return None


def another_object(naming: Naming, target: Target) -> str:
    """That photos and target.yaml are of different objects: what both show."""
    largest = _largest(naming)
    size = max(largest, key=lambda grid: grid.corners).size
    boards = grid_boards(target)
    says = ", ".join(f"{board.name} {_times((board.columns, board.rows))}" for board in boards[:6])
    more = f" and {len(boards) - 6} more boards" if len(boards) > 6 else ""
    one = len(boards) == 1
    return (
        f"{_photos(len(largest))} show{'s' * (len(largest) == 1)} grids of up to {_times(size)} "
        f"inner corners, but target.yaml has {'one board' if one else 'boards'} of another size "
        f"({says}{more}): give the target.yaml of the object in the photos, or correct its "
        "corners, which are counted where four squares meet"
    )


def grid_boards(target: Target) -> list[Board]:
    """The boards that show as a grid of squares."""
    return [board for board in target.boards if board.has_squares]


def _is_another_object(naming: Naming, target: Target) -> bool:
    """Whether photo after photo shows one grid whole that is none of the boards."""
    grids = [grid for own in naming.grids for grid in own]
    if all(grid.verdict is Verdict.TOO_LARGE for grid in grids):
        return True
    full = Counter(
        size
        for own in naming.grids
        for size in {
            (max(grid.size), min(grid.size))
            for grid in own
            if grid.corners == grid.size[0] * grid.size[1] >= FEWEST_CORNERS
        }
    )
    drawn = {tuple(sorted((b.columns, b.rows), reverse=True)) for b in grid_boards(target)}
    seen = sum(bool(own) for own in naming.grids)
    least = max(_FEWEST_PHOTOS, _COMMON * seen)
    return any(photos >= least for size, photos in full.items() if size not in drawn)


def _largest(naming: Naming) -> list[GridReport]:
    """The largest grid of each photo that has one."""
    return [max(own, key=lambda grid: grid.corners) for own in naming.grids if own]


def _counted_squares(board: Board, photos: int) -> str:
    return (
        f"found {board.columns - 1}x{board.rows - 1} inner corners in {_photos(photos)}, but the "
        f"target says {board.columns}x{board.rows}: were squares counted? The target's corners "
        "are those where four squares meet"
    )


def _times(size: tuple[int, int]) -> str:
    """A size with the longer side first, as boards lie in photos any way round."""
    return f"{max(size)}x{min(size)}"


def _photos(count: int) -> str:
    return f"{count} photo{'s' * (count != 1)}"
