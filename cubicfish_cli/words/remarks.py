"""Lines about photos; what many photos share is said once."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from cubicfish import Finding, listed
from cubicfish.find import PhotoReport
from cubicfish.judge import Code
from cubicfish_cli.words.sentences import render

# Figures of a grid, in which those that share the rest may differ.
_OF_GRID = frozenset(("grids", "columns", "rows", "corners"))
# Figures of a photo, of which the largest is reported of several.
_OF_PHOTO = frozenset(("error_px", "times"))
# Figures of what was seen where no grid was found, of which the first photo's are reported.
_OF_SIGHT = frozenset(("side_px", "blur_px", "seen_at", "dots"))
_OF_ONE = _OF_GRID | _OF_PHOTO | _OF_SIGHT


def remark_lines(findings: Sequence[Finding]) -> list[str]:
    """One line for what several photos share, with their count and first names.

    The lines come in the order in which something of the kind is first said.
    """
    groups: defaultdict[object, list[Finding]] = defaultdict(list)
    for one in findings:
        rest = tuple((key, one.figures[key]) for key in one.figures if key not in _OF_ONE)
        groups[one.code, one.case, one.boards, rest].append(one)
    return [line for own in groups.values() for line in _write_lines(own)]


def line_of(finding: Finding) -> str:
    """A line about one photo, with its name."""
    if finding.code == Code.CANNOT_BE_READ:  # the photo's error names the file
        return render(finding).line
    return f"{finding.images[0]}: {render(finding).line}"


def problem_of(photo: PhotoReport) -> str | None:
    """One line that says why a photo gave no corners; None when it did."""
    return "; ".join(render(one).line for one in photo.findings) if photo.lost else None


def _write_lines(own: Sequence[Finding]) -> list[str]:
    photos = tuple(dict.fromkeys(name for one in own for name in one.images))
    if len(photos) == 1:
        return [line_of(one) for one in own]
    worst = {key: max(one.figures[key] for one in own) for key in _OF_PHOTO & own[0].figures.keys()}
    together = replace(own[0], images=photos, figures={**own[0].figures, **worst})
    if "grids" in together.figures:
        sizes = [(one.figures["columns"], one.figures["rows"]) for one in own]
        columns, rows = max((max(size), min(size)) for size in sizes)
        size = {"grids": len(own), "columns": columns, "rows": rows}
        together = replace(together, figures={**together.figures, **size})
    return [f"{len(photos)} photos ({listed(photos, 'photos')}): {render(together).line}"]
