"""What is written for an object: the boards' pages, how to join them, and its target file."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from cubicfish_cli.printing.assembly import Words, assembly_page
from cubicfish_cli.printing.canvas import STYLE, write_pdf
from cubicfish_cli.printing.extra import drawing
from cubicfish_cli.printing.layout import Page
from cubicfish_cli.printing.page import draw_pages
from cubicfish_cli.printing.sheet import Sheet

_US_PAPER = ("Letter", "Legal", "Tabloid", "Ledger", "ANSI")


def write_boards(path: Path, pages: Sequence[Page], *, date: datetime | None) -> None:
    """Write the boards' pages as one PDF file; the same pages are the same bytes.

    Raises:
        OSError: the file cannot be written.

    """
    names = dict.fromkeys(page.sheet.board.name for page in pages)
    with drawing(STYLE):
        write_pdf(path, ", ".join(names), draw_pages(pages), date=date)


def write_assembly(
    path: Path, sheets: Sequence[Sheet], words: Words, paper: str, *, date: datetime | None
) -> None:
    """Write the page that says how sheets are joined, as a PDF file.

    Raises:
        OSError: the file cannot be written.

    """
    with drawing(STYLE):
        page = assembly_page(sheets, words, letter=paper.startswith(_US_PAPER))
        write_pdf(path, words.title, [page], date=date)


def words_for(kind: str | None, paper: str) -> Words:
    """What the page says about an object of a kind that is made here, or (None) any other."""
    check = (
        f"Print boards.pdf at 100 % on {paper}, without 'fit to page', and check the printed "
        "rulers with a real one: 100 mm must be 100 mm. If not, print again; if that does not "
        "help, multiply every length in target.yaml by measured / 100."
    )
    then = (
        "Take photos that fill the picture to the rim, from near and from different sides, then: "
        "cubicfish calibrate photos/ --target target.yaml"
    )
    measure = (
        "Measure the lengths below. What is off by a millimetre or two, or not quite square or "
        "flat, 'cubicfish calibrate --refine-target auto' (the default) finds by itself; correct "
        "larger differences in target.yaml."
    )
    if kind is None:
        place = (
            "Glue the pages onto flat, stiff plates, and fix the plates where the target file "
            "says: dots mark corner (0, 0), lines from it the way of columns (orange) and rows "
            "(blue)."
        )
        return Words(title="How the boards are placed", steps=(check, place, measure, then))
    inside = kind != "block"
    glue = (
        "Glue the sheets onto flat, stiff plates (foam board, acrylic, glass), without bubbles, "
        "and cut along the dashed lines. Edges without a line may stay as they are."
    )
    join = (
        f"Join edges with the same letter at right angles, printed faces "
        f"{'inside' if inside else 'outside'}, as drawn. The printed faces must meet in the edges: "
        f"{'let the plates overlap behind them' if inside else 'mitre thick plates'}."
    )
    names = {
        "corner": "A corner of three boards, seen from inside",
        "box": "An open box of five boards, seen from inside",
        "block": "A block of five boards, seen from outside",
    }
    steps = [check, glue, join, measure, then]
    if kind != "corner":
        steps.insert(
            3, "A board may be left away: take its entry out of target.yaml, with no other change."
        )
    return Words(title=names[kind], steps=tuple(steps))
