"""``cubicfish target``: the target, checked before any photo is taken."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.app import drawing as extra
from cubicfish_cli.app.asked import RUN, Run, StrPath, path_or_none
from cubicfish_cli.app.extensions import extension_commands
from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.figures import count
from cubicfish_cli.app.terminal.main import LazyGroup
from cubicfish_cli.app.terminal.options import (
    as_command,
    common_options,
    examples,
    option,
    record,
)
from cubicfish_cli.app.terminal.progress import How
from cubicfish_cli.app.terminal.terminal import print_table, result
from cubicfish_cli.core.errors import CubicfishError, OutputError, UsageError
from cubicfish_cli.core.files import refuse_existing, write_files

if TYPE_CHECKING:
    from cubicfish_cli.commands.target_files import TargetCheck
    from cubicfish_cli.core.boards.board import Board

_LABEL = 12


@record
class CheckOptions:
    """A look at a target.

    Attributes:
        target: its file.
        drawing: where an SVG of it goes; None for none.

    """

    target: StrPath = options.argument(
        "The target.yaml.",
        metavar="TARGET",
        missing="name the target: 'cubicfish target check target.yaml'",
    )
    drawing: StrPath | None = option(
        "--draw FILE.svg",
        "Also draw the target: does it look like yours? Needs pip install 'cubicfish[report]'.",
        options.FILE,
    )


def check_target_files(asked: CheckOptions, *, run: Run = RUN) -> TargetCheck:
    """Look at the target in a file, and draw it, as ``cubicfish target check`` does.

    Raises:
        UsageError: files may be replaced, and none is written.
        TargetError: the file is no usable target.
        OutputError: the drawing exists and may not be replaced, or has another suffix.

    """
    from cubicfish_cli.commands.target_files import check_target
    from cubicfish_cli.core.target import load_target

    path = path_or_none(asked.drawing)
    if path is None and run.overwrite:
        raise UsageError("--overwrite goes with --draw, which writes a file: leave it out")
    if path is not None:
        if path.suffix.lower() != ".svg":
            raise OutputError(f"{path}: drawings are SVG: end the name in .svg")
        if extra.missing(extra.PRINTING):
            raise CubicfishError(f"a drawing needs matplotlib: {extra.INSTALL}")
        refuse_existing(path, overwrite=run.overwrite)
    loaded = load_target(Path(asked.target)).as_printed()
    run.listener.progress("Looking at the target from all sides")
    checked = check_target(loaded)
    if path is not None:
        with extra.quiet():
            from cubicfish_cli.app.target_drawing import object_svg
        write_files({path: object_svg(loaded)}, overwrite=run.overwrite)
    return replace(checked, drawing=path)


@as_command(
    "check",
    "Say what a target is worth, and draw it.",
    "cubicfish target check target.yaml",
    "cubicfish target check target.yaml --draw object.svg",
    do=check_target_files,
    how=("overwrite", "as_json"),
    json="target-check",
)
def check(checked: TargetCheck, given: CheckOptions, how: How) -> None:
    """Check TARGET, a target.yaml, before you take photos.

    Says which boards are where, how many photos to take, whether boards or the whole target can
    be mistaken for something else in photos, and what looks like a slip of the pen. The exit
    code is 1 only when the file is no usable target.
    """
    if how.print(checked):
        return
    _print(checked)
    if checked.drawing is not None:
        result(f"\nwrote {checked.drawing}")


def _print(checked: TargetCheck) -> None:
    target, facts = checked.target, checked.facts
    print_table(
        ("board", "type", "corners", "square", "print", "corner (0, 0)", "columns", "rows",
         "faces"),
        list(map(_row, target.boards)),
    )  # fmt: skip
    result(f"\nlengths in {target.units}; the print includes the outer squares\n")
    planes = count(facts.planes, "plane")
    result(f"{'Target':<{_LABEL}}{count(facts.corners, 'corner')} on {planes}")
    before = ""
    for label, text in checked.advice:
        result(f"{'' if label == before else label:<{_LABEL}}{text}")
        before = label


def _row(board: Board) -> tuple[str, ...]:
    from cubicfish_cli.commands.target_files import print_size

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


@common_options
@click.group(
    "target",
    cls=LazyGroup,
    own={"check": "cubicfish_cli.commands.target:check"},
    more=partial(extension_commands, "target"),
    short_help="Print or check the calibration target, before any photo.",
    epilog=examples(
        "cubicfish target print --object corner --paper A4 -o my-target/",
        "cubicfish target check target.yaml --draw object.svg",
    ),
)
def command() -> None:
    """Print the calibration target, and look at it before any photo is taken."""
