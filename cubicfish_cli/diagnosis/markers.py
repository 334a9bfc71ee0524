"""Why markers of some boards are in no photo."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np

from cubicfish_cli.detection.grids import FoundGrids
from cubicfish_cli.detection.markers import find_marked_corners
from cubicfish_cli.diagnosis.evidence import MarkerEvidence
from cubicfish_cli.photos import Picture
from cubicfish_cli.target import Target
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# Photos in which unseen markers are looked for once more, and how many corners tell.
_PHOTOS = 3
_TELLING_CORNERS = 4


def otherwise_printed(evidence: MarkerEvidence) -> list[Finding]:
    """That markers of some boards are inverted, or photos are mirrored, where they are unseen."""
    target, unseen = evidence.target, _unseen(evidence)
    if not unseen:
        return []
    changed = {index: target.boards[index].with_negative_markers() for index in unseen}
    kinds = {target.boards[index].kind for index in unseen}
    others = [target.with_boards(changed)] if "charuco" in kinds else []
    # Where some boards are read as they are, the photos are not mirrored.
    marked = sum(board.markers is not None for board in target.boards)
    if len(unseen) == marked:
        others += [one.in_mirror() for one in (target, *others)]
    if not others:
        return []
    for picture, grids in islice(_richest(evidence), _PHOTOS):
        for other in others:
            found = find_marked_corners(picture, other, grids)
            boards = [index for index in unseen if (found.board == index).any()]
            if np.isin(found.board, unseen).sum() >= _TELLING_CORNERS:
                return [_printed_so(target, other, boards, len(found))]
    return []


def no_markers(evidence: MarkerEvidence) -> list[Finding]:
    """That no photo shows any."""
    markers = [board.markers for board in evidence.target.boards]
    families = sorted({one.dictionary for one in markers if one is not None})
    figures = {"photos": evidence.photos, "families": ", ".join(families)}
    return [Finding(code=Code.NO_MARKERS, case="all", severity=Severity.BAD, figures=figures)]


def _unseen(evidence: MarkerEvidence) -> list[int]:
    """Boards with markers of which no photo shows a corner."""
    seen = set(np.unique(evidence.corners.board).tolist())
    return [
        index
        for index, board in enumerate(evidence.target.boards)
        if board.markers is not None and index not in seen
    ]


def _richest(evidence: MarkerEvidence) -> Iterator[tuple[Picture, FoundGrids]]:
    """Brightness of photos and their grids, those that show most first."""
    order = sorted(
        range(len(evidence.grids)),
        key=lambda number: -sum(map(len, evidence.grids[number].grids)),
    )
    for number in order:
        picture = evidence.picture(number)
        if picture is not None:
            yield picture, evidence.grids[number]


def _printed_so(target: Target, other: Target, boards: list[int], corners: int) -> Finding:
    names = tuple(target.boards[index].name for index in boards)
    first, now = target.boards[boards[0]], other.boards[boards[0]]
    inverted = (
        first.markers is not None
        and now.markers is not None
        and first.markers.inverted != now.markers.inverted
    )
    mirrored = target.mirrored != other.mirrored
    how = ["inverted"] * inverted
    how += ["mirrored" if other.mirrored else "not_mirrored"] * mirrored
    printed = "_".join(how)
    return Finding(
        code=Code.MIRRORED if mirrored else Code.INVERTED,
        case="markers" if mirrored else "",
        severity=Severity.BAD if mirrored else Severity.CARE,
        boards=names,
        figures={
            "printed": printed,
            "print_help": printed,
            "light": first.markers is not None and not first.markers.inverted,
            "first_square": other.as_printed().boards[boards[0]].first_square,
            "corners": corners,
        },
    )
