"""Films, or many photos -> the few that are worth calibrating from."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cubicfish_cli.app.asked import Run, StrPath, paths_of
from cubicfish_cli.app.films import MOST
from cubicfish_cli.app.films.frame_search import Search, both_looks, size_of, targets_of, why_ended
from cubicfish_cli.app.films.scan import Measured, scan, tell_of_film
from cubicfish_cli.app.films.source import Film, open_films
from cubicfish_cli.app.listener import Listener
from cubicfish_cli.app.photos import Photo, expanded
from cubicfish_cli.core.errors import DetectionError, PhotoError
from cubicfish_cli.core.target import Target, target_text
from cubicfish_cli.extensions.films.candidates import REPEATED, candidates, kept_of, passed_over
from cubicfish_cli.extensions.films.written import (
    TABLE,
    Chosen,
    depends_on,
    ended_of,
    listed,
    photos_of_table,
)

# Frames are looked at in rounds of so many from all over the films, until more would hardly add
# anything.
_ROUND = 24
_ENOUGH = "not looked at: others of all times had no more to add"


def scanned(films: Sequence[Film], room: Path, most: int, listener: Listener) -> list[Measured]:
    """All frames of films, measured, and those kept that may be chosen."""
    every, measured = kept_of(films, most), []
    for film in films:
        reading = listener.counting(f"Reading {film.path.name}")
        measured.append(scan(film, reading, folder=room / film.label, every=every))
        tell_of_film(measured[-1], listener)
    return measured


def chosen_of(
    measured: Sequence[Measured], targets: Sequence[Target] | None, most: int, run: Run
) -> Chosen:
    """Look at frames that were kept, and choose.

    Raises:
        DetectionError: no frame shows the target.

    """
    frames, size = candidates(measured), measured[0].film.size
    why = passed_over(frames, size, run.listener.counting("Comparing frames"))
    search = Search(
        names=[frame.photo.name for frame in frames],
        seen=[frame.seen for frame in frames],
        size=size,
        most=most,
        targets=targets,
        at_once=_ROUND,
    )
    try:
        search.look(
            *both_looks([frame.photo for frame in frames], size, "frames", run),
            [at for at, word in enumerate(why) if word is None],
            [at for at, word in enumerate(why) if word not in (None, REPEATED)],
        )
    except DetectionError as error:
        raise DetectionError(f"no frame can be chosen of {listed(measured)}: {error}") from error
    looked_at = frozenset(search.looked_at)
    if not search.choice.order:
        raise DetectionError(
            f"no frame can be chosen of {listed(measured)}: no board was found in "
            f"{len(looked_at)} frame{'s' * (len(looked_at) != 1)} from all over: is a board in "
            "view, whole squares of it, sharp and not covered?"
        )
    return Chosen(
        measured=measured,
        frames=frames,
        looked_at=looked_at,
        seen=search.seen,
        gain=search.choice.gain,
        ended=why_ended(search.choice, "frame"),
        why_not=[
            search.choice.why_not[at] if at in looked_at else (why[at] or _ENOUGH)
            for at in range(len(frames))
        ],
    )


def earlier_frames(
    films: StrPath | Sequence[StrPath],
    folder: StrPath,
    target: Target | Sequence[Target] | None = None,
    *,
    most: int = MOST,
) -> tuple[tuple[Path, ...], str]:
    """Frames that an earlier :func:`choose_frames` of the same arguments chose; none if none did.

    Returns:
        The pictures, and why there are no more, in a sentence.

    Raises:
        PhotoError: a film cannot be used.
        OutputError: the extra ``video`` is not installed.

    """
    path = Path(folder) / TABLE
    of = depends_on(open_films(expanded_films(films)), most, fingerprint_of(targets_of(target)))
    ended = ended_of(path, of)
    kept = () if ended is None else tuple(path.parent / name for name in photos_of_table(path))
    if ended is None or not all(one.is_file() for one in kept):
        return (), ""
    return kept, ended


def refuse_other_photos(photos: Sequence[Photo], films: StrPath | Sequence[StrPath]) -> None:
    """Raise :class:`PhotoError` where photos beside films are of another size."""
    film = open_films(expanded_films(films))[0]
    for photo in photos:
        size = size_of(photo)
        if size not in (None, film.size):
            raise PhotoError(
                "{} has {}x{} pixels and {} has {}x{}: photos and films differ in crop and "
                "stabilisation, so calibrate each by itself".format(
                    photo.name, *size, film.path, *film.size
                )
            )


def fingerprint_of(targets: Sequence[Target] | None) -> str | None:
    """What tells one object from another."""
    if targets is None:
        return None
    return hashlib.sha256("\n".join(map(target_text, targets)).encode()).hexdigest()


def expanded_films(films: StrPath | Sequence[StrPath]) -> list[Path]:
    """Films, with patterns replaced by what they match."""
    every: list[Path] = []
    for path in paths_of(films):
        matches = expanded(path)
        if not matches:
            raise PhotoError(f"{path} matches no film: check the name and the current folder")
        every += matches
    if not every:
        raise PhotoError("no film was given: name one")
    return every


def record_of(measured: Measured) -> dict[str, Any]:
    """What became of a film, as plain data."""
    film = measured.film
    return {
        "film": str(film.path),
        "frames": len(measured),
        "image_size": film.size,
        "seconds": measured.time[-1],
        "turned_deg": measured.turned_deg,
        "missing": measured.missing,
        "problem": measured.problem,
    }
