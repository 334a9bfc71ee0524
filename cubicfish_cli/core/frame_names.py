"""File names of film frames: they carry the film's name and the time."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from pathlib import PurePath

# Digits of a time since 1970 in seconds, milliseconds, microseconds and nanoseconds.
_SINCE_1970 = {10: 1.0, 13: 1e-3, 16: 1e-6, 19: 1e-9}
_NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?")
_FRAME = re.compile(r"(?P<film>.+)_(?P<seconds>[0-9]{6,}\.[0-9]{3})s(_[0-9]+)?")

_MOST_NAMED = 3


def frame_name(film: str, seconds: float) -> str:
    """The name, without suffix, of a film's frame at some seconds from its beginning.

    Names of one film's frames sort by time.
    """
    return f"{film}_{max(0.0, seconds):010.3f}s"


def film_and_time(photo: str) -> tuple[str, float] | None:
    """The film and the seconds of a photo's name; None where it is no frame of a film."""
    path = PurePath(photo)  # with a suffix or without: a time has a point of its own
    found = _FRAME.fullmatch(path.name) or _FRAME.fullmatch(path.stem)
    return (found["film"], float(found["seconds"])) if found else None


def counted(photos: Iterable[str]) -> str:
    """What photos are, by their names: ``12 photos``, or ``52 frames of garden and 1 photo``.

    Of more than three films only the number is told.
    """
    names = [film_and_time(photo) for photo in photos]
    films = Counter(name[0] for name in names if name is not None)
    single = len(names) - films.total()
    parts = []
    if films:
        of = ", ".join(films) if len(films) <= _MOST_NAMED else f"{len(films)} films"
        parts.append(f"{_number(films.total(), 'frame')} of {of}")
    if single or not films:
        parts.append(_number(single, "photo"))
    return " and ".join(parts)


def _number(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def time_of(photo: str) -> float | None:
    """When a photo was taken, as its name says, seconds; None where it does not.

    A frame of a film has it, and so have names that hold a time since 1970 (in seconds, or
    whole milliseconds, microseconds or nanoseconds), or nothing but a number with a point.
    """
    frame = film_and_time(photo)
    if frame is not None:
        return frame[1]
    path = PurePath(photo)
    # A name without a suffix may be a number with a point.
    stem = path.name if _NUMBER.fullmatch(path.name) else path.stem
    numbers = [found[0] for found in _NUMBER.finditer(stem)]
    for number in numbers:
        unit = _SINCE_1970.get(len(number.split(".")[0]))
        if unit is not None and number.split(".")[0][0] == "1":
            return float(number) * unit
    return float(numbers[0]) if len(numbers) == 1 and numbers[0] == stem and "." in stem else None
