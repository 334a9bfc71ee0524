"""Plurals, lists, shares and lengths in sentences."""

import math
import os
import shlex
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from cubicfish import listed
from cubicfish.files import FrameName
from cubicfish.target import MILLIMETRES

_MOST_FILMS = 3
_IMPERIAL = ("in", "inch", "inches", "ft")


def shell_line(*words: object) -> str:
    """A command that can be pasted into a shell, whatever its words are.

    A path that begins like an option gets its folder before it.
    """
    return shlex.join(
        f".{os.sep}{word}" if isinstance(word, Path) and str(word)[:1] == "-" else str(word)
        for word in words
    )


def plural(number: float, what: str) -> str:
    """Return ``1 photo``, ``2 photos``, ``1,200 photos``."""
    return f"{number:,.0f} {what}{'' if number == 1 else 's'}"


def percent(share: float) -> str:
    """Return a share as a signed percentage of two digits or more: 0.0123 -> ``+1.2 %``."""
    return f"{100 * share:+.0f} %" if abs(share) >= 0.995 else f"{100 * share:+.2g} %"


def whole(share: float) -> str:
    """Return a share in whole percents: 0.4 -> ``40 %``."""
    return f"{100 * share:.0f} %"


def pick(number: float | Sequence[str], one: str, several: str) -> str:
    """Return the words for one thing, or for a number or a list of others."""
    return one if (len(number) if isinstance(number, Sequence) else number) == 1 else several


def counted(photos: Iterable[str]) -> str:
    """Count photos and frames by their names: ``52 frames of garden and 1 photo``.

    More than three films are counted, not named.
    """
    names = [FrameName.read(photo) for photo in photos]
    films = Counter(name[0] for name in names if name is not None)
    single = len(names) - films.total()
    parts = []
    if films:
        of = ", ".join(films) if len(films) <= _MOST_FILMS else f"{len(films)} films"
        parts.append(f"{plural(films.total(), 'frame')} of {of}")
    if single or not films:
        parts.append(plural(single, "photo"))
    return " and ".join(parts)


def near_duplicates(repeats: Sequence[Sequence[str]]) -> str:
    """Say which photos or shots repeat which, of pairs: the first, and the one like it."""
    alike = [f"{copy} is a near-duplicate of {first}" for first, copy in repeats]
    return listed(alike, "near-duplicates")


def length_words(length: float, units: str) -> str:
    """Return a length to two digits in a suitable unit, ``40 cm``; others than metric stay.

    Args:
        length: in ``units``.
        units: of the length; ``""`` where they are not known.

    """
    size = 0.0 if units in _IMPERIAL else MILLIMETRES.get(units, 0.0)
    if length > 0 and size:
        for name in ("m", "cm", "mm"):
            own = length * size / MILLIMETRES[name]
            if own >= (2 if name == "cm" else 1) or name == "mm":
                return f"{two_digits(own)} {name}"
    return f"{two_digits(length)} {units}".rstrip()


def two_digits(value: float) -> str:
    """Return a number, 0 or above, to two digits: ``1100``, ``0.41``."""
    digits = 1 - math.floor(math.log10(value)) if value > 0 else 0
    return f"{round(value, digits):.{max(0, digits)}f}"
