"""Frames of films, or photos of many, that are worth calibrating from: found, chosen, written."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from glob import glob, has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.cli.cache_folder import cache_folder
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.inputs import detect
from cubicfish_cli.cli.target_choice import TargetChoice
from cubicfish_cli.cli.terminal import detail, progress, say, working
from cubicfish_cli.cli.video_options import is_video_name
from cubicfish_cli.errors import DetectionError, PhotoError
from cubicfish_cli.frame_names import frame_name

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from cubicfish_cli.advice.worth import Worth
    from cubicfish_cli.correspondences import Correspondences
    from cubicfish_cli.films.choose import Choice, Patch, Seen
    from cubicfish_cli.films.film import Film
    from cubicfish_cli.films.scan import Measured
    from cubicfish_cli.films.table import FrameRow
    from cubicfish_cli.photos import Photo
    from cubicfish_cli.target import Target

    FloatArray = npt.NDArray[np.float64]

MOST = 60
# So many frames are kept for each that may be chosen, but one every so many seconds at least, up to
# so many. Corners are looked for in no more.
_KEPT, _KEPT_SECONDS, _MOST_KEPT = 1.5, 2.0, 5.0
_RATE = 30.0  # frames a second of films that do not say
# A frame is compared with so many before it and after it.
_COMPARED = 8
# Frames are searched in rounds of so many from all over the films, until a round gives hardly any
# that are worth choosing.
_ROUND, _HARDLY_ANY = 24, 0.1
# Where fewer than these of the good frames show the object, what is good is not told by them.
_FEW, _FEW_SHARE = 3, 0.5
# One frame of so many is looked at where a film does not say how many it has.
_EVERY = 15
_UNFINISHED = ".unfinished"
_PASSED_OVER = "not looked at: a neighbour is sharper or stiller"
_REPEATED = "not looked at: nearly the same picture as another"
_ENOUGH = "not looked at: others of all times had no more to add"


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
    from cubicfish_cli.films.choose import Seen
    from cubicfish_cli.films.film import open_films
    from cubicfish_cli.films.scan import scan

    films = open_films(expanded(paths))
    table, sheet = folder / frames_table.NAME, folder / contact.NAME
    for path in (table, sheet):
        refuse_existing(path, overwrite=overwrite)
    unfinished = folder / _UNFINISHED
    every = _every(films, most)
    measured = []
    for film in films:
        with progress(f"Reading {film.path.name}") as callback:
            measured.append(scan(film, unfinished / film.label, every, callback))
        say_of_film(measured[-1])
    names = {
        (number, index): name
        for number, film in enumerate(measured)
        for index, name in _names(film).items()
    }
    photos = _photos(measured, names)
    frames = sum(map(len, measured))
    seen = [
        Seen(patches=(), sharpness=measured[number].sharpness[index],
             motion=measured[number].motion[index])
        for number, index in names
    ]  # fmt: skip
    passed_over = _passed_over(photos, seen, films[0].size)
    say(f"{count(frames, 'frame')}; boards are looked for in the best.")
    search = _Search(photos=photos, seen=seen, size=films[0].size, most=most, target=target)
    try:
        search.look(passed_over, jobs, no_cache=no_cache)
    except DetectionError as error:
        raise DetectionError(f"no frame can be chosen of {_listed(films)}: {error}") from error
    seen, choice, looked_at = search.seen, search.choice, search.looked_at
    if not choice.order:
        raise DetectionError(
            f"no frame can be chosen of {_listed(films)}: no board was found in "
            f"{count(len(looked_at), 'frame')} from all over: is a board in view, whole squares "
            "of it, sharp and not covered?"
        )
    chosen = [
        (folder / name, photos[at].path, at)
        for at, name in enumerate(names.values())
        if not choice.why_not[at]
    ]
    of = frames_table.depends_on(films, most, _sha256(target))
    why_not = [
        choice.why_not[at] if at in looked_at else (passed_over[at] or "")
        for at in range(len(seen))
    ]
    rows = _Rows(
        measured=measured,
        places={place: at for at, place in enumerate(names)},
        looked_at=frozenset(looked_at),
        seen=seen,
        gain=choice.gain,
        why_not=why_not,
        written={at: path.name for path, _, at in chosen},
    )
    _write(table, sheet, of, chosen, rows, overwrite=overwrite)
    shutil.rmtree(unfinished, ignore_errors=True)
    return ChosenFrames(
        photos=tuple(path for path, _, _ in chosen),
        table=table,
        sheet=sheet,
        frames=frames,
        looked_at=len(looked_at),
        films=tuple(_record(one) for one in measured),
    )


def _every(films: Sequence[Film], most: int) -> int:
    """Of how many frames one is kept."""
    total = sum(film.frames for film in films)
    if not total:
        return _EVERY
    rate = min(film.rate or _RATE for film in films)
    few = min(total / (_KEPT * most), _KEPT_SECONDS * rate)
    return max(1, math.ceil(max(few, total / (_MOST_KEPT * most))))


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
    from cubicfish_cli.films.choose import Seen
    from cubicfish_cli.films.measure import sharpness
    from cubicfish_cli.photos import photo_size

    found = found_in(photos, target.load(), jobs, no_cache)
    seen = []
    with progress("Measuring sharpness") as callback:
        for at, photo in enumerate(photos):
            callback(at, len(photos))
            patches = found.patches.get(photo.name, ())
            sharp = sharpness(photo.read_grey()) if patches else 0.0
            seen.append(Seen(patches=patches, sharpness=sharp))
    shown = next((photo for photo, one in zip(photos, seen, strict=True) if one.corners), photos[0])
    names = [photo.name for photo in photos]
    choice = _choose(names, seen, found, photo_size(shown.path), most)
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Found:
    """What photos show.

    Attributes:
        patches: corners by the names of the photos that have any.
        pairs: the same as pairs; None where no object is known.
        target: the object that they are of.

    """

    patches: dict[str, tuple[Patch, ...]]
    pairs: Correspondences | None
    target: Target | None = None

    def with_more(self, more: _Found) -> _Found:
        """Of these and of other photos."""
        from cubicfish_cli.correspondences import joined

        one, other = self.pairs, more.pairs
        both = other if one is None else one if other is None else joined(one, other)
        return _Found(patches={**self.patches, **more.patches}, pairs=both)


@dataclass(kw_only=True, eq=False)
class _Search:
    """Looking for corners in frames, as long as that brings anything.

    Attributes:
        photos, seen: the frames, and what is known of each.
        size: (width, height) of them.
        most: how many may be chosen.
        target: the object; None where none is known.
        looked_at: numbers of those that were searched.
        choice: what is chosen of these.

    """

    photos: Sequence[Photo]
    seen: list[Seen]
    size: tuple[int, int]
    most: int
    target: TargetChoice | None
    looked_at: list[int] = field(default_factory=list)

    def look(self, passed_over: Sequence[str | None], jobs: int | None, *, no_cache: bool) -> None:
        """Search frames, good ones first, those that are passed over only where these show little.

        Raises:
            DetectionError: none shows the object.

        """
        good = [at for at, why in enumerate(passed_over) if why is None]
        others = [at for at, why in enumerate(passed_over) if why not in (None, _REPEATED)]
        found = _Found(patches={}, pairs=None)
        targets = None if self.target is None else self.target.load()
        failure: DetectionError | None = None
        for numbers in (good, others):
            if len(found.patches) >= max(_FEW, _FEW_SHARE * len(self.looked_at)):
                break
            rounds = -(-len(numbers) // _ROUND)
            for first in range(rounds):
                some = numbers[first::rounds]  # from the beginning to the end
                try:
                    more = found_in([self.photos[at] for at in some], targets, jobs, no_cache)
                except DetectionError as error:
                    failure, more = error, _Found(patches={}, pairs=None)
                found = found.with_more(more)
                if more.target is not None:
                    targets = [more.target]
                self.looked_at += some
                before = len(self.choice.order) if first else 0
                self._choose_of(found)
                chosen = len(set(self.choice.order) & set(some))
                full = len(self.choice.order) >= self.most
                if full or (before and chosen <= _HARDLY_ANY * len(some)):
                    break
        self.looked_at.sort()
        if not found.patches:
            self._choose_of(found)
            if failure is not None:
                raise failure

    def _choose_of(self, found: _Found) -> None:
        from dataclasses import replace

        self.seen = [
            replace(one, patches=found.patches.get(photo.name, ()))
            for one, photo in zip(self.seen, self.photos, strict=True)
        ]
        names = [photo.name for photo in self.photos]
        self.choice: Choice = _choose(names, self.seen, found, self.size, self.most)


def _passed_over(
    photos: Sequence[Photo], measured: Sequence[Seen], size: tuple[int, int]
) -> list[str | None]:
    """Why each frame is not searched for corners; None for those that are."""
    from cubicfish_cli.films.choose import Scale
    from cubicfish_cli.films.measure import motion, small_picture
    from cubicfish_cli.films.scan import still_px

    still = still_px(size)
    scale = Scale.of(measured, still)
    why: list[str | None] = []
    good: list[tuple[int, Any]] = []
    with progress("Comparing frames") as callback:
        for at, (photo, one) in enumerate(zip(photos, measured, strict=True)):
            callback(at, len(photos))
            why.append(scale.spoilt(one))
            if why[at] is not None:
                continue
            good = [other for other in good if other[0] >= at - _COMPARED]
            small = small_picture(photo.read_grey())
            same = [other for other, before in good if motion(before, small, size[0]) < still]
            worse = [other for other in same if scale.quality(measured[other]) < scale.quality(one)]
            if len(worse) < len(same):
                why[at] = _REPEATED
                continue
            for other in worse:
                why[other] = _REPEATED
            good = [other for other in good if other[0] not in worse] + [(at, small)]
    return why


def found_in(
    photos: Sequence[Photo], targets: Sequence[Target] | None, jobs: int | None, no_cache: bool
) -> _Found:
    """Find the named corners of a target, or else grids as they are."""
    import numpy as np

    from cubicfish_cli.correspondences import pair
    from cubicfish_cli.detection.grid_cache import GridCache
    from cubicfish_cli.detection.look import nameless_grids
    from cubicfish_cli.films.choose import Patch

    patches: dict[str, tuple[Patch, ...]] = {}
    if targets is None:
        kept = None if no_cache else cache_folder()
        cache = None if kept is None else GridCache(folder=kept)
        with progress("Finding boards") as callback:
            found = nameless_grids(photos, jobs=jobs, progress=callback, cache=cache)
        for photo, one in zip(photos, found, strict=True):
            grids = () if one is None else one.grids
            if grids:
                patches[photo.name] = tuple(
                    Patch(board=-1, cells=grid.cells, pixel=grid.pixel) for grid in grids
                )
        return _Found(patches=patches, pairs=None)
    corners = detect(photos, targets, jobs, no_cache=no_cache, again=False).corners
    known = corners.target
    cells = np.column_stack([corners.column, corners.row])
    for number, name in enumerate(corners.images):
        here = corners.image == number
        patches[name] = tuple(
            Patch(board=int(board), cells=cells[own], pixel=corners.pixel[own])
            for board in np.unique(corners.board[here])
            for own in (here & (corners.board == board),)
        )
    pairs = None if known is None else pair(corners, known)
    return _Found(patches=patches, pairs=pairs, target=known)


def _choose(
    names: Sequence[str], seen: Sequence[Seen], found: _Found, size: tuple[int, int], most: int
) -> Choice:
    """Choose by what photos add to the camera, or where none can be fitted, by what they show."""
    from cubicfish_cli.advice.worth import Worth
    from cubicfish_cli.errors import FitError
    from cubicfish_cli.films.choose import choose
    from cubicfish_cli.films.scan import still_px

    def gains(quality: FloatArray) -> _Gains | None:
        if found.pairs is None:
            return None
        try:
            with working("Fitting a first lens"):
                worth = Worth(found.pairs, dict(zip(names, quality, strict=True)))
        except FitError as problem:
            detail(f"no first lens ({problem}): frames are chosen by where their corners are")
            return None
        return _Gains(names=names, worth=worth)

    return choose(seen, size, most, still_px(size), gains)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Gains:
    """What photos add, by their numbers."""

    names: Sequence[str]
    worth: Worth

    @property
    def flat(self) -> float:
        return self.worth.flat

    def of(self, picture: int) -> float:
        return self.worth.of(self.names[picture])

    def take(self, picture: int) -> None:
        self.worth.take(self.names[picture])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rows:
    """What frames.csv says of all frames.

    Attributes:
        measured: a record a film.
        places: film and frame -> number among those that were kept.
        looked_at: numbers of those that were searched.
        seen, gain, why_not: a thing for each that was kept.
        written: numbers of those chosen -> the pictures' names.

    """

    measured: Sequence[Measured]
    places: Mapping[tuple[int, int], int]
    looked_at: frozenset[int]
    seen: Sequence[Seen]
    gain: FloatArray
    why_not: Sequence[str]
    written: Mapping[int, str]

    def __iter__(self) -> Iterator[FrameRow]:
        from cubicfish_cli.films.table import FrameRow

        for number, film in enumerate(self.measured):
            for index in range(len(film)):
                at = self.places.get((number, index), -1)
                looked_at = at in self.looked_at
                gain = float(self.gain[at]) if looked_at else math.nan
                yield FrameRow(
                    film=str(film.film.path),
                    time=film.time[index],
                    sharpness=film.sharpness[index],
                    motion=film.motion[index],
                    corners=self.seen[at].corners if looked_at else None,
                    gain=gain if math.isfinite(gain) else None,
                    why_not=_PASSED_OVER if at < 0 else self.why_not[at],
                    photo=self.written.get(at, ""),
                )


def _write(
    table: Path,
    sheet: Path,
    of: Mapping[str, Any],
    chosen: Sequence[tuple[Path, Path, int]],
    rows: _Rows,
    *,
    overwrite: bool,
) -> None:
    """Write table, sheet and pictures, all or none; pictures of an earlier choice go."""
    from cubicfish_cli.files import whole_files, write_text
    from cubicfish_cli.films import sheet as contact
    from cubicfish_cli.films.table import photos_of_table, write_rows

    def captions() -> Iterator[tuple[Path, str]]:
        for path, source, at in chosen:
            one = rows.seen[at]
            yield (
                source,
                f"{path.name}: {count(one.corners, 'corner')}, sharpness {one.sharpness:.2f}, "
                f"motion {one.motion:.1f} px, gain {rows.gain[at]:.3f}",
            )

    films = [one.film for one in rows.measured]
    title = f"{count(len(chosen), 'frame')} of {_listed(films)}"
    paths = [table, sheet, *(path for path, _, _ in chosen)]
    old = [table.parent / name for name in photos_of_table(table)] if overwrite else []
    obsolete = [path for path in old if path not in paths]
    with whole_files(paths, overwrite=overwrite, obsolete=obsolete) as temporaries:
        write_rows(temporaries[0], of, rows)
        write_text(temporaries[1], contact.sheet(title, captions()), overwrite=False)
        for temporary, (_, source, _) in zip(temporaries[2:], chosen, strict=True):
            shutil.copyfile(source, temporary)


def _listed(films: Sequence[Film]) -> str:
    from cubicfish_cli.photos import shown

    names = [shown(film.path.name) for film in films]
    return ", ".join(names[:4]) + f" and {len(names) - 4} more" * (len(names) > 4)


def say_of_film(measured: Measured) -> None:
    """Say what is odd about a film."""
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
