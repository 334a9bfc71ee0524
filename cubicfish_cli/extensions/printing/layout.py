"""Where a board's print lies on its page of paper."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Literal

from cubicfish import Target, TargetError, quoted
from cubicfish.scene import board_face
from cubicfish.target import MILLIMETRES, Board
from cubicfish_cli.extensions.printing.paper import Paper

Point = tuple[float, float]
Side = Literal["left", "top", "right", "bottom"]

STRIP = 12.5
"""Height of the strip with ruler and words, in millimetres."""
SHORTEST_STRIP = 124.0
"""Length that the strip needs for its ruler."""
# White around a print on small paper, as shares of its quiet zone.
_SHARES = (1.0, 0.75, 0.5, 0.4)
_ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True)
class Cut:
    """A side of a sheet that is cut, to be joined to another sheet.

    Attributes:
        place: where on the page, along x or along y.
        board: the other sheet's board.
        side: the other sheet's side.

    """

    place: float
    board: str
    side: Side


@dataclass(frozen=True, kw_only=True, eq=False)
class Page:
    """One page of paper with one board, in millimetres from its top left corner.

    Attributes:
        board: the board, with lengths in millimetres.
        width, height: of the paper.
        shift: where the board's corner (0, 0) is.
        strip: the top left corner of the strip with ruler and words.
        length: of the strip, along its words.
        turned: whether its words run upwards, beside the print, instead of along x.
        cuts: the sides that are cut.

    """

    board: Board
    width: float
    height: float
    shift: Point
    strip: Point
    length: float
    turned: bool = False
    cuts: Mapping[Side, Cut] = field(default_factory=dict)


def lay_out(board: Board, paper: Paper, *, margin: float) -> Page:
    """Place a board in the middle of a page, with as much white around it as there is room for.

    Args:
        board: the board, in millimetres.
        paper: the paper; upright or across, whichever suits.
        margin: at the paper's edges, where nothing is printed, in millimetres.

    Raises:
        TargetError: the board does not fit.

    """
    face = board_face(board, margin=0.0)
    (left, top), (right, bottom) = face.lower, face.upper
    sizes = [(paper.short, paper.long), (paper.long, paper.short)]
    if right - left > bottom - top:
        sizes.reverse()
    for share, turned, (width, height) in product(_SHARES, (False, True), sizes):
        white = share * quiet_zone(board)
        # Paper where the printer cannot print is white too; the strip bounds it on its side.
        rim, beside = max(white, margin), margin + STRIP + white
        free_x = width - (right - left) - rim - (beside if turned else rim)
        free_y = height - (bottom - top) - rim - (rim if turned else beside)
        length = (height if turned else width) - 2 * margin
        if min(free_x, free_y) < -_ROUNDING or length < SHORTEST_STRIP:
            continue
        return Page(
            board=board,
            width=width,
            height=height,
            shift=(rim + free_x / 2 - left, rim + free_y / 2 - top),
            strip=(width - margin - STRIP, margin) if turned else (margin, height - margin - STRIP),
            length=length,
            turned=turned,
        )
    raise TargetError(
        f"board {quoted(board.name)}, {right - left:.0f} x {bottom - top:.0f} mm, does not fit on "
        f"one page of {paper.name} with margins of {margin:g} mm: take larger paper"
    )


def quiet_zone(board: Board) -> float:
    """White that the print should have around it: a square, or half a tag."""
    return board.square / board.per_cell


def boards_in_millimetres(target: Target) -> list[Board]:
    """Return the nominal boards of a target that have a print, with every length in millimetres.

    Raises:
        TargetError: no board has a print, or the unit is not known.

    """
    boards = [board for board in target.boards if board.points is None]
    if not boards:
        raise TargetError("the target has lists of points only, which have no print")
    factor = MILLIMETRES.get(target.units.strip().lower().rstrip("."))
    if factor is None:
        raise TargetError(
            f"units {quoted(target.units)} cannot be printed at true scale: write mm, cm, m or in"
        )
    return [
        replace(
            board,
            square=board.square * factor,
            origin=board.origin * factor,
            markers=board.markers and replace(board.markers, side=board.markers.side * factor),
            shape=None,
        )
        for board in boards
    ]
