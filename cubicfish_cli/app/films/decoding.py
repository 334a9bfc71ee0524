"""A film's frames in order, and when each was taken."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from cubicfish_cli.app.films.recordings import Recording
from cubicfish_cli.app.films.source import library
from cubicfish_cli.app.photos import shown
from cubicfish_cli.core.errors import PhotoError

# Times that go back further, or forward further, are of another film that was joined to this one,
# seconds.
_JOINED_BACK, _JOINED_AHEAD = 1.0, 3600.0
# Each frame of these stands by itself. Damage is passed over in silence unless it is an error.
_SINGLE = frozenset(["mjpeg"])


def frames(
    source: Path, container: Any, stream: Any, lost: Callable[[], None] = lambda: None
) -> Iterator[Any]:
    """A film's frames as PyAV has them; their pts grow from frame to frame.

    Args:
        source: the file, for messages.
        container: as :class:`~cubicfish_cli.app.films.source.opened` gives it.
        stream: its pictures.
        lost: called for each frame that cannot be decoded; it is left out.

    Raises:
        PhotoError: the file cannot be read further, or its frames change their size; the frames
            before that have been given.

    """
    if not isinstance(container, Recording) and stream.codec_context.name in _SINGLE:
        stream.thread_type = "NONE"  # so that an error is that of the packet
        context = stream.codec_context
        context.options = {**context.options, "err_detect": "explode"}
    return (item for item in decode(source, container, stream, lost) if is_frame(item))


def is_frame(item: Any) -> bool:
    """Whether what :func:`decode` gave is a frame, not a packet of sound."""
    return hasattr(item, "planes")


def decode(
    source: Path, container: Any, stream: Any, lost: Callable[[], None] | None = None
) -> Iterator[Any]:
    """Frames of the film and packets of its sound, in the file's order.

    Args:
        source: the file, for messages.
        container: as :class:`~cubicfish_cli.app.films.source.opened` gives it.
        stream: its pictures.
        lost: called for each frame that cannot be decoded; None refuses the film there.

    Raises:
        PhotoError: the file is damaged, or its frames change their size; the frames before that
            have been given.

    """
    size, count = (stream.width, stream.height), 0
    if isinstance(container, Recording):
        for frame in container.frames():
            _refuse_another_size(source, frame, size, count)
            count += 1
            yield frame
        return
    av = library()
    times = Times(container, stream)
    try:
        for packet in container.demux(stream, *container.streams.audio):
            if packet.stream is not stream:
                if packet.dts is not None:  # the last packet is a mark without content
                    yield packet
                continue
            times.sent(packet)
            try:
                made = packet.decode()
            except av.FFmpegError:
                if lost is None:
                    raise
                times.lost()
                lost()
                continue
            for frame in made:
                _refuse_another_size(source, frame, size, count)
                times.set(frame)
                if frame.is_corrupt and lost is not None:
                    lost()
                    continue
                count += 1
                yield frame
    except av.FFmpegError as problem:
        raise PhotoError(
            f"{shown(source)} is damaged after frame {count} ({problem.strerror}): "
            "copy it again or cut it with ffmpeg"
        ) from problem


def _refuse_another_size(source: Path, frame: Any, size: tuple[int, int], count: int) -> None:
    """Refuse a frame that is not of the size that the film has from its beginning."""
    if (frame.width, frame.height) != size:
        raise PhotoError(
            f"{shown(source)} has frames of {frame.width}x{frame.height} pixels after frame "
            f"{count}, and of {size[0]}x{size[1]} before: cut it there with ffmpeg"
        )


class Times:
    """Times of frames, which grow from each to the next.

    AVI files have none, and what FFmpeg makes up for frames that are drawn upon later ones is out
    of order: the order of their packets is what counts. Where films are joined, times begin anew.
    """

    def __init__(self, container: Any, stream: Any) -> None:
        """Of a film as :class:`~cubicfish_cli.app.films.source.opened` gives it."""
        second = 1 / stream.time_base
        self._back, self._ahead = round(_JOINED_BACK * second), round(_JOINED_AHEAD * second)
        rate = stream.average_rate
        self._step = max(1, round(second / rate)) if rate else None
        self._of_packets: deque[int] | None = deque() if container.format.name == "avi" else None
        self._shift = 0
        self._last: int | None = None

    def sent(self, packet: Any) -> None:
        """A packet is decoded, maybe in a while."""
        if self._of_packets is not None and packet.size and packet.dts is not None:
            self._of_packets.append(packet.dts)

    def lost(self) -> None:
        """A packet has no frame."""
        if self._of_packets:
            self._of_packets.popleft()

    def set(self, frame: Any) -> None:
        """Give a frame its time, where there is one."""
        own, last = frame.pts, self._last
        if self._of_packets is not None:
            own = self._of_packets.popleft() if self._of_packets else None
        if own is None:
            if self._step is None:
                return
            pts = 0 if last is None else last + self._step
        elif last is None or last < own <= last + self._ahead:
            pts = own
        else:
            pts = own + self._shift
            if not last - self._back <= pts <= last + self._ahead:
                self._shift = last + (self._step or 1) - own
            pts = max(own + self._shift, last + 1)
        frame.pts = self._last = pts
