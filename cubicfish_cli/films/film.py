"""What a film says of itself, and films that belong together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubicfish_cli.errors import PhotoError
from cubicfish_cli.films.recordings import file_and_topic, is_recording, label_of
from cubicfish_cli.films.source import frame_count, opened
from cubicfish_cli.photos import shown


@dataclass(frozen=True, kw_only=True)
class Film:
    """A film on disk.

    Attributes:
        path: where it is.
        label: what names of its frames begin with; unique among the films.
        size: (width, height) of its frames, as they are stored.
        frames: how many it claims to have; 0 where it does not say.
        rate: frames a second, in the mean; 0 where it does not say.
        counted: whether that is a count, not worked out from a length and a rate.
        stamp: its size and time of change: other ones mean another film.

    """

    path: Path
    label: str
    size: tuple[int, int]
    frames: int
    rate: float
    counted: bool
    stamp: tuple[int, int]


def open_films(paths: Sequence[Path]) -> list[Film]:
    """Films of one camera, each once, in the order given.

    Raises:
        PhotoError: a film cannot be read, holds no moving pictures, or is of another size than
            the first.
        OutputError: the extra ``video`` is not installed.

    """
    distinct = {path.resolve(): path for path in reversed(paths)}
    labels: list[str] = []
    films = []
    for path in reversed(distinct.values()):
        label = _label(path)
        number, plain = 2, label
        while label.casefold() in labels:
            label = f"{plain}-{number}"
            number += 1
        labels.append(label.casefold())
        films.append(_film(path, label))
    first = films[0]
    for film in films[1:]:
        if film.size != first.size:
            raise PhotoError(
                "{} has {}x{} pixels and {} has {}x{}: films of one camera have one size, without "
                "crop or stabilisation; do each size by itself".format(
                    shown(film.path), *film.size, shown(first.path), *first.size
                )
            )
    return films


def _film(path: Path, label: str) -> Film:
    with opened(path) as (container, stream):
        if _is_cover(stream):
            raise PhotoError(f"{shown(path)} holds sound and a cover, no film: give a film")
        size = (int(stream.width), int(stream.height))
        if min(size) < 1:
            raise PhotoError(f"{shown(path)} does not say how large its frames are: copy it again")
        status = file_and_topic(path)[0].stat()
        return Film(
            path=path,
            label=label,
            size=size,
            frames=frame_count(container, stream),
            rate=float(getattr(stream, "average_rate", None) or 0),
            counted=bool(stream.frames),
            stamp=(status.st_size, status.st_mtime_ns),
        )


def _is_cover(stream: Any) -> bool:
    disposition = getattr(stream, "disposition", None)
    return disposition is not None and bool(disposition & disposition.__class__.attached_pic)


def _label(path: Path) -> str:
    """The name without its suffix; what steers a terminal, and blanks at its ends, left out."""
    stem = label_of(path) if is_recording(path) else path.stem
    name = "".join(c if c.isprintable() else "_" for c in stem).strip().lstrip(".")
    return name or "film"
