"""Photos whose grids are not the target's: boards with more or fewer corners, another target.

A board has more corners if photos show it as a larger grid, and never as its nominal size. It has
fewer if whole grids of one size end in view of the lens, and no photo shows more. If photos show
boards and give no corners, and they are many, the set-up is to blame.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cubicfish.diagnosis.evidence import (
    GridEvidence,
    PhotoEvidence,
    boards_with_squares,
    grid_boards,
)
from cubicfish.find.detection.grids import Grid
from cubicfish.find.identification.identified import (
    CODES,
    FEWEST_CORNERS,
    Decided,
    Identified,
    Place,
)
from cubicfish.fit.calibration import FitEvidence
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.target.boards.board import Board
from cubicfish.target.placement import TURNS
from cubicfish.target.target import Target
from cubicfish.types import BoolArray, IntArray
from cubicfish.wording import listed

if TYPE_CHECKING:
    from cubicfish.find.identification.ends import Ends  # it loads pictures
    from cubicfish.find.identification.scene import Scene

# Photos that must show the whole board before squares count as counted for corners.
_WHOLE_BOARDS = 3
# Share of the photos of another target that show the same grid whole.
_COMMON = 0.5
# Number of sizes of grids that are listed.
_MOST_SIZES = 4
# Fewest photos that must show a thing: in one photo, anything may cover a line of corners, or two
# things may look like one grid.
_FEWEST_PHOTOS = 2
# Fewer photos that are lost for one reason may be of another board, or taken by mistake. And where
# boards have their names in so many photos, whatever is larger stands in the background.
_MANY = 1 / 3
# A grid fills its box if it has this share of it.
_FILLED = 0.9
# Share of the grids that end in view that must have equally many lines.
_AGREE_SHARE = 0.8
# A line of corners should be in view if so many of them would be visible.
_LINE_CORNERS = 3
Size = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class Count:
    """How many corners a board has, as photos show it.

    Attributes:
        board: index into the target's boards.
        size: the numbers of columns and rows that are seen.
        photos: how many photos show it.

    """

    board: int
    size: Size
    photos: int


def squares_of_corners(evidence: FitEvidence) -> list[Finding]:
    """Find boards that photos show whole, except for the last column and row of the target.

    Corners of a table may be counted rightly where the squares of the target were counted.
    """
    pairs, boards = evidence.pairs, []
    for index, board in enumerate(evidence.target.boards if evidence.target else ()):
        own = pairs.board == index
        if board.points is not None or not own.any() or min(board.columns, board.rows) < 3:
            continue
        last = pairs.column[own].max() + 1, pairs.row[own].max() + 1
        if last != (board.columns - 1, board.rows - 1):
            continue
        seen = np.bincount(pairs.image[own], minlength=len(pairs.images))
        if (seen == last[0] * last[1]).sum() >= _WHOLE_BOARDS:
            boards.append(board)
    return [squares_counted(boards)] if boards else []


def squares_of_grids(evidence: GridEvidence) -> list[Finding]:
    """Find boards that many photos show whole, with one corner less both ways."""
    boards = grid_boards(evidence.target)
    if len(boards) != 1:
        return []
    columns, rows = sorted((boards[0].columns, boards[0].rows))
    largest = [max(own, key=len) for own in evidence.identified.found if own]
    sizes = [tuple(sorted((np.ptp(grid.cells, axis=0) + 1).tolist())) for grid in largest]
    counted = (columns - 1, rows - 1)
    whole = sum(
        size == counted and len(grid) == size[0] * size[1]
        for grid, size in zip(largest, sizes, strict=True)
    )
    larger = any(size[0] > counted[0] or size[1] > counted[1] for size in sizes)
    if whole and 2 * whole >= len(largest) and not larger:
        return [squares_counted(boards, whole)]
    return []


def squares_counted(boards: Sequence[Board], photos: int | None = None) -> Finding:
    """Report that boards have one corner less each way than the target says.

    Args:
        boards: the boards, at least one.
        photos: how many photos show it, where no photo can be used; None where the corners of a
            table are counted rightly.

    """
    first = boards[0]
    return Finding(
        code=Code.CORNER_COUNT,
        case="squares" if photos is None else "all_squares",
        severity=Severity.NOTE if photos is None else Severity.BAD,
        boards=tuple(board.name for board in boards),
        figures={
            "columns": first.columns - 1,
            "rows": first.rows - 1,
            "drawn_columns": first.columns,
            "drawn_rows": first.rows,
            "photos": photos,
        },
    )


def miscounted(evidence: GridEvidence) -> list[Finding]:
    """Find boards of which photos show another number of corners."""
    counts = evidence.counts
    if not counts:
        return []
    boards = [evidence.target.boards[one.board] for one in counts]
    seen = [
        {
            "board": board.name,
            "columns": count.size[0],
            "rows": count.size[1],
            "drawn_columns": board.columns,
            "drawn_rows": board.rows,
        }
        for count, board in zip(counts, boards, strict=True)
    ]
    fewest, most = min(one.photos for one in counts), max(one.photos for one in counts)
    finding = Finding(
        code=Code.CORNER_COUNT,
        severity=Severity.CARE,
        boards=tuple(board.name for board in boards),
        figures={
            "counts": seen,
            "alike": fewest == most,
            "fewest": fewest,
            "most": most,
            "photos": len(evidence.names),
        },
    )
    return [finding]


def count_corners(identified: Identified, target: Target) -> list[Count]:
    """Count the corners of boards where photos show another number than the nominal target.

    Args:
        identified: what became of the photos' grids.
        target: the nominal target.

    Returns:
        One count for each board that has more or fewer corners, in the order of the boards.

    """
    boards = boards_with_squares(target)
    counts = _find_more(identified, target, boards)
    counts |= _find_fewer(identified, target, [one for one in boards if one not in counts])
    return [counts[index] for index in sorted(counts)]


def _find_more(identified: Identified, target: Target, boards: list[int]) -> dict[int, Count]:
    """Find boards that are a line longer: grids that fit nowhere, in photos without the board."""
    of_nominal, shown = defaultdict[int, set[int]](set), defaultdict[int, set[int]](set)
    larger = defaultdict[tuple[int, ...], set[int]](set)
    for photo, own in enumerate(identified.grids):
        for number, report in enumerate(own):
            size = tuple(sorted(report.size))
            if report.place is not None:
                board = target.boards[report.place.board]
                shown[report.place.board].add(photo)
                if size == tuple(sorted((board.columns, board.rows))):
                    of_nominal[report.place.board].add(photo)
            elif report.corners >= FEWEST_CORNERS and _is_full(identified.found[photo][number]):
                larger[size].add(photo)
    counts = {}
    for index in boards:
        board = target.boards[index]
        other = of_nominal[index] if len(boards) == 1 else shown[index]
        for size in ((board.columns + 1, board.rows), (board.columns, board.rows + 1)):
            photos = larger[tuple(sorted(size))] - other
            if len(photos) >= max(_FEWEST_PHOTOS, len(of_nominal[index]) + 1):
                counts[index] = Count(board=index, size=size, photos=len(photos))
    return counts


def _find_fewer(identified: Identified, target: Target, boards: list[int]) -> dict[int, Count]:
    """Find boards of which many photos show as many corners, and both ends; no photo shows more."""
    doubtful = [index for index in boards if not _is_shown_whole(identified, target, index)]
    scene = identified.scene
    if scene is None or scene.camera is None or not doubtful:
        return {}
    scene = scene.placed()
    alone = len(boards_with_squares(target)) == 1
    seen = defaultdict[int, list[_Extent]](list)
    for own, reports in zip(scene.photos, identified.grids, strict=True):
        for index, report in zip(sorted(own), reports, strict=True):
            place = report.place
            if place is None or place.board not in doubtful or report.corners < FEWEST_CORNERS:
                continue
            seen[place.board].append(_find_extent(scene, own, index, place, alone=alone))
    counts = {index: _count_fewer(target, index, grids) for index, grids in seen.items()}
    return {index: count for index, count in counts.items() if count is not None}


_Extent = tuple[IntArray, BoolArray | None]
"""How many columns and rows (2,) a grid has, and which of these ways (2,) both ends of its board
are seen; None of a grid that has gaps."""


def _find_extent(
    scene: Scene, own: Sequence[int], index: int, place: Place, *, alone: bool
) -> _Extent:
    """Find how far a grid of a photo reaches on its board, which may be alone on its target."""
    board, grid, turn = scene.target.boards[place.board], scene.grids[index], TURNS[place.turn]
    size, extent = np.array([board.columns, board.rows]), grid.cells.max(axis=0) + 1
    axes = np.abs(turn).argmax(axis=1)
    if alone and (extent[axes[0]] < extent[axes[1]]) == (size[0] >= size[1]):
        axes = axes[::-1]  # any place will do: it lies as its longer side does
    ends = scene.ends(own, index) if scene.poses[index] is not None else None
    if ends is None or not _is_full(grid):
        return extent[axes], None
    ended = _find_ends_in_view(ends)[axes]
    if not alone:
        cells = grid.cells @ turn.T + [place.column, place.row]
        ended = np.where(turn.sum(axis=1)[:, None] < 0, ended[:, ::-1], ended)
        ended |= np.stack([cells.min(axis=0) == 0, cells.max(axis=0) == size - 1], axis=1)
    return extent[axes], ended.all(axis=1)


def _count_fewer(target: Target, index: int, grids: Sequence[_Extent]) -> Count | None:
    """Count a board's corners, if hardly any grid that ends in view has fewer than the largest."""
    board, most = target.boards[index], np.max([extent for extent, _ in grids], axis=0)
    short = most < [board.columns, board.rows]
    ending = [extent for extent, ended in grids if ended is not None and ended[short].all()]
    alike = sum(bool((extent == most)[short].all()) for extent in ending)
    if alike < max(_FEWEST_PHOTOS, _AGREE_SHARE * len(ending)):
        return None
    columns, rows = most.tolist()
    return Count(board=index, size=(columns, rows), photos=alike)


def _is_shown_whole(identified: Identified, target: Target, index: int) -> bool:
    """Whether photos show the first and the last columns and rows of the nominal board.

    Where one board is the whole target, a photo must show as many corners.
    """
    board = target.boards[index]
    nominal = np.array([board.columns, board.rows])
    if len(boards_with_squares(target)) == 1:
        reports = [one for own in identified.grids for one in own if one.named]
        sizes = [sorted(one.size) for one in reports if one.corners >= FEWEST_CORNERS]
        return not sizes or bool((np.max(sizes, axis=0) >= sorted(nominal)).all())
    corners = identified.corners
    own = np.stack([corners.column, corners.row], axis=1)[corners.board == index]
    return not len(own) or not (own.min(axis=0).any() or (own.max(axis=0) < nominal - 1).any())


def _is_full(grid: Grid) -> bool:
    """Whether a grid has nearly all corners of its box."""
    return bool(len(grid) >= _FILLED * (grid.cells.max(axis=0) + 1).prod())


def _find_ends_in_view(ends: Ends) -> BoolArray:
    """(2, 2) before and after the grid along i and j: whether a next line is missing in view."""
    missing = np.array([ends.table[tuple(room)] for room in np.eye(4, dtype=np.intp)])
    return np.asarray(missing.reshape(2, 2) >= _LINE_CORNERS)


def nothing_named(evidence: GridEvidence) -> list[Finding]:
    """Find why none of the grids could be named, if there are any."""
    identified, target = evidence.identified, evidence.target
    grids = [grid for own in identified.grids for grid in own]
    if not grids:
        return []
    boards = grid_boards(target)
    seen = sum(bool(own) for own in identified.grids)
    common = max(_FEWEST_PHOTOS, _COMMON * seen)
    others = _list_other_sizes(identified, target, common)
    if others or all(grid.verdict is Decided.TOO_LARGE for grid in grids):
        return [_describe_another_target(identified, target)]
    columns, rows = _find_largest(identified)
    for board in boards:
        if (columns, rows) == _sort_sides((board.columns - 1, board.rows - 1)):
            return [squares_counted([board], 1)]
    why = CODES[Counter(grid.verdict for grid in grids).most_common(1)[0][0]]
    finding = Finding(
        code=Code.NOTHING_NAMED,
        severity=Severity.BAD,
        figures={
            "grids": len(grids),
            "columns": columns,
            "rows": rows,
            "photos": seen,
            "says": ", ".join(f"{board.columns}x{board.rows}" for board in boards[:6]),
            "why": why.value,
        },
    )
    return [finding]


def another_target(evidence: GridEvidence) -> list[Finding]:
    """Find that corners have names, but are those of another target's boards."""
    identified, target = evidence.identified, evidence.target
    boards = grid_boards(target)
    nominal = (boards[0].columns, boards[0].rows)
    counts = evidence.counts if len(boards) == 1 else []
    other = any(np.abs(np.subtract(one.size, nominal)).sum() > 1 for one in counts)
    grids = [grid for own in identified.grids for grid in own if grid.corners >= FEWEST_CORNERS]
    beyond = sum(grid.corners for grid in grids if grid.verdict is Decided.TOO_LARGE)
    enough = min(2, len(boards))
    named = sum(sum(grid.named for grid in own) >= enough for own in identified.grids)
    seen = sum(bool(own) for own in identified.grids)
    if 2 * beyond > sum(grid.corners for grid in grids) and named < _MANY * seen:
        other = True
    return [_describe_another_target(identified, target)] if other else []


def _describe_another_target(identified: Identified, target: Target) -> Finding:
    """Report that photos and target.yaml are of different targets, and what both show."""
    boards = grid_boards(target)
    # The longer side comes first, since boards lie in photos any way round.
    sizes = [_sort_sides((board.columns, board.rows)) for board in boards]
    named = list(zip(boards, sizes, strict=True))[:6]
    says = ", ".join(f"{board.name} {long}x{short}" for board, (long, short) in named)
    more = f" and {len(boards) - 6} more boards" if len(boards) > 6 else ""
    return Finding(
        code=Code.ANOTHER_TARGET,
        severity=Severity.BAD,
        boards=tuple(board.name for board in boards),
        figures={
            "photos": _count_photos(identified),
            "seen": _describe_sizes(identified, target),
            "says": says + more,
        },
    )


def _count_photos(identified: Identified) -> int:
    """How many photos show a grid."""
    return sum(bool(own) for own in identified.grids)


def _describe_sizes(identified: Identified, target: Target, *, too_large: bool = False) -> str:
    """Sizes of grids that photos show whole and the target does not have, or of the largest.

    Args:
        identified: what became of all grids.
        target: the calibration target.
        too_large: whether sizes that a board of the target could show in part are left out.

    """
    common = _list_other_sizes(identified, target, _FEWEST_PHOTOS, _MOST_SIZES)
    if too_large:
        boards = [_sort_sides((board.columns, board.rows)) for board in grid_boards(target)]
        common = [
            (size, photos)
            for size, photos in common
            if all(size[0] > long or size[1] > short for long, short in boards)
        ]
    if [photos for _, photos in common] == [_count_photos(identified)]:
        (long, short), _ = common[0]
        return f"{long}x{short}"
    if common:
        return listed([f"{long}x{short} (in {photos})" for (long, short), photos in common], "")
    columns, rows = _find_largest(identified)
    return f"up to {columns}x{rows}"


def _list_other_sizes(
    identified: Identified, target: Target, least: float, most: int | None = None
) -> list[tuple[Size, int]]:
    """Sizes of whole grids that are no board's, in how many photos each, of the commonest ones.

    Args:
        identified: what became of all grids.
        target: the calibration target.
        least: what fewer photos show is left out.
        most: so many sizes are looked at; None for all.

    """
    nominal = {_sort_sides((board.columns, board.rows)) for board in grid_boards(target)}
    sizes = _count_whole_grids(identified).most_common(most)
    return [(size, photos) for size, photos in sizes if photos >= least and size not in nominal]


def _count_whole_grids(identified: Identified) -> Counter[Size]:
    """Count the photos with a grid of each size, the longer side first, that has no gap."""
    return Counter(
        size
        for own in identified.grids
        for size in {
            _sort_sides(grid.size)
            for grid in own
            if grid.corners >= max(grid.size[0] * grid.size[1], FEWEST_CORNERS)
        }
    )


def _find_largest(identified: Identified) -> Size:
    """The size of the grid with the most corners, the longer side first."""
    grids = [grid for own in identified.grids for grid in own]
    return _sort_sides(max(grids, key=lambda grid: grid.corners).size)


def _sort_sides(size: Size) -> Size:
    return max(size), min(size)


def many_lost(evidence: PhotoEvidence) -> list[Finding]:
    """Find that one reason loses more than a third of the photos in which boards were found."""
    lost = defaultdict[str, list[Finding]](list)
    for one in evidence.lost:
        lost[one.code].append(one)
    own = max(lost.values(), key=len, default=[])
    if len(own) < _FEWEST_PHOTOS or len(own) <= _MANY * evidence.with_boards:
        return []
    figures = {**own[0].figures, "left_out": len(own), "photos": evidence.with_boards}
    if isinstance(evidence, GridEvidence):
        figures["seen"] = _describe_sizes(
            evidence.identified, evidence.target, too_large=own[0].code == Code.TOO_LARGE
        )
    return [
        Finding(
            code=own[0].code,
            case="many",
            severity=Severity.CARE,
            images=tuple(name for one in own for name in one.images),
            figures=figures,
        )
    ]


def many_grids_left_out(evidence: GridEvidence) -> list[Finding]:
    """Find that more than a third of the grids that may be boards have no place on the target.

    No more of a photo's grids are counted than the target has boards: others are of other things.
    """
    boards, grids, left_out = boards_with_squares(evidence.target), 0, 0
    for own in evidence.identified.grids:
        large = [grid for grid in own if grid.corners >= FEWEST_CORNERS]
        named, few = sum(grid.named for grid in large), min(len(large), len(boards))
        grids += few
        left_out += max(few - named, 0)
    if left_out < _FEWEST_PHOTOS or left_out <= _MANY * grids:
        return []
    seen = set(evidence.corners.board.tolist())
    unseen = [evidence.target.boards[index].name for index in boards if index not in seen]
    figures: dict[str, int | str] = {"left_out": left_out, "grids": grids}
    if unseen:
        figures["unseen"] = listed(unseen, "boards")
    return [
        Finding(
            code=Code.FITS_NOWHERE,
            case="many_grids",
            severity=Severity.CARE,
            boards=tuple(unseen),
            figures=figures,
        )
    ]
