"""Whether boards have as many corners as the target says: photos count them too."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cubicfish_cli.boards.board import Board
from cubicfish_cli.identification.name_grids import Identified
from cubicfish_cli.identification.wrong_drawing.count import Count
from cubicfish_cli.identification.wrong_drawing.fewer_corners import fewer_corners
from cubicfish_cli.identification.wrong_drawing.more_corners import more_corners
from cubicfish_cli.photos import Picture
from cubicfish_cli.target import Target
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding


def counted(
    identified: Identified, target: Target, picture: Callable[[int], Picture | None]
) -> list[Count]:
    """Boards that have another number of corners than the target says, as photos show it.

    Args:
        identified: what became of the grids.
        target: the object that they were named by.
        picture: the brightness (H, W) of the photo of this number; None where it cannot be read.
            Only asked for where boards seem to be smaller than drawn.

    """
    fewer = fewer_corners(identified, target, picture)
    more = more_corners(identified, target)
    known = {count.board for count in more}
    both = [*more, *(count for count in fewer if count.board not in known)]
    return sorted(both, key=lambda count: count.board)


def miscounted(counts: Sequence[Count], target: Target, photos: int) -> Finding | None:
    """What is to be said of boards of which photos show another number of corners.

    Args:
        counts: of :func:`counted`.
        target: the object.
        photos: how many photos there are.

    """
    if not counts:
        return None
    fewest, most = min(one.photos for one in counts), max(one.photos for one in counts)
    boards = [target.boards[count.board] for count in counts]
    return Finding(
        code=Code.CORNER_COUNT,
        severity=Severity.CARE,
        boards=tuple(board.name for board in boards),
        figures={
            "counts": [_seen(*both) for both in zip(counts, boards, strict=True)],
            "alike": fewest == most,
            "fewest": fewest,
            "most": most,
            "photos": photos,
        },
    )


def _seen(count: Count, board: Board) -> dict[str, str | int]:
    columns, rows = count.size
    return {
        "form": "both" if all(count.sure) else "columns" if count.sure[0] else "rows",
        "board": board.name,
        "columns": columns,
        "rows": rows,
        "drawn_columns": board.columns,
        "drawn_rows": board.rows,
    }
