"""Frames of films, or photos of many, that are worth calibrating from: found, chosen, written."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from glob import glob, has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.inputs import detect
from cubicfish_cli.cli.kept import cache_folder
from cubicfish_cli.cli.target_choice import TargetChoice
from cubicfish_cli.cli.terminal import progress, say
from cubicfish_cli.cli.video_options import is_video_name
from cubicfish_cli.errors import DetectionError, PhotoError
from cubicfish_cli.frame_names import frame_name

if TYPE_CHECKING:
    from cubicfish_cli.films.choose import Choice, Seen
    from cubicfish_cli.films.film import Film
    from cubicfish_cli.films.scan import Measured
    from cubicfish_cli.photos import Photo

MOST = 60
# Of so many frames for each that may be chosen the corners are looked for.
_LOOKED_AT = 3
# One frame of so many is looked at where a film does not say how many it has.
_EVERY = 15
_UNFINISHED = ".unfinished"
_PASSED_OVER = "not looked at: a neighbour is sharper or stiller"


@dataclass(frozen=True, kw_only=True)
class ChosenFrames:
    """What became of films.

    Attributes:
        photos: the pictures that were written, in the films' order.
        table: frames.csv.
        sheet: the contact sheet.
        frames: how many frames the films have.
        looked_at: in how many of them corners were looked for.
        films: a record a film.

    """

    photos: tuple[Path, ...]
    table: Path
    sheet: Path
    frames: int
    looked_at: int
    films: tuple[dict[str, Any], ...]


def films_among(inputs: Sequence[Path]) -> list[Path]:
    """Those of the inputs that are films, recordings or patterns of such, by their names."""
    from cubicfish_cli.films.recordings import is_recording

    return [
        path for path in inputs if (is_video_name(path) and not path.is_dir()) or is_recording(path)
    ]


def expanded(paths: Sequence[Path]) -> list[Path]:
    """Films, with patterns replaced by what they match.

    Raises:
        PhotoError: a pattern matches nothing.

    """
    films = []
    for path in paths:
        matches = [path]
        if not path.exists() and has_magic(str(path)):
            matches = [Path(one) for one in sorted(glob(str(path), recursive=True))]
            if not matches:
                raise PhotoError(f"{path} matches no film: check the name and the current folder")
        films += matches
    return films


def choose_frames(
    paths: Sequence[Path],
    folder: Path,
    target: TargetChoice | None,
    *,
    most: int,
    jobs: int | None,
    no_cache: bool,
    overwrite: bool,
) -> ChosenFrames:
    """Choose frames of films, and write them with a table and a contact sheet, or nothing.

    What was measured by a run that was broken off lies in a hidden folder in ``folder``, and is not
    done again.

    Raises:
        CubicfishError: a film cannot be used, or shows no board; or the folder holds frames.

    """
    from cubicfish_cli.files import refuse_existing
    from cubicfish_cli.films import sheet as contact
    from cubicfish_cli.films import table as frames_table
    from cubicfish_cli.films.film import open_films
    from cubicfish_cli.films.scan import scan

    films = open_films(expanded(paths))
    table, sheet = folder / frames_table.NAME, folder / contact.NAME
    for path in (table, sheet):
        refuse_existing(path, overwrite=overwrite)
    unfinished = folder / _UNFINISHED
    total = sum(film.frames for film in films)
    every = max(1, math.ceil(total / (_LOOKED_AT * most))) if total else _EVERY
    measured = []
    for film in films:
        with progress(f"Reading {film.path.name}") as callback:
            measured.append(scan(film, unfinished / film.label, every, callback))
        _say_of_film(measured[-1])
    names = {
        (number, index): name
        for number, film in enumerate(measured)
        for index, name in _names(film).items()
    }
    photos = _photos(measured, names)
    frames = sum(map(len, measured))
    say(f"{count(frames, 'frame')}; the best {len(photos)} are searched for boards.")
    try:
        seen = _seen(photos, target, jobs, no_cache=no_cache)
    except DetectionError as error:
        raise DetectionError(f"no frame can be chosen of {_listed(films)}: {error}") from error
    seen = [
        _measured_too(one, measured[number].sharpness[index], measured[number].motion[index])
        for one, (number, index) in zip(seen, names, strict=True)
    ]
    choice = _choose(seen, films[0].size, most)
    if not choice.order:
        raise DetectionError(
            f"no frame can be chosen of {_listed(films)}: no board was found in {len(seen)} frames "
            "from all over: is a board in view, whole squares of it, sharp and not covered?"
        )
    chosen = [
        (folder / name, photos[at].path, at)
        for at, name in enumerate(names.values())
        if not choice.why_not[at]
    ]
    of = frames_table.depends_on(films, most, _sha256(target))
    _write(table, sheet, of, chosen, measured, list(names), seen, choice, overwrite=overwrite)
    shutil.rmtree(unfinished, ignore_errors=True)
    return ChosenFrames(
        photos=tuple(path for path, _, _ in chosen),
        table=table,
        sheet=sheet,
        frames=frames,
        looked_at=len(photos),
        films=tuple(_record(one) for one in measured),
    )


def frames_to_calibrate(
    paths: Sequence[Path],
    folder: Path,
    target: TargetChoice,
    *,
    most: int,
    jobs: int | None,
    no_cache: bool,
    overwrite: bool,
) -> tuple[Path, ...]:
    """The frames to calibrate from; those that an earlier run chose of the same films are kept.

    Raises:
        CubicfishError: as :func:`choose_frames`.

    """
    from cubicfish_cli.films import table as frames_table
    from cubicfish_cli.films.film import open_films

    table = folder / frames_table.NAME
    of = frames_table.depends_on(open_films(expanded(paths)), most, _sha256(target))
    if not no_cache and table.is_file() and frames_table.is_of(table, of):
        kept = [folder / name for name in frames_table.photos_of_table(table)]
        if kept and all(path.is_file() for path in kept):
            say(f"{count(len(kept), 'frame')} chosen before in {folder}: these are used.")
            return tuple(kept)
    chosen = choose_frames(
        paths, folder, target, most=most, jobs=jobs, no_cache=no_cache, overwrite=overwrite
    )
    say(f"{count(len(chosen.photos), 'frame')} of {chosen.frames} chosen: {folder}.")
    return chosen.photos


def best_photos(
    photos: Sequence[Photo], target: TargetChoice, most: int, jobs: int | None, *, no_cache: bool
) -> list[Photo]:
    """Those of many photos that are worth calibrating from, in the order given.

    Raises:
        DetectionError: none shows the object.

    """
    from cubicfish_cli.films.measure import sharpness
    from cubicfish_cli.photos import photo_size

    seen = _seen(photos, target, jobs, no_cache=no_cache)
    with progress("Measuring sharpness") as callback:
        for at, photo in enumerate(photos):
            callback(at, len(photos))
            if seen[at].corners:
                seen[at] = _measured_too(seen[at], sharpness(photo.read_grey()), 0.0)
    shown = next((photo for photo, one in zip(photos, seen, strict=True) if one.corners), photos[0])
    choice = _choose(seen, photo_size(shown.path), most)
    say(f"{count(len(choice.order), 'photo')} of {len(photos)} chosen, which add most.")
    return [photos[at] for at in sorted(choice.order)]


def refuse_other_photos(photos: Sequence[Photo], films: Sequence[Path]) -> None:
    """Raise :class:`PhotoError` where photos beside films are of another size."""
    from cubicfish_cli.films.film import open_films
    from cubicfish_cli.photos import photo_size

    size = open_films(expanded(films))[0].size
    for photo in photos:
        try:
            other = photo_size(photo.path)
        except PhotoError:  # a damaged one is left out with a word later
            continue
        if other != size:
            raise PhotoError(
                "{} has {}x{} pixels and {} has {}x{}: photos and films differ in crop and "
                "stabilisation, so calibrate each by itself".format(
                    photo.name, *other, films[0], *size
                )
            )


def _sha256(target: TargetChoice | None) -> str | None:
    """What tells one object from another."""
    if target is None:
        return None
    file = target.fingerprint()
    return f"{target.counts} {target.square}" if file is None else file.sha256


def _names(measured: Measured) -> dict[int, str]:
    """Frames that were kept, by index -> what their pictures are called."""
    names: dict[int, str] = {}
    taken = set()
    for index in sorted(measured.kept):
        name = frame_name(measured.film.label, measured.time[index])
        if name in taken:  # less than a millisecond apart
            name += f"_{index}"
        taken.add(name)
        names[index] = f"{name}.png"
    return names


def _photos(measured: Sequence[Measured], names: dict[tuple[int, int], str]) -> list[Photo]:
    from cubicfish_cli.photos import Photo

    return [
        Photo(name=name, path=measured[number].kept[index])
        for (number, index), name in names.items()
    ]


def _seen(
    photos: Sequence[Photo], target: TargetChoice | None, jobs: int | None, *, no_cache: bool
) -> list[Seen]:
    """What each photo shows: named corners of a target, else grids as they are."""
    import numpy as np

    from cubicfish_cli.films.choose import Patch, Seen
    from cubicfish_cli.naming.cache import GridCache
    from cubicfish_cli.naming.nameless import nameless_grids

    patches: dict[str, list[Patch]] = {photo.name: [] for photo in photos}
    if target is None:
        kept = None if no_cache else cache_folder()
        cache = None if kept is None else GridCache(folder=kept)
        with progress("Finding boards") as callback:
            found = nameless_grids(photos, jobs=jobs, progress=callback, cache=cache)
        for photo, one in zip(photos, found, strict=True):
            for grid in () if one is None else one.grids:
                patch = Patch(board=-1, cells=grid.cells, pixel=grid.pixel)
                patches[photo.name].append(patch)
    else:
        detection = detect(photos, target.load(), jobs, no_cache=no_cache, again=False)
        corners = detection.corners
        cells = np.column_stack([corners.column, corners.row])
        for number, name in enumerate(corners.images):
            for board in np.unique(corners.board[corners.image == number]):
                own = (corners.image == number) & (corners.board == board)
                patch = Patch(board=int(board), cells=cells[own], pixel=corners.pixel[own])
                patches[name].append(patch)
    return [Seen(patches=tuple(patches[photo.name]), sharpness=1.0) for photo in photos]


def _measured_too(one: Seen, sharpness: float, motion: float) -> Seen:
    from dataclasses import replace

    return replace(one, sharpness=sharpness, motion=motion)


def _choose(seen: Sequence[Seen], size: tuple[int, int], most: int) -> Choice:
    from cubicfish_cli.films.choose import choose
    from cubicfish_cli.films.scan import still_px

    return choose(seen, size, most, still_px(size))


def _write(
    table: Path,
    sheet: Path,
    of: Mapping[str, Any],
    chosen: Sequence[tuple[Path, Path, int]],
    measured: Sequence[Measured],
    places: Sequence[tuple[int, int]],
    seen: Sequence[Seen],
    choice: Choice,
    *,
    overwrite: bool,
) -> None:
    """Write table, sheet and pictures, all or none; pictures of an earlier choice go."""
    from cubicfish_cli.files import whole_files, write_text
    from cubicfish_cli.films import sheet as contact
    from cubicfish_cli.films.table import FrameRow, photos_of_table, write_rows

    written = {at: path for path, _, at in chosen}
    looked_at = {place: at for at, place in enumerate(places)}

    def rows() -> Iterator[FrameRow]:
        for number, film in enumerate(measured):
            for index in range(len(film)):
                at = looked_at.get((number, index))
                gain = math.nan if at is None else float(choice.gain[at])
                yield FrameRow(
                    film=str(film.film.path),
                    time=film.time[index],
                    sharpness=film.sharpness[index],
                    motion=film.motion[index],
                    corners=None if at is None else seen[at].corners,
                    gain=gain if math.isfinite(gain) else None,
                    why_not=_PASSED_OVER if at is None else choice.why_not[at],
                    photo="" if at not in written else written[at].name,
                )

    def captions() -> Iterator[tuple[Path, str]]:
        for path, source, at in chosen:
            one = seen[at]
            yield (
                source,
                f"{path.name}: {count(one.corners, 'corner')}, sharpness {one.sharpness:.2f}, "
                f"motion {one.motion:.1f} px, gain {choice.gain[at]:.1f}",
            )

    films = [one.film for one in measured]
    title = f"{count(len(chosen), 'frame')} of {_listed(films)}"
    paths = [table, sheet, *(path for path, _, _ in chosen)]
    old = [table.parent / name for name in photos_of_table(table)] if overwrite else []
    obsolete = [path for path in old if path not in paths]
    with whole_files(paths, overwrite=overwrite, obsolete=obsolete) as temporaries:
        write_rows(temporaries[0], of, rows())
        write_text(temporaries[1], contact.sheet(title, captions()), overwrite=False)
        for temporary, (_, source, _) in zip(temporaries[2:], chosen, strict=True):
            shutil.copyfile(source, temporary)


def _listed(films: Sequence[Film]) -> str:
    from cubicfish_cli.photos import shown

    names = [shown(film.path.name) for film in films]
    return ", ".join(names[:4]) + f" and {len(names) - 4} more" * (len(names) > 4)


def _say_of_film(measured: Measured) -> None:
    from cubicfish_cli.photos import shown

    name = shown(measured.film.path)
    if measured.problem is not None:
        say(f"warning: {measured.problem}")
    if measured.turned_deg:
        say(
            f"note: {name} tells players to turn it by {measured.turned_deg}°: frames are as the "
            "sensor made them"
        )
    if measured.interlaced:
        say(
            f"warning: {name} is interlaced: a frame is two half pictures of different times, and "
            "only good where nothing moves"
        )


def _record(measured: Measured) -> dict[str, Any]:
    film = measured.film
    return {
        "film": str(film.path),
        "frames": len(measured),
        "image_size": film.size,
        "seconds": measured.time[-1],
        "turned_deg": measured.turned_deg,
        "interlaced": measured.interlaced,
        "problem": measured.problem,
    }
