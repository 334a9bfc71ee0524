"""What is told of several cameras on one body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cubicfish_cli.words.catalogue import Saying
from cubicfish_cli.words.finding import Finding


@dataclass(frozen=True, kw_only=True)
class RigFinding(Finding):
    """Something that is likely wrong with a rig.

    Attributes:
        cameras: whose.
        shots: of which shots, or of which photos where these are not of their shot.

    """

    cameras: tuple[str, ...] = ()
    shots: tuple[str, ...] = ()

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON and YAML."""
        return {
            **super().as_record(),
            "cameras": list(self.cameras),
            "shots": list(self.shots),
            "line": self.line,
        }

    @property
    def _about(self) -> dict[str, tuple[str, ...]]:
        return {**super()._about, "cameras": self.cameras, "of_shots": self.shots}


def of_camera(name: str, finding: Finding) -> RigFinding:
    """What is told of one camera alone, as a rig tells it."""
    said = Saying(f"camera {name}: {finding.what}", finding.evidence, finding.do, finding.remedy)
    return RigFinding(
        code=finding.code,
        severity=finding.severity,
        images=finding.images,
        boards=finding.boards,
        figures=finding.figures,
        recorded=said,
        cameras=(name,),
    )
