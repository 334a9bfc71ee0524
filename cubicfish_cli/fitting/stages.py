"""How far a fit is, for whoever waits for it: what is done now, and the share that is done."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

Progress = Callable[[str, float], None]
Stage = Literal[
    "start", "cubic", "held out", "shape", "shape held out", "points", "points held out", "checks"
]

_WORDS: dict[Stage, str] = {
    "start": "poses and a radial lens",
    "cubic": "the cubic camera",
    "held out": "held-out photos",
    "shape": "boards' shapes",
    "shape held out": "boards' shapes, held-out photos",
    "points": "single corners",
    "points held out": "single corners, held-out photos",
    "checks": "what may be wrong",
}
# Roughly how long each takes beside the others.
_WEIGHTS: dict[Stage, float] = {
    "start": 1.0,
    "cubic": 5.0,
    "held out": 4.0,
    "shape": 2.5,
    "shape held out": 6.0,
    "points": 3.0,
    "points held out": 6.0,
    "checks": 3.0,
}


class Stages:
    """The stages of one fit.

    Args:
        progress: called with words and the share done, 0 to 1; None where nobody waits.
        refined: whether the object may be fitted too.
        hold_out: whether photos are held out.

    """

    def __init__(self, progress: Progress | None, *, refined: bool, hold_out: bool) -> None:
        left_out = set[Stage]()
        if not refined:
            left_out |= {"shape", "shape held out", "points", "points held out"}
        if not hold_out:
            left_out |= {"held out", "shape held out", "points held out"}
        self._progress = progress
        self._plan = [stage for stage in _WORDS if stage not in left_out]
        self._share = 0.0

    def begin(self, stage: Stage, done: int = 0, parts: int = 1) -> None:
        """Say that a stage begins, or that so many of its parts are done.

        What was not planned, or comes again, keeps the share that was reached.
        """
        if self._progress is None:
            return
        if stage in self._plan:
            before = sum(_WEIGHTS[each] for each in self._plan[: self._plan.index(stage)])
            reached = before + _WEIGHTS[stage] * done / parts
            share = reached / sum(_WEIGHTS[each] for each in self._plan)
            self._share = max(self._share, share)
        counted = f" ({done + 1} of {parts})" if parts > 1 else ""
        self._progress(_WORDS[stage] + counted, self._share)
