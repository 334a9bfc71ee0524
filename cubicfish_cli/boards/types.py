"""The types of boards, in the order in which they are named."""

from __future__ import annotations

from cubicfish_cli.boards.aprilgrid import AprilGrid
from cubicfish_cli.boards.board import Board
from cubicfish_cli.boards.charuco import Charuco
from cubicfish_cli.boards.checkerboard import Checkerboard
from cubicfish_cli.boards.point_list import PointList

BOARD_TYPES: dict[str, type[Board]] = {
    board.kind: board for board in (Checkerboard, Charuco, AprilGrid, PointList)
}
