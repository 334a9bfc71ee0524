"""``cubicfish target``: the target, printed and checked before any photo is taken.

``cubicfish target print``: boards on paper at true scale, and targets made for a paper size.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from cubicfish_cli import __version__
from cubicfish_cli.app import drawing as extra
from cubicfish_cli.app.asked import RUN, Run, StrPath, made_at, path_or_none
from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.figures import count
from cubicfish_cli.app.terminal.options import (
    COUNTS,
    as_command,
    common_options,
    examples,
    option,
    record,
)
from cubicfish_cli.app.terminal.progress import How
from cubicfish_cli.app.terminal.terminal import (
    Column,
    Row,
    print_columns,
    print_table,
    result,
    say,
)
from cubicfish_cli.core.boards.registry import DESIGNED
from cubicfish_cli.core.codes import Event
from cubicfish_cli.core.errors import CubicfishError, OutputError, UsageError
from cubicfish_cli.core.files import Content, refuse_existing, write_files

if TYPE_CHECKING:
    from cubicfish_cli.commands.target_files import TargetCheck
    from cubicfish_cli.core.boards.board import Board
    from cubicfish_cli.extensions.printing.layout import Page
    from cubicfish_cli.extensions.printing.paper import Paper

NAMES = {"boards": "boards.pdf", "target": "target.yaml"}
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
            from cubicfish_cli.extensions.printing.object_drawing import object_svg
        write_files({path: object_svg(loaded)}, overwrite=run.overwrite)
    return replace(checked, drawing=path)


@as_command(
    "check",
    "Say what a target is worth, and draw it.",
    "cubicfish target check target.yaml",
    "cubicfish target check target.yaml --draw object.svg",
    how=("overwrite", "as_json"),
    json="target-check",
)
def check(given: CheckOptions, how: How) -> None:
    """Check TARGET, a target.yaml, before you take photos.

    Says which boards are where, how many photos to take, whether boards or the whole target can
    be mistaken for something else in photos, and what looks like a slip of the pen. The exit
    code is 1 only when the file is no usable target.
    """
    checked = how.do(check_target_files, given)
    if how.print(checked):
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


_OBJECTS = ("corner", "box", "board")


@record
class PrintOptions:
    """Boards on paper: those of a target, or of a new one.

    Attributes:
        target: the target's file; None makes a new one.
        kind: of a new target: ``corner``, ``box`` or ``board``.
        paper: its size, such as ``A3``, ``Letter`` or ``600x400mm``.
        board_type: of a new target's boards: ``checkerboard``, ``charuco`` or ``aprilgrid``.
        square: the side of a new target's squares, such as ``30mm``.
        counts: (columns, rows) of inner corners of its largest board.
        dictionary: of its markers.
        margin: along the paper's edges.
        boards: those of ``target`` that are printed; all where there are none.
        folder: where the pages go.

    Raises:
        UsageError: they do not go together.

    """

    target: StrPath | None = options.argument(
        "The target.yaml of boards that are there already; leave it out with --object.",
        required=False,
        metavar="[TARGET]",
    )
    kind: Literal["corner", "box", "board"] | None = option(
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
    board_type: Literal["checkerboard", "charuco", "aprilgrid"] | None = option(
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
    boards: Sequence[str] = option(
        "--board NAME", "Of TARGET, print this board only. May be given again.", multiple=True
    )
    folder: StrPath = options.output_option(
        "Where boards.pdf and target.yaml go.", default="printed", folder=True
    )

    def __post_init__(self) -> None:
        made = (self.kind, self.board_type, self.square, self.counts, self.dictionary)
        if self.target is None and self.kind is None:
            raise UsageError(
                "name a target.yaml, or make a target with --object corner, box or board"
            )
        if self.target is not None and any(one is not None for one in made):
            raise UsageError(
                "--object, --type, --square, --corners and --dictionary make a new target; the "
                "boards of TARGET are printed as they are: give the one or the other"
            )
        if self.target is None and self.boards:
            raise UsageError("--board chooses among the boards of TARGET: name a target.yaml")


@dataclass(frozen=True, kw_only=True, eq=False)
class PrintedFiles:
    """What became of :func:`print_target_files`.

    Attributes:
        files: what was written, by its name in :data:`NAMES`.
        pages: the pages, each with its board.
        paper: the paper.

    """

    files: dict[str, Path]
    pages: Sequence[Page]
    paper: Paper

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish target print --json`` prints."""
        pages = [
            {
                "board": page.board.name,
                "size_mm": [page.width, page.height],
                "corner_0_0_mm": list(page.shift),
            }
            for page in self.pages
        ]
        return {**self.files, "paper": self.paper.name, "pages": pages}


def print_target_files(asked: PrintOptions, *, run: Run = RUN) -> PrintedFiles:
    """Print the boards of a target, or of a new one, as ``cubicfish target print`` does.

    Raises:
        CubicfishError: matplotlib is not installed, something cannot be printed, or a file exists
            and may not be replaced.

    """
    from cubicfish_cli.commands.target_files import check_target
    from cubicfish_cli.core.target import load_target, target_text
    from cubicfish_cli.extensions.printing.layout import boards_in_millimetres, lay_out
    from cubicfish_cli.extensions.printing.objects import Wanted, design
    from cubicfish_cli.extensions.printing.paper import length_mm
    from cubicfish_cli.extensions.printing.paper import paper as paper_of

    lacking = extra.missing(extra.PRINTING)
    if lacking:
        raise CubicfishError(f"printing needs {' and '.join(lacking)}: {extra.INSTALL}")
    on, rim = paper_of(asked.paper), length_mm(asked.margin)
    contents: dict[str, Content] = {}
    if asked.target is not None:
        loaded = load_target(Path(asked.target)).as_printed()
        printed = boards_in_millimetres(loaded, tuple(asked.boards))
        pages = [lay_out(board, on, margin=rim) for board in printed]
        if any(board.shape is not None for board in loaded.boards):
            run.listener.tell(Event.PRINTED_AS_DRAWN)
    elif asked.kind is not None:
        wanted = Wanted(
            kind=asked.kind,
            type=asked.board_type or "checkerboard",
            square=None if asked.square is None else length_mm(asked.square),
            counts=asked.counts,
            dictionary=asked.dictionary,
        )
        loaded, pages = design(wanted, on, margin=rim)
        checked = check_target(loaded)
        for about, words in checked.advice if checked.facts.ambiguous else ():
            if about == "Names":
                run.listener.tell(Event.AMBIGUOUS, line=words)
        join = "" if len(pages) == 1 else " Cut and join them as it says, and measure."
        contents["target"] = (
            f"# {asked.kind}, printed by cubicfish {__version__} on {on.name}: boards.pdf at 100 %."
            f"{join}\n{target_text(loaded)}"
        )
    # Pages carry no date, so that they can be made again, or that of SOURCE_DATE_EPOCH.
    date = datetime.fromisoformat(made_at()) if "SOURCE_DATE_EPOCH" in os.environ else None
    with extra.quiet():
        from cubicfish_cli.extensions.printing.drawing import write_boards

    contents = {"boards": lambda path: write_boards(path, pages, date=date), **contents}
    outputs = {name: Path(asked.folder) / NAMES[name] for name in contents}
    refuse_existing(*outputs.values(), overwrite=run.overwrite)
    run.listener.progress(f"Drawing {len(pages)} page{'s' * (len(pages) != 1)}")
    write_files({path: contents[name] for name, path in outputs.items()}, overwrite=run.overwrite)
    return PrintedFiles(files=outputs, pages=pages, paper=on)


@as_command(
    "print",
    "Boards on paper, at true scale.",
    "cubicfish target print --object corner --paper A4 -o my-target/",
    "cubicfish target print --object board --type charuco --square 30mm --paper A3",
    "cubicfish target print target.yaml --paper Letter -o pages/",
    how=("overwrite", "as_json"),
    json="target-print",
)
def print_boards(given: PrintOptions, how: How) -> None:
    """Print the boards of TARGET, or those of a new target that fits the paper.

    Writes boards.pdf, a board a page, to be printed at 100 %, each with a ruler, the board's name
    and which way up it is. A new target comes with its target.yaml, and its pages say where they
    are cut and which edges are joined.
    """
    for name, text in (("--square", given.square), ("--margin", given.margin)):
        options.say_if_in_mm(name, text)
    made = how.do(print_target_files, given)
    if how.print(made):
        return
    _print_written(made)


def _print_written(made: PrintedFiles) -> None:
    from cubicfish_cli.commands.target_files import print_size

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
