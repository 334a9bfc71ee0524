"""File names of film frames: they carry the film's name and the time."""

import re
from pathlib import PurePath
from typing import NamedTuple

_FRAME = re.compile(r"(?P<film>.+)_(?P<seconds>[0-9]{6,}\.[0-9]{3})s(_[0-9]+)?")


class FrameName(NamedTuple):
    """What the name of a film's frame says; as text it is the name, without suffix.

    Names of one film's frames sort by time.

    Attributes:
        film: the film's name.
        seconds: the time from its beginning.

    """

    film: str
    seconds: float

    def __str__(self) -> str:
        """The name, without suffix."""
        return f"{self.film}_{max(0.0, self.seconds):010.3f}s"

    @classmethod
    def read(cls, photo: str) -> "FrameName | None":
        """What a photo's name says; None where it is no frame of a film."""
        path = PurePath(photo)  # with a suffix or without: a time has a point of its own
        found = _FRAME.fullmatch(path.name) or _FRAME.fullmatch(path.stem)
        return cls(found["film"], float(found["seconds"])) if found else None
