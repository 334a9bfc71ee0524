"""A film on disk: opening it, its header, and its frames in order.

PyAV, the extra ``video``, decodes it. Frames are as the sensor made them: a note that players
should turn the film is not followed, since the lens does not turn with it.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from os.path import realpath
from pathlib import Path
from typing import Any

from cubicfish import OutputError, PhotoError, shown
from cubicfish.photos import PictureFile
from cubicfish_cli.films.recordings import Recording, label_of
from cubicfish_cli.inputs.paths import is_recording

# Playlists and other formats that would read more than the file itself are not opened.
_ONLY = {
    "format_whitelist": "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,mpegvideo,asf",
    "protocol_whitelist": "file",
}
# A film lacks frames where it has less than this share of those that it announces.
_WHOLE = 0.95
# Times that go forward further are of another film that was joined to this one, seconds.
_JOINED = 3600.0
# Each frame of these stands by itself. Damage is passed over in silence unless it is an error.
_SINGLE = frozenset(["mjpeg"])


def library() -> Any:
    """Import PyAV.

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


@contextmanager
def opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """Open a film: its container and first stream of pictures, for a ``with`` block.

    Raises:
        PhotoError: the file cannot be read, or holds no pictures.
        OutputError: the extra ``video`` is not installed.

    """
    if is_recording(path):
        with closing(Recording(path)) as recording:
            yield recording, recording.stream
        return
    av = library()
    # What matters comes back as an error. At any other level FFmpeg's threads wait for Python's
    # lock to say something, while Python, which holds it, waits for them to end.
    av.logging.set_level(None)
    if not path.exists():
        raise PhotoError.missing(path)
    if not path.is_file():
        raise PhotoError(f"{shown(path)} is no file")
    try:
        # As ``options`` PyAV before 18 hands them to every stream that it finds later on, too,
        # by a list that is as long as the streams known at first: MPEG files crash.
        container = av.open(f"file:{path}", container_options=_ONLY)
    except av.FFmpegError as problem:
        raise PhotoError(
            f"{shown(path)} cannot be read as a video ({problem.strerror}): "
            "copy it again or convert it with ffmpeg"
        ) from problem
    with closing(container):
        if not container.streams.video:
            raise PhotoError(f"{shown(path)} holds no video")
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        stream.codec_context.options = {"max_pixels": str(PictureFile.MAX_PIXELS)}
        yield container, stream


def frame_count(container: Any, stream: Any) -> int:
    """Return how many frames a stream has, as its header says; 0 where that is not known."""
    if stream.frames:
        return int(stream.frames)
    if not stream.average_rate:
        return 0
    if stream.duration:
        return int(stream.duration * stream.time_base * stream.average_rate)
    # Matroska has the length of the file alone, in microseconds.
    return int((container.duration or 0) * stream.average_rate / 1_000_000)


def missing_frames(stream: Any, found: int, end: float) -> int:
    """Return how many frames a film announces and lacks; 0 for a few, which is common.

    Args:
        stream: its pictures, whose header counts them or says how long they last, or neither.
        found: how many there are.
        end: when the last one was taken, seconds after the first.

    """
    if announced := int(stream.frames):
        return announced - found if found < _WHOLE * announced else 0
    hours, minutes, seconds = (*str(stream.metadata.get("DURATION", "")).split(":"), "", "")[:3]
    try:
        length = 3600 * int(hours) + 60 * int(minutes) + float(seconds)
    except ValueError:
        return 0
    length -= float((stream.start_time or 0) * stream.time_base)
    rate = float(stream.average_rate or 0)
    end += 1 / rate if rate else 0
    return max(1, round((length - end) * rate)) if end < _WHOLE * length < math.inf else 0


@dataclass(frozen=True, kw_only=True)
class Film:
    """A film on disk.

    Attributes:
        path: where it is.
        label: what names of its frames begin with; unique among the films.
        size: (width, height) of its frames, as they are stored.
        frames: how many it claims to have; 0 if it does not say.
        rate: frames per second, in the mean; 0 if it does not say.

    """

    path: Path
    label: str
    size: tuple[int, int]
    frames: int
    rate: float


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
        label = _make_label(path)
        number, plain = 2, label
        while label.casefold() in labels:
            label = f"{plain}-{number}"
            number += 1
        labels.append(label.casefold())
        films.append(_read_film(path, label))
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


def _read_film(path: Path, label: str) -> Film:
    with opened(path) as (container, stream):
        disposition = getattr(stream, "disposition", None)
        if disposition is not None and disposition & disposition.__class__.attached_pic:
            raise PhotoError(f"{shown(path)} holds sound and a cover, no film: give a film")
        size = (int(stream.width), int(stream.height))
        if min(size) < 1:
            raise PhotoError(f"{shown(path)} does not say how large its frames are: copy it again")
        frames, rate = frame_count(container, stream), float(stream.average_rate or 0)
        return Film(path=path, label=label, size=size, frames=frames, rate=rate)


def _make_label(path: Path) -> str:
    """Return the name without suffix, control characters and blanks at its ends."""
    stem = label_of(path) if is_recording(path) else path.stem
    name = "".join(c if c.isprintable() else "_" for c in stem).strip().lstrip(".")
    return name or "film"


def frames(source: Path, container: Any, stream: Any) -> Iterator[Any]:
    """Yield a film's frames as PyAV has them, with strictly growing pts.

    Those that cannot be decoded are left out.

    Args:
        source: the file, for messages.
        container: as :class:`opened` gives it.
        stream: its pictures.

    Raises:
        PhotoError: the file cannot be read further, or its frames change their size; the frames
            before that have been given.

    """
    if not isinstance(container, Recording) and stream.codec_context.name in _SINGLE:
        stream.thread_type = "NONE"  # so that an error is that of the packet
        context = stream.codec_context
        context.options = {**context.options, "err_detect": "explode"}
    return (item for item in decode(source, container, stream, whole=False) if is_frame(item))


def is_frame(item: Any) -> bool:
    """Return whether what :func:`decode` gave is a frame, not a packet of sound."""
    return hasattr(item, "planes")


def decode(source: Path, container: Any, stream: Any, *, whole: bool = True) -> Iterator[Any]:
    """Yield frames of the film and packets of its sound, in the file's order.

    Args:
        source: the file, for messages.
        container: as :class:`opened` gives it.
        stream: its pictures.
        whole: whether a frame that cannot be decoded ends it; else it is left out.

    Raises:
        PhotoError: the file is damaged, or its frames change their size; the frames before that
            have been given.

    """
    size = stream.width, stream.height
    if isinstance(container, Recording):
        for number, frame in enumerate(container.frames()):
            _refuse_another_size(source, frame, size, number)
            yield frame
    else:
        yield from _decode_packets(source, container, stream, size, whole=whole)


def _decode_packets(
    source: Path, container: Any, stream: Any, size: tuple[int, int], *, whole: bool
) -> Iterator[Any]:
    av, times, count = library(), _Times(container, stream), 0
    is_cut, last, damaged = False, None, set[int | None]()
    try:
        for packet in container.demux(stream, *container.streams.audio):
            if packet.stream is not stream:
                if packet.dts is not None:  # the last packet is a mark without content
                    yield packet
                continue
            try:
                made = packet.decode()
            except av.FFmpegError:
                if whole:
                    raise
                is_cut = True
                continue
            if packet.size:  # the last one only asks for frames that are held back
                is_cut, last = packet.is_corrupt, packet.pts
            for frame in made:
                _refuse_another_size(source, frame, size, count)
                if frame.is_corrupt:
                    damaged.add(frame.pts)
                frame.pts = times.next(frame.pts)
                if whole or not frame.is_corrupt:
                    count += 1
                    yield frame
    except av.FFmpegError as problem:
        raise PhotoError(
            f"{shown(source)} is damaged after frame {count} ({problem.strerror}): "
            "copy it again or cut it with ffmpeg"
        ) from problem
    # Frames that are drawn upon the last packet may follow it.
    if is_cut or last in damaged - {None} or _ends_within_packet(source, container):
        _refuse_cut(source, stream, count)


def _ends_within_packet(source: Path, container: Any) -> bool:
    """Whether a transport stream ends before its last packet does: the file was not copied whole.

    Its packets, each begun by a byte of its own, are 188 bytes long, with a time before them 192,
    with a check behind them 204. A recording may begin within one.
    """
    if container.format.name != "mpegts":
        return False
    with source.open("rb") as file:
        head, size = file.read(16 * 204), source.stat().st_size
    for length, before in ((188, 0), (192, 4), (204, 0)):
        for start in range(length):
            if head[start::length] == b"\x47" * len(head[start::length]):
                return (size - start + before) % length != 0
    return False


def _refuse_cut(source: Path, stream: Any, count: int) -> None:
    """Refuse a film that does not count its frames: nothing else says that some are missing."""
    if count and not stream.frames:
        raise PhotoError(
            f"{shown(source)} is cut short after frame {count}: copy it again or cut it with ffmpeg"
        )


def _refuse_another_size(source: Path, frame: Any, size: tuple[int, int], count: int) -> None:
    """Refuse a frame that is not of the size that the film has from its beginning."""
    if (frame.width, frame.height) != size:
        raise PhotoError(
            f"{shown(source)} has frames of {frame.width}x{frame.height} pixels after frame "
            f"{count}, and of {size[0]}x{size[1]} before: cut it there with ffmpeg"
        )


class _Times:
    """Times of a film's frames that grow from frame to frame, in units of the stream."""

    def __init__(self, container: Any, stream: Any) -> None:
        second, rate = 1 / stream.time_base, stream.average_rate
        self._step = max(1, round(second / rate)) if rate else None
        self._most = _JOINED * second
        # What FFmpeg makes up there, where frames are drawn upon later ones, is out of order.
        self._stated = container.format.name != "avi" or not stream.codec_context.has_b_frames
        self._last: int | None = None

    def next(self, own: int | None) -> int | None:
        """Return the time of the next frame, which states this one itself."""
        self._last = time_after(self._last, own if self._stated else None, self._step, self._most)
        return self._last


def time_after(last: int | None, own: int | None, step: int | None, most: float) -> int | None:
    """Return the time of a frame, after that of the frame before; None where it is not known.

    Where films are joined, times begin anew.

    Args:
        last: time of the frame before; None for the first.
        own: time that the frame itself states.
        step: how long a frame lasts, where that is known.
        most: what is longer than this after the frame before is of another film.

    """
    if own is None:
        return None if step is None else 0 if last is None else last + step
    return own if last is None or last < own <= last + most else last + (step or 1)
