"""``cubicfish target print``: boards on paper at true scale, and objects made for a paper size."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.cache_folder import keep_fonts
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import COUNTS, as_command, option, record
from cubicfish_cli.cli.progress import working
from cubicfish_cli.cli.terminal import print_json, print_table, result, say

if TYPE_CHECKING:
    from cubicfish_cli.printing.layout import Page
    from cubicfish_cli.printing.paper import Paper
    from cubicfish_cli.printing.sheet import Sheet
    from cubicfish_cli.target import Target

_OBJECTS = ("corner", "box", "block", "board")
_TYPES = ("checkerboard", "charuco", "aprilgrid")


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
        "--type", "Of a target's boards. [default: checkerboard]", click.Choice(_TYPES)
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
    _refuse_mixed(
        given.target,
        given.kind,
        (given.board_type, given.square, given.counts, given.dictionary),
        given.boards,
    )

    from cubicfish_cli.errors import CubicfishError
    from cubicfish_cli.printing.extra import INSTALL, PRINTING, missing, quiet

    lacking = missing(PRINTING)
    if lacking:
        raise CubicfishError(f"printing needs {' and '.join(lacking)}: {INSTALL}")
    keep_fonts()

    from cubicfish_cli.files import Content, refuse_existing, write_files
    from cubicfish_cli.printing.layout import lay_out
    from cubicfish_cli.printing.paper import length_mm
    from cubicfish_cli.printing.paper import paper as paper_of

    on, rim = paper_of(given.paper), length_mm(given.margin)
    text = None
    if given.target is not None:
        sheets = _of_file(given.target, given.boards)
    else:
        loaded, sheets = _made(
            given.kind, given.board_type, given.square, given.counts, given.dictionary, on, rim
        )
        text = _target_text(loaded, given.kind or "", on)
    pages = [page for sheet in sheets for page in lay_out(sheet, on, margin=rim)]
    wanted = {"boards": True, "assembly": len(sheets) > 1, "target": text is not None}
    names = {"boards": "boards.pdf", "assembly": "assembly.pdf", "target": "target.yaml"}
    outputs = {kind: given.output / names[kind] for kind, there in wanted.items() if there}
    refuse_existing(*outputs.values(), overwrite=given.overwrite)
    date = _date()

    with quiet():
        from cubicfish_cli.printing.assembly import words_for, write_assembly, write_boards

    contents: dict[str, Content] = {
        "boards": lambda path: write_boards(path, pages, date=date),
        "assembly": lambda path: write_assembly(
            path, sheets, words_for(given.kind, on.name), on.name, date=date
        ),
        "target": text or "",
    }
    with working(f"Drawing {count(len(pages), 'page')}"):
        files = {path: contents[kind] for kind, path in outputs.items()}
        write_files(files, overwrite=given.overwrite)
    if given.as_json:
        print_json({**outputs, "paper": on.name, "pages": list(map(_page_record, pages))})
        return
    _print(outputs, sheets, pages, on)


def _refuse_mixed(
    target: Path | None, kind: str | None, made: tuple[object, ...], boards: tuple[str, ...]
) -> None:
    if target is None and kind is None:
        raise click.UsageError(
            "name a target.yaml, or make a target with --object corner, box, block or board"
        )
    if target is not None and (kind is not None or any(one is not None for one in made)):
        raise click.UsageError(
            "--object, --type, --square, --corners and --dictionary make a new target; the boards "
            "of TARGET are printed as they are: give the one or the other"
        )
    if target is None and boards:
        raise click.UsageError("--board chooses among the boards of TARGET: name a target.yaml")


def _of_file(path: Path, names: tuple[str, ...]) -> list[Sheet]:
    from cubicfish_cli.printing.sheet import sheets_of
    from cubicfish_cli.target import load_target

    loaded = load_target(path).as_printed()
    sheets = sheets_of(loaded, names)
    if any(board.shape is not None for board in loaded.boards):
        say("note: boards are printed as drawn; how a calibration found them to depart is left out")
    return sheets


def _made(
    kind: Any,
    board_type: Any,
    square: str | None,
    counts: tuple[int, int] | None,
    dictionary: str | None,
    paper: Paper,
    margin: float,
) -> tuple[Target, list[Sheet]]:
    from cubicfish_cli.library.target_check import check_target
    from cubicfish_cli.printing.objects import Wanted, design
    from cubicfish_cli.printing.paper import length_mm

    wanted = Wanted(
        kind=kind,
        type=board_type or "checkerboard",
        square=None if square is None else length_mm(square),
        counts=counts,
        dictionary=dictionary,
    )
    loaded, sheets = design(wanted, paper, margin=margin)
    checked = check_target(loaded)
    if checked.facts.ambiguous:
        for about, words in checked.advice:
            if about == "Names":
                say(f"note: {words}")
    return loaded, sheets


def _target_text(target: Target, kind: str, paper: Paper) -> str:
    from cubicfish_cli import __version__
    from cubicfish_cli.target import target_text

    join = "" if len(target.boards) == 1 else " Join them as assembly.pdf says, and measure."
    return (
        f"# {kind}, printed by cubicfish {__version__} on {paper.name}: boards.pdf at 100 %."
        f"{join}\n{target_text(target)}"
    )


def _date() -> datetime | None:
    """The date that pages carry: none, so that they can be made again, or SOURCE_DATE_EPOCH's."""
    from cubicfish_cli.library.provenance import made_at

    return datetime.fromisoformat(made_at()) if "SOURCE_DATE_EPOCH" in os.environ else None


def _page_record(page: Page) -> dict[str, Any]:
    tile = page.tile
    return {
        "board": page.sheet.board.name,
        "size_mm": [page.width, page.height],
        "tile": tile and {key: getattr(tile, key) for key in ("row", "column", "rows", "columns")},
        "corner_0_0_mm": list(page.shift),
    }


def _print(outputs: dict[str, Path], sheets: list[Sheet], pages: list[Page], paper: Paper) -> None:
    rows = []
    for sheet in sheets:
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
        f"\n{count(len(pages), 'page')} on {paper.name}: print at 100 %, without 'fit to page', "
        "and check the printed rulers with a real one."
    )
    if "target" in outputs:
        say(
            "Take photos that fill the picture to the rim, then: cubicfish calibrate photos/ "
            f"--target {outputs['target']}"
        )
