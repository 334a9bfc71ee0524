"""The result of a command that writes a page, and the extra that pages need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.app import drawing as extra
from cubicfish_cli.core.errors import CubicfishError

if TYPE_CHECKING:
    from cubicfish_cli.core.assess.verdict import Verdict

PAGE = "report.html"


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
        """Return plain data: what ``cubicfish report --json`` prints."""
        named = {"report": str(self.page), "model": str(self.model)}
        return {**named, "verdict": self.verdict.as_record(), "absent": self.absent}


def refuse_without_extra() -> None:
    """Refuse to make a page if the extra ``report`` is not installed.

    Raises:
        CubicfishError: it is not installed.

    """
    lacking = extra.missing(extra.REPORT)
    if lacking:
        raise CubicfishError(f"a report needs {' and '.join(lacking)}: {extra.INSTALL}")
