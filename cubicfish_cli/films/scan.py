"""First pass over a film: every frame is measured, the best of each short stretch is kept.

It can be broken off at any frame. What was measured and kept lies in a folder, and the next run
goes on from there. Memory does not grow with the film but for a few numbers per frame.
"""

from __future__ import annotations

import json
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import OutputError, PhotoError
from cubicfish_cli.files import whole_file, write_text
from cubicfish_cli.films.decoding import Decoded, frames
from cubicfish_cli.films.frame_files import SUFFIX, brightness, save_frame
from cubicfish_cli.films.measure import motion, sharpness, small_picture
from cubicfish_cli.films.source import Film, opened
from cubicfish_cli.photos import shown

_VERSION = 4
# A film that claims more frames than this share beyond what came out of it was cut short.
_SHORT = 0.95
# One frame is kept of so many, or where they come more slowly than the film says, of those in so
# many times the time that they should take.
_SLOWER = 1.5
_SAME = 1e-4


@dataclass(kw_only=True, eq=False)
class Measured:
    """What is known of a film's frames, in the film's order.

    Attributes:
        film: the film.
        time: seconds from its beginning, of each frame.
        sharpness: see :mod:`cubicfish_cli.films.measure`.
        motion: to the nearer of both neighbours, pixels.
        damaged: whether parts of each frame are made up by the decoder.
        lost: how many frames could not be decoded, between those that could.
        kept: frames (by index) that were kept -> their files, see :mod:`~.frame_files`.
        turned_deg: how far players are told to turn the film.
        problem: one line where the film ends before its end.

    """

    film: Film
    time: array[float] = field(default_factory=lambda: array("d"))
    sharpness: array[float] = field(default_factory=lambda: array("f"))
    motion: array[float] = field(default_factory=lambda: array("f"))
    damaged: array[int] = field(default_factory=lambda: array("b"))
    lost: int = 0
    kept: dict[int, Path] = field(default_factory=dict)
    turned_deg: int = 0
    problem: str | None = None

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    @property
    def spoilt(self) -> int:
        """How many frames are damaged or lost."""
        return sum(self.damaged) + self.lost


def scan(
    film: Film,
    folder: Path,
    every: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Measured:
    """Measure every frame, and keep the best of each ``every`` frames as it is.

    Args:
        film: the film.
        folder: where it is kept, for this film alone; of an unfinished run what is there is used.
        every: how many frames one is kept of, or of fewer where they come slowly.
        progress: called with frames done and all frames (0 where unknown).

    Raises:
        PhotoError: the film has no frame that can be decoded.
        OutputError: the folder cannot be written.

    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return _Scan(film, folder, every, progress).run()
    except OutputError:
        raise
    except PhotoError:
        raise
    except OSError as error:
        raise OutputError(
            f"{folder} cannot be written ({error.strerror or error}): check the folder, its "
            "permissions and the free space"
        ) from error


@dataclass(kw_only=True, eq=False)
class _Frame:
    """A frame whose right neighbour is not known yet."""

    decoded: Decoded
    small: npt.NDArray[np.float32]
    time: float
    sharpness: float
    motion: float


class _Scan:
    def __init__(
        self, film: Film, folder: Path, every: int, progress: Callable[[int, int], None]
    ) -> None:
        self._film, self._folder, self._every = film, folder, every
        self._progress = progress
        self._table = folder / "measured.csv"
        self._start = {
            "format": _VERSION,
            "film": str(film.path.resolve()),
            "stamp": list(film.stamp),
            "every": every,
        }
        self.measured = Measured(film=film)
        self._last_pts: int | None = None
        self._rows: list[str] = []  # of the few frames that one is kept of
        self._begun = 0.0  # the time of their first
        self._longest = _SLOWER * every / film.rate if film.rate > 0 else np.inf
        self._best: tuple[tuple[bool, float], int, Any] | None = None

    def run(self) -> Measured:
        if self._resumed():
            return self.measured
        try:
            self._go()
        except _NotThere:  # the film cannot be entered where the earlier run ended
            self._anew()
            self._go()
        measured, film = self.measured, self._film
        if not len(measured):
            raise PhotoError(
                measured.problem or f"{shown(film.path)} holds no frames: copy it again"
            )
        self._close_few()
        if (
            measured.problem is None
            and film.counted
            and (len(measured) + measured.lost < _SHORT * film.frames)
        ):
            measured.problem = (
                f"{shown(film.path)} claims {film.frames} frames and has {len(measured)}: its end "
                "is missing"
            )
        self._append("# end " + json.dumps([measured.turned_deg, measured.problem]) + "\n")
        return measured

    def _resumed(self) -> bool:
        """Take over what an earlier run measured; whether that is all."""
        try:
            lines = self._table.read_text(encoding="utf-8").splitlines(keepends=True)
            if json.loads(lines[0].removeprefix("# ")) != self._start:
                raise ValueError("of another film, or of other options")
            done = lines[-1].startswith("# end ") and lines[-1].endswith("\n")
            rows = lines[1:-1] if done else lines[1:]
            # A few whose writing was cut short, and no frame kept of them, are measured again.
            while rows and (rows[-1].endswith(",\n") or not rows[-1].endswith("\n")):
                rows.pop()
            for row in rows:
                self._take(row)
            if done:
                turned, problem = json.loads(lines[-1].removeprefix("# end "))
                self.measured.turned_deg = int(turned)
                self.measured.problem = problem
                return True
            write_text(self._table, "".join([lines[0], *rows]), overwrite=True)
        except (OSError, ValueError, IndexError, TypeError):
            self._anew()
        return False

    def _take(self, line: str) -> None:
        pts, time, sharp, moved, damaged, lost, kept = line.rstrip("\n").split(",")
        for index in kept.split():
            path = self._folder / f"{int(index)}{SUFFIX}"
            if not path.is_file():
                raise ValueError("a frame is missing")
            self.measured.kept[int(index)] = path
        self._add(float(time), float(sharp), float(moved), int(damaged), int(lost))
        # Where a frame's time is not that of the file, the film is measured from its beginning.
        self._last_pts = int(pts)

    def _add(self, time: float, sharp: float, moved: float, damaged: int, lost: int) -> None:
        self.measured.time.append(time)
        self.measured.sharpness.append(sharp)
        self.measured.motion.append(moved)
        self.measured.damaged.append(damaged)
        self.measured.lost += lost

    def _anew(self) -> None:
        self.measured = Measured(film=self._film)
        self._last_pts, self._rows, self._best = None, [], None
        for old in self._folder.iterdir():
            old.unlink()
        self._append(f"# {json.dumps(self._start)}\n")

    def _append(self, text: str) -> None:
        with self._table.open("a", encoding="utf-8", newline="\n") as file:
            file.write(text)

    def _go(self) -> None:
        film, measured = self._film, self.measured
        with opened(film.path) as (container, stream):
            begin = int(stream.start_time or 0)
            before, entered = None, self._last_pts is None
            if self._last_pts is not None:
                container.seek(self._last_pts, stream=stream, backward=True)
            pending: _Frame | None = None
            try:
                for decoded in frames(film.path, container, stream):
                    frame = decoded.frame
                    self._refuse(frame)
                    measured.turned_deg = measured.turned_deg or int(
                        getattr(frame, "rotation", 0) or 0
                    )
                    grey = brightness(frame)
                    small, sharp = small_picture(grey), sharpness(grey)
                    if not entered:
                        entered = self._is_the_last(frame.pts, sharp)
                        before = small
                        continue
                    moved = np.inf if before is None else motion(before, small, film.size[0])
                    if pending is not None:
                        pending.motion = min(pending.motion, moved)
                        self._finish(pending)
                    pending = _Frame(
                        decoded=decoded,
                        small=small,
                        time=float((frame.pts - begin) * stream.time_base),
                        sharpness=sharp,
                        motion=float(moved),
                    )
                    before = small
                    self._progress(
                        len(measured), max(film.frames, len(measured)) if film.frames else 0
                    )
                if not entered:
                    raise _NotThere
            except PhotoError as problem:
                if not len(measured) and pending is None:
                    raise
                measured.problem = f"{problem}; what comes after is left out"
            if pending is not None:
                self._finish(pending)

    def _is_the_last(self, pts: int, sharp: float) -> bool:
        """Whether this is the last frame of the earlier run; it comes before any other."""
        assert self._last_pts is not None
        if pts < self._last_pts:
            return False
        if pts > self._last_pts or abs(sharp - self.measured.sharpness[-1]) > _SAME:
            raise _NotThere
        return True

    def _refuse(self, frame: Any) -> None:
        if frame.pts is None:
            raise PhotoError(
                f"{shown(self._film.path)} does not say when its frames are: convert it with ffmpeg"
            )

    def _finish(self, frame: _Frame) -> None:
        """A frame of which all is known: keep it if it is the best of its few."""
        if not np.isfinite(frame.motion):  # the only frame
            frame.motion = 0.0
        if not self._rows:
            self._begun = frame.time
        elif frame.time - self._begun > self._longest:
            self._close_few()
            self._begun = frame.time
        index, decoded = len(self.measured), frame.decoded
        damaged, lost = int(decoded.damaged), decoded.lost
        self._add(frame.time, frame.sharpness, frame.motion, damaged, lost)
        pts = "" if decoded.entered_by is None else decoded.entered_by
        self._rows.append(
            f"{pts},{frame.time!r},{frame.sharpness!r},{frame.motion!r},{damaged},{lost},"
        )
        score = (not damaged, quality(frame.sharpness, frame.motion, self._film.size))
        if self._best is None or score > self._best[0]:
            self._best = (score, index, decoded.frame)
        if len(self._rows) >= self._every:
            self._close_few()

    def _close_few(self) -> None:
        if self._best is None:
            return
        _, index, frame = self._best
        path = self._folder / f"{index}{SUFFIX}"
        with whole_file(path, overwrite=True) as temporary:
            save_frame(temporary, frame)
        self.measured.kept[index] = path
        self._rows[-1] += str(index)
        self._append("".join(f"{row}\n" for row in self._rows))
        self._rows, self._best = [], None


class _NotThere(Exception):
    """The film cannot be entered at the frame that was looked for."""


def still_px(size: tuple[int, int]) -> float:
    """Motion between neighbours below which a frame counts as still, pixels."""
    return 0.001 * float(np.hypot(*size))


def quality(sharp: float, moved: float, size: tuple[int, int]) -> float:
    """How good a frame is beside its neighbours: sharp, and still."""
    return sharp / (1 + (moved / still_px(size)) ** 2) ** 0.5
