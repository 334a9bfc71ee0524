"""``cubicfish target``: the target, printed and checked before any photo is taken."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli import options, target_print
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import as_command, common_options, examples, option, record
from cubicfish_cli.cli.progress import running
from cubicfish_cli.cli.streams import columns_of, text_width
from cubicfish_cli.cli.terminal import Column, Row, print_columns, print_json, result

if TYPE_CHECKING:
    from cubicfish_cli.boards.board import Board
    from cubicfish_cli.library.target_files import TargetCheck

_LABEL, _LINE = 12, 96


@record
class Asked:
    """What is asked of ``cubicfish check``."""

    target: Path = options.argument(
        "The target.yaml.",
        metavar="TARGET",
        missing="name the target: 'cubicfish target check target.yaml'",
    )
    draw: Path | None = option(
        "--draw FILE.svg", "Also draw the target: does it look like yours?", options.FILE
    )
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option("target-check")


@as_command(
    "check",
    "Say what a target is worth, and draw it.",
    "cubicfish target check target.yaml",
    "cubicfish target check target.yaml --draw object.svg",
)
def check(given: Asked) -> None:
    """Check TARGET, a target.yaml, before you take photos.

    Says which boards are where, how many photos to take, whether boards or the whole target can
    be mistaken for something else in photos, and what looks like a slip of the pen. The exit
    code is 1 only when the file is no usable target.
    """
    from cubicfish_cli.library.target_files import check_target_files

    with running(overwrite=given.overwrite) as run:
        checked = check_target_files(given.target, given.draw, run=run)
    if given.as_json:
        print_json(checked.as_record())
        return
    _print(checked)
    if checked.drawing is not None:
        result(f"\nwrote {checked.drawing}")


def _print(checked: TargetCheck) -> None:
    target, facts = checked.target, checked.facts
    print_columns(
        [
            Column(title="board", least=8),
            Column(title="type", least=5, cut="end"),
            "corners",
            "square",
            "print",
            "corner (0, 0)",
            "columns",
            "rows",
            "faces",
        ],
        [Row(cells=_row(board)) for board in target.boards],
    )
    result(f"\nlengths in {target.units}; the print includes the outer squares\n")
    planes = count(facts.planes, "plane")
    _paragraph("Target", f"{count(facts.corners, 'corner')} on {planes}")
    before = ""
    for label, text in checked.advice:
        _paragraph("" if label == before else label, text)
        before = label


def _paragraph(label: str, text: str) -> None:
    lines = [text]  # what is no terminal gets a line as a line, as everywhere
    if columns_of(sys.stdout) is not None:
        width = text_width(_LINE) - _LABEL
        lines = textwrap.wrap(text, width, break_on_hyphens=False, break_long_words=False)
    for number, line in enumerate(lines):
        result(f"{label if number == 0 else '':<{_LABEL}}{line}")


def _row(board: Board) -> tuple[str, ...]:
    from cubicfish_cli.library.target_files import print_size

    size = " x ".join(f"{side:g}" for side in print_size(board))
    if board.points is not None:
        first = _vector(board.points[0])
        return (board.name, board.kind, str(board.columns), "-", size, first, "-", "-", "-")
    return (
        board.name,
        board.kind,
        f"{board.columns}x{board.rows}",
        f"{board.square:g}",
        size,
        _vector(board.origin),
        _direction(board.x_axis),
        _direction(board.y_axis),
        _direction(-board.axes[2]),
    )


def _vector(values: Iterable[float]) -> str:
    return ", ".join(f"{round(float(value), 3) + 0.0:g}" for value in values)


def _direction(axis: Iterable[float]) -> str:
    """``+x`` for a world axis, else the three numbers."""
    values = list(axis)
    for name, value in zip("xyz", values, strict=True):
        if abs(value) > 1 - 5e-7:
            return f"{'+' if value > 0 else '-'}{name}"
    return _vector(values)


@click.group(
    "target",
    short_help="Print or check the calibration target, before any photo.",
    epilog=examples(
        "cubicfish target print --object corner --paper A4 -o my-target/",
        "cubicfish target check target.yaml --draw object.svg",
    ),
)
@common_options
def command() -> None:
    """Print the calibration target, and look at it before any photo is taken."""


command.add_command(target_print.command)
command.add_command(check)
