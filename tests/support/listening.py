"""What the library tells, kept for tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cubicfish import Event, Finding, Listener


class Heard(Listener):
    """Keeps all that it hears: steps as (what, done, total, now), events with their figures."""

    def __init__(self) -> None:
        self.steps: list[tuple[str, float, float, str]] = []
        self.events: list[tuple[Event, dict[str, Any]]] = []
        self.findings: list[Finding] = []

    def progress(self, step: str, done: float = 0, total: float = 0, now: str = "") -> None:
        self.steps.append((step, done, total, now))

    def tell(self, event: Event, **figures: Any) -> None:
        self.events.append((event, figures))

    def found(self, findings: Sequence[Finding]) -> None:
        self.findings += findings

    def of(self, step: str) -> list[tuple[float, float]]:
        """(done, total) of one step."""
        return [(done, total) for what, done, total, _ in self.steps if what == step]
