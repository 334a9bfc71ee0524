"""Whether boards have as many corners as the target says: photos count them too."""

from __future__ import annotations

from collections.abc import Callable

from cubicfish_cli.naming.name_grids import Naming
from cubicfish_cli.naming.wrong_drawing.count import Count
from cubicfish_cli.naming.wrong_drawing.fewer_corners import fewer_corners
from cubicfish_cli.naming.wrong_drawing.more_corners import more_corners
from cubicfish_cli.photos import Picture
from cubicfish_cli.target import Target


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
