"""``cubicfish target``: the target, printed and checked before any photo is taken.

``cubicfish target print``: boards on paper at true scale, and targets made for a paper size.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.boards.registry import DESIGNED
from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import COUNTS, as_command, common_options, examples, option, record
from cubicfish_cli.cli.progress import call, keep_fonts
from cubicfish_cli.cli.terminal import (
    Column,
    Row,
    print_columns,
    print_json,
    print_table,
    result,
    say,
)

if TYPE_CHECKING:
    from cubicfish_cli.boards.board import Board
    from cubicfish_cli.library.target_files import PrintedFiles, TargetCheck


_LABEL = 12


@record
class Asked:
    """What is asked of ``cubicfish check``."""

    target: Path = options.argument(
        "The target.yaml.",
        metavar="TARGET",
        missing="name the target: 'cubicfish target check target.yaml'",
    )
    drawing: Path | None = option(
        "--draw FILE.svg", "Also draw the target: does it look like yours?", options.FILE
    )
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "check",
    "Say what a target is worth, and draw it.",
    "cubicfish target check target.yaml",
    "cubicfish target check target.yaml --draw object.svg",
    json="target-check",
)
def check(given: Asked) -> None:
    """Check TARGET, a target.yaml, before you take photos.

    Says which boards are where, how many photos to take, whether boards or the whole target can
    be mistaken for something else in photos, and what looks like a slip of the pen. The exit
    code is 1 only when the file is no usable target.
    """
    from cubicfish_cli.library.target_files import check_target_files

    checked = call(check_target_files, given)
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
            Column(title="type", least=5),
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
    result(f"{'Target':<{_LABEL}}{count(facts.corners, 'corner')} on {planes}")
    before = ""
    for label, text in checked.advice:
        result(f"{'' if label == before else label:<{_LABEL}}{text}")
        before = label


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


_OBJECTS = ("corner", "box", "board")


@record
class PrintAsked:
    """What is asked of ``cubicfish print``."""

    target: Path | None = options.argument(
        "The target.yaml of boards that are there already; leave it out with --object.",
        required=False,
        metavar="[TARGET]",
    )
    kind: str | None = option(
        "--object",
        "Make a target: a corner (floor and two walls, seen from inside), an open box of five "
        "boards seen from inside, or one flat board.",
        click.Choice(_OBJECTS),
    )
    paper: str = option(
        "--paper SIZE",
        "A0 to A5, B0 to B4, Letter, Legal, Tabloid, 'ANSI C' to 'ANSI E', or WIDTHxHEIGHT such "
        "as 600x400mm. Upright or across is chosen for each page.",
        default="A4",
    )
    board_type: str | None = option(
        "--type", "Of a target's boards. [default: checkerboard]", click.Choice(DESIGNED)
    )
    square: str | None = option(
        "--square LENGTH",
        "Side of a target's squares (of an aprilgrid's tags): 30mm, 3cm, 1.25in. [default: as "
        "large as covers most of the paper]",
    )
    counts: tuple[int, int] | None = option(
        "--corners --tags COLUMNSxROWS",
        "Inner corners (of an aprilgrid: tags) of a target's largest board.",
        COUNTS,
    )
    dictionary: str | None = option(
        "--dictionary NAME",
        "Markers' family, such as DICT_5X5_250 or tag36h11. [default: the smallest DICT_5X5 that "
        "is large enough; tag36h11]",
    )
    margin: str = option(
        "--margin LENGTH", "Along the paper's edges, where the printer cannot print.", default="8mm"
    )
    boards: tuple[str, ...] = option(
        "--board NAME", "Of TARGET, print this board only. May be given again.", multiple=True
    )
    folder: Path = options.output_option(
        "Where boards.pdf and target.yaml go.", default="printed", folder=True
    )
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "print",
    "Boards on paper, at true scale.",
    "cubicfish target print --object corner --paper A4 -o my-target/",
    "cubicfish target print --object board --type charuco --square 30mm --paper A3",
    "cubicfish target print target.yaml --paper Letter -o pages/",
    json="target-print",
)
def print_boards(given: PrintAsked) -> None:
    """Print the boards of TARGET, or those of a new target that fits the paper.

    Writes boards.pdf, a board a page, to be printed at 100 %, each with a ruler, the board's name
    and which way up it is. A new target comes with its target.yaml, and its pages say where they
    are cut and which edges are joined.
    """
    from cubicfish_cli.library.target_files import print_target_files

    keep_fonts()
    made = call(print_target_files, given)
    if given.as_json:
        print_json(made.as_record())
        return
    _print_written(made)


def _print_written(made: PrintedFiles) -> None:
    from cubicfish_cli.library.target_files import print_size

    outputs, pages = made.files, made.pages
    rows = [
        (
            board.name,
            board.kind,
            f"{board.columns}x{board.rows}",
            f"{board.square:g}",
            " x ".join(f"{side:g}" for side in print_size(board)),
        )
        for board in (page.board for page in pages)
    ]
    print_table(("board", "type", "corners", "square mm", "print mm"), rows)
    result("\n" + "\n".join(f"wrote {path}" for path in outputs.values()))
    say(
        f"\n{count(len(pages), 'page')} on {made.paper.name}: print at 100 %, without 'fit to "
        "page', and check the printed rulers with a real one."
    )
    if "target" in outputs:
        say(
            "Take photos that fill the picture to the rim, then: cubicfish calibrate photos/ "
            f"--target {outputs['target']}"
        )


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


command.add_command(print_boards)
command.add_command(check)
