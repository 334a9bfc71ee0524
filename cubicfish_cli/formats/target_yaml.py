"""Writing target.yaml: a refined object is a target file like any other."""

from __future__ import annotations

from typing import Any

import numpy as np

from cubicfish_cli.boards.board import Board
from cubicfish_cli.plain_yaml import plain_yaml_text
from cubicfish_cli.target import Target


def target_text(target: Target) -> str:
    """The text of a target file: what :func:`cubicfish_cli.target.load_target` reads back."""
    boards = [_board_record(board) for board in target.as_printed().boards]
    mirrored = {"mirrored": True} if target.mirrored else {}
    return plain_yaml_text({"units": target.units, **mirrored, "boards": boards})


def _board_record(board: Board) -> dict[str, Any]:
    record: dict[str, Any] = {"name": board.name, "type": board.kind, **board.own_record()}
    if board.points is None:
        record |= {key: getattr(board, key).tolist() for key in ("origin", "x_axis", "y_axis")}
    shape = board.shape
    if shape is None:
        return record
    if board.points is None:
        record |= {
            "bend": shape.bend.tolist(),
            "twist": shape.twist,
            "stretch": shape.stretch.tolist(),
        }
    row, column = np.nonzero(shape.offsets.any(axis=2))
    if len(row):
        record["offsets"] = [
            [int(c), int(r), *shape.offsets[r, c].tolist()]
            for c, r in zip(column, row, strict=True)
        ]
    return record
