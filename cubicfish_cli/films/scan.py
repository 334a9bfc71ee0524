"""First pass over a film: measure every frame, and keep the best of each short stretch.

Memory grows with the film by a few numbers per frame only.
"""

from __future__ import annotations

import shutil
from array import array
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish import Event, Listener, PhotoError, shown
from cubicfish.files import write_files
from cubicfish.photos import Photo
from cubicfish_cli.films.measure import Grey, motion, sharpness, small_picture
from cubicfish_cli.films.source import Film, frames, missing_frames, opened

# One frame of so many is kept; where frames come more slowly than the film says, one of those
# within so many times the time that they should take.
_SLOWER = 1.5
# Compressing a picture takes as long as searching it for boards, and writing it half as long. So
# frames that may yet be dropped are held in memory, up to so many bytes, and the next written
# without compression, up to so many: 90 of 12 megapixels have 3 GB, which not every disk has.
_MOST_HELD = 2**28
_PLAIN, _MOST_PLAIN = ".bmp", 2**30
# Compressing a picture well takes as long as decoding twenty.
_FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
if hasattr(cv2, "IMWRITE_PNG_FILTER"):  # OpenCV 4.12 and later
    _FAST += [cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP]


@dataclass(kw_only=True, eq=False)
class Measured:
    """What is known of a film's frames, in the film's order.

    Attributes:
        film: the film.
        time: seconds from its beginning, of each frame.
        sharpness: see :mod:`cubicfish_cli.films.measure`.
        motion: to the nearer of both neighbours, pixels.
        step: from the frame before, pixels; 0 of the first.
        missing: how many more frames the film announces; 0 for a few, which is common.
        kept: frames (by index) that were kept -> their pictures, in memory or in files.
        turned_deg: the turn that the film asks of players.
        problem: one line if the film breaks off before its end.

    """

    film: Film
    time: array[float] = field(default_factory=lambda: array("d"))
    sharpness: array[float] = field(default_factory=lambda: array("f"))
    motion: array[float] = field(default_factory=lambda: array("f"))
    step: array[float] = field(default_factory=lambda: array("f"))
    missing: int = 0
    kept: dict[int, Photo] = field(default_factory=dict)
    turned_deg: int = 0
    problem: str | None = None

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)


@contextmanager
def room_for_frames(folder: Path) -> Iterator[Path]:
    """Make a hidden folder in ``folder`` for frames until some are chosen, and remove it.

    Folders that were made for it and hold nothing then are removed, too.
    """
    room = folder / ".unfinished"
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    shutil.rmtree(room, ignore_errors=True)  # of a run that was killed
    try:
        yield room
    finally:
        shutil.rmtree(room, ignore_errors=True)
        with suppress(OSError):
            for path in made:
                path.rmdir()


def scan(
    film: Film,
    progress: Callable[[int, int], None] = lambda done, total: None,
    *,
    folder: Path | None = None,
    every: int = 1,
) -> Measured:
    """Measure every frame, and keep the best of each ``every`` frames as a picture.

    Args:
        film: the film.
        progress: called with frames done and all frames (0 where unknown).
        folder: where frames are kept; None keeps none.
        every: one of so many frames is kept, or one of fewer where they come slowly.

    Raises:
        PhotoError: the film has no frame that can be decoded.
        OutputError: the folder cannot be written.

    """
    measured = Measured(film=film)
    with opened(film.path) as (container, stream):
        decoded = frames(film.path, container, stream)
        begin = int(stream.start_time or 0)
        every_frame = _measure_frames(measured, decoded, begin, stream.time_base, progress)
        for index, frame in _choose_best_of_stretches(measured, every_frame, every):
            if folder is not None:
                measured.kept[index] = _keep(frame, folder / str(index), len(measured.kept))
        if not len(measured):
            raise PhotoError(
                f"{shown(film.path)} holds no frame that can be decoded: copy it again"
            )
        last = measured.time[-1] - measured.time[0]
        measured.missing = missing_frames(stream, len(measured), last)
    return measured


def _keep(frame: Any, path: Path, before: int) -> Photo:
    """Keep a frame in memory, or beside so many others in a file, whose suffix this adds."""
    size = 3 * frame.width * frame.height
    if (before + 1) * size <= _MOST_HELD:
        picture = _picture_of(frame)
        return Photo(name=path.name, path=path, picture=picture, has_file=False)
    path = path.with_suffix(_PLAIN if (before + 1) * size <= _MOST_HELD + _MOST_PLAIN else ".png")
    write_frame(path, frame)
    return Photo(name=path.name, path=path)


def _measure_frames(
    measured: Measured,
    decoded: Iterable[Any],
    begin: int,
    time_base: Any,
    progress: Callable[[int, int], None],
) -> Iterator[tuple[int, Any]]:
    """Yield each frame's index and picture, once it and both of its neighbours are measured."""
    film, small, last = measured.film, None, None
    try:
        for frame in decoded:
            if frame.pts is None:
                raise PhotoError(
                    f"{shown(film.path)} does not say when its frames are: convert it with ffmpeg"
                )
            measured.turned_deg = measured.turned_deg or int(getattr(frame, "rotation", 0) or 0)
            grey = brightness(frame)
            before, small = small, small_picture(grey)
            moved = None if before is None else motion(before, small, film.size[0])
            if moved is not None:
                # The first frame has a neighbour on one side only.
                known = measured.motion[-1] if len(measured) > 1 else np.inf
                measured.motion[-1] = min(known, moved)
                yield len(measured) - 1, last
            measured.time.append(float((frame.pts - begin) * time_base))
            measured.sharpness.append(sharpness(grey))
            measured.motion.append(moved or 0.0)
            measured.step.append(moved or 0.0)
            last = frame
            progress(len(measured), max(film.frames, len(measured)) if film.frames else 0)
    except PhotoError as problem:
        if not len(measured):
            raise
        measured.problem = f"{problem}; what comes after is left out"
    if last is not None:
        yield len(measured) - 1, last


def _choose_best_of_stretches(
    measured: Measured, every_frame: Iterable[tuple[int, Any]], every: int
) -> Iterator[tuple[int, Any]]:
    """Index and picture of the best of each ``every`` frames, or of fewer that come slowly."""
    film, first, best = measured.film, 0, None
    longest = _SLOWER * every / film.rate if film.rate > 0 else np.inf
    for index, frame in every_frame:
        late = measured.time[index] - measured.time[first] > longest
        if best is not None and (late or index - first >= every):
            yield best[1:]
            first, best = index, None
        score = quality(measured.sharpness[index], measured.motion[index], film.size)
        if best is None or score > best[0]:
            best = (score, index, frame)
    if best is not None:
        yield best[1:]


def brightness(frame: Any) -> Grey:
    """Return grey levels (H, W) of a frame of PyAV, uint8 or uint16, as stored where possible."""
    kind = frame.format
    alone = len(kind.components) == 1 or (kind.is_planar and not kind.is_rgb)
    if not alone or kind.has_palette or kind.is_big_endian or kind.is_bit_stream:
        return np.asarray(frame.to_ndarray(format="gray"))
    plane = frame.planes[0]
    rows = np.frombuffer(plane, np.uint8 if kind.components[0].bits <= 8 else "<u2")
    return np.asarray(rows.reshape(plane.height, -1)[:, : plane.width])


def write_frame(path: Path, frame: Any) -> None:
    """Write a frame as a PNG or BMP of 8 bits, as the path says, grey where the film is grey.

    Raises:
        OutputError: it cannot be written.

    """
    write_files({path: _encode(_picture_of(frame), path.suffix)}, overwrite=True)


def _picture_of(frame: Any) -> npt.NDArray[Any]:
    grey = frame.format.name.startswith("gray")
    return np.asarray(frame.to_ndarray(format="gray" if grey else "bgr24"))


def copy_as_png(kept: Photo, path: Path) -> None:
    """Copy a frame that was kept, as a PNG."""
    if kept.path.suffix == ".png":
        shutil.copyfile(kept.path, path)
    else:
        path.write_bytes(_encode(kept.read(), ".png"))


def _encode(picture: npt.NDArray[Any], suffix: str) -> bytes:
    return cv2.imencode(suffix, picture, _FAST if suffix == ".png" else [])[1].tobytes()


def still_px(size: tuple[int, int]) -> float:
    """Motion between neighbours below which a frame counts as still, pixels."""
    return 0.001 * float(np.hypot(*size))


def quality(sharp: float, moved: float, size: tuple[int, int]) -> float:
    """Return how good a frame is beside its neighbours: sharp, and still."""
    return sharp / (1 + (moved / still_px(size)) ** 2) ** 0.5


def report_film(measured: Measured, listener: Listener) -> None:
    """Tell the listener what is odd about a film."""
    name = shown(measured.film.path)
    if measured.problem is not None:
        listener.tell(Event.FILM_ENDS, problem=measured.problem)
    elif measured.missing:
        frames, missing = len(measured), measured.missing
        listener.tell(Event.FILM_DAMAGED, film=name, frames=frames, of=frames + missing)
    if measured.turned_deg:
        listener.tell(Event.FILM_TURNED, film=name, turned_deg=measured.turned_deg)
