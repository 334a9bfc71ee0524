"""Which object photos show: a target.yaml, or one flat board named by its counts."""

from __future__ import annotations

import re
from pathlib import Path

import click

from cubicfish_cli.cli.options import Parsed, bundle, option, target_option
from cubicfish_cli.cli.terminal import say
from cubicfish_cli.library.asked import TargetSource

DEFAULT_TARGET = Path("target.yaml")


def _counts(text: str) -> tuple[int, int]:
    """``9x6`` -> (9, 6)."""
    match = re.fullmatch(r"\s*([0-9]{1,3})\s*[xX×]\s*([0-9]{1,3})\s*", text)
    columns, rows = (int(match[1]), int(match[2])) if match else (0, 0)
    if not (2 <= columns <= 100 and 2 <= rows <= 100):
        raise ValueError(f"{text!r} is not two numbers from 2 to 100, such as 9x6")
    return columns, rows


COUNTS = Parsed("COLUMNSxROWS", _counts)


def _choice(target: Path | None, board: tuple[int, int] | None, square: str | None) -> TargetSource:
    if board is None:
        if square is not None:
            raise click.UsageError("--square is of --board: add --board 9x6 (inner corners)")
        return TargetSource(path=target_path(target), told=target is None)
    if target is not None:
        raise click.UsageError("--target says what the target is: leave --board out, or --target")
    if square is None:
        raise click.UsageError("--board needs the side of its squares: add --square 25mm")
    from cubicfish_cli.printing.paper import length_mm

    return TargetSource(counts=board, square=length_mm(square))


target_options = bundle(
    _choice,
    target_option,
    option(
        "--board",
        "In the place of a target.yaml: one flat checkerboard of so many inner corners "
        "(squares less one), such as 9x6.",
        COUNTS,
    ),
    option("--square LENGTH", "Side of the squares of --board: 30mm, 3cm, 1.25in."),
)
"""``--target``, or ``--board`` and ``--square``: one :class:`TargetSource` as ``target``."""


def target_path(given: Path | None) -> Path | None:
    """The file that was named, else ./target.yaml; None where it is not there."""
    return given or (DEFAULT_TARGET if DEFAULT_TARGET.is_file() else None)


def needed_target(given: Path | None) -> Path:
    """The object's file, by default ./target.yaml, for commands that need one.

    Raises:
        click.UsageError: none was named, and none is there.

    """
    path = target_path(given)
    if path is None:
        raise click.UsageError(
            "name the calibration target with --target target.yaml: there is no ./target.yaml, and "
            "'cubicfish target print' makes one"
        )
    if given is None:
        say(f"Target: {path}.")
    return path
