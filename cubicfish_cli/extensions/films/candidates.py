"""Which frames of films are looked at for corners: some of those that the scan kept."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish_cli.app.films.choose import Scale, Seen
from cubicfish_cli.app.films.measure import motion, small_picture
from cubicfish_cli.app.films.scan import Measured, still_px
from cubicfish_cli.app.films.source import Film
from cubicfish_cli.app.photos import Photo
from cubicfish_cli.core.frame_names import frame_name

# So many frames are kept for each that may be chosen, but one every so many seconds at least, up to
# so many.
_KEPT, _KEPT_SECONDS, _MOST_KEPT = 1.5, 2.0, 5.0
_RATE = 30.0  # frames per second of films that do not say
# One frame of so many is kept where a film does not say how many it has.
_EVERY = 15
# A frame is compared with so many before it and after it.
_COMPARED = 8

REPEATED = "not looked at: nearly the same picture as another"


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A frame that may be chosen.

    Attributes:
        film, index: the film's number, and the frame's place in it.
        photo: its picture, until the choice is made.
        seen: what was measured of it.

    """

    film: int
    index: int
    photo: Photo
    seen: Seen


def kept_of(films: Sequence[Film], most: int) -> int:
    """Of how many frames one is kept, where ``most`` may be chosen of all."""
    total = sum(film.frames for film in films)
    if not total:
        return _EVERY
    rate = min(film.rate or _RATE for film in films)
    few = min(total / (_KEPT * most), _KEPT_SECONDS * rate)
    return max(1, math.ceil(max(few, total / (_MOST_KEPT * most))))


def candidates(measured: Sequence[Measured]) -> list[Candidate]:
    """The frames that were kept, film by film."""
    every = []
    for number, film in enumerate(measured):
        taken = set()
        for index in sorted(film.kept):
            name = frame_name(film.film.label, film.time[index])
            if name in taken:  # less than a millisecond apart
                name += f"_{index}"
            taken.add(name)
            seen = Seen(
                patches=(),
                sharpness=film.sharpness[index],
                motion=film.motion[index],
            )
            photo = Photo(name=f"{name}.png", path=film.kept[index])
            every.append(Candidate(film=number, index=index, photo=photo, seen=seen))
    return every


def passed_over(
    frames: Sequence[Candidate],
    size: tuple[int, int],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[str | None]:
    """Why each frame is not looked at: blurred, moving or a copy; None where it is."""
    still = still_px(size)
    scale = Scale.of([frame.seen for frame in frames], still)
    why: list[str | None] = []
    good: list[tuple[int, npt.NDArray[np.float32]]] = []
    for at, frame in enumerate(frames):
        progress(at, len(frames))
        why.append(scale.spoilt(frame.seen))
        if why[at] is not None:
            continue
        good = [other for other in good if other[0] >= at - _COMPARED]
        small = small_picture(frame.photo.read_grey())
        same = [other for other, before in good if motion(before, small, size[0]) < still]
        quality = scale.quality(frame.seen)
        worse = [other for other in same if scale.quality(frames[other].seen) < quality]
        if len(worse) < len(same):
            why[at] = REPEATED
            continue
        for other in worse:
            why[other] = REPEATED
        good = [other for other in good if other[0] not in worse] + [(at, small)]
    return why
