"""The commonest slip: squares of a board are counted in target.yaml where corners are meant."""

from __future__ import annotations

from collections.abc import Sequence

from cubicfish_cli.boards.board import Board
from cubicfish_cli.words.codes import Code
from cubicfish_cli.words.finding import Finding


def squares_counted(boards: Sequence[Board], photos: int | None = None) -> Finding:
    """That boards have one corner less each way than the target says.

    Args:
        boards: these boards, one at least.
        photos: how many photos show it, where nothing could be made of any; None where the
            corners of a table are counted rightly.

    """
    first = boards[0]
    return Finding(
        code=Code.CORNER_COUNT,
        case="squares" if photos is None else "all_squares",
        boards=tuple(board.name for board in boards),
        figures={
            "columns": first.columns - 1,
            "rows": first.rows - 1,
            "drawn_columns": first.columns,
            "drawn_rows": first.rows,
            "photos": photos,
        },
    )
