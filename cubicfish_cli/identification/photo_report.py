"""What became of photos in which corners were looked for."""

from __future__ import annotations

from dataclasses import dataclass

from cubicfish_cli.detection.grids import FoundGrids
from cubicfish_cli.identification.identified import GridReport
from cubicfish_cli.observations import Observations
from cubicfish_cli.words.finding import Finding


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoReport:
    """What became of one photo.

    Attributes:
        name: the photo's name.
        refusal: why nothing was looked for, or found, in it; None where something was.
        remarks: what is told of its grids and boards: left out, or named by convention.
        boards: names of the boards that were found in it, in the target's order.
        corners: how many corners were named.
        added: how many of them a second pass added.
        exact: whether these are surely the corners that they are named as; see
            :class:`cubicfish_cli.identification.name_grids.Identified`.
        found: everything that was found in it, named or not; None when it could not be used.
        grids: what became of each of ``found.grids``.

    """

    name: str
    refusal: Finding | None = None
    remarks: tuple[Finding, ...] = ()
    boards: tuple[str, ...] = ()
    corners: int = 0
    added: int = 0
    exact: bool = True
    found: FoundGrids | None = None
    grids: tuple[GridReport, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is told of it, thing by thing."""
        return self.remarks if self.refusal is None else (self.refusal,)

    @property
    def lost(self) -> bool:
        """Whether it gave no corners, for a reason that is known."""
        none_named = bool(self.grids) and not any(grid.named for grid in self.grids)
        return self.refusal is not None or (none_named and bool(self.remarks))

    @property
    def problem(self) -> str | None:
        """One line that says why it gave no corners; None when it did."""
        return "; ".join(finding.line for finding in self.findings) if self.lost else None

    @property
    def notes(self) -> tuple[str, ...]:
        """One line for each grid that was left out, or named by convention."""
        return tuple(remark.line for remark in self.remarks)


@dataclass(frozen=True, kw_only=True, eq=False)
class Detection:
    """The corners found in a set of photos.

    Attributes:
        corners: the named corners; ``images`` are the photos that have some.
        photos: a report on every photo, in the order given.
        findings: what is likely wrong with photos or target, where many grids fit nowhere.
        other_colours: whether the only board is light where the target says that it is dark.

    """

    corners: Observations
    photos: tuple[PhotoReport, ...]
    findings: tuple[Finding, ...] = ()
    other_colours: bool = False
