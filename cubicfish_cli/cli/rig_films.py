"""Films of a rig's cameras: the moments to calibrate from, their frames, and how these move."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.cli.cache_folder import cache_folder
from cubicfish_cli.cli.choosing import say_of_film
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.target_choice import TargetChoice
from cubicfish_cli.cli.terminal import progress, say
from cubicfish_cli.errors import DetectionError, PhotoError
from cubicfish_cli.frame_names import frame_name

if TYPE_CHECKING:
    from cubicfish_cli.films.scan import Measured
    from cubicfish_cli.films.shots import Moments
    from cubicfish_cli.fitting.rig.clocks import Moving
    from cubicfish_cli.observations import Observations

_Beside = tuple[Path | None, float]

# Of so many moments for each that may be chosen the corners are looked for.
_LOOKED_AT = 2
_UNFINISHED = ".unfinished"
# Frames are kept of a pass in stretches of so many: where that is broken off, it goes on there.
_STRETCH = 50


@dataclass(frozen=True, kw_only=True)
class RigFrames:
    """Frames of films, chosen together.

    Attributes:
        photos: of each camera by name, the pictures.
        shots: rows (shot, camera, picture's name).
        late: of each camera and picture's name, seconds after the shot's moment.
        beside: of each camera and picture's name, the film's frames before and after it, and
            seconds to them.
        ahead: of each camera, by how much its clock was found to be ahead of the first's, seconds.
        folder: what is only kept until all is done.

    """

    photos: Mapping[str, tuple[Path, ...]]
    shots: list[tuple[str, str, str]]
    late: Mapping[str, Mapping[str, float]]
    beside: Mapping[str, Mapping[str, tuple[_Beside, _Beside]]]
    ahead: Mapping[str, float]
    folder: Path

    def say_clocks(self, late: Mapping[str, float | None]) -> None:
        """Say how far clocks differ in all, by when films move and by the fit.

        Args:
            late: of each camera, by how much it was found to be later still, seconds.

        """
        first = next(iter(self.ahead))
        for name, ahead in self.ahead.items():
            total = ahead - (late.get(name) or 0.0)
            if total:
                say(
                    f"note: in all, the clock of {name} is {1e3 * abs(total):.1f} ms "
                    f"{'ahead of' if total > 0 else 'behind'} that of {first}."
                )

    def moving(self, camera: str, pairs: Observations) -> Moving:
        """How the corners of a camera's pictures move."""
        import numpy as np

        from cubicfish_cli.films.shots import flow
        from cubicfish_cli.fitting.rig.clocks import Moving
        from cubicfish_cli.photos import read_grey

        files = {path.name: path for path in self.photos[camera]}
        parts = []
        with progress(f"Measuring motion in {camera}") as callback:
            for number, image in enumerate(pairs.images):
                callback(number, len(pairs.images))
                name, own = Path(image).name, pairs.image == number
                late = np.full(int(own.sum()), self.late[camera][name])
                picture, beside = read_grey(files[name]), self.beside[camera][name]
                before, after = (
                    None if path is None else flow(picture, read_grey(path), pairs.pixel[own])
                    for path, _ in beside
                )
                moving = Moving.between(before, after, (beside[0][1], beside[1][1]))
                parts.append(replace(moving, late=late))
        return Moving.joined(parts)

    def done(self) -> None:
        """Remove what is no longer needed."""
        shutil.rmtree(self.folder, ignore_errors=True)


def rig_frames(
    films: Mapping[str, Path],
    folder: Path,
    target: TargetChoice,
    *,
    most: int,
    tolerance: float | None,
    jobs: int | None,
    no_cache: bool,
    overwrite: bool,
) -> RigFrames:
    """Choose moments at which cameras see the target sharply at once, and write their frames.

    Args:
        films: of each camera by name.
        folder: where frames go, in a folder for each camera, and shots.csv.
        target: the object.
        most: how many moments are chosen at most.
        tolerance: how far apart frames of a moment may be, seconds; None for half a frame.
        jobs: how many photos are searched at once.
        no_cache: whether nothing found before is used.
        overwrite: whether frames of an earlier run may be replaced.

    Raises:
        CubicfishError: a film cannot be used, films share no time, or show no board.

    """
    from cubicfish_cli.files import refuse_existing
    from cubicfish_cli.films.scan import scan
    from cubicfish_cli.films.source import open_films

    table = folder / "shots.csv"
    refuse_existing(table, overwrite=overwrite)
    unfinished = folder / _UNFINISHED
    measured = []
    for name, path in films.items():
        (film,) = open_films([path])
        with progress(f"Reading {film.path.name}") as callback:
            measured.append(scan(film, unfinished / name, _STRETCH, callback))
        say_of_film(measured[-1])
    names = list(films)
    told, ahead = _clocks(names, measured)
    apart = [one + other for one, other in zip(told, ahead, strict=True)]
    found = _moments(names, measured, apart, _LOOKED_AT * most, tolerance)
    say(f"{count(len(found.time), 'moment')} of the films are searched for boards.")
    taken = {
        name: _taken(one, found, column, unfinished / f"{name} frames")
        for column, (name, one) in enumerate(zip(names, measured, strict=True))
    }
    chosen = _chosen(names, measured, found, taken, target, most, jobs, no_cache=no_cache)
    written = _written(names, measured, found, taken, chosen, folder, overwrite=overwrite)
    return replace(written, ahead=dict(zip(names, ahead, strict=True)))


def _clocks(names: Sequence[str], measured: Sequence[Measured]) -> tuple[list[float], list[float]]:
    """By how much each film's own time is ahead of the first's, seconds: as told, and as found."""
    from cubicfish_cli.films.clocks import film_offset
    from cubicfish_cli.films.shots import begins_at

    begins = [begins_at(one.film) for one in measured]
    # What clocks say themselves, where they say it.
    told = [begins[0] - begin for begin in begins]
    ahead = [0.0]
    for name, one, known in zip(names[1:], measured[1:], told[1:], strict=True):
        first = [time + known for time in measured[0].time]
        differs = film_offset((first, one.time), (measured[0].motion, one.motion))
        if differs:
            say(
                f"note: the clock of {name} is {1e3 * abs(differs):.0f} ms "
                f"{'ahead of' if differs > 0 else 'behind'} that of {names[0]}, by when they move "
                "(to about a frame): it is matched so."
            )
        ahead.append(differs)
    return told, ahead


def _moments(
    names: Sequence[str],
    measured: Sequence[Measured],
    ahead: Sequence[float],
    most: int,
    tolerance: float | None,
) -> Moments:
    from cubicfish_cli.films.shots import moments

    found = moments(measured, ahead, most, tolerance)
    if not len(found.time):
        raise PhotoError(
            f"the films of {' and '.join(names)} have no frame at the same time: check that they "
            "were taken together, or say a larger --tolerance"
        )
    return found


def _taken(measured: Measured, found: Moments, column: int, folder: Path) -> dict[int, Path]:
    """Take the moments' frames out of a film, and their neighbours: by index, their pictures."""
    from cubicfish_cli.films.shots import take_out

    folder.mkdir(parents=True, exist_ok=True)
    wanted = {
        index + step
        for index in found.frame[:, column].tolist()
        for step in (-1, 0, 1)
        if index >= 0 and 0 <= index + step < len(measured)
    }
    paths = {index: folder / f"{index}.png" for index in sorted(wanted)}
    with progress(f"Taking frames of {measured.film.path.name}") as callback:
        take_out(measured.film, paths, callback)
    return paths


def _chosen(
    names: Sequence[str],
    measured: Sequence[Measured],
    found: Moments,
    taken: Mapping[str, Mapping[int, Path]],
    target: TargetChoice,
    most: int,
    jobs: int | None,
    *,
    no_cache: bool,
) -> dict[int, list[int]]:
    """Rows of the moments that add most, and which cameras show something there."""
    import numpy as np

    from cubicfish_cli.films.choose import Seen, choose_shots
    from cubicfish_cli.films.scan import still_px
    from cubicfish_cli.library.frame_search import found_in
    from cubicfish_cli.photos import Photo

    cache = None if no_cache else cache_folder()
    shots: list[list[Seen | None]] = [[None] * len(names) for _ in found.time]
    for column, (name, film) in enumerate(zip(names, measured, strict=True)):
        rows = np.flatnonzero(found.frame[:, column] >= 0).tolist()
        frames = found.frame[rows, column].tolist()
        photos = [Photo(name=f"{name} {index}", path=taken[name][index]) for index in frames]
        try:
            with progress(f"Finding corners in {name}") as callback:
                patches = found_in(
                    photos, target.load(), jobs=jobs, cache=cache, progress=callback
                ).patches
        except DetectionError as error:
            raise DetectionError(f"camera {name}: no frame can be chosen: {error}") from error
        for row, index, photo in zip(rows, frames, photos, strict=True):
            shots[row][column] = Seen(
                patches=patches.get(photo.name, ()),
                sharpness=film.sharpness[index],
                motion=film.motion[index],
            )
    sizes = [one.film.size for one in measured]
    choice = choose_shots(shots, sizes, most, [still_px(size) for size in sizes])
    say(f"{count(len(choice.order), 'shot')} of {len(shots)} chosen, which add most.")
    return {
        row: [column for column, one in enumerate(shots[row]) if one is not None and one.corners]
        for row in sorted(choice.order)
    }


def _written(
    names: Sequence[str],
    measured: Sequence[Measured],
    found: Moments,
    taken: Mapping[str, Mapping[int, Path]],
    chosen: Mapping[int, Sequence[int]],
    folder: Path,
    *,
    overwrite: bool,
) -> RigFrames:
    """Write the chosen frames and shots.csv, all or none."""
    from cubicfish_cli.files import whole_files, write_text
    from cubicfish_cli.tables import csv_text

    start = min(0.0, float(found.time.min()))
    rows: list[tuple[str, str, str]] = []
    sources: dict[Path, Path] = {}
    late: dict[str, dict[str, float]] = {name: {} for name in names}
    beside: dict[str, dict[str, tuple[_Beside, _Beside]]] = {name: {} for name in names}
    for row, showing in chosen.items():
        shot = frame_name("shot", float(found.time[row]) - start)
        for column in showing:
            name, film = names[column], measured[column]
            index = int(found.frame[row, column])
            picture = f"{frame_name(name, film.time[index])}.png"
            if picture in late[name]:
                continue  # one frame for two moments
            sources[folder / name / picture] = taken[name][index]
            rows.append((shot, name, picture))
            late[name][picture] = float(found.late[row, column])
            beside[name][picture] = (
                _beside(film, taken[name], index, -1),
                _beside(film, taken[name], index, 1),
            )
    for name in names:
        if not late[name]:
            raise DetectionError(
                f"camera {name}: no board was found in any frame that was chosen: is one in view "
                "while the others see the target too?"
            )
    table = folder / "shots.csv"
    with whole_files([table, *sources], overwrite=overwrite) as temporaries:
        write_text(temporaries[0], csv_text([("shot", "camera", "image"), *rows]), overwrite=False)
        for temporary, source in zip(temporaries[1:], sources.values(), strict=True):
            shutil.copyfile(source, temporary)
    return RigFrames(
        photos={
            name: tuple(path for path in sources if path.parent.name == name) for name in names
        },
        shots=rows,
        late=late,
        beside=beside,
        ahead=dict.fromkeys(names, 0.0),
        folder=folder / _UNFINISHED,
    )


def _beside(measured: Measured, taken: Mapping[int, Path], index: int, step: int) -> _Beside:
    """A frame's neighbour: its picture, None where there is none, and seconds to it."""
    if index + step not in taken:
        return None, float(step)
    seconds = measured.time[index + step] - measured.time[index]
    return (taken[index + step], seconds) if seconds * step > 0 else (None, float(step))
