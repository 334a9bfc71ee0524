"""Films of a rig's cameras: the moments to calibrate from, their frames, and how these move."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cubicfish_cli.app.asked import Run
from cubicfish_cli.app.films.choose import Seen, choose_shots
from cubicfish_cli.app.films.frame_search import found_in, why_ended
from cubicfish_cli.app.films.scan import Measured, scan, still_px, tell_of_film
from cubicfish_cli.app.films.source import open_films
from cubicfish_cli.app.listener import Event, Listener
from cubicfish_cli.app.photos import Photo, read_grey
from cubicfish_cli.core.errors import DetectionError, PhotoError
from cubicfish_cli.core.files import refuse_existing, whole_files, write_text
from cubicfish_cli.core.frame_names import frame_name
from cubicfish_cli.core.observations import Observations
from cubicfish_cli.core.tables import csv_text
from cubicfish_cli.core.target import Target
from cubicfish_cli.extensions.rigs.film_clocks import film_offset
from cubicfish_cli.extensions.rigs.fit.times import Moving
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

    """

    photos: Mapping[str, tuple[Path, ...]]
    shots: list[tuple[str, str, str]]
    late: Mapping[str, Mapping[str, float]]
    beside: Mapping[str, Mapping[str, tuple[_Beside, _Beside]]]

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
    refuse_existing(folder / "shots.csv", overwrite=run.overwrite)
    measured = {}
    for name, path in films.items():
        (film,) = open_films([path])
        measured[name] = scan(film, run.listener.counting(f"Reading {film.path.name}"))
        tell_of_film(measured[name], run.listener)
    apart = _ahead(measured, run.listener)
    found = moments(list(measured.values()), apart, _LOOKED_AT * most, tolerance)
    if not len(found.time):
        raise PhotoError(
            f"the films of {' and '.join(films)} have no frame at the same time: check that they "
            "were taken together, or say a larger --tolerance"
        )
    run.listener.tell(Event.MOMENTS, moments=len(found.time))
    taken = {}
    for column, (name, one) in enumerate(measured.items()):
        frames = {
            index + step
            for index in found.frame[:, column].tolist()
            for step in (-1, 0, 1)
            if index >= 0 and 0 <= index + step < len(one)
        }
        taken[name] = {index: room / name / f"{index}.png" for index in sorted(frames)}
        take_out(
            one.film, taken[name], run.listener.counting(f"Taking frames of {one.film.path.name}")
        )
    chosen = _choose(measured, found, taken, targets, most, run)
    return _write(measured, found, taken, chosen, folder, overwrite=run.overwrite)


def _ahead(measured: Mapping[str, Measured], listener: Listener) -> list[float]:
    """By how much each film's own time is ahead of the first's, seconds, told and found."""
    (first_name, first), *others = measured.items()
    begin, found = begins_at(first.film), [0.0]
    for name, one in others:
        told = begin - begins_at(one.film)  # what clocks say themselves, where they say it
        times = ([time + told for time in first.time], one.time)
        differs = film_offset(times, (first.motion, one.motion))
        if differs:
            figures = {"by_ms": 1e3 * abs(differs), "ahead": differs > 0}
            listener.tell(Event.CLOCK, name=name, first=first_name, **figures)
        found.append(told + differs)
    return found


def _choose(
    measured: Mapping[str, Measured],
    found: Moments,
    taken: Mapping[str, Mapping[int, Path]],
    targets: Sequence[Target],
    most: int,
    run: Run,
) -> dict[int, list[int]]:
    """Rows of the moments that add most, and which cameras show something there."""
    shots: list[list[Seen | None]] = [[None] * len(measured) for _ in found.time]
    for column, (name, film) in enumerate(measured.items()):
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
    sizes = [one.film.size for one in measured.values()]
    choice = choose_shots(shots, sizes, most, [still_px(size) for size in sizes])
    told = {"chosen": len(choice.order), "shots": len(shots)}
    run.listener.tell(Event.SHOTS_CHOSEN, **told, ended=why_ended(choice, "shot"))
    return {
        row: [column for column, one in enumerate(shots[row]) if one is not None and one.corners]
        for row in sorted(choice.order)
    }


def _write(
    measured: Mapping[str, Measured],
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
    late: dict[str, dict[str, float]] = {name: {} for name in measured}
    beside: dict[str, dict[str, tuple[_Beside, _Beside]]] = {name: {} for name in measured}
    for row, showing in chosen.items():
        shot = frame_name("shot", float(found.time[row]) - start)
        for column in showing:
            name, film = list(measured.items())[column]
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
    for name, own in late.items():
        if not own:
            raise DetectionError(
                f"camera {name}: no board was found in any frame that was chosen: is one in view "
                "while the others see the target too?"
            )
    table = folder / "shots.csv"
    with whole_files([table, *sources], overwrite=overwrite, folder=folder) as temporaries:
        write_text(temporaries[0], csv_text([("shot", "camera", "image"), *rows]), overwrite=False)
        for temporary, source in zip(temporaries[1:], sources.values(), strict=True):
            shutil.copyfile(source, temporary)
    return RigFrames(
        photos={
            name: tuple(path for path in sources if path.parent.name == name) for name in measured
        },
        shots=rows,
        late=late,
        beside=beside,
    )


def _beside(measured: Measured, taken: Mapping[int, Path], index: int, step: int) -> _Beside:
    """A frame's neighbour: its picture, None where there is none, and seconds to it."""
    if index + step not in taken:
        return None, float(step)
    seconds = measured.time[index + step] - measured.time[index]
    return (taken[index + step], seconds) if seconds * step > 0 else (None, float(step))
