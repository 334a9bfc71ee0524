"""Whether boards have as many corners as the target says: photos count them too."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cubicfish_cli.fitting.diagnosis.finding import Finding, listed
from cubicfish_cli.naming.name_grids import Naming
from cubicfish_cli.naming.wrong_drawing.count import Count
from cubicfish_cli.naming.wrong_drawing.fewer_corners import fewer_corners
from cubicfish_cli.naming.wrong_drawing.more_corners import more_corners
from cubicfish_cli.photos import Picture
from cubicfish_cli.target import Board, Target


def counted(
    naming: Naming, target: Target, picture: Callable[[int], Picture | None]
) -> list[Count]:
    """Boards that have another number of corners than the target says, as photos show it.

    Args:
        naming: what became of the grids.
        target: the object that they were named by.
        picture: the brightness (H, W) of the photo of this number; None where it cannot be read.
            Only asked for where boards seem to be smaller than drawn.

    """
    fewer = fewer_corners(naming, target, picture)
    more = more_corners(naming, target)
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
    names = tuple(target.boards[count.board].name for count in counts)
    parts = [_words(count, target.boards[count.board]) for count in counts]
    several = len(counts) > 1
    fewest, most = min(one.photos for one in counts), max(one.photos for one in counts)
    which = f"{most}" if fewest == most else f"{fewest} to {most}"
    return Finding(
        cause="corner_count",
        level="care",
        what=f"photos show {listed(parts, 'boards')}",
        evidence=f"{which} of {photos} photos show where {'they end' if several else 'it ends'}, "
        "none shows otherwise",
        do="correct corners in target.yaml (and origin, if it was of a corner that is not there) "
        "and run it again",
        boards=names,
    )


def _words(count: Count, board: Board) -> str:
    drawn = board.columns, board.rows
    if all(count.sure):
        what, says = f"{_times(*count.size)} inner corners", _times(*drawn)
    else:
        axis = 0 if count.sure[0] else 1
        what = f"{count.size[axis]} {('columns', 'rows')[axis]} of inner corners"
        says = f"{drawn[axis]}"
    return f"{what} of board {board.name} (target.yaml says {says})"


def _times(columns: int, rows: int) -> str:
    return f"{columns}x{rows}"
