"""Listener: progress and events that the library reports while it works."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cubicfish.judge.finding import Finding

Count = Callable[[int, int], None]


class Event(StrEnum):
    """What happens while work is done, for whoever waits for it."""

    TARGET = "target"
    CAMERA = "camera"
    PASSED_OVER = "passed_over"
    MANY_PHOTOS = "many_photos"
    PHOTOS_CHOSEN = "photos_chosen"
    FILM_ENDS = "film_ends"
    FILM_DAMAGED = "film_damaged"
    FILM_TURNED = "film_turned"
    FRAMES_CHOSEN = "frames_chosen"
    MOMENTS = "moments"
    SHOTS_CHOSEN = "shots_chosen"
    CLOCK = "clock"
    CLOCK_UNSURE = "clock_unsure"
    LOOKING = "looking"
    LOOKED_AGAIN = "looked_again"
    NOT_CERTAIN = "not_certain"
    FITTING = "fitting"
    NO_MAP = "no_map"
    PRINTED_AS_DRAWN = "printed_as_drawn"
    MEASURED_AS_DRAWN = "measured_as_drawn"
    AMBIGUOUS = "ambiguous"
    WITHOUT_POSE = "without_pose"
    VIDEO_TURNED = "video_turned"
    VIDEO_INTERLACED = "video_interlaced"
    VIDEO_REDUCED = "video_reduced"
    RESCALED = "rescaled"
    RENDERED_FLAT = "rendered_flat"
    RENDERING = "rendering"


class Listener:
    """Hears how far work is and what is reported on the way; this one keeps silent.

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
        """Something happened: what it was, its numbers and its names."""

    def found(self, findings: Sequence[Finding]) -> None:
        """These are reported of photos and grids."""

    def counting(self, step: str) -> Count:
        """What is called with things done and all things of a step, which begins now."""
        self.progress(step)
        return lambda done, total: self.progress(step, done, total)

    def stages(self, step: str) -> Callable[[str, float], None]:
        """What is called with words and the share done of a step, which begins now."""
        self.progress(step)
        return lambda words, share: self.progress(step, share, 1, words)
