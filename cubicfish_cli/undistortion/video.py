"""Map and video -> undistorted video, with its audio and its timestamps.

Decoding, remapping and encoding run on threads of their own, a few frames apart. Pictures stay in
the planes that codecs use (brightness, and colour at half the size): nothing is converted or lost
by it, ten-bit video stays so, and half as many samples are remapped.
"""

from __future__ import annotations

import errno
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cubicfish import (
    CubicCamera,
    CubicfishError,
    Event,
    Listener,
    OutputError,
    PhotoError,
    UndistortMap,
    View,
    ViewError,
    shown,
)
from cubicfish.files import write_files
from cubicfish.views import Interpolation, ViewOptions
from cubicfish_cli.films.source import (
    decode,
    frame_count,
    is_frame,
    library,
    missing_frames,
    opened,
)
from cubicfish_cli.undistortion.batch import Job, Size, Views, Write
from cubicfish_cli.undistortion.images import naming

if TYPE_CHECKING:
    import av

DEFAULT_CRF = 18
# Codecs for kinds of files that do not take H.264.
_CODECS = {".webm": "libvpx-vp9"}
# Errors of the disk, not of the video.
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)

# Frames between one thread and the next: enough to even out their pace.
_QUEUE = 4
_BYTE = 8
# Codecs whose colour samples lie in the middle of their columns. Those of all other codecs, also of
# those that are written, lie on the first column, unless a video says otherwise; hardly any does.
_CENTRED = frozenset(["mjpeg"])

# Planes of green, blue and red. They are kept where the options allow no loss: H.264 has an encoder
# of its own for them, others take them as they are.
_RGB = "gbrp"


_TAGS = ("color_range", "color_primaries", "color_trc", "colorspace")
# As H.264 numbers them.
_LIMITED, _FULL = 1, 2
_AS_RGB, _BT601 = 0, 5


class _Colours(NamedTuple):
    """How pictures are written: what is said of them follows from this, not from the source.

    Attributes:
        format: of the pixels.
        tags: of the stream: how its numbers are to be read.
        black: numbers of black, one for each plane.
        convert: how pictures of another format become such, for PyAV.

    """

    format: str
    tags: dict[str, int]
    black: tuple[int, ...]
    convert: dict[str, Any]

    @classmethod
    def of(cls, context: Any, written: str) -> _Colours:
        """Of a source's codec and the format that is written."""
        tags = {
            name: value for name in _TAGS if (value := getattr(context, name, None)) is not None
        }
        given, kind, convert = context.format, library().VideoFormat(written), dict[str, Any]()
        if kind.is_rgb:
            tags |= {"color_range": _FULL, "colorspace": _AS_RGB}
            return cls(written, tags, (0, 0, 0), convert)
        if given.is_rgb or given.has_palette:
            from av.video.reformatter import ColorRange, Colorspace

            convert = {"dst_colorspace": Colorspace.ITU601, "dst_color_range": ColorRange.MPEG}
            tags |= {"color_range": _LIMITED, "colorspace": _BT601}
        elif len(kind.components) == 1 and tags.get("color_range") != _LIMITED:
            tags["color_range"] = _FULL  # as FFmpeg takes grey of which nothing is said
        bits = kind.components[0].bits
        full = written.startswith("yuvj") or tags.get("color_range") == _FULL
        middle = 2 ** (bits - 1)
        return cls(written, tags, (0 if full else 2 ** (bits - 4), middle, middle), convert)


class _Rendered(NamedTuple):
    """What came of a video: how its frames were remapped, and how many it has and lacks."""

    remapper: _PlaneRemapper
    frames: int
    missing: int


def video_size(path: Path) -> Size:
    """(width, height) of a video's frames.

    Raises:
        PhotoError: the file cannot be read, or holds no video.
        OutputError: the extra ``video`` is not installed.

    """
    with opened(path) as (_, stream):
        return stream.width, stream.height


class VideoViews(Views):
    """The view of a camera's videos."""

    @staticmethod
    def size_of(path: Path) -> Size:
        """See :func:`video_size`."""
        return video_size(path)

    def __init__(
        self,
        camera: CubicCamera,
        wanted: View | ViewOptions | None,
        interpolation: Interpolation,
        crf: int,
        listener: Listener,
    ) -> None:
        """Prepare for videos of this camera, as :class:`Views` does for photos.

        Args:
            camera: the camera.
            wanted: the view, or its options.
            interpolation: how pixels are interpolated.
            crf: constant rate factor of the encoder; a lower number is better, and makes a larger
                file.
            listener: is told of progress, and how far players turn a video.

        """
        super().__init__(camera, wanted, interpolation)
        self._crf, self._listener = crf, listener

    def writer(self, quality: int | None) -> Write:
        """The function that writes a video; the quality is that of pictures."""
        return self.write

    def write(self, job: Job, *, overwrite: bool) -> CubicfishError | None:
        """Render every frame of a video; audio and timestamps are kept.

        The result appears whole or not at all, also when this is interrupted.

        Returns:
            Why there is no result, or one that lacks frames: a :class:`PhotoError` if the video
            cannot be read to its end or is cut short; a :class:`ViewError` if the map cannot be
            made, or an encoder needs even sides and they are not; an :class:`OutputError` if the
            output exists, cannot be written, cannot hold the codec or the audio, or the extra
            ``video`` is not installed.

        """
        source, output = job.source, job.outputs[""]
        made: list[_Rendered] = []
        try:
            write_files(
                {output: lambda part: made.append(self._render(job, part))}, overwrite=overwrite
            )
        except CubicfishError as problem:
            return problem
        ((remapper, frames, missing),) = made
        if remapper.turned_deg:
            turned_deg = remapper.turned_deg
            self._listener.tell(Event.VIDEO_TURNED, video=output, turned_deg=turned_deg)
        if remapper.interlaced:
            self._listener.tell(Event.VIDEO_INTERLACED, video=output)
        if remapper.reduced:
            written = remapper.colours.format
            self._listener.tell(
                Event.VIDEO_REDUCED, video=output, given=remapper.reduced, written=written
            )
        if not missing:
            return None
        return PhotoError(
            f"{shown(source)} is cut short: it announces {frames + missing:,} frames and has "
            f"{frames:,}, which {shown(output)} holds: copy it again if you can"
        )

    def _render(self, job: Job, path: Path) -> _Rendered:
        """Write a video to the name that it has while it is not finished."""
        source, output = job.source, job.outputs[""]
        progress = self._listener.counting(job.name)
        with opened(source) as (container, stream):
            with naming(source):
                made = self.maps(source, (stream.width, stream.height))[""]
            writer = _Writer(path, output, container, stream, made, self._crf)
            with closing(writer):
                codec = stream.codec_context.name
                remapper = _PlaneRemapper(made, self.interpolation, writer.colours, codec)
                frames, missing = _run(source, container, stream, remapper, writer, progress)
        return _Rendered(remapper, frames, missing)


def _run(
    source: Path,
    container: Any,
    stream: Any,
    remapper: _PlaneRemapper,
    writer: _Writer,
    progress: Callable[[int, int], None],
) -> tuple[int, int]:
    """Return how many frames were written, and how many more the source announces."""
    total = frame_count(container, stream)

    def remapped(items: Iterator[Any]) -> Iterator[Any]:
        for item in items:
            yield remapper(item) if is_frame(item) else item

    begin, end, frames = int(stream.start_time or 0), 0.0, 0
    progress(0, total)
    decoded = decode(source, container, stream)
    with closing(_run_ahead(decoded)) as ready, closing(_run_ahead(remapped(ready))) as flat:
        for item in flat:
            writer.write(item)
            if is_frame(item):
                frames += 1
                end = end if item.pts is None else float((item.pts - begin) * stream.time_base)
                progress(frames, max(total, frames) if total else 0)
        if not frames:
            raise PhotoError(f"{shown(source)} holds no frames: copy it again")
        writer.finish()
    return frames, missing_frames(stream, frames, end)


def _run_ahead(items: Iterator[Any]) -> Generator[Any]:
    """The items of an iterator that runs in a thread of its own, a few ahead of the consumer."""
    end = object()
    with ThreadPoolExecutor(1) as thread:
        try:
            coming = deque(thread.submit(next, items, end) for _ in range(_QUEUE))
            while (item := coming.popleft().result()) is not end:
                coming.append(thread.submit(next, items, end))
                yield item
        finally:
            thread.shutdown(cancel_futures=True)


class _Writer:
    """The output file: one video stream, and the source's audio as it was."""

    def __init__(
        self,
        temporary: Path,
        destination: Path,
        source: Any,
        stream: Any,
        undistort_map: UndistortMap,
        crf: int,
    ) -> None:
        self._av = library()
        self._destination = destination
        given = stream.codec_context.format
        rgb = crf == 0 and given.is_rgb and given.components[0].bits == 8
        self.codec = codec = _CODECS.get(
            destination.suffix.lower(), "libx264rgb" if rgb else "libx264"
        )
        with self._explain_errors():
            known = {"crf": str(crf)}
            if codec == "libvpx-vp9":
                known |= {"b": "0", "row-mt": "1", "lossless": str(int(crf == 0))}
            self._container = self._av.open(str(temporary), "w")
            self._stream = self._container.add_stream(
                codec, rate=stream.average_rate or Fraction(25), options=known
            )
        context = self._stream.codec_context
        width, height = undistort_map.view.size
        written = _RGB if rgb else self._choose_format(stream.codec_context.pix_fmt)
        self.colours = _Colours.of(stream.codec_context, written)
        self._refuse_odd_sides(written, width, height)
        self._stream.width, self._stream.height = width, height
        self._stream.pix_fmt = "bgr24" if codec == "libx264rgb" else written
        context.time_base = stream.time_base
        for name, value in self.colours.tags.items():
            setattr(context, name, value)
        with self._explain_errors():
            self._audio = {
                audio.index: self._container.add_stream_from_template(audio)
                for audio in source.streams.audio
            }
        streams = [(stream, self._stream)]
        streams += [(audio, self._audio[audio.index]) for audio in source.streams.audio]
        for given_stream, made in streams:  # languages and titles
            made.metadata.update(given_stream.metadata)
        self._container.metadata.update(source.metadata)

    def _refuse_odd_sides(self, written: str, width: int, height: int) -> None:
        _, across, down = _find_layout(written)
        if (across and width % across) or (down and height % down):
            self._container.close()
            raise ViewError(
                f"{written} video has even sides, which {width}x{height} has not: "
                f"choose --size {width + width % 2}x{height + height % 2}"
            )

    def _choose_format(self, wanted: str) -> str:
        """The source's own format if the encoder takes it, or the nearest one that it takes."""
        usable = {one.name for one in self._stream.codec_context.codec.video_formats or []}
        components = self._av.VideoFormat(wanted).components
        near = ["gray10le", "gray"] if len(components) == 1 and "pal" not in wanted else []
        near += ["yuv420p10le"]
        if components[0].bits <= _BYTE:
            near = [name for name in near if "10" not in name]
        known = [wanted] if _has_planes(wanted) else []
        return next((name for name in [*known, *near] if name in usable), "yuv420p")

    def write(self, item: Any) -> None:
        """Encode a frame, or copy a packet of audio."""
        with self._explain_errors():
            if is_frame(item):
                self._container.mux(self._stream.encode(item))
            else:
                item.stream = self._audio[item.stream.index]
                self._container.mux(item)

    def finish(self) -> None:
        """Encode the frames that are held back, and complete the file."""
        with self._explain_errors():
            self._container.mux(self._stream.encode(None))
            self._container.close()

    def close(self) -> None:
        """Close the file."""
        with suppress(self._av.FFmpegError):  # an unfinished file that is thrown away
            self._container.close()

    @contextmanager
    def _explain_errors(self) -> Iterator[None]:
        """Turn errors of the video library into one line."""
        try:
            yield
        except (self._av.FFmpegError, ValueError) as problem:
            path, what = self._destination, getattr(problem, "strerror", None) or problem
            if getattr(problem, "errno", None) in _NO_ROOM:
                raise OSError(problem.errno, what) from problem  # type: ignore[union-attr]
            raise OutputError(
                f"{shown(path)}: a {path.suffix} file cannot be written with codec {self.codec} "
                f"and this audio ({what}): name a .mkv, which takes all"
            ) from problem


class _PlaneRemapper:
    """Remaps frames plane by plane."""

    def __init__(
        self,
        undistort_map: UndistortMap,
        interpolation: Interpolation,
        colours: _Colours,
        codec: str,
    ) -> None:
        """Prepare for frames of a codec."""
        bits, across, down = _find_layout(colours.format)
        self.colours, self._size = colours, undistort_map.view.size
        self._dtype = np.dtype(np.uint8 if bits == 8 else np.uint16)
        self._interpolation = interpolation
        self._maps = [undistort_map]
        if across:
            chroma = _make_chroma_maps(undistort_map, across, down, centred=codec in _CENTRED)
            self._maps += [chroma, chroma]
        self.turned_deg, self.interlaced, self.reduced = 0, False, ""

    def __call__(self, frame: av.VideoFrame) -> av.VideoFrame:
        """A frame of the source -> the same of the view."""
        pyav = library()
        given, wanted = frame, self.colours.format
        if frame.format.name != wanted:
            given = frame.reformat(format=wanted, **self.colours.convert)
            self.reduced = self.reduced or frame.format.name * _holds_less(frame.format, wanted)
        made = pyav.VideoFrame(*self._size, wanted)
        self.interlaced = self.interlaced or bool(frame.interlaced_frame)
        self.turned_deg = self.turned_deg or int(getattr(frame, "rotation", 0) or 0)
        for plane, out, own, value in zip(
            given.planes, made.planes, self._maps, self.colours.black, strict=False
        ):
            flat = own.render(self._get_pixels(plane), self._interpolation, value)
            self._get_pixels(out)[...] = flat
        made.pts, made.time_base = frame.pts, frame.time_base
        return made

    def _get_pixels(self, plane: Any) -> npt.NDArray[Any]:
        rows = np.frombuffer(plane, self._dtype).reshape(
            plane.height, plane.line_size // self._dtype.itemsize
        )
        return rows[:, : plane.width]


def _has_planes(pixel_format: str) -> bool:
    """Whether brightness and both colours have a plane each, or there is brightness alone."""
    kind = library().VideoFormat(pixel_format)
    planes = sorted(part.plane for part in kind.components)
    return planes in ([0], [0, 1, 2]) and not kind.is_big_endian


def _find_layout(pixel_format: str) -> tuple[int, int, int]:
    """Bits, and columns and rows of brightness for one sample of colour (0 for no colour)."""
    brightness, *colours = library().VideoFormat(pixel_format, 64, 64).components
    if not colours:
        return brightness.bits, 0, 0
    return brightness.bits, 64 // colours[0].width, 64 // colours[0].height


def _make_chroma_maps(
    undistort_map: UndistortMap, across: int, down: int, *, centred: bool
) -> UndistortMap:
    """The map for colour samples, each of which stands for ``across`` x ``down`` pixels.

    A sample lies in the middle of its rows and on its first column, or where those of the source
    are ``centred`` in the middle of its columns there. Its source is the mean of the sources of
    the pixels around it.
    """

    def mean(values: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
        return np.asarray(np.mean([values[row::down, ::across] for row in range(down)], axis=0))

    photo_width, photo_height = undistort_map.image_size
    size = -(-photo_width // across), -(-photo_height // down)
    shift_x = (across - 1) / 2 if centred else 0.0
    x = np.clip((mean(undistort_map.map_x) - shift_x) / across, 0, size[0] - 1)
    y = np.clip((mean(undistort_map.map_y) - (down - 1) / 2) / down, 0, size[1] - 1)
    inside = mean(undistort_map.empty) == 0
    map_x, map_y = (np.where(inside, one, -1).astype(np.float32) for one in (x, y))
    return replace(undistort_map, map_x=map_x, map_y=map_y, valid=inside, image_size=size)


def _holds_less(given: Any, written: str) -> bool:
    """Whether a format has fewer bits or fewer samples of colour than the one that was given."""
    (bits, *mine), (had, *theirs) = _find_layout(written), _find_layout(given.name)
    coarser = any(own > other for own, other in zip(mine, theirs, strict=True) if other)
    return had > bits or coarser
