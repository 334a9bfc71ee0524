"""Listener: progress and events that the library reports while it works."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cubicfish_cli.core.codes import Event
    from cubicfish_cli.core.finding import Finding

Count = Callable[[int, int], None]


class Listener:
    """Hears how far work is and what is told on the way; this one keeps silent.

    A program that wants to hear overrides what it wants to hear. Steps come one after the other: a
    step is over when the next one begins, or the call returns.
    """

    def progress(self, step: str, done: float = 0, total: float = 0, now: str = "") -> None:
        """So much of a step is done.

        Args:
            step: what is done, in words.
            done: how many things, or the share where ``total`` is 1.
            total: of how many; 0 where that is not known.
            now: what is done within the step just now, in words; empty where things are counted.

        """

    def tell(self, event: Event, **figures: Any) -> None:
        """Something happened: its numbers and names; ``event.line(**figures)`` has the words."""

    def found(self, findings: Sequence[Finding]) -> None:
        """These are told of photos and grids."""

    def counting(self, step: str) -> Count:
        """What is called with things done and all things of a step, which begins now."""
        self.progress(step)
        return lambda done, total: self.progress(step, done, total)

    def stages(self, step: str) -> Callable[[str, float], None]:
        """What is called with words and the share done of a step, which begins now."""
        self.progress(step)
        return lambda words, share: self.progress(step, share, 1, words)


SILENT = Listener()
