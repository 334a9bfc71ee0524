"""What is likely wrong with a set-up: in words, with the figures that say so and what to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

Cause = Literal[
    "board_order",
    "board_names",
    "board_place",
    "board_square",
    "corner_names",
    "corner_count",
    "mirrored",
    "inverted",
    "two_lenses",
    "zoom",
    "scaled",
    "shifted",
    "turned",
    "photo_lens",
    "sheared",
    "sheet_bends",
    "autofocus",
    "stabilisation",
    "repeats",
    "one_place",
]
# What helps, for programs.
Remedy = Literal["correct_target", "correct_photos", "separate_photos", "take_photos", "hold_still"]
_REMEDIES: dict[Cause, Remedy] = {
    "board_order": "correct_target",
    "board_names": "correct_target",
    "board_place": "correct_target",
    "board_square": "correct_target",
    "corner_names": "correct_target",
    "corner_count": "correct_target",
    "mirrored": "correct_photos",
    "two_lenses": "separate_photos",
    "zoom": "separate_photos",
    "scaled": "correct_photos",
    "shifted": "separate_photos",
    "turned": "correct_photos",
    "photo_lens": "separate_photos",
    "sheared": "hold_still",
    "sheet_bends": "hold_still",
    "autofocus": "hold_still",
    "stabilisation": "hold_still",
    "repeats": "take_photos",
    "one_place": "take_photos",
}
# What a finding says about the camera: nothing against it, to be used with care, or wrong.
Level = Literal["note", "care", "bad"]

_MOST_NAMES = 6


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing that is likely wrong.

    Attributes:
        cause: what kind of thing, for programs.
        level: ``bad`` where the camera is wrong with it, ``care`` where it may be, ``note`` where
            it is not.
        what: what is likely wrong, with figures.
        evidence: the figures that say so.
        do: what to do about it.
        images: names of the photos that it is about; empty for all.
        boards: names of the boards that it is about; empty for all.

    """

    cause: Cause
    level: Level
    what: str
    evidence: str
    do: str
    images: tuple[str, ...] = ()
    boards: tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """All in one line."""
        return f"{self.what} ({self.evidence}); {self.do}"

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON and YAML."""
        return {
            "cause": self.cause,
            "code": self.cause,
            "level": self.level,
            "severity": self.level,
            "remedy": _REMEDIES[self.cause],
            "what": self.what,
            "evidence": self.evidence,
            "do": self.do,
            "images": list(self.images),
            "boards": list(self.boards),
        }


def listed(names: Sequence[str], what: str) -> str:
    """A few names as they are, of many the first ones and how many more.

    Args:
        names: at least one.
        what: what they are, in the plural, such as ``photos``.

    """
    if len(names) <= _MOST_NAMES:
        return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
    few = _MOST_NAMES - 2
    return f"{', '.join(names[:few])} and {len(names) - few} more {what}"


def percent(share: float) -> str:
    """A share as a signed percentage of two digits: 0.0123 -> ``+1.2 %``."""
    return f"{100 * share:+.2g} %"
