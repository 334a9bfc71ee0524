"""Films of a rig's cameras: the moments to calibrate from, their frames, and how these move."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish import (
    CubicfishError,
    DetectionError,
    Event,
    Listener,
    Observations,
    PhotoError,
    Run,
    Target,
    detect,
)
from cubicfish.files import Content, FrameName, Table, write_files
from cubicfish.photos import Photo
from cubicfish.rigs import CornerMotion
from cubicfish_cli.extensions.rigs.film_clocks import FilmMotion, match_films
from cubicfish_cli.extensions.rigs.moments import Moments, begins_at, flow, moments, take_out
from cubicfish_cli.films.choose import Seen, choose_shots
from cubicfish_cli.films.frame_search import Found
from cubicfish_cli.films.scan import Measured, report_film, scan, still_px
from cubicfish_cli.films.source import open_films
from cubicfish_cli.plan import Plan
from cubicfish_cli.words.events import why_ended

# Of so many moments for each that may be chosen the corners are looked for.
_LOOKED_AT = 2


@dataclass(frozen=True, kw_only=True)
class ShotFrame:
    """A frame of a camera's film that is of a shot.

    Attributes:
        shot: name of the shot.
        camera: name of the camera.
        picture: the frame's picture.
        late: seconds after the shot's moment.
        beside: the film's frames before and after it, None where there is none.
        seconds: to these.

    """

    shot: str
    camera: str
    picture: Path
    late: float
    beside: tuple[Path | None, Path | None]
    seconds: tuple[float, float]


def measure_motion(
    frames: Sequence[ShotFrame], pairs: Observations, listener: Listener
) -> CornerMotion:
    """How the corners move that were found in a camera's frames."""
    frame_of = {one.picture.name: one for one in frames}
    parts, progress = [], listener.counting(f"Measuring motion in {frames[0].camera}")
    for number, image in enumerate(pairs.images):
        progress(number, len(pairs.images))
        frame, pixel = frame_of[Path(image).name], pairs.pixel[pairs.image == number]
        picture = _grey_of(frame.picture)
        ways = [
            None if one is None else flow(picture, _grey_of(one), pixel) for one in frame.beside
        ]
        moving = CornerMotion.between(ways[0], ways[1], frame.seconds)
        parts.append(replace(moving, late=np.full(len(pixel), frame.late)))
    return CornerMotion.joined(parts)


def _grey_of(path: Path) -> npt.NDArray[Any]:
    return Photo(name=path.name, path=path).read_grey()


@contextmanager
def keeping_frames(frames: Sequence[ShotFrame], folder: Path) -> Iterator[None]:
    """Say with any error that chosen frames, which took long, stay in a folder, and their use."""
    try:
        yield
    except CubicfishError as error:
        if not frames:
            raise
        raise error.amid(
            after=f"; the chosen frames stay in {folder}: go on from its folders with '--shots "
            f"{folder / 'shots.csv'}'"
        ) from error


def rig_frames(
    films: Mapping[str, Path],
    folder: Path,
    room: Path,
    targets: Sequence[Target],
    run: Run,
    plan: Plan,
    *,
    most: int,
    tolerance: float | None,
) -> list[ShotFrame]:
    """Choose moments at which cameras see the target sharply at once, and write their frames.

    Args:
        films: of each camera by name.
        folder: where frames go, in a folder for each camera, and shots.csv.
        room: a folder for frames that are needed until it is known how corners move.
        targets: the calibration target, or what it may be.
        run: how the work is done.
        plan: what is read and written.
        most: how many moments are chosen at most.
        tolerance: how far apart frames of a moment may be, seconds; None for half a frame.

    Raises:
        CubicfishError: a film cannot be used, films share no time, or show no board.

    """
    plan.writes(folder / "shots.csv")
    measured = {}
    for name, path in films.items():
        (film,) = open_films([path])
        measured[name] = scan(film, run.listener.counting(f"Reading {film.path.name}"))
        report_film(measured[name], run.listener)
    apart = find_ahead(measured, run.listener)
    found = moments(list(measured.values()), apart, _LOOKED_AT * most, tolerance)
    if not len(found.time):
        raise PhotoError(
            f"the films of {' and '.join(films)} have no frame at the same time: check that they "
            "were taken together, or say a larger --tolerance"
        )
    run.listener.tell(Event.MOMENTS, moments=len(found.time))
    taken = {}
    for (name, one), own in zip(measured.items(), found.frame.T, strict=True):
        frames = np.unique(own[own >= 0][:, None] + [-1, 0, 1])
        frames = frames[(frames >= 0) & (frames < len(one))]
        taken[name] = {index: room / name / f"{index}.png" for index in frames.tolist()}
        take_out(
            one.film, taken[name], run.listener.counting(f"Taking frames of {one.film.path.name}")
        )
    chosen = _choose(measured, found, taken, targets, most, run)
    return _write(measured, found, taken, chosen, folder, plan, overwrite=run.overwrite)


def find_ahead(measured: Mapping[str, Measured], listener: Listener) -> list[float]:
    """By how much each film's own time is ahead of the first's, seconds, stated and found."""
    (first_name, first), *others = measured.items()
    begin, found = begins_at(first.film), [0.0]
    for name, one in others:
        stated = begin - begins_at(one.film)  # what clocks say themselves, where they say it
        match = match_films(_motion_of(first, stated), _motion_of(one))
        if match.ahead:
            figures = {"by_ms": 1e3 * abs(match.ahead), "ahead": match.ahead > 0}
            listener.tell(Event.CLOCK, name=name, first=first_name, **figures)
        elif match.alike:
            apart = {"apart_s": abs(match.alike[1] - match.alike[0])}
            listener.tell(Event.CLOCK_UNSURE, name=name, first=first_name, **apart)
        found.append(stated + match.ahead)
    return found


def _motion_of(measured: Measured, ahead: float = 0.0) -> FilmMotion:
    """How a film moves from frame to frame, by a clock that is so far ahead of its own."""
    time = np.asarray(measured.time) + ahead
    moved = np.asarray(measured.step[1:]) / still_px(measured.film.size)
    return FilmMotion(time=(time[1:] + time[:-1]) / 2, moved=moved)


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
            step = f"Finding corners in {name}"
            detection = detect(photos, targets, run, again=False, step=step)
        except DetectionError as error:
            raise error.amid(f"camera {name}: no frame can be chosen: ") from error
        patches = Found.of(detection).patches
        for row, index, photo in zip(rows, frames, photos, strict=True):
            shots[row][column] = Seen(
                patches=patches.get(photo.name, ()),
                sharpness=film.sharpness[index],
                motion=film.motion[index],
            )
    sizes = [one.film.size for one in measured.values()]
    choice = choose_shots(shots, sizes, most, [still_px(size) for size in sizes])
    figures = {"chosen": len(choice.order), "shots": len(shots)}
    run.listener.tell(
        Event.SHOTS_CHOSEN, **figures, ended=why_ended(choice.ended, len(choice.order), "shot")
    )
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
    plan: Plan,
    *,
    overwrite: bool,
) -> list[ShotFrame]:
    """Write the chosen frames and shots.csv, all or none."""
    start, films = min(0.0, float(found.time.min())), list(measured.items())
    frames: list[ShotFrame] = []
    sources: dict[Path, Path] = {}
    for row, column in ((row, column) for row, showing in chosen.items() for column in showing):
        name, film = films[column]
        index = int(found.frame[row, column])
        picture = folder / name / f"{FrameName(name, film.time[index])}.png"
        if picture in sources:
            continue  # one frame for two moments
        sources[picture] = taken[name][index]
        (before, first), (after, second) = (
            _find_frame_beside(film, taken[name], index, step) for step in (-1, 1)
        )
        frames.append(
            ShotFrame(
                shot=str(FrameName("shot", float(found.time[row]) - start)),
                camera=name,
                picture=picture,
                late=float(found.late[row, column]),
                beside=(before, after),
                seconds=(first, second),
            )
        )
    for name in measured:
        if all(one.camera != name for one in frames):
            raise DetectionError(
                f"camera {name}: no board was found in any frame that was chosen: is one in view "
                "while the others see the target too?"
            )
    plan.writes(*sources, within=folder)
    table = folder / "shots.csv"
    rows = [(one.shot, one.camera, one.picture.name) for one in frames]
    files: dict[Path, Content] = {table: Table.text([("shot", "camera", "image"), *rows])}
    files |= {path: partial(shutil.copyfile, source) for path, source in sources.items()}
    write_files(files, overwrite=overwrite, folder=folder)
    return frames


def _find_frame_beside(
    measured: Measured, taken: Mapping[int, Path], index: int, step: int
) -> tuple[Path | None, float]:
    """A frame's neighbour: its picture, None where there is none, and seconds to it."""
    if index + step not in taken:
        return None, float(step)
    seconds = measured.time[index + step] - measured.time[index]
    return (taken[index + step], seconds) if seconds * step > 0 else (None, float(step))
