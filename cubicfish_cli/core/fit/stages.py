"""How far a fit is, for whoever waits for it: what is done now, and the share that is done."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

Progress = Callable[[str, float], None]
Stage = Literal[
    "start", "cubic", "held out", "shape", "shape held out", "points", "points held out", "checks"
]

# What each is called, and roughly how long it takes beside the others.
_STAGES: dict[Stage, tuple[str, float]] = {
    "start": ("poses and a radial lens", 1.0),
    "cubic": ("the cubic camera", 5.0),
    "held out": ("held-out photos", 4.0),
    "shape": ("boards' shapes", 2.5),
    "shape held out": ("boards' shapes, held-out photos", 6.0),
    "points": ("single corners", 3.0),
    "points held out": ("single corners, held-out photos", 6.0),
    "checks": ("what may be wrong", 3.0),
}


class Stages:
    """The stages of one fit.

    Args:
        progress: called with words and the share done, 0 to 1; None where nobody waits.
        refined: whether the target may be fitted too.
        hold_out: whether photos are held out.

    """

    def __init__(self, progress: Progress | None, *, refined: bool, hold_out: bool) -> None:
        left_out = set[Stage]()
        if not refined:
            left_out |= {"shape", "shape held out", "points", "points held out"}
        if not hold_out:
            left_out |= {"held out", "shape held out", "points held out"}
        self._progress = progress
        self._plan = [stage for stage in _STAGES if stage not in left_out]
        self._share = 0.0

    def begin(self, stage: Stage, done: int = 0, parts: int = 1) -> None:
        """Say that a stage begins, or that so many of its parts are done.

        What was not planned, or comes again, keeps the share that was reached.
        """
        if self._progress is None:
            return
        if stage in self._plan:
            weights = [_STAGES[each][1] for each in self._plan]
            before = self._plan.index(stage)
            share = (sum(weights[:before]) + weights[before] * done / parts) / sum(weights)
            self._share = max(self._share, share)
        counted = f" ({done + 1} of {parts})" if parts > 1 else ""
        self._progress(_STAGES[stage][0] + counted, self._share)
