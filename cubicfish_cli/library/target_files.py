"""Boards on paper: the pages of a target that is there, or of one that is made for a paper size."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from cubicfish_cli import __version__
from cubicfish_cli.errors import CubicfishError, UsageError
from cubicfish_cli.files import Content, refuse_existing, write_files
from cubicfish_cli.library.asked import RUN, Run, StrPath
from cubicfish_cli.library.provenance import made_at
from cubicfish_cli.library.target_check import check_target
from cubicfish_cli.printing import extra
from cubicfish_cli.printing.layout import Page, lay_out
from cubicfish_cli.printing.objects import Wanted, design
from cubicfish_cli.printing.paper import Paper, length_mm
from cubicfish_cli.printing.paper import paper as paper_of
from cubicfish_cli.printing.sheet import Sheet, sheets_of
from cubicfish_cli.target import load_target, target_text
from cubicfish_cli.words.codes import Event

NAMES = {"boards": "boards.pdf", "assembly": "assembly.pdf", "target": "target.yaml"}


@dataclass(frozen=True, kw_only=True, eq=False)
class PrintedFiles:
    """What became of :func:`print_target_files`.

    Attributes:
        files: what was written, by its name in :data:`NAMES`.
        sheets: the boards.
        pages: the pages that they are on.
        paper: the paper.

    """

    files: dict[str, Path]
    sheets: Sequence[Sheet]
    pages: Sequence[Page]
    paper: Paper

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish target print --json`` prints."""
        pages = list(map(_page_record, self.pages))
        return {**self.files, "paper": self.paper.name, "pages": pages}


def print_target_files(
    target: StrPath | None = None,
    folder: StrPath = "printed",
    *,
    kind: Any = None,
    paper: str = "A4",
    board_type: Any = None,
    square: str | None = None,
    counts: tuple[int, int] | None = None,
    dictionary: str | None = None,
    margin: str = "8mm",
    boards: Sequence[str] = (),
    run: Run = RUN,
) -> PrintedFiles:
    """Print the boards of a target, or of a new one, as ``cubicfish target print`` does.

    Args:
        target: the target's file; None makes a new one.
        folder: where the pages go.
        kind: of a new target: ``corner``, ``box``, ``block`` or ``board``.
        paper: its size, such as ``A3``, ``Letter`` or ``600x400mm``.
        board_type: of a new target's boards: ``checkerboard``, ``charuco`` or ``aprilgrid``.
        square: the side of a new target's squares, such as ``30mm``.
        counts: (columns, rows) of inner corners of its largest board.
        dictionary: of its markers.
        margin: along the paper's edges.
        boards: those of ``target`` that are printed; all where there are none.
        run: how the work is done.

    Raises:
        UsageError: what is asked does not go together.
        CubicfishError: matplotlib is not installed, something cannot be printed, or a file exists
            and may not be replaced.

    """
    made = (board_type, square, counts, dictionary)
    if target is None and kind is None:
        raise UsageError(
            "name a target.yaml, or make a target with --object corner, box, block or board"
        )
    if target is not None and (kind is not None or any(one is not None for one in made)):
        raise UsageError(
            "--object, --type, --square, --corners and --dictionary make a new target; the boards "
            "of TARGET are printed as they are: give the one or the other"
        )
    if target is None and boards:
        raise UsageError("--board chooses among the boards of TARGET: name a target.yaml")
    lacking = extra.missing(extra.PRINTING)
    if lacking:
        raise CubicfishError(f"printing needs {' and '.join(lacking)}: {extra.INSTALL}")
    on, rim = paper_of(paper), length_mm(margin)
    text = None
    if target is not None:
        loaded = load_target(Path(target)).as_printed()
        sheets = sheets_of(loaded, tuple(boards))
        if any(board.shape is not None for board in loaded.boards):
            run.listener.tell(Event.PRINTED_AS_DRAWN)
    else:
        side = None if square is None else length_mm(square)
        wanted = Wanted(
            kind=kind,
            type=board_type or "checkerboard",
            square=side,
            counts=counts,
            dictionary=dictionary,
        )
        loaded, sheets = design(wanted, on, margin=rim)
        checked = check_target(loaded)
        for about, words in checked.advice if checked.facts.ambiguous else ():
            if about == "Names":
                run.listener.tell(Event.AMBIGUOUS, line=words)
        join = "" if len(loaded.boards) == 1 else " Join them as assembly.pdf says, and measure."
        text = (
            f"# {kind}, printed by cubicfish {__version__} on {on.name}: boards.pdf at 100 %."
            f"{join}\n{target_text(loaded)}"
        )
    pages = [page for sheet in sheets for page in lay_out(sheet, on, margin=rim)]
    there = {"boards": True, "assembly": len(sheets) > 1, "target": text is not None}
    outputs = {name: Path(folder) / NAMES[name] for name, wanted in there.items() if wanted}
    refuse_existing(*outputs.values(), overwrite=run.overwrite)
    # Pages carry no date, so that they can be made again, or that of SOURCE_DATE_EPOCH.
    date = datetime.fromisoformat(made_at()) if "SOURCE_DATE_EPOCH" in os.environ else None
    with extra.quiet():
        from cubicfish_cli.printing.assembly import words_for, write_assembly, write_boards

    contents: dict[str, Content] = {
        "boards": lambda path: write_boards(path, pages, date=date),
        "assembly": lambda path: write_assembly(
            path, sheets, words_for(kind, on.name), on.name, date=date
        ),
        "target": text or "",
    }
    run.listener.progress(f"Drawing {len(pages)} page{'s' * (len(pages) != 1)}")
    write_files({path: contents[name] for name, path in outputs.items()}, overwrite=run.overwrite)
    return PrintedFiles(files=outputs, sheets=sheets, pages=pages, paper=on)


def _page_record(page: Page) -> dict[str, Any]:
    tile = page.tile
    return {
        "board": page.sheet.board.name,
        "size_mm": [page.width, page.height],
        "tile": tile and {key: getattr(tile, key) for key in ("row", "column", "rows", "columns")},
        "corner_0_0_mm": list(page.shift),
    }
