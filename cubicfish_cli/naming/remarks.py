"""What became of photos, in as few lines as say it: what many photos share is said once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

from cubicfish_cli.fitting.diagnosis.finding import listed
from cubicfish_cli.naming.decide import Verdict
from cubicfish_cli.naming.name_grids import GridReport
from cubicfish_cli.naming.refusals import ADVICE, WHY


@dataclass(frozen=True, kw_only=True)
class Remark:
    """Something about one photo.

    Attributes:
        photo: the photo's name.
        text: what, without the name.
        size: columns and rows of the grid that it is about; None where it is about no grid.
        corners: how many corners that grid has.

    """

    photo: str
    text: str
    size: tuple[int, int] | None = None
    corners: int = 0

    @property
    def line(self) -> str:
        """All in one line, as it stands beside the photo's name."""
        if self.size is None:
            return self.text
        columns, rows = self.size
        return f"a grid of {columns}x{rows} with {self.corners} corners{self.text}"


def remark_of(photo: str, grid: GridReport) -> Remark | None:
    """What is to be said of a grid; None where it is simply named."""
    if grid.verdict is Verdict.NAMED:
        return None
    text = (
        ": part of the board, placed in its middle; a lens does not depend on where, measuring "
        "the board would"
        if grid.verdict is Verdict.CONVENTION
        else f" is left out: {WHY[grid.verdict]}; {ADVICE[grid.verdict]}"
    )
    return Remark(photo=photo, text=text, size=grid.size, corners=grid.corners)


@dataclass
class _Group:
    remarks: list[Remark] = field(default_factory=list)

    @property
    def photos(self) -> list[str]:
        return list(dict.fromkeys(remark.photo for remark in self.remarks))

    def lines(self) -> list[str]:
        if len(self.photos) == 1:
            return [_with_name(remark.photo, remark.line) for remark in self.remarks]
        sizes = [remark.size for remark in self.remarks if remark.size is not None]
        first = self.remarks[0].text
        names = f"{len(self.photos)} photos ({listed(self.photos, 'photos')})"
        if not sizes:
            return [f"{names}: {first}"]
        columns, rows = max((max(size), min(size)) for size in sizes)
        what = first.replace(" is left out", " are left out").replace(": fits no", ": they fit no")
        return [f"{names}: {len(sizes)} grids of up to {columns}x{rows} corners{what}"]


def remark_lines(remarks: Sequence[Remark]) -> list[str]:
    """One line for what several photos share, with their count and first names.

    The lines come in the order in which something of the kind is first said.
    """
    groups: defaultdict[str, _Group] = defaultdict(_Group)
    for remark in remarks:
        groups[remark.text].remarks.append(remark)
    return [line for group in groups.values() for line in group.lines()]


def _with_name(photo: str, text: str) -> str:
    return text if photo in text else f"{photo}: {text}"
