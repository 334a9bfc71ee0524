"""File names of film frames: they carry the film's name and the time."""

import re
from collections import Counter
from collections.abc import Iterable
from pathlib import PurePath

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
