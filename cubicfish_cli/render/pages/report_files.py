"""The result of a command that writes a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cubicfish import Verdict


@dataclass(frozen=True, kw_only=True)
class ReportFiles:
    """The result of a command that writes a report.

    Attributes:
        page: the page.
        model: the file that it is about.
        verdict: what the camera or the rig is worth.
        absent: what is not on the page, a line each.

    """

    page: Path
    model: Path
    verdict: Verdict
    absent: Sequence[str] = ()

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish report --json`` prints.

        Keys:
            report: the page
            model: the file of the camera or the rig
            verdict: level (good, care or bad), words, figures, and reasons, a record each, with
                why: what and evidence in one
            absent: what the page lacks and why, a line each

        """
        from cubicfish_cli.words.camera import verdict_record

        named = {"report": str(self.page), "model": str(self.model)}
        return {**named, "verdict": verdict_record(self.verdict), "absent": self.absent}
