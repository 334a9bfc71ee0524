"""The types of boards, in the order in which they are named."""

from __future__ import annotations

from importlib import import_module

from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.boards.registry import ENTRIES

BOARD_TYPES: dict[str, type[Board]] = {
    kind: getattr(import_module(f"cubicfish_cli.core.boards.{entry.module}"), entry.name)
    for kind, entry in ENTRIES.items()
}
