"""Objects with markers: ids name the corners photo by photo, without any geometry.

Boards without markers on the same object are named afterwards, in the second pass: by then the
marked boards have told the lens and where each photo was taken from.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice

import numpy as np

from cubicfish_cli.correspondences import Corners
from cubicfish_cli.detection.grids import FoundGrids
from cubicfish_cli.detection.markers import MarkedCorners, find_marked_corners
from cubicfish_cli.photos import Picture
from cubicfish_cli.target import Target
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding

# Photos in which unseen markers are looked for once more, and how many corners tell.
_PHOTOS = 3
_TELLING_CORNERS = 4


def has_markers(target: Target) -> bool:
    """Whether any board of the target carries markers."""
    return any(board.markers is not None for board in target.boards)


def marked_corners(
    marked: Sequence[MarkedCorners],
    target: Target,
    image_size: tuple[int, int],
    images: Sequence[str],
) -> Corners:
    """What markers named in each of the photos, as one table sorted by photo.

    Args:
        marked: one for each photo.
        target: the object.
        image_size: (width, height) of all photos, pixels.
        images: the photos' names.

    """
    image = np.repeat(np.arange(len(marked)), [len(one) for one in marked])
    board, column, row = (
        np.concatenate([getattr(one, name) for one in marked]).astype(np.intp)
        for name in ("board", "column", "row")
    )
    pixel = np.concatenate([one.pixel for one in marked])
    order = np.lexsort([column, row, board, image])
    return Corners(
        image_size=image_size,
        images=tuple(images),
        boards=target.board_names,
        image=image[order],
        board=board[order],
        column=column[order],
        row=row[order],
        pixel=pixel[order],
        weight=np.ones(len(order)),
        target=target,
    )


def unseen_markers(corners: Corners, target: Target) -> list[int]:
    """Boards with markers of which no photo shows a corner."""
    seen = set(np.unique(corners.board).tolist())
    return [
        index
        for index, board in enumerate(target.boards)
        if board.markers is not None and index not in seen
    ]


def otherwise_printed(
    photos: Iterable[tuple[Picture, FoundGrids]], target: Target, unseen: Sequence[int]
) -> Finding | None:
    """Why markers of some boards are not seen: they are inverted, or photos are mirrored.

    Args:
        photos: brightness (H, W) of photos and their grids, those that show most first; only a
            few of them are looked at.
        target: the object.
        unseen: indices of these boards.

    Returns:
        None where they are not seen otherwise either.

    """
    changed = {index: target.boards[index].with_negative_markers() for index in unseen}
    kinds = {target.boards[index].kind for index in unseen}
    others = [target.with_boards(changed)] if "charuco" in kinds else []
    # Where some boards are read as they are, the photos are not mirrored.
    marked = sum(board.markers is not None for board in target.boards)
    if len(unseen) == marked:
        others += [one.in_mirror() for one in (target, *others)]
    if not others:
        return None
    for picture, grids in islice(photos, _PHOTOS):
        for other in others:
            found = find_marked_corners(picture, other, grids)
            boards = [index for index in unseen if (found.board == index).any()]
            if np.isin(found.board, unseen).sum() >= _TELLING_CORNERS:
                return _printed_so(target, other, boards, len(found))
    return None


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
