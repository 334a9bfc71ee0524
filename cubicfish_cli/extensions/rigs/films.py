"""Films of a rig's cameras: the moments to calibrate from, their frames, and how these move."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cubicfish_cli.app.asked import Run
from cubicfish_cli.app.listener import Listener
from cubicfish_cli.app.photos import Photo, read_grey
from cubicfish_cli.core.codes import Event
from cubicfish_cli.core.errors import DetectionError, PhotoError
from cubicfish_cli.core.files import refuse_existing, whole_files, write_text
from cubicfish_cli.core.frame_names import frame_name
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.tables import csv_text
from cubicfish_cli.core.target import Target
from cubicfish_cli.extensions.films.choose import Seen, choose_shots
from cubicfish_cli.extensions.films.frame_search import found_in
from cubicfish_cli.extensions.films.frames import tell_of_film, why_ended
from cubicfish_cli.extensions.films.scan import Measured, scan, still_px
from cubicfish_cli.extensions.films.source import open_films
from cubicfish_cli.extensions.rigs.film_clocks import film_offset
from cubicfish_cli.extensions.rigs.fit.clocks import Moving
from cubicfish_cli.extensions.rigs.moments import Moments, begins_at, flow, moments, take_out

_Beside = tuple[Path | None, float]

# Of so many moments for each that may be chosen the corners are looked for.
_LOOKED_AT = 2


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

    """

    photos: Mapping[str, tuple[Path, ...]]
    shots: list[tuple[str, str, str]]
    late: Mapping[str, Mapping[str, float]]
    beside: Mapping[str, Mapping[str, tuple[_Beside, _Beside]]]
    ahead: Mapping[str, float]

    def tell_clocks(self, late: Mapping[str, float | None], listener: Listener) -> None:
        """Tell how far clocks differ in all, by when films move and by the fit.

        Args:
            late: of each camera, by how much it was found to be later still, seconds.
            listener: who is told.

        """
        first = next(iter(self.ahead))
        for name, ahead in self.ahead.items():
            total = ahead - (late.get(name) or 0.0)
            if total:
                _tell_clock(listener, Event.CLOCK_IN_ALL, name, first, total)

    def moving(self, camera: str, pairs: Observations, listener: Listener) -> Moving:
        """How the corners of a camera's pictures move."""
        files = {path.name: path for path in self.photos[camera]}
        parts, progress = [], listener.counting(f"Measuring motion in {camera}")
        for number, image in enumerate(pairs.images):
            progress(number, len(pairs.images))
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


def rig_frames(
    films: Mapping[str, Path],
    folder: Path,
    room: Path,
    targets: Sequence[Target],
    run: Run,
    *,
    most: int,
    tolerance: float | None,
) -> RigFrames:
    """Choose moments at which cameras see the target sharply at once, and write their frames.

    Args:
        films: of each camera by name.
        folder: where frames go, in a folder for each camera, and shots.csv.
        room: a folder for frames that are needed until it is known how corners move.
        targets: the calibration target, or what it may be.
        run: how the work is done.
        most: how many moments are chosen at most.
        tolerance: how far apart frames of a moment may be, seconds; None for half a frame.

    Raises:
        CubicfishError: a film cannot be used, films share no time, or show no board.

    """
    table = folder / "shots.csv"
    refuse_existing(table, overwrite=run.overwrite)
    measured = []
    for path in films.values():
        (film,) = open_films([path])
        progress = run.listener.counting(f"Reading {film.path.name}")
        measured.append(scan(film, progress))
        tell_of_film(measured[-1], run.listener)
    names = list(films)
    told, ahead = _clocks(names, measured, run.listener)
    apart = [one + other for one, other in zip(told, ahead, strict=True)]
    found = _moments(names, measured, apart, _LOOKED_AT * most, tolerance)
    run.listener.tell(Event.MOMENTS, moments=len(found.time))
    taken = {
        name: _taken(one, found, column, room / name, run.listener)
        for column, (name, one) in enumerate(zip(names, measured, strict=True))
    }
    chosen = _chosen(names, measured, found, taken, targets, most, run)
    written = _written(names, measured, found, taken, chosen, folder, overwrite=run.overwrite)
    return replace(written, ahead=dict(zip(names, ahead, strict=True)))


def _clocks(
    names: Sequence[str], measured: Sequence[Measured], listener: Listener
) -> tuple[list[float], list[float]]:
    """By how much each film's own time is ahead of the first's, seconds: as told, and as found."""
    begins = [begins_at(one.film) for one in measured]
    # What clocks say themselves, where they say it.
    told = [begins[0] - begin for begin in begins]
    ahead = [0.0]
    for name, one, known in zip(names[1:], measured[1:], told[1:], strict=True):
        first = [time + known for time in measured[0].time]
        differs = film_offset((first, one.time), (measured[0].motion, one.motion))
        if differs:
            _tell_clock(listener, Event.CLOCK, name, names[0], differs)
        ahead.append(differs)
    return told, ahead


def _tell_clock(listener: Listener, event: Event, name: str, first: str, ahead_s: float) -> None:
    by_ms = 1e3 * abs(ahead_s)
    listener.tell(event, name=name, first=first, by_ms=by_ms, ahead=ahead_s > 0)


def _moments(
    names: Sequence[str],
    measured: Sequence[Measured],
    ahead: Sequence[float],
    most: int,
    tolerance: float | None,
) -> Moments:

    found = moments(measured, ahead, most, tolerance)
    if not len(found.time):
        raise PhotoError(
            f"the films of {' and '.join(names)} have no frame at the same time: check that they "
            "were taken together, or say a larger --tolerance"
        )
    return found


def _taken(
    measured: Measured, found: Moments, column: int, folder: Path, listener: Listener
) -> dict[int, Path]:
    """Take the moments' frames out of a film, and their neighbours: by index, their pictures."""
    wanted = {
        index + step
        for index in found.frame[:, column].tolist()
        for step in (-1, 0, 1)
        if index >= 0 and 0 <= index + step < len(measured)
    }
    paths = {index: folder / f"{index}.png" for index in sorted(wanted)}
    progress = listener.counting(f"Taking frames of {measured.film.path.name}")
    take_out(measured.film, paths, progress)
    return paths


def _chosen(
    names: Sequence[str],
    measured: Sequence[Measured],
    found: Moments,
    taken: Mapping[str, Mapping[int, Path]],
    targets: Sequence[Target],
    most: int,
    run: Run,
) -> dict[int, list[int]]:
    """Rows of the moments that add most, and which cameras show something there."""
    shots: list[list[Seen | None]] = [[None] * len(names) for _ in found.time]
    for column, (name, film) in enumerate(zip(names, measured, strict=True)):
        rows = np.flatnonzero(found.frame[:, column] >= 0).tolist()
        frames = found.frame[rows, column].tolist()
        photos = [Photo(name=f"{name} {index}", path=taken[name][index]) for index in frames]
        try:
            work = run.work(f"Finding corners in {name}")
            patches = found_in(photos, targets, work, run.cache).patches
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
    told = {"chosen": len(choice.order), "shots": len(shots)}
    run.listener.tell(Event.SHOTS_CHOSEN, **told, ended=why_ended(choice, "shot"))
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
    )


def _beside(measured: Measured, taken: Mapping[int, Path], index: int, step: int) -> _Beside:
    """A frame's neighbour: its picture, None where there is none, and seconds to it."""
    if index + step not in taken:
        return None, float(step)
    seconds = measured.time[index + step] - measured.time[index]
    return (taken[index + step], seconds) if seconds * step > 0 else (None, float(step))
