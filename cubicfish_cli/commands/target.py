"""``cubicfish target check``: judging a target before any photo is taken."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish import OutputError, Run, UsageError
from cubicfish.files import StrPath
from cubicfish_cli.core_table import COMMANDS, commands_of
from cubicfish_cli.inputs.paths import path_or_none
from cubicfish_cli.inputs.target_source import target_in
from cubicfish_cli.plan import Plan
from cubicfish_cli.render import drawing as extra
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.main import LazyGroup
from cubicfish_cli.terminal.parameters import (
    as_command,
    common_options,
    examples,
    option,
    record,
)
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_table, result
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish import Target
    from cubicfish.diagnosis import ObjectFacts
    from cubicfish.target import Board

_LABEL = 12
_FACTS = ("corners", "planes", "flat", "named_by", "ambiguous", "look_alikes", "crossing")


@record
class CheckOptions:
    """Options of :func:`check_target_files`.

    Attributes:
        target: the target's file.
        drawing: the SVG to draw; None for none.

    """

    target: StrPath = parameters.argument(
        "The target.yaml.",
        metavar="TARGET",
    )
    drawing: StrPath | None = option(
        "--draw FILE.svg",
        "Also draw the target: does it look like yours? Needs pip install 'cubicfish[report]'.",
        parameters.FILE,
    )


@dataclass(frozen=True, kw_only=True)
class TargetCheck:
    """A target, the facts about it, and advice on them.

    Attributes:
        target: the target.
        facts: which of its boards and photos may be mistaken for others.
        advice: (topic, text) of each piece of advice, in order.
        drawing: the file of a drawing; None without one.

    """

    target: Target
    facts: ObjectFacts
    advice: list[tuple[str, str]]
    drawing: Path | None = None

    def as_record(self) -> dict[str, Any]:
        """Return plain data for JSON.

        Keys:
            units: of all lengths
            boards: a record per board: its keys in target.yaml, columns, rows, square, print,
                and where it faces
            corners: how many corners the target has
            planes: on how many planes they are
            flat: whether all corners are on one plane
            named_by: what names corners in photos: markers, geometry or table
            ambiguous: whether boards, or the whole target, can be mistaken for something else
            symmetries: turns that take the target onto itself
            look_alikes: groups of boards that look the same in photos; of one: it does when
                turned
            crossing: pairs of boards that cut through each other
            advice: what to do, a record each: about, text
            drawing: the file of --draw, where it was asked for

        """
        return {
            "units": self.target.units,
            "boards": [_record_board(board) for board in self.target.boards],
            **{name: getattr(self.facts, name) for name in _FACTS},
            "symmetries": [turn.as_record() for turn in self.facts.symmetries],
            "advice": [{"about": label, "text": text} for label, text in self.advice],
            **({} if self.drawing is None else {"drawing": self.drawing}),
        }


def check_target(target: Target) -> TargetCheck:
    """Judge a target before photos are taken: which boards and photos may be mistaken for others.

    Args:
        target: the target, as it is printed.

    """
    from cubicfish.diagnosis import check_object
    from cubicfish_cli.words.target import advise

    facts = check_object(target)
    return TargetCheck(target=target, facts=facts, advice=advise(target, facts))


def print_size(board: Board) -> list[float]:
    """Width and height of the print; of a list of points its extent along x, y and z."""
    if board.points is not None:
        extent = board.points.max(axis=0) - board.points.min(axis=0)
        return [round(float(side), 6) for side in extent]
    rim = 2 * board.rim
    end = board.plane_points(board.columns - 1, board.rows - 1) + rim
    return [round(float(side), 6) for side in end]


def _record_board(board: Board) -> dict[str, Any]:
    return {
        **board.as_record(),
        "columns": board.columns,
        "rows": board.rows,
        "square": board.square,
        "print": print_size(board),
        "faces": None if board.points is not None else -board.axes[2] + 0.0,
    }


def check_target_files(options: CheckOptions, *, run: Run = Run()) -> TargetCheck:
    """Judge the target in a file, and draw it, as ``cubicfish target check`` does.

    Raises:
        UsageError: ``overwrite`` is set though no file is written.
        TargetError: the file is no usable target.
        OutputError: the drawing exists and may not be replaced, or has another suffix.

    """
    path, plan = path_or_none(options.drawing), Plan(run).reads(options.target)
    if path is None and run.overwrite:
        raise UsageError("--overwrite goes with --draw, which writes a file: leave it out")
    if path is not None:
        if path.suffix.lower() != ".svg":
            raise OutputError(f"{path}: drawings are SVG: end the name in .svg")
        extra.require(extra.PRINTING, "a drawing")
        plan.writes(path)
    loaded = target_in(options.target).as_printed()
    run.listener.progress("Looking at the target from all sides")
    checked = check_target(loaded)
    if path is not None:
        with extra.quiet():
            from cubicfish_cli.render.target_drawing import object_svg
        plan.write({path: object_svg(loaded)})
    return replace(checked, drawing=path)


@as_command(
    "check",
    "Check a target before you take photos, and draw it.",
    "cubicfish target check target.yaml",
    "cubicfish target check target.yaml --draw object.svg",
    do=check_target_files,
    how=("overwrite", "as_json"),
)
def check(checked: TargetCheck, given: CheckOptions, how: How) -> None:
    """Check TARGET, a target.yaml, before you take photos.

    Says which boards are where, how many photos to take, whether boards or the whole target can be
    mistaken for something else in photos, and what is probably a mistake in the file. The exit code
    is 1 only where the file cannot be used as a target.
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
        list(map(_make_row, target.boards)),
    )  # fmt: skip
    result(f"\nlengths in {target.units}; the print includes the outer squares\n")
    planes = plural(facts.planes, "plane")
    result(f"{'Target':<{_LABEL}}{plural(facts.corners, 'corner')} on {planes}")
    before = ""
    for label, text in checked.advice:
        result(f"{'' if label == before else label:<{_LABEL}}{text}")
        before = label


def _make_row(board: Board) -> tuple[str, ...]:
    size = " x ".join(f"{side:g}" for side in print_size(board))
    if board.points is not None:
        first = _write_vector(board.points[0])
        return (board.name, board.kind, str(board.columns), "-", size, first, "-", "-", "-")
    return (
        board.name,
        board.kind,
        f"{board.columns}x{board.rows}",
        f"{board.square:g}",
        size,
        _write_vector(board.origin),
        _write_direction(board.x_axis),
        _write_direction(board.y_axis),
        _write_direction(-board.axes[2]),
    )


def _write_vector(values: Iterable[float]) -> str:
    return ", ".join(f"{round(float(value), 3) + 0.0:g}" for value in values)


def _write_direction(axis: Iterable[float]) -> str:
    """Return ``+x`` for a world axis, else the three numbers."""
    values = list(axis)
    for name, value in zip("xyz", values, strict=True):
        if abs(value) > 1 - 5e-7:
            return f"{'+' if value > 0 else '-'}{name}"
    return _write_vector(values)


@common_options
@click.group(
    "target",
    cls=LazyGroup,
    own=commands_of(COMMANDS, "target"),
    of="target",
    short_help="Print or check a calibration target.",
    epilog=examples(
        "cubicfish target print --object corner --paper A4 -o my-target/",
        "cubicfish target check target.yaml --draw object.svg",
    ),
)
def command() -> None:
    """Print the calibration target, and look at it before any photo is taken."""
