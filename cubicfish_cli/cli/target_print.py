"""``cubicfish target print``: boards on paper at true scale, and targets made for a paper size."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.boards.registry import DESIGNED
from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import COUNTS, as_command, option, record
from cubicfish_cli.cli.progress import keep_fonts, running
from cubicfish_cli.cli.terminal import print_json, print_table, result, say

if TYPE_CHECKING:
    from cubicfish_cli.library.target_files import PrintedFiles

_OBJECTS = ("corner", "box", "block", "board")


@record
class Asked:
    """What is asked of ``cubicfish print``."""

    target: Path | None = options.argument(
        "The target.yaml of boards that are there already; leave it out with --object.",
        required=False,
        metavar="[TARGET]",
    )
    kind: str | None = option(
        "--object",
        "Make a target: a corner (floor and two walls, seen from inside), an open box of five "
        "boards seen from inside, a block of five seen from outside, or one flat board.",
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
        "Inner corners (of an aprilgrid: tags) of a target's largest board. With --square too, "
        "boards may be larger than the paper, and are printed in parts.",
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
    output: Path = options.output_option(
        "Where boards.pdf, assembly.pdf and target.yaml go.", default="printed", folder=True
    )
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option("target-print")


@as_command(
    "print",
    "Boards on paper, at true scale.",
    "cubicfish target print --object corner --paper A4 -o my-target/",
    "cubicfish target print --object board --type charuco --square 30mm --paper A3",
    "cubicfish target print target.yaml --paper Letter -o pages/",
)
def command(given: Asked) -> None:
    """Print the boards of TARGET, or those of a new target that fits the paper.

    Writes boards.pdf, pages to be printed at 100 %, each with a ruler, the board's name and which
    way up it is; boards that are larger than the paper are in parts to be glued together. A new
    target comes with its target.yaml and with assembly.pdf, which says how to join the boards.
    """
    from cubicfish_cli.library.target_files import print_target_files

    keep_fonts()
    with running(overwrite=given.overwrite) as run:
        made = print_target_files(
            given.target,
            given.output,
            kind=given.kind,
            paper=given.paper,
            board_type=given.board_type,
            square=given.square,
            counts=given.counts,
            dictionary=given.dictionary,
            margin=given.margin,
            boards=given.boards,
            run=run,
        )
    if given.as_json:
        print_json(made.as_record())
        return
    _print(made)


def _print(made: PrintedFiles) -> None:
    outputs, pages = made.files, made.pages
    rows = []
    for sheet in made.sheets:
        board = sheet.board
        own = [page for page in pages if page.sheet is sheet]
        parts = own[0].tile
        rows.append(
            (
                board.name,
                board.kind,
                f"{board.columns}x{board.rows}",
                f"{board.square:g}",
                " x ".join(f"{side:g}" for side in sheet.size),
                f"{len(own)}" if parts is None else f"{len(own)} ({parts.rows} x {parts.columns})",
            )
        )
    print_table(("board", "type", "corners", "square mm", "print mm", "pages"), rows)
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
