"""Which photos of several cameras are of one shot: taken at the same moment."""

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath

from cubicfish.errors import FitError
from cubicfish.files.frame_names import FrameName
from cubicfish.wording import quoted

TOLERANCE = 5e-3
"""How far apart photos of one time may be, seconds."""
Row = tuple[str, str, str]


@dataclass(frozen=True, kw_only=True)
class Shots:
    """The shots of a rig.

    Attributes:
        names: of the shots, in order.
        photos: for each camera, which shot each of its photos is of: photo's name -> index.

    """

    names: tuple[str, ...]
    photos: tuple[Mapping[str, int], ...]


Matching = str | Sequence[Row] | Shots
"""Which photos are of one shot: those of one ``name``, of one ``time``, rows (shot, camera, photo),
or the shots themselves."""
Times = Mapping[str, Mapping[str, float]]
"""By camera and photo, seconds on one clock."""


def match_shots(
    photos: Mapping[str, Sequence[str]],
    shots: Matching,
    tolerance: float | None = None,
    times: Times | None = None,
) -> Shots:
    """The shots of photos (by camera), as :func:`calibrate_rig` is asked for them.

    Raises:
        FitError: it is not known how, or no two cameras share a shot.

    """
    if isinstance(shots, Shots):
        return shots
    if not isinstance(shots, str):
        return shots_of_table(photos, shots)
    if shots == "name":
        return shots_by_name(photos)
    if shots == "time":
        known = times or {}
        found = {camera: times_of(names, known.get(camera)) for camera, names in photos.items()}
        return shots_by_time(photos, found, TOLERANCE if tolerance is None else tolerance)
    raise FitError(f"shots {quoted(shots)} is not known: use 'name', 'time', or rows")


def shots_by_name(photos: Mapping[str, Sequence[str]]) -> Shots:
    """Photos (by camera) of the same name, whatever their folder and kind of file, are one shot.

    Where no name comes twice, what all photos of a camera begin and end with is left out:
    ``left01.png`` and ``right01.png`` are then one shot.

    Raises:
        FitError: two photos of a camera have one name, or no two cameras share one.

    """
    stems = [[Path(name).stem for name in names] for names in photos.values()]
    if not _is_any_shared(stems):
        stems = [_cut_common_ends(names) for names in stems]
    for (camera, names), own in zip(photos.items(), stems, strict=True):
        seen: dict[str, str] = {}
        for name, stem in zip(names, own, strict=True):
            if seen.setdefault(stem, name) != name:
                raise FitError(
                    f"camera {camera}: {quoted(seen[stem])} and {quoted(name)} would be of one "
                    "shot",
                    do="give each photo of a camera a name of its own, or list the shots with "
                    "{shots}",
                    arguments={"shots": "shots"},
                )
    if not _is_any_shared(stems):
        raise FitError(
            f"no photo of {next(iter(photos))} is called as one of another camera, so no two "
            "cameras share a shot",
            do="call the photos of a shot alike, or list them with {shots}",
            arguments={"shots": "shots"},
        )
    return _number_shots(
        dict(zip(*pair, strict=True)) for pair in zip(photos.values(), stems, strict=True)
    )


def times_of(photos: Iterable[str], times: Mapping[str, float] | None) -> dict[str, float]:
    """When photos were taken, by a table (in which folders may be left out), or by their names.

    Photos whose time is not known are left out.
    """
    if times is None:
        found = {photo: time_of(photo) for photo in photos}
    else:
        found = {photo: times.get(photo, times.get(os.path.basename(photo))) for photo in photos}
    return {photo: time for photo, time in found.items() if time is not None}


def shots_by_time(
    photos: Mapping[str, Sequence[str]],
    times: Times,
    tolerance: float,
) -> Shots:
    """Photos (by camera) that were taken at one time are one shot: each with the nearest of others.

    Args:
        photos: by camera, their names.
        times: by camera and photo, seconds on one clock, as far as known.
        tolerance: how far from the first of a shot the others may be, seconds.

    Raises:
        FitError: a photo has no time, or no two cameras share one.

    """
    taken = sorted(
        (_refuse_timeless(camera, name, times[camera].get(name)), number, name)
        for number, (camera, names) in enumerate(photos.items())
        for name in names
    )
    found: list[dict[str, float]] = [{} for _ in photos]
    begin, seen, most = -float("inf"), set[int](), 0
    for time, camera, name in taken:
        if time - begin > tolerance or camera in seen:
            begin, seen = time, set()
        seen.add(camera)
        most = max(most, len(seen))
        found[camera][name] = begin
    if most < 2:
        raise FitError(
            f"no two cameras have photos within {1e3 * tolerance:g} ms",
            do="check that their times are of one clock, or say a larger {tolerance}",
            arguments={"tolerance": "tolerance"},
        )
    return _number_shots({name: f"{key:020.6f}" for name, key in own.items()} for own in found)


def _refuse_timeless(camera: str, name: str, time: float | None) -> float:
    if time is None:
        raise FitError(
            f"camera {camera}: {quoted(name)} has no time in its name",
            do="list the shots with {shots}, or leave {tolerance} out",
            arguments={"shots": "shots", "tolerance": "tolerance"},
        )
    return time


def shots_of_table(photos: Mapping[str, Sequence[str]], rows: Sequence[Row]) -> Shots:
    """Shots of photos (by camera) as a table lists them: (shot, camera, photo).

    Photos that are not listed take no part.

    Raises:
        FitError: a row names a camera that is not there, or a photo or a camera twice.

    """
    listed: dict[str, dict[str, str]] = {camera: {} for camera in photos}
    for shot, camera, photo in rows:
        if camera not in photos:
            raise FitError(
                f"shot {quoted(shot)}: there is no camera {quoted(camera)}: the cameras are "
                + ", ".join(photos)
            )
        known = {os.path.basename(name): name for name in photos[camera]}
        name = photo if photo in photos[camera] else known.get(photo, "")
        if not name:
            continue  # a photo in which nothing was found
        if name in listed[camera] or shot in listed[camera].values():
            raise FitError(
                f"shot {quoted(shot)}: camera {camera} has two photos of a shot, or one of two"
            )
        listed[camera][name] = shot
    if not any(listed.values()):
        raise FitError("no row of shots is of these photos: each is (shot, camera, photo)")
    return _number_shots(listed.values())


def _number_shots(photos: Iterable[Mapping[str, str]]) -> Shots:
    """Shots by what each camera's photos say that theirs is called."""
    photos = list(photos)
    names = sorted({key for own in photos for key in own.values()})
    index = {name: number for number, name in enumerate(names)}
    return Shots(
        names=tuple(names),
        photos=tuple({name: index[key] for name, key in own.items()} for own in photos),
    )


def _is_any_shared(stems: Sequence[Sequence[str]]) -> bool:
    names = [name for own in stems for name in set(own)]
    return len(set(names)) < len(names)


def _cut_common_ends(names: Sequence[str]) -> list[str]:
    """What sets names apart: from the first to the last digit or letter in which they differ.

    Digits stay whole, since a digit that all begin with is part of their numbers.
    """
    first = os.path.commonprefix(names)  # noqa: RUF071 (letter by letter)
    first = re.sub(r"\d.*$", "", first, flags=re.DOTALL)
    rest = [name[len(first) :] for name in names]
    last = os.path.commonprefix([name[::-1] for name in rest])[::-1]  # noqa: RUF071
    last = re.sub(r"^.*\d", "", last, flags=re.DOTALL)
    return [name[: len(name) - len(last)] for name in rest]


# Digits of a time since 1970 in seconds, milliseconds, microseconds and nanoseconds.
_SINCE_1970 = {10: 1.0, 13: 1e-3, 16: 1e-6, 19: 1e-9}
_NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?")


def time_of(photo: str) -> float | None:
    """When a photo was taken, as its name says, seconds; None where it does not.

    A frame of a film has it, and so have names that hold a time since 1970 (in seconds, or
    whole milliseconds, microseconds or nanoseconds), or nothing but a number with a point.
    """
    frame = FrameName.read(photo)
    if frame is not None:
        return frame[1]
    path = PurePath(photo)
    # A name without a suffix may be a number with a point.
    stem = path.name if _NUMBER.fullmatch(path.name) else path.stem
    numbers = [found[0] for found in _NUMBER.finditer(stem)]
    for number in numbers:
        unit = _SINCE_1970.get(len(number.split(".")[0]))
        if unit is not None and number.split(".")[0][0] == "1":
            return float(number) * unit
    return float(numbers[0]) if len(numbers) == 1 and numbers[0] == stem and "." in stem else None
