"""A camera or a film that takes the photos: its live picture, and the best frame of each moment."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from threading import Condition, Thread
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish import CubicfishError, PhotoError, quoted
from cubicfish.photos import Photo
from cubicfish_cli.films.choose import Scale, Seen
from cubicfish_cli.films.measure import motion, sharpness, small_picture
from cubicfish_cli.films.scan import quality, still_px
from cubicfish_cli.films.source import frames, opened
from cubicfish_cli.render.small_pictures import thumbnail

Picture = npt.NDArray[np.uint8]

# Frames beside which one counts as sharp and still; fewer tell nothing.
_BESIDE, _FEWEST = 100, 4
_LIVE_PIXELS, _LIVE_SECONDS, _LIVE_QUALITY = 960, 0.1, 70


def frames_of(source: str) -> Iterator[Picture]:
    """Frames (H, W, 3) of a camera's number, a URL, or a film, which plays at its own speed.

    Raises:
        CubicfishError: it cannot be opened or read.

    """
    if not source.isdecimal() and "://" not in source:
        begun = time.monotonic()
        with opened(Path(source)) as (container, stream):
            for frame in frames(Path(source), container, stream):
                time.sleep(max(0.0, begun + float(frame.time or 0) - time.monotonic()))
                yield frame.to_ndarray(format="bgr24")
        return
    here = source.isdecimal()
    taken = cv2.VideoCapture(int(source) if here else source)
    taken.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
    try:
        there, picture = taken.read()
        if not there:
            do = "is it plugged in, and no other program using it?"
            do = do if here else "is its address right, and a stream or a film there?"
            raise PhotoError(f"camera {quoted(source)} gives no picture: {do}")
        while there:
            yield np.asarray(picture, np.uint8)
            there, picture = taken.read()
    finally:
        taken.release()


class Camera(Thread):
    """Reads frames as they come, and keeps the best that nobody has taken yet.

    Attributes:
        size: (width, height) of its frames.
        problem: why it ended, where that was an error.

    """

    def __init__(self, source: str) -> None:
        """Open it.

        Raises:
            CubicfishError: it gives no picture.

        """
        super().__init__(daemon=True)
        self._frames = frames_of(source)
        self._first = next(self._frames, None)
        if self._first is None:
            raise PhotoError(f"{quoted(source)} holds no frame that can be decoded")
        self.size = (self._first.shape[1], self._first.shape[0])
        self.problem: CubicfishError | None = None
        self._best: tuple[float, Picture] | None = None
        self._live, self._number, self._changed = b"", 0, Condition()
        self._seen: deque[Seen] = deque(maxlen=_BESIDE)

    def run(self) -> None:
        """Read until the end; what is not taken in time is not missed."""
        shown_at, before, frame = 0.0, None, self._first
        with suppress(StopIteration):
            while True:
                assert frame is not None
                before = self._measure(frame, before)
                if time.monotonic() - shown_at > _LIVE_SECONDS:
                    shown_at = time.monotonic()
                    self._show(frame)
                try:
                    frame = next(self._frames)
                except CubicfishError as problem:
                    self.problem = problem
                    return

    def _measure(self, frame: Picture, before: Any) -> Any:
        grey, size = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), (frame.shape[1], frame.shape[0])
        small = small_picture(grey)
        moved = np.inf if before is None else motion(before, small, size[0])
        seen = Seen(sharpness=sharpness(grey), motion=moved)
        self._seen.append(seen)
        if len(self._seen) >= _FEWEST:
            scale = Scale.of([*self._seen], still_px(size))
            if not scale.is_spoilt(seen):
                good = quality(seen.sharpness, seen.motion, size)
                with self._changed:
                    if self._best is None or good > self._best[0]:
                        self._best = (good, frame)
        return small

    def _show(self, frame: Picture) -> None:
        small, look = thumbnail(frame, _LIVE_PIXELS), [cv2.IMWRITE_JPEG_QUALITY, _LIVE_QUALITY]
        with self._changed:
            self._live = cv2.imencode(".jpg", small, look)[1].tobytes()
            self._number += 1
            self._changed.notify_all()

    def best(self, path: Path) -> Photo | None:
        """Take the best frame since the last was taken, as the photo of a path; None without."""
        with self._changed:
            best, self._best = self._best, None
        return (
            None
            if best is None
            else Photo(name=path.name, path=path, picture=best[1], has_file=False)
        )

    def live(self, after: int, seconds: float) -> tuple[int, bytes]:
        """Wait for the next live picture after a number: its own number, and a JPEG file."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > after, seconds)
            return self._number, self._live
