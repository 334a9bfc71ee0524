"""What is wrong with boards of markers: their rows, colours, gaps and kind.

Markers may lie in another way than the target says, be printed in other colours, have other gaps,
or be of another kind. The photos that show most are read again as the boards might be.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from cubicfish.diagnosis.evidence import MarkerEvidence
from cubicfish.find.detection.grids import FoundGrids
from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.solve.statistics import neighbours
from cubicfish.target.boards.board import Board, FirstSquare
from cubicfish.target.boards.markers import MARKER_DICTIONARIES, alike
from cubicfish.target.observations import Observations
from cubicfish.target.target import Target
from cubicfish.types import FloatArray, IntArray

if TYPE_CHECKING:
    from cubicfish.photos.photos import Picture

# Number of photos that are read again: those that show most.
_PHOTOS = 3
# Most columns that a board may have.
_MOST_COLUMNS = 40
# Fewest corners that show anything.
_FEWEST_CORNERS = 4
# Side by side in a row, two or three markers agree however long rows are: a whole board must agree
# in a photo, and so many times more markers than for any other length. Likewise so many markers of
# one family are no accident if they are so many times more than those of any other.
_LEAST_MARKERS, _CLEARLY = 4, 2
_COLOURS: tuple[FirstSquare, ...] = ("dark", "light")
_NO_IDS: IntArray = np.empty(0, np.intp)
# So many gaps show anything, and this percentage of them must be off to the same side.
_LEAST_GAPS, _MOST = 12, 80
# By how much, as a share: corners are exact to a hundredth of a gap, outlines of tags are not.
_OFF, _OFF_OUTLINES = 0.05, 0.2


def otherwise_laid_out(evidence: MarkerEvidence) -> list[Finding]:
    """Find boards hardly a corner of which has a name, though markers are read: rows are of others.

    Ids run row by row, so the markers that follow each other across rows show how long rows are.
    """
    boards = evidence.target.boards
    indices = range(len(boards)) if hardly_named(evidence) else unseen_boards(evidence)
    found = (_find_rows(evidence, index) for index in indices if _may_differ(boards[index]))
    return [one for one in found if one is not None]


def _may_differ(board: Board) -> bool:
    """Whether a board has markers that can be read as they are, in rows of any length."""
    return board.markers is not None and not board.mirrored and not board.markers.inverted


def _find_rows(evidence: MarkerEvidence, index: int) -> Finding | None:
    """Find that the rows of a board are longer or shorter than the target says."""
    from cubicfish.find.detection.markers import find_marked_corners  # for photos alone
    from cubicfish.find.detection.markers_measure import agreeing_markers

    board = evidence.target.boards[index]
    boards = _try_layouts(board)
    layouts = [evidence.target.with_boards({index: other}) for other in boards]
    photos = list(richest(evidence))
    counts: IntArray = np.zeros(len(boards), np.intp)
    for picture, grids in photos:
        counts = np.maximum(counts, agreeing_markers(picture, layouts, index, grids))
    best = int(counts.argmax())
    if _is_laid_out_alike(boards[best], board):
        return None
    longer = np.array([other.columns != boards[best].columns for other in boards])
    if counts[best] < max(_LEAST_MARKERS, _CLEARLY * int(counts[longer].max(initial=0))):
        return None
    seen = [find_marked_corners(picture, layouts[best], grids) for picture, grids in photos]
    rows = np.concatenate([one.row[one.board == index] for one in seen])
    if not len(rows):
        return None
    some = len(evidence.corners.pixel) > 0 and not hardly_named(evidence)
    severity = Severity.CARE if some else Severity.BAD
    return _describe_rows(board, boards[best], rows, int(counts[best]), severity)


def _try_layouts(board: Board) -> list[Board]:
    """The board with rows of any length, and as many rows as there are markers for."""
    squares: Sequence[FirstSquare] = _COLOURS if board.has_squares else (board.first_square,)
    lengths = range(1, _MOST_COLUMNS + 1)
    layouts = [_lay_out_rows(board, length, first) for length in lengths for first in squares]
    usable = [one for one in layouts if one is not None]
    # The first one shall have all markers.
    return sorted(usable, key=lambda one: -(one.markers.count if one.markers else 0))


def _lay_out_rows(board: Board, length: int, first: FirstSquare) -> Board | None:
    """The board with so many columns of squares' corners, or of tags; None if there is none.

    It has as many rows as there are markers for.
    """
    markers = board.markers
    if markers is None:
        return None
    available = MARKER_DICTIONARIES[markers.dictionary] - markers.first
    if board.per_cell == 2:
        high = available // length
        columns, rows, count = 2 * length, 2 * high, length * high
    else:
        carrying = first == "light"
        high = (2 * available - carrying) // (length + 1)
        columns, rows, count = length, high - 1, (high * (length + 1) + carrying) // 2
    if min(columns, rows) < 2 or count < _LEAST_MARKERS:
        return None
    return replace(
        board,
        columns=columns,
        rows=rows,
        first_square=first,
        markers=replace(markers, count=count),
        shape=None,
    )


def _is_laid_out_alike(one: Board, other: Board) -> bool:
    return one.columns == other.columns and one.first_square == other.first_square


def _describe_rows(
    board: Board, other: Board, rows: IntArray, markers: int, severity: Severity
) -> Finding:
    # Tags are counted from the bottom.
    last = other.rows - int(rows.min()) if board.per_cell == 2 else int(rows.max()) + 1
    return Finding(
        code=Code.CORNER_COUNT,
        case="tags" if board.per_cell == 2 else "markers",
        severity=severity,
        boards=(board.name,),
        figures={
            "board": board.name,
            "markers": markers,
            "columns": other.columns // board.per_cell,
            "rows": last // board.per_cell,
            "drawn_columns": board.columns // board.per_cell,
            "drawn_rows": board.rows // board.per_cell,
            "first_square": other.first_square,
        },
    )


def otherwise_printed(evidence: MarkerEvidence) -> list[Finding]:
    """Find that markers of unseen boards are inverted, or that photos are mirrored."""
    from cubicfish.find.detection.markers import find_marked_corners  # for photos alone

    target, unseen = evidence.target, unseen_boards(evidence)
    if not unseen:
        return []
    changed = {
        index: target.boards[index].with_other_colours()
        for index in unseen
        if target.boards[index].has_squares
    }
    kinds = {target.boards[index].kind for index in unseen}
    others = [target.with_boards(changed)] if "charuco" in kinds else []
    # Where some boards are read as they are, the photos are not mirrored.
    marked = sum(board.markers is not None for board in target.boards)
    if len(unseen) == marked:
        others += [one.in_mirror() for one in (target, *others)]
    if not others:
        return []
    for picture, grids in richest(evidence):
        for other in others:
            found = find_marked_corners(picture, other, grids)
            boards = [index for index in unseen if (found.board == index).any()]
            if np.isin(found.board, unseen).sum() >= _FEWEST_CORNERS:
                return [_describe_print(target, other, boards, len(found))]
    return []


def _describe_print(target: Target, other: Target, boards: list[int], corners: int) -> Finding:
    names = tuple(target.boards[index].name for index in boards)
    first, now = target.boards[boards[0]], other.boards[boards[0]]
    inverted = (
        first.markers is not None
        and now.markers is not None
        and first.markers.inverted != now.markers.inverted
    )
    mirrored = target.mirrored != other.mirrored
    printed = "inverted"
    if mirrored and inverted:
        printed = "inverted_mirrored" if other.mirrored else "inverted_not_mirrored"
    elif mirrored:
        printed = "mirrored" if other.mirrored else "not_mirrored"
    return Finding(
        code=Code.MIRRORED if mirrored else Code.INVERTED,
        case="markers" if mirrored else "",
        severity=Severity.BAD if mirrored else Severity.CARE,
        boards=names,
        figures={
            "printed": printed,
            "light": first.markers is not None and not first.markers.inverted,
            "first_square": other.as_printed().boards[boards[0]].first_square,
            "corners": corners,
        },
    )


def no_markers(evidence: MarkerEvidence) -> list[Finding]:
    """Find that no photo shows the target's markers, and which ones photos show."""
    markers = [board.markers for board in evidence.target.boards if board.markers is not None]
    says = [f"{one.first} to {one.first + one.count - 1} of {one.dictionary}" for one in markers]
    finding = Finding(
        code=Code.NO_MARKERS,
        case="all",
        severity=Severity.BAD,
        figures={"photos": evidence.photos, "says": ", ".join(dict.fromkeys(says))},
    )
    dictionary, ids = _read_any_markers(evidence)
    own = [one for one in markers if one.dictionary in alike(dictionary)]
    if not len(ids):
        return [finding]
    known = {int(id) for one in own for id in ids if 0 <= id - one.first < one.count}
    if known:
        figures = {**finding.figures, "markers": len(known)}
        return [replace(finding, case="unplaced_in_all", figures=figures)]
    names = [*(one.dictionary for one in own), *alike(dictionary)]
    seen = next(name for name in names if MARKER_DICTIONARIES[name] > ids.max())
    figures = {**finding.figures, "seen": seen, "first": int(ids.min()), "last": int(ids.max())}
    return [replace(finding, case="others", figures=figures)]


def _read_any_markers(evidence: MarkerEvidence) -> tuple[str, IntArray]:
    """Read the markers that photos show, whatever the target says: dictionary and ids, if any.

    The ids of a board follow each other; those of other things that look like markers do not.
    """
    from cubicfish.find.detection.markers_measure import (
        markers_of_any_kind,  # for photos alone
    )

    seen = [markers_of_any_kind(picture) for picture, _ in richest(evidence)]
    rows = []
    for name in seen[0] if seen else ():
        ids = np.unique(np.concatenate([one[name] for one in seen]))
        rows.append((name, ids[np.isin(ids, ids - 1) | np.isin(ids, ids + 1)]))
    *_, next_best, best = sorted(rows, key=lambda row: len(row[1])) or [("", _NO_IDS)] * 2
    clear = len(best[1]) >= max(_LEAST_MARKERS, _CLEARLY * len(next_best[1]))
    return best if clear else (best[0], _NO_IDS)


def other_spacing(evidence: MarkerEvidence) -> list[Finding]:
    """Find boards of tags with another spacing, by gaps between corners or between tags."""
    from cubicfish.find.detection.markers_measure import tags_apart  # for photos alone

    target, findings = evidence.target, []
    for index, board in enumerate(target.boards):
        if board.per_cell != 2 or board.markers is None:
            continue
        gaps, off = _measure_gaps(evidence.corners, index), _OFF
        if len(gaps) < _LEAST_GAPS and not target.mirrored:
            photos = richest(evidence)
            apart = [tags_apart(picture, target, index, grids) for picture, grids in photos]
            gaps, off = np.concatenate([np.zeros(0), *apart]) - 1, _OFF_OUTLINES
        if len(gaps) < _LEAST_GAPS:
            continue
        low, middle, high = np.percentile(gaps, [100 - _MOST, 50, _MOST]) / board.spacing
        if low > 1 + off or high < 1 - off:
            finding = Finding(
                code=Code.BOARD_SQUARE,
                case="spacing",
                severity=Severity.BAD,
                boards=(board.name,),
                figures={
                    "gaps": len(gaps),
                    "spacing": float(middle * board.spacing),
                    "drawn_spacing": board.spacing,
                },
            )
            findings.append(finding)
    return findings


def _measure_gaps(corners: Observations, board: int) -> FloatArray:
    """Measure gaps between tags of a board, in sides of the tags on both sides of each gap.

    The cross-ratio of four corners in a line hardly depends on how the lens or the view stretches
    it.
    """
    own = corners.select(corners.board == board)
    if not len(own.pixel):
        return np.zeros(0)
    parts = []
    for following, place in zip(neighbours(own), (own.column, own.row), strict=True):
        line = np.flatnonzero(place % 2 == 0)[None]
        for _ in range(3):
            line = line[:, following[line[-1]] >= 0]
            line = np.concatenate([line, following[line[-1]][None]])
        first, gap, last = np.linalg.norm(np.diff(own.pixel[line], axis=0), axis=-1)
        parts.append(gap / (0.5 * (first + last)))
    return np.concatenate(parts)


def unseen_boards(evidence: MarkerEvidence) -> list[int]:
    """The boards with markers of which no photo shows a corner."""
    seen = set(np.unique(evidence.corners.board).tolist())
    return [
        index
        for index, board in enumerate(evidence.target.boards)
        if board.markers is not None and index not in seen
    ]


def hardly_named(evidence: MarkerEvidence) -> bool:
    """Whether most of the photos that show most squares have no named corner.

    The few names in the other photos are then no better: two markers side by side lie on many a
    board as the target says.
    """
    named = np.isin(_sort_richest_first(evidence)[:_PHOTOS], evidence.corners.image)
    return bool(2 * named.sum() < len(named))


def richest(evidence: MarkerEvidence) -> Iterator[tuple[Picture, FoundGrids]]:
    """Yield brightness and grids of the photos that show most, the one with most first."""
    from cubicfish.find.detection.finder import find_grids  # for photos alone

    pictures = (
        (evidence.picture(one), evidence.grids[one]) for one in _sort_richest_first(evidence)
    )
    known = (
        (picture, grids if grids.searched else find_grids(picture))
        for picture, grids in pictures
        if picture is not None
    )
    return islice(known, _PHOTOS)


def _sort_richest_first(evidence: MarkerEvidence) -> list[int]:
    named = np.bincount(evidence.corners.image, minlength=len(evidence.grids))
    shown = [sum(map(len, found.grids)) for found in evidence.grids]
    return sorted(range(len(shown)), key=lambda number: -max(shown[number], int(named[number])))
