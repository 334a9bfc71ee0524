"""A film on disk: opening it, and what it says of itself.

PyAV does it, the extra ``video``. Frames are as the sensor made them: a note that tells players to
turn the film is not followed, since the lens does not turn with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from os.path import realpath
from pathlib import Path
from typing import Any

from cubicfish_cli.app.films.recordings import (
    Recording,
    file_and_topic,
    is_recording,
    label_of,
)
from cubicfish_cli.app.photos import MAX_PIXELS, shown
from cubicfish_cli.core.errors import MISSING, OutputError, PhotoError

# Lists of other files, and whatever else would make a video of what is not in the file, stay shut.
_ONLY = {
    "format_whitelist": "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,mpegvideo,asf",
    "protocol_whitelist": "file",
}
# A film lacks frames where it has less than this share of those that it announces.
_WHOLE = 0.95


def library() -> Any:
    """PyAV.

    Raises:
        OutputError: it is not installed.

    """
    try:
        import av
    except ImportError as problem:
        raise OutputError(
            "videos need one more package: pip install 'cubicfish[video]'"
        ) from problem
    return av


class opened:
    """A film's container and its first stream of pictures, for a ``with`` block.

    Raises:
        PhotoError: the file cannot be read, or holds no pictures.
        OutputError: the extra ``video`` is not installed.

    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> tuple[Any, Any]:
        if is_recording(self._path):
            recording = Recording(self._path)
            self._container: Any = recording
            return recording, recording.stream
        av = library()
        # What matters comes back as an error. At any other level FFmpeg's threads wait for Python's
        # lock to say something, while Python, which holds it, waits for them to end.
        av.logging.set_level(None)
        if not Path(self._path).is_file():
            there = Path(self._path).exists()
            raise PhotoError(f"{shown(self._path)} {'is no file' if there else MISSING}")
        try:
            # As ``options`` PyAV before 18 hands them to every stream that it finds later on, too,
            # by a list that is as long as the streams known at first: MPEG files crash.
            self._container = av.open(f"file:{self._path}", container_options=_ONLY)
        except av.FFmpegError as problem:
            raise PhotoError(
                f"{shown(self._path)} cannot be read as a video ({problem.strerror}): "
                "copy it again or convert it with ffmpeg"
            ) from problem
        if not self._container.streams.video:
            self._container.close()
            raise PhotoError(f"{shown(self._path)} holds no video")
        stream = self._container.streams.video[0]
        stream.thread_type = "AUTO"
        stream.codec_context.options = {"max_pixels": str(MAX_PIXELS)}
        return self._container, stream

    def __exit__(self, *_: object) -> None:
        self._container.close()


def frame_count(container: Any, stream: Any) -> int:
    """How many frames a stream has, as its header says; 0 where that is not known."""
    if stream.frames:
        return int(stream.frames)
    if not stream.average_rate:
        return 0
    if stream.duration:
        return int(stream.duration * stream.time_base * stream.average_rate)
    # Matroska has the length of the file alone, in microseconds.
    return int((container.duration or 0) * stream.average_rate / 1_000_000)


def announced_seconds(stream: Any) -> float:
    """How long it is from a stream's first picture to its end, as its header says.

    0 where it does not say, as in files whose length is told by their last packets.
    """
    hours, minutes, seconds = (*str(stream.metadata.get("DURATION", "")).split(":"), "", "")[:3]
    try:
        length = 3600 * int(hours) + 60 * int(minutes) + float(seconds)
        length -= float((stream.start_time or 0) * stream.time_base)
    except ValueError:
        return 0.0
    return length if 0 < length < math.inf else 0.0


def missing_frames(announced: int, seconds: float, rate: float, found: int, end: float) -> int:
    """How many frames a film announces beyond those that it has; 0 for a few, which is common.

    Args:
        announced: how many it counts; 0 where it does not.
        seconds: how long it says that it lasts; 0 where it does not.
        rate: frames per second.
        found: how many there are.
        end: when the last one was taken, seconds after the first.

    """
    if announced:
        return announced - found if found < _WHOLE * announced else 0
    end += 1 / rate if rate else 0
    return max(1, round((seconds - end) * rate)) if end < _WHOLE * seconds else 0


@dataclass(frozen=True, kw_only=True)
class Film:
    """A film on disk.

    Attributes:
        path: where it is.
        label: what names of its frames begin with; unique among the films.
        size: (width, height) of its frames, as they are stored.
        frames: how many it claims to have; 0 where it does not say.
        rate: frames per second, in the mean; 0 where it does not say.
        counted: whether that is a count, not worked out from a length and a rate.
        seconds: how long its header says that it lasts; 0 where it does not say.
        stamp: its size and time of change: other ones mean another film.

    """

    path: Path
    label: str
    size: tuple[int, int]
    frames: int
    rate: float
    counted: bool
    seconds: float = 0.0
    stamp: tuple[int, int]


def open_films(paths: Sequence[Path]) -> list[Film]:
    """Films of one camera, each once, in the order given.

    Raises:
        PhotoError: a film cannot be read, holds no moving pictures, or is of another size than
            the first.
        OutputError: the extra ``video`` is not installed.

    """
    distinct = {realpath(path): path for path in reversed(paths)}
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
            seconds=0.0 if is_recording(path) else announced_seconds(stream),
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
