"""Choosing shots from a rig's films: moments at which all cameras are sharp and still.

Films are read twice: every frame is measured (``scan.py``), then the frames of those moments are
taken out, each with its neighbours, which show how what it shows moves.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish import FloatArray
from cubicfish_cli.films.scan import Measured, quality, write_frame
from cubicfish_cli.films.source import Film, frames, opened
from cubicfish_cli.inputs.paths import is_recording

Picture = npt.NDArray[Any]

# The flow of a corner is measured in a window of so many pixels, coarse to fine.
_WINDOW, _LEVELS = 21, 4
# And back again it must come to where it began, within so many pixels.
_THERE_AND_BACK_PX = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class Moments:
    """Moments at which cameras saw something at once.

    Attributes:
        time: (S,) seconds on the first film's clock.
        frame: (S, C) frame of each film; -1 where it has none near enough.
        late: (S, C) by how much that frame is later than the moment, seconds; NaN likewise.

    """

    time: FloatArray
    frame: npt.NDArray[np.intp]
    late: FloatArray


def begins_at(film: Film) -> float:
    """When a recording's first image is by its messages' clock, seconds; 0 for other films."""
    if not is_recording(film.path):
        return 0.0
    with opened(film.path) as (_, stream):
        return float((stream.start_time or 0) * stream.time_base)


def moments(
    measured: Sequence[Measured], ahead: Sequence[float], most: int, tolerance: float | None
) -> Moments:
    """The best moment of each of ``most`` stretches of time.

    Args:
        measured: of each camera's film.
        ahead: by how much each film's own time is ahead of the first's, seconds.
        most: how many.
        tolerance: how far apart frames of a moment may be, seconds; by default half of the
            longest time between two frames.

    """
    times = [np.asarray(one.time) - late for one, late in zip(measured, ahead, strict=True)]
    good = [_rate_frames(one) for one in measured]
    if tolerance is None:
        steps = [float(np.median(np.diff(time))) if len(time) > 1 else 0.0 for time in times]
        tolerance = 0.5 * max(steps) + 1e-6
    begin = min(float(time[0]) for time in times)
    end = max(float(time[-1]) for time in times) + 1e-9
    # Moments are looked for where any film has a frame, those of the densest film first.
    lead = int(np.argmax([len(time) for time in times]))
    frame = np.full((len(times[lead]), len(measured)), -1)
    late = np.full(frame.shape, np.nan)
    for camera, time in enumerate(times):
        nearest = np.searchsorted((time[1:] + time[:-1]) / 2, times[lead])
        apart = time[nearest] - times[lead]
        near = np.abs(apart) <= tolerance
        frame[near, camera], late[near, camera] = nearest[near], apart[near]
    score = np.zeros(len(frame))
    for camera, goodness in enumerate(good):
        seen = frame[:, camera] >= 0
        score[seen] += goodness[frame[seen, camera]]
    score[(frame >= 0).sum(axis=1) < min(2, len(measured))] = -np.inf
    stretch = np.minimum(((times[lead] - begin) / (end - begin) * most).astype(int), most - 1)
    chosen = []
    for number in np.unique(stretch).tolist():
        own = np.flatnonzero(stretch == number)
        best = own[np.argmax(score[own])]
        if np.isfinite(score[best]):
            chosen.append(int(best))
    rows = np.array(chosen, np.intp)
    return Moments(time=times[lead][rows], frame=frame[rows], late=late[rows])


def _rate_frames(measured: Measured) -> FloatArray:
    """(N,) how good each frame is beside the film's usual one: 0 as good, 1 much better."""
    own = np.array(
        [
            quality(sharp, moved, measured.film.size)
            for sharp, moved in zip(measured.sharpness, measured.motion, strict=True)
        ]
    )
    usual = float(np.median(own[own > 0])) if (own > 0).any() else 1.0
    return np.asarray(np.minimum(np.log(np.maximum(own / usual, 1e-3)), 1.0))


def take_out(
    film: Film,
    paths: Mapping[int, Path],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """Write some frames of a film as PNGs.

    Args:
        film: the film.
        paths: frames (by index) -> their pictures.
        progress: called with frames done and all frames.

    Raises:
        PhotoError: the film is damaged before the last of them.

    """
    last = max(paths, default=-1)
    with opened(film.path) as (container, stream):
        for index, frame in enumerate(frames(film.path, container, stream)):
            if index in paths:
                write_frame(paths[index], frame)
            progress(index, last + 1)
            if index >= last:
                return


def flow(picture: Picture, after: Picture, pixel: FloatArray) -> FloatArray:
    """How far points (N, 2) of a grey picture are elsewhere in the next one, (N, 2) pixels.

    NaN where that is unknown: the way there and back again does not end where it began.
    """
    if not len(pixel):
        return np.zeros((0, 2))
    picture, after = (_convert_to_8_bits(one) for one in (picture, after))
    start = np.ascontiguousarray(pixel, np.float32)[:, None]
    there: Any = start.copy()
    back: Any = start.copy()
    size = (_WINDOW, _WINDOW)
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        picture, after, start, there, winSize=size, maxLevel=_LEVELS
    )
    back, again, _ = cv2.calcOpticalFlowPyrLK(
        after, picture, there, back, winSize=size, maxLevel=_LEVELS
    )
    moved = (there - start)[:, 0].astype(float)
    off = np.hypot(*(back - start)[:, 0].T)
    lost = (found[:, 0] == 0) | (again[:, 0] == 0) | (off > _THERE_AND_BACK_PX)
    moved[lost] = np.nan
    return moved


def _convert_to_8_bits(picture: Picture) -> npt.NDArray[np.uint8]:
    return np.asarray(picture if picture.dtype == np.uint8 else picture >> 8, np.uint8)
