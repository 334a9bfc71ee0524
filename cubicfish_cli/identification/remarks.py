"""What became of grids and photos, in as few lines as say it: what many share is said once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from cubicfish_cli.identification.decide import Decided
from cubicfish_cli.identification.identified import GridReport
from cubicfish_cli.words.codes import Code, Severity
from cubicfish_cli.words.finding import Finding
from cubicfish_cli.words.phrases import listed

CODES = {
    Decided.CONVENTION: Code.BY_CONVENTION,
    Decided.AMBIGUOUS: Code.AMBIGUOUS,
    Decided.SLIDE: Code.SLIDES,
    Decided.TWIN: Code.LOOKS_LIKE_ANOTHER,
    Decided.NO_FIT: Code.FITS_NOWHERE,
    Decided.TOO_LARGE: Code.TOO_LARGE,
    Decided.COLOURS: Code.OTHER_COLOURS,
    Decided.NOT_PLANE: Code.NO_PLANE,
}
"""What is told of a grid, by what became of it."""
# Figures of a grid, in which those that share the rest may differ.
_OF_GRID = frozenset(("grids", "columns", "rows", "corners"))


def remark_of(photo: str, grid: GridReport) -> Finding | None:
    """What is to be said of a grid; None where it is simply named."""
    if grid.verdict is Decided.NAMED:
        return None
    columns, rows = grid.size
    return Finding(
        code=CODES[grid.verdict],
        severity=Severity.NOTE if grid.named else Severity.CARE,
        images=(photo,),
        figures={"grids": 1, "columns": columns, "rows": rows, "corners": grid.corners},
    )


def remark_lines(findings: Sequence[Finding]) -> list[str]:
    """One line for what several photos share, with their count and first names.

    The lines come in the order in which something of the kind is first said.
    """
    groups: defaultdict[object, list[Finding]] = defaultdict(list)
    for one in findings:
        rest = tuple((key, one.figures[key]) for key in one.figures if key not in _OF_GRID)
        groups[one.code, one.case, one.boards, rest].append(one)
    return [line for own in groups.values() for line in _lines(own)]


def line_of(finding: Finding) -> str:
    """A line about one photo, with its name."""
    if finding.code is Code.CANNOT_BE_READ:  # the photo's error names the file
        return finding.line
    return f"{finding.images[0]}: {finding.line}"


def _lines(own: Sequence[Finding]) -> list[str]:
    photos = tuple(dict.fromkeys(name for one in own for name in one.images))
    if len(photos) == 1:
        return [line_of(one) for one in own]
    together = own[0]
    if "grids" in together.figures:
        sizes = [(one.figures["columns"], one.figures["rows"]) for one in own]
        columns, rows = max((max(size), min(size)) for size in sizes)
        size = {"grids": len(own), "columns": columns, "rows": rows}
        together = replace(together, figures={**together.figures, **size})
    return [f"{len(photos)} photos ({listed(photos, 'photos')}): {together.line}"]
