"""``cubicfish target print``: boards on paper at true scale, and targets for a paper size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cubicfish import Event, Run, UsageError
from cubicfish.files import Content, StrPath
from cubicfish_cli import __version__
from cubicfish_cli.inputs.target_source import length_mm, target_in
from cubicfish_cli.plan import Plan
from cubicfish_cli.render import drawing as extra
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import COUNTS, as_command, option, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_message, print_table, result
from cubicfish_cli.words.phrases import plural, shell_line

if TYPE_CHECKING:
    from cubicfish_cli.extensions.printing.layout import Page
    from cubicfish_cli.extensions.printing.paper import Paper

NAMES = {"boards": "boards.pdf", "target": "target.yaml"}

_OBJECTS = ("corner", "box", "board")
_TYPES = ("checkerboard", "charuco", "aprilgrid")


@record
class PrintOptions:
    """Options of :func:`print_target_files`.

    Attributes:
        target: the target's file; None makes a new target.
        kind: of a new target: ``corner``, ``box`` or ``board``.
        paper: its size, such as ``A3``, ``Letter`` or ``600x400mm``.
        board_type: of a new target's boards: ``checkerboard``, ``charuco`` or ``aprilgrid``.
        square: the side of a new target's squares, such as ``30mm``.
        counts: (columns, rows) of inner corners of a flat board.
        dictionary: of its markers.
        margin: along the paper's edges, such as ``8mm``.
        folder: the folder for the pages.

    Raises:
        UsageError: the options do not go together.

    """

    target: StrPath | None = parameters.argument(
        "The target.yaml of boards that are there already; leave it out with --object.",
        required=False,
        metavar="[TARGET]",
    )
    kind: Literal["corner", "box", "board"] | None = option(
        "--object",
        "Make a target: a corner (floor and two walls, seen from inside), an open box of five "
        "boards seen from inside, or one flat board.",
        parameters.Choice(_OBJECTS),
    )
    paper: str = option(
        "--paper SIZE",
        "A0 to A5, Letter, Legal, Tabloid, or WIDTHxHEIGHT such as 600x400mm. Upright or "
        "across is chosen for each page.",
        default="A4",
    )
    board_type: Literal["checkerboard", "charuco", "aprilgrid"] | None = option(
        "--type", "Of a target's boards. [default: checkerboard]", parameters.Choice(_TYPES)
    )
    square: str | None = option(
        "--square LENGTH",
        "Side of a target's squares (of an aprilgrid's tags): 30mm, 3cm, 1.25in. [default: as "
        "large as covers most of the paper]",
        parameters.LENGTH,
    )
    counts: tuple[int, int] | None = option(
        "--corners --tags COLUMNSxROWS",
        "Inner corners (of an aprilgrid: tags) of --object board.",
        COUNTS,
    )
    dictionary: str | None = option(
        "--dictionary NAME",
        "Markers' family, such as DICT_5X5_250 or tag36h11. [default: the smallest DICT_5X5 that "
        "is large enough; tag36h11]",
    )
    margin: str = option(
        "--margin LENGTH",
        "Along the paper's edges, where the printer cannot print.",
        parameters.LENGTH,
        "8mm",
    )
    folder: StrPath = parameters.output_option(
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
        if self.counts is not None and self.kind in ("corner", "box"):
            raise UsageError(
                "--corners is of one flat board: leave it out, or take --object board; the boards "
                f"of a {self.kind} are as large as --square and the paper allow"
            )
        if self.dictionary is not None and self.board_type not in ("charuco", "aprilgrid"):
            raise UsageError("--dictionary is of markers: add --type charuco or --type aprilgrid")


@dataclass(frozen=True, kw_only=True, eq=False)
class PrintedFiles:
    """Result of :func:`print_target_files`.

    Attributes:
        files: the files that were written, by their names in :data:`NAMES`.
        pages: the pages, each with its board.
        paper: the paper.

    """

    files: dict[str, Path]
    pages: Sequence[Page]
    paper: Paper

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish target print --json`` prints.

        Keys:
            boards: the file of the pages
            target: target.yaml, where a target was made
            paper: the paper's name
            pages: a record a page: board, size_mm, corner_0_0_mm

        """
        pages = [
            {
                "board": page.board.name,
                "size_mm": [page.width, page.height],
                "corner_0_0_mm": list(page.shift),
            }
            for page in self.pages
        ]
        return {**self.files, "paper": self.paper.name, "pages": pages}


def print_target_files(options: PrintOptions, *, run: Run = Run()) -> PrintedFiles:
    """Print the boards of a target, or of a new one, as ``cubicfish target print`` does.

    Raises:
        CubicfishError: matplotlib is not installed, something cannot be printed, or a file exists
            and may not be replaced.

    """
    from cubicfish_cli.commands.target import check_target
    from cubicfish_cli.extensions.printing.layout import boards_in_millimetres, lay_out
    from cubicfish_cli.extensions.printing.objects import design
    from cubicfish_cli.extensions.printing.paper import paper as paper_of

    extra.require(extra.PRINTING, "printing")
    on, rim = paper_of(options.paper), length_mm(options.margin)
    contents: dict[str, Content] = {}
    if options.target is not None:
        loaded = target_in(options.target).as_printed()
        pages = [lay_out(board, on, margin=rim) for board in boards_in_millimetres(loaded)]
        if any(board.shape is not None for board in loaded.boards):
            run.listener.tell(Event.PRINTED_AS_DRAWN)
    elif options.kind is not None:
        loaded, pages = design(options, on, margin=rim)
        checked = check_target(loaded)
        for about, words in checked.advice if checked.facts.ambiguous else ():
            if about == "Names":
                run.listener.tell(Event.AMBIGUOUS, line=words)
        join = "" if len(pages) == 1 else " Cut and join them as it says, and measure."
        contents["target"] = (
            f"# {options.kind}, printed by cubicfish {__version__} on {on.name}: boards.pdf at "
            f"100 %.{join}\n{loaded.text()}"
        )
    with extra.quiet():
        from cubicfish_cli.extensions.printing.drawing import write_boards

    contents = {"boards": lambda path: write_boards(path, pages), **contents}
    outputs = {name: Path(options.folder) / NAMES[name] for name in contents}
    plan = Plan(run).reads(options.target)
    plan.writes(*outputs.values())
    run.listener.progress(f"Drawing {plural(len(pages), 'page')}")
    files = {path: contents[name] for name, path in outputs.items()}
    plan.write(files)
    return PrintedFiles(files=outputs, pages=pages, paper=on)


@as_command(
    "print",
    "Print boards on paper, at true scale.",
    "cubicfish target print --object corner --paper A4 -o my-target/",
    "cubicfish target print --object board --type charuco --square 30mm --paper A3",
    "cubicfish target print target.yaml --paper Letter -o pages/",
    do=print_target_files,
    how=("overwrite", "as_json"),
)
def command(made: PrintedFiles, given: PrintOptions, how: How) -> None:
    """Print the boards of TARGET, or those of a new target that fits the paper.

    Writes boards.pdf, one board per page, to be printed at 100 %, each with a ruler, the board's
    name and which way up it is. A new target comes with its target.yaml, and its pages say where
    they are cut and which edges are joined.
    """
    from cubicfish_cli.commands.target import print_size

    if how.print(made):
        return
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
    print_message(
        f"\n{plural(len(pages), 'page')} on {made.paper.name}: print at 100 %, without 'fit to "
        "page', and check the printed rulers with a real one."
    )
    if "target" in outputs:
        then = shell_line("cubicfish", "calibrate", "photos/", "--target", outputs["target"])
        print_message(f"Take photos that fill the picture to the rim, then: {then}")
