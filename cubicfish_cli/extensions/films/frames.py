"""Choosing the few frames that are worth calibrating from, of those that a scan kept."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from cubicfish import DetectionError, Listener, Run, Target, listed, shown
from cubicfish.files import FrameName
from cubicfish.observe import Glances
from cubicfish.photos import Photo
from cubicfish_cli.films.choose import Scale, Seen
from cubicfish_cli.films.frame_search import Search
from cubicfish_cli.films.scan import Measured, report_film, scan, still_px
from cubicfish_cli.films.source import Film
from cubicfish_cli.words.events import why_ended
from cubicfish_cli.words.phrases import plural

# So many frames are kept for each that may be chosen, at least one every so many seconds, and at
# most so many.
_KEPT, _KEPT_SECONDS, _MOST_KEPT = 1.5, 2.0, 5.0
_RATE = 30.0  # frames per second of films that do not say
# One frame of so many is kept if a film does not say how many it has.
_EVERY = 15
# Frames from all over the films are searched in rounds of so many, until more would hardly add
# anything.
_ROUND = 24


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A frame that may be chosen.

    Attributes:
        film, index: the film's number, and the frame's place in it.
        photo: its picture, until the choice is made.
        seen: its sharpness and motion, and what it shows if it was searched.
        gain: what it adds, if it was chosen.

    """

    film: int
    index: int
    photo: Photo
    seen: Seen
    gain: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Chosen:
    """The choice of films' frames.

    Attributes:
        measured: a record per film.
        taken: the chosen frames, in the films' order.
        looked_at: how many frames were searched for corners.
        ended: why no more were chosen, in a sentence.

    """

    measured: Sequence[Measured]
    taken: Sequence[Candidate]
    looked_at: int
    ended: str


def scanned(films: Sequence[Film], room: Path, most: int, listener: Listener) -> list[Measured]:
    """Measure all frames of films, and keep those that may be chosen."""
    every, measured = kept_of(films, most), []
    for film in films:
        reading = listener.counting(f"Reading {film.path.name}")
        measured.append(scan(film, reading, folder=room / film.label, every=every))
        report_film(measured[-1], listener)
    return measured


def kept_of(films: Sequence[Film], most: int) -> int:
    """Return of how many frames one is kept, if ``most`` may be chosen of all."""
    total = sum(film.frames for film in films)
    if not total:
        return _EVERY
    rate = min(film.rate or _RATE for film in films)
    few = min(total / (_KEPT * most), _KEPT_SECONDS * rate)
    return max(1, math.ceil(max(few, total / (_MOST_KEPT * most))))


def chosen_of(
    measured: Sequence[Measured], targets: Sequence[Target] | None, most: int, run: Run
) -> Chosen:
    """Search frames that were kept, and choose.

    Raises:
        DetectionError: no frame shows the target.

    """
    frames, size = _list_candidates(measured), measured[0].film.size
    scale = Scale.of([frame.seen for frame in frames], still_px(size))
    worse = [at for at, frame in enumerate(frames) if scale.is_spoilt(frame.seen)]
    search = Search(
        glances=Glances(photos=[frame.photo for frame in frames], size=size, is_film=True),
        seen=[frame.seen for frame in frames],
        most=most,
        targets=targets,
        run=run,
        what="frames",
        at_once=_ROUND,
        quick_jobs=1,
    )
    try:
        search.search([at for at in range(len(frames)) if at not in worse], worse)
        if not search.choice.order:
            raise DetectionError(
                f"no board was found in {plural(len(search.searched), 'frame')} from all over: is "
                "a board in view, whole squares of it, sharp and not covered?"
            )
    except DetectionError as error:
        raise error.amid(f"no frame can be chosen of {names_of(measured)}: ") from error
    gains = sorted(zip(search.choice.order, search.choice.gain, strict=True))
    return Chosen(
        measured=measured,
        taken=[replace(frames[at], seen=search.seen[at], gain=gain) for at, gain in gains],
        looked_at=len(search.searched),
        ended=why_ended(search.choice.ended, len(search.choice.order), "frame"),
    )


def _list_candidates(measured: Sequence[Measured]) -> list[Candidate]:
    """Return the frames that were kept, film by film."""
    every = []
    for number, film in enumerate(measured):
        taken = set()
        for index in sorted(film.kept):
            name = str(FrameName(film.film.label, film.time[index]))
            if name in taken:  # less than a millisecond apart
                name += f"_{index}"
            taken.add(name)
            seen = Seen(sharpness=film.sharpness[index], motion=film.motion[index])
            photo = replace(film.kept[index], name=f"{name}.png")
            every.append(Candidate(film=number, index=index, photo=photo, seen=seen))
    return every


def names_of(films: Sequence[Measured]) -> str:
    """Return the films' names, the first of many."""
    return listed([shown(one.film.path.name) for one in films], "films")
