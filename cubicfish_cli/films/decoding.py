"""A film's frames in order: when each was taken, and whether it is as the camera took it.

Decoders go on where a file is damaged: they fill what is missing from other frames, or with grey,
and every frame up to the next whole one is drawn upon that.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cubicfish_cli.errors import PhotoError
from cubicfish_cli.films.recordings import Recording
from cubicfish_cli.films.source import library
from cubicfish_cli.photos import shown

# Times that go back further, or forward further, are of another film that was joined to this one,
# seconds.
_JOINED_BACK, _JOINED_AHEAD = 1.0, 3600.0
# So many packets at the most seem damaged since another stream begins behind them.
_AT_A_JOIN = 2
# Streams of these never hold zeros in a row (their emulation prevention: ITU-T H.264, 7.4.1), but
# for what pads the end of a unit: where it has its length before it, no more than a few.
_WITHOUT_ZEROS = frozenset(["h264", "hevc"])
_FEW_ZEROS, _MANY_ZEROS = bytes(8), bytes(32)
_FOLLOWED = re.compile(rb"\0{8}\0*[^\0\1]")
# Each frame of these stands by itself. Damage is passed over in silence unless it is an error.
_SINGLE = frozenset(["mjpeg"])
# Where a JPEG picture ends; some cameras never write it.
_END = b"\xff\xd9"


@dataclass(frozen=True, kw_only=True, eq=False)
class Decoded:
    """A frame of a film.

    Attributes:
        frame: as PyAV has it; its pts grows from frame to frame.
        damaged: whether parts of it are made up.
        lost: how many frames before it could not be decoded.

    """

    frame: Any
    damaged: bool = False
    lost: int = 0


def frames(source: Path, container: Any, stream: Any) -> Iterator[Decoded]:
    """A film's frames, damaged ones among them.

    Args:
        source: the file, for messages.
        container: as :class:`~cubicfish_cli.films.source.opened` gives it.
        stream: its pictures.

    Raises:
        PhotoError: the file cannot be read further, or no frame can be decoded; the frames before
            that have been given.

    """
    size, count = (stream.width, stream.height), 0
    if isinstance(container, Recording):
        for frame in _recorded(source, container, size):
            yield Decoded(frame=frame)
        return
    decoder = _Decoder(container, stream)
    held: list[Decoded] = []
    for count, one in enumerate(decoder.run(source), 1):
        _refuse_another_size(source, one.frame, size, count - 1)
        held.append(one)
        # Those that are shown before the frame that they are drawn upon are as good as that.
        if one.frame.pict_type == _BETWEEN and len(held) <= _MOST_HELD:
            continue
        yield from (replace(other, damaged=other.damaged or one.damaged) for other in held)
        held = []
    yield from held
    if not count and decoder.problem is not None:
        raise PhotoError(
            f"{shown(source)} is damaged from its first frame on ({decoder.problem}): copy it again"
        )


def is_frame(item: Any) -> bool:
    """Whether what :func:`decode` gave is a frame, not a packet of sound."""
    return hasattr(item, "planes")


def decode(source: Path, container: Any, stream: Any) -> Iterator[Any]:
    """Frames of the film and packets of its sound, in the file's order.

    Args:
        source: the file, for messages.
        container: as :class:`~cubicfish_cli.films.source.opened` gives it.
        stream: its pictures.

    Raises:
        PhotoError: the file is damaged, or its frames change their size; the frames before that
            have been given.

    """
    size, count = (stream.width, stream.height), 0
    if isinstance(container, Recording):
        yield from _recorded(source, container, size)
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
            for frame in packet.decode():
                _refuse_another_size(source, frame, size, count)
                times.set(frame)
                count += 1
                yield frame
    except av.FFmpegError as problem:
        raise PhotoError(
            f"{shown(source)} is damaged after frame {count} ({problem.strerror}): "
            "copy it again or cut it with ffmpeg"
        ) from problem


def _recorded(source: Path, recording: Recording, size: tuple[int, int]) -> Iterator[Any]:
    """The frames of a recording."""
    for count, frame in enumerate(recording.frames()):
        _refuse_another_size(source, frame, size, count)
        yield frame


def _refuse_another_size(source: Path, frame: Any, size: tuple[int, int], count: int) -> None:
    """Refuse a frame that is not of the size that the film has from its beginning."""
    if (frame.width, frame.height) != size:
        raise PhotoError(
            f"{shown(source)} has frames of {frame.width}x{frame.height} pixels after frame "
            f"{count}, and of {size[0]}x{size[1]} before: cut it there with ffmpeg"
        )


# FFmpeg's number for frames that are drawn upon one before and one after, and how many of them
# stand in a row at most.
_BETWEEN, _MOST_HELD = 3, 16


class _Decoder:
    """Decodes packet by packet and keeps account of damage.

    Attributes:
        problem: what the decoder said last of a frame that it could not decode.

    """

    def __init__(self, container: Any, stream: Any) -> None:
        self.problem: str | None = None
        self._container, self._stream = container, stream
        self._times, self._damage = Times(container, stream), _Damage(stream)
        self._lost = 0
        self._again: Any = None
        context = stream.codec_context
        if context.name in _SINGLE:
            stream.thread_type = "NONE"  # so that an error is that of the packet
            context.options = {**context.options, "err_detect": "explode"}
            self._again = library().CodecContext.create(context.name, "r")
            self._again.extradata = context.extradata

    def run(self, source: Path) -> Iterator[Decoded]:
        av = library()
        try:
            for packet in self._container.demux(self._stream):
                self._times.sent(packet)
                self._damage.sent(packet)
                failed = False
                try:
                    made = packet.decode()
                except av.FFmpegError as problem:
                    self.problem, failed = problem.strerror, True
                    made = self._after_error(packet)
                for frame in made:
                    damaged = self._damage.of(frame) or failed
                    self._times.set(frame)
                    yield Decoded(frame=frame, damaged=damaged, lost=self._lost)
                    self._lost = 0
        except av.FFmpegError as problem:
            raise PhotoError(
                f"{shown(source)} cannot be read further ({problem.strerror}): copy it again or "
                "cut it with ffmpeg"
            ) from problem

    def _after_error(self, packet: Any) -> list[Any]:
        self._damage.failed()
        if self._again is not None and packet.size:
            try:
                made = list(self._again.decode(packet))
            except library().FFmpegError:
                made = []
            if made:
                return made
        self._times.lost()
        self._lost += 1
        return []


class _Damage:
    """Which frames are made up in part, as far as packets and the decoder say."""

    def __init__(self, stream: Any) -> None:
        context = stream.codec_context
        self._without_zeros = context.name in _WITHOUT_ZEROS
        self._single, self._with_end = context.name in _SINGLE, False
        self._with_lengths = (context.extradata or b"")[:1] == b"\1"
        self._sent = self._made = False  # drawn upon what is damaged
        self._of_damaged: set[int] = set()
        self._back = round(_JOINED_BACK / stream.time_base)
        self._last_dts: int | None = None
        self._doubted: list[int] = []  # by the container alone

    def sent(self, packet: Any) -> None:
        """Look at a packet before it is decoded."""
        self._forgive_a_join(packet)
        if packet.is_keyframe:
            self._sent = False
        shown = bool(packet.size) and self._shows_it(packet)
        if packet.is_keyframe or shown:
            self._doubted = []
        if packet.is_corrupt or shown:
            self._sent = True
        if self._sent and packet.pts is not None:
            self._of_damaged.add(packet.pts)
            if packet.is_corrupt or self._doubted:
                self._doubted.append(packet.pts)

    def _forgive_a_join(self, packet: Any) -> None:
        """Where streams are joined, the count of packets breaks off: the last ones seem damaged."""
        if packet.dts is None:
            return
        if self._last_dts is not None and packet.dts < self._last_dts - self._back:
            if len(self._doubted) <= _AT_A_JOIN:
                self._of_damaged.difference_update(self._doubted)
            self._doubted = []
        self._last_dts = packet.dts

    def _shows_it(self, packet: Any) -> bool:
        """Whether a packet's bytes cannot be those that an encoder wrote."""
        if self._single:
            ends = _END in bytes(packet)
            self._with_end |= ends
            return self._with_end and not ends
        data = bytes(packet) if self._without_zeros else b""
        if _FEW_ZEROS not in data:  # ten times faster than what follows
            return False
        return (self._with_lengths and _MANY_ZEROS in data) or _FOLLOWED.search(data) is not None

    def failed(self) -> None:
        """A frame could not be decoded."""
        self._made = True

    def of(self, frame: Any) -> bool:
        """Whether a frame, as it was decoded, is made up in part."""
        if frame.key_frame:
            self._made = False
        self._made |= frame.is_corrupt
        found = frame.pts in self._of_damaged
        self._of_damaged.discard(frame.pts)
        return found or self._made


class Times:
    """Times of frames, which grow from each to the next.

    AVI files have none, and what FFmpeg makes up for frames that are drawn upon later ones is out
    of order: the order of their packets is what counts. Where films are joined, times begin anew.
    """

    def __init__(self, container: Any, stream: Any) -> None:
        """Of a film as :class:`~cubicfish_cli.films.source.opened` gives it."""
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
