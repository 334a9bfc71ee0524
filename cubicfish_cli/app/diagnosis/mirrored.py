"""Photos, targets or markers that are the other way round, as in a mirror or in a negative.

No lens turns a picture inside out: on every photo of a printed face the row grows to the right of
the direction in which the column grows, or corners are in another order, or the photo is mirrored.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from cubicfish_cli.app.diagnosis.evidence import GridEvidence, MarkerEvidence, grid_boards
from cubicfish_cli.core.boards.markers import MARKER_DICTIONARIES, alike
from cubicfish_cli.core.codes import Code, Severity
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.fit.evidence import FailedFit
from cubicfish_cli.core.fit.radial_reference import fit_radial
from cubicfish_cli.core.fit.robust import neighbours, noise_px
from cubicfish_cli.core.fit.subset import flatness
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.types import IntArray
from cubicfish_cli.corners.detection.grids import FoundGrids

if TYPE_CHECKING:
    from cubicfish_cli.app.photos import Picture

# Fewer squares than this, or a smaller majority of them, say nothing.
_FEWEST = 3
_MAJORITY = 0.9
_SURE_FOCAL = 0.03
# A target that leaves a plane by less looks the same in a mirror, from behind.
_FLAT = 1e-4
# Photos in which unseen markers are looked for once more, and how many corners tell.
_PHOTOS = 3
_TELLING_CORNERS = 4
# So many markers of one family, and so many times more than of any other, are no accident.
_LEAST_MARKERS, _CLEARLY = 4, 2
_NO_IDS: IntArray = np.empty(0, np.intp)


def handed(pairs: Observations) -> list[Finding]:
    """Photos or boards that are seen as in a mirror, though the fit succeeded."""
    sides = seen_sides(pairs)
    some = some_mirrored(sides, pairs)
    if some:
        return some
    if flatness(pairs.world) < _FLAT and (sides < 0).any() and not (sides > 0).any():
        return [Finding(code=Code.MIRRORED, case="behind", severity=Severity.CARE)]
    return []


def some_mirrored(sides: IntArray, pairs: Observations) -> list[Finding]:
    """Photos that show boards the other way round than most photos show the same boards."""
    usual = np.sign(sides.sum(axis=0))
    against = (sides * usual < 0).any(axis=1) & ~(sides * usual > 0).any(axis=1)
    known = (sides * usual != 0).any(axis=1)
    if not against.any() or 2 * against.sum() >= known.sum():
        return []
    names = tuple(pairs.images[photo] for photo in np.flatnonzero(against))
    return [Finding(code=Code.MIRRORED, case="some", images=names)]


def mirrored_photos(evidence: FailedFit) -> list[Finding]:
    """Photos that show boards the other way round, of which there is no fit for that."""
    pairs, _ = evidence.scaled
    return some_mirrored(seen_sides(pairs), pairs)


def mirrored_object(pairs: Observations) -> list[Finding]:
    """Photos that fit a lens and the target as it is seen in a mirror.

    Args:
        pairs: all pairs, in units in which the target is of order 1.

    """
    if flatness(pairs.world) < _FLAT:
        return []
    fit = fit_radial(in_mirror(pairs), thorough=False)
    if fit.focal_uncertainty > _SURE_FOCAL:
        return []
    return [
        Finding(
            code=Code.MIRRORED,
            case="points",
            severity=Severity.BAD,
            because="corrected",
            figures={"after_px": noise_px(fit.residual)},
        )
    ]


def in_mirror(pairs: Observations) -> Observations:
    """The pairs of photos with left and right exchanged."""
    return replace(pairs, pixel=pairs.pixel * [-1, 1] + [pairs.image_size[0] - 1, 0])


def other_colours(evidence: GridEvidence) -> list[Finding]:
    """That the only board is light where the target says that it is dark."""
    target = evidence.target
    if not evidence.identified.other_colours:
        return []
    board = grid_boards(target.as_printed())[0]
    first = board.first_square
    finding = Finding(
        code=Code.MIRRORED,
        case="colours_in_mirror" if target.mirrored else "colours",
        boards=(board.name,),
        figures={
            "board": board.name,
            "first_square": first,
            "other": "light" if first == "dark" else "dark",
        },
    )
    return [finding]


def seen_sides(pairs: Observations) -> IntArray:
    """(photos, boards): 1 where a board is seen from its face, -1 mirrored, 0 where it is unknown.

    Boards whose corners have no rows and columns, such as lists of points, are never known.
    """
    photos, boards = len(pairs.images), max(len(pairs.boards), 1)
    sides = np.zeros((photos, boards), np.intp)
    if not len(pairs.pixel) or (pairs.board < 0).any():
        return sides
    right, down = neighbours(pairs)
    both = np.flatnonzero((right >= 0) & (down >= 0))
    along = pairs.pixel[right[both]] - pairs.pixel[both]
    across = pairs.pixel[down[both]] - pairs.pixel[both]
    sign = np.sign(along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0])
    view = pairs.image[both] * boards + pairs.board[both]
    count = np.bincount(view, minlength=photos * boards)
    total = np.bincount(view, weights=sign, minlength=photos * boards)
    known = (count >= _FEWEST) & (np.abs(total) >= (2 * _MAJORITY - 1) * count)
    return np.where(known, np.sign(total), 0).astype(np.intp).reshape(photos, boards)


def otherwise_printed(evidence: MarkerEvidence) -> list[Finding]:
    """That markers of some boards are inverted, or photos are mirrored, where they are unseen."""
    from cubicfish_cli.corners.detection.markers import find_marked_corners  # for photos alone

    target, unseen = evidence.target, unseen_boards(evidence)
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
    for picture, grids in islice(richest(evidence), _PHOTOS):
        for other in others:
            found = find_marked_corners(picture, other, grids)
            boards = [index for index in unseen if (found.board == index).any()]
            if np.isin(found.board, unseen).sum() >= _TELLING_CORNERS:
                return [_describe_print(target, other, boards, len(found))]
    return []


def no_markers(evidence: MarkerEvidence) -> list[Finding]:
    """That no photo shows any, and which ones photos show."""
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
    if not len(ids) or any(np.isin(ids - one.first, range(one.count)).any() for one in own):
        return [finding]
    names = [*(one.dictionary for one in own), *alike(dictionary)]
    seen = next(name for name in names if MARKER_DICTIONARIES[name] > ids.max())
    figures = {**finding.figures, "seen": seen, "first": int(ids.min()), "last": int(ids.max())}
    return [replace(finding, case="others", figures=figures)]


def _read_any_markers(evidence: MarkerEvidence) -> tuple[str, IntArray]:
    """Markers that photos show, whatever the target says: their dictionary and ids, if any.

    A board's ids follow each other, those that something else is mistaken for do not.
    """
    from cubicfish_cli.corners.detection.markers_measure import (
        markers_of_any_kind,  # for photos alone
    )

    seen = [markers_of_any_kind(picture) for picture, _ in islice(richest(evidence), _PHOTOS)]
    rows = []
    for name in seen[0] if seen else ():
        ids = np.unique(np.concatenate([one[name] for one in seen]))
        rows.append((name, ids[np.isin(ids, ids - 1) | np.isin(ids, ids + 1)]))
    *_, next_best, best = sorted(rows, key=lambda row: len(row[1])) or [("", _NO_IDS)] * 2
    clear = len(best[1]) >= max(_LEAST_MARKERS, _CLEARLY * len(next_best[1]))
    return best if clear else (best[0], _NO_IDS)


def unseen_boards(evidence: MarkerEvidence) -> list[int]:
    """Boards with markers of which no photo shows a corner."""
    seen = set(np.unique(evidence.corners.board).tolist())
    return [
        index
        for index, board in enumerate(evidence.target.boards)
        if board.markers is not None and index not in seen
    ]


def hardly_named(evidence: MarkerEvidence) -> bool:
    """Whether most of the photos that show most squares have no name for any of their corners.

    The others' few names are then no better: two markers side by side lie as the target says on
    many a board.
    """
    named = np.isin(_sort_richest_first(evidence)[:_PHOTOS], evidence.corners.image)
    return bool(2 * named.sum() < len(named))


def richest(evidence: MarkerEvidence) -> Iterator[tuple[Picture, FoundGrids]]:
    """Brightness of photos and their grids, those that show most first."""
    for number in _sort_richest_first(evidence):
        picture = evidence.picture(number)
        if picture is not None:
            yield picture, evidence.grids[number]


def _sort_richest_first(evidence: MarkerEvidence) -> list[int]:
    return sorted(
        range(len(evidence.grids)),
        key=lambda number: -sum(map(len, evidence.grids[number].grids)),
    )


def _describe_print(target: Target, other: Target, boards: list[int], corners: int) -> Finding:
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
