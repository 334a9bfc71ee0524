"""File names of film frames: they carry the film's name and the time."""

import re
from pathlib import PurePath

_FRAME = re.compile(r"(?P<film>.+)_(?P<seconds>[0-9]{6,}\.[0-9]{3})s(_[0-9]+)?")


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
