"""Which photos of several cameras are of one shot: taken at the same moment."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cubicfish_cli.core.errors import FitError
from cubicfish_cli.core.wording import quoted


@dataclass(frozen=True, kw_only=True)
class Shots:
    """The shots of a rig.

    Attributes:
        names: of the shots, in order.
        photos: for each camera, which shot each of its photos is of: photo's name -> index.

    """

    names: tuple[str, ...]
    photos: tuple[Mapping[str, int], ...]


def shots_by_name(cameras: Sequence[str], photos: Sequence[Sequence[str]]) -> Shots:
    """Photos of the same name, whatever their folder and kind of file, are one shot.

    Where no name comes twice, what all photos of a camera begin and end with is left out:
    ``left01.png`` and ``right01.png`` are then one shot.

    Args:
        cameras: names of the cameras.
        photos: for each camera the names of its photos.

    Raises:
        FitError: two photos of a camera have one name, or no two cameras share one.

    """
    stems = [[_stem(name) for name in names] for names in photos]
    if not _shared(stems):
        stems = [_without_common_ends(names) for names in stems]
    for camera, names, own in zip(cameras, photos, stems, strict=True):
        seen: dict[str, str] = {}
        for name, stem in zip(names, own, strict=True):
            if stem in seen:
                raise FitError(
                    f"camera {camera}: {quoted(seen[stem])} and {quoted(name)} would be of one "
                    "shot: give each photo of a camera a name of its own, or list the shots with "
                    "--shots"
                )
            seen[stem] = name
    if not _shared(stems):
        raise FitError(
            f"no photo of {cameras[0]} is called as one of another camera, so no two cameras share "
            "a shot: call the photos of a shot alike, or list them with --shots"
        )
    return _shots(photos, stems)


def shots_by_time(
    cameras: Sequence[str],
    photos: Sequence[Sequence[str]],
    times: Sequence[Mapping[str, float]],
    tolerance: float,
) -> Shots:
    """Photos that were taken at one time are one shot: each with the nearest of other cameras.

    Args:
        cameras: names of the cameras.
        photos: for each camera the names of its photos.
        times: for each camera its photos' times, seconds on one clock.
        tolerance: how far from the first of a shot the others may be, seconds.

    Raises:
        FitError: a photo has no time, or no two cameras share one.

    """
    taken = sorted(
        (_known_time(camera, name, own), number, name)
        for number, (camera, names, own) in enumerate(zip(cameras, photos, times, strict=True))
        for name in names
    )
    begins: list[float] = []
    found: list[list[tuple[float, str] | None]] = []
    for time, camera, name in taken:
        if not begins or time - begins[-1] > tolerance or found[-1][camera] is not None:
            begins.append(time)
            found.append([None] * len(cameras))
        found[-1][camera] = (time, name)
    if all(sum(one is not None for one in shot) < 2 for shot in found):
        raise FitError(
            f"no two cameras have photos within {1e3 * tolerance:g} ms: check that their times are "
            "of one clock, or say a larger --tolerance"
        )
    keys = [f"{begin:020.6f}" for begin in begins]
    of_camera = [
        [(shot[number], key) for shot, key in zip(found, keys, strict=True)]
        for number in range(len(cameras))
    ]
    kept = [[(one[1], key) for one, key in own if one is not None] for own in of_camera]
    return _shots(
        [[name for name, _ in own] for own in kept], [[key for _, key in own] for own in kept]
    )


def _known_time(camera: str, name: str, times: Mapping[str, float]) -> float:
    name = name if name in times else os.path.basename(name)
    if name not in times:
        raise FitError(
            f"camera {camera}: {quoted(name)} has no time in its name: list the shots with "
            "--shots, or leave --tolerance out"
        )
    return times[name]


def shots_of_table(
    cameras: Sequence[str], photos: Sequence[Sequence[str]], rows: Sequence[tuple[str, str, str]]
) -> Shots:
    """Shots as a table lists them: (shot, camera, photo).

    Photos that are not listed take no part.

    Raises:
        FitError: a row names a camera or a photo that is not there, or a photo twice.

    """
    listed: list[dict[str, str]] = [{} for _ in cameras]
    for shot, camera, photo in rows:
        if camera not in cameras:
            raise FitError(
                f"shot {quoted(shot)}: there is no camera {quoted(camera)}: the cameras are "
                + ", ".join(cameras)
            )
        own = listed[cameras.index(camera)]
        known = {os.path.basename(name): name for name in photos[cameras.index(camera)]}
        name = photo if photo in photos[cameras.index(camera)] else known.get(photo, "")
        if not name:
            continue  # a photo in which nothing was found
        if name in own or shot in own.values():
            raise FitError(
                f"shot {quoted(shot)}: camera {camera} has two photos of a shot, or one of two"
            )
        own[name] = shot
    kept = [
        [name for name in names if name in own] for names, own in zip(photos, listed, strict=True)
    ]
    return _shots(
        kept, [[own[name] for name in names] for names, own in zip(kept, listed, strict=True)]
    )


def _shots(photos: Sequence[Sequence[str]], keys: Sequence[Sequence[str]]) -> Shots:
    names = sorted({key for own in keys for key in own})
    index = {name: number for number, name in enumerate(names)}
    return Shots(
        names=tuple(names),
        photos=tuple(
            {name: index[key] for name, key in zip(own, key_of, strict=True)}
            for own, key_of in zip(photos, keys, strict=True)
        ),
    )


def _stem(name: str) -> str:
    return os.path.splitext(os.path.basename(name))[0]


def _shared(stems: Sequence[Sequence[str]]) -> bool:
    names = [name for own in stems for name in set(own)]
    return len(set(names)) < len(names)


def _without_common_ends(names: Sequence[str]) -> list[str]:
    """What sets names apart: from the first to the last digit or letter in which they differ.

    Digits stay whole, since a digit that all begin with is part of their numbers.
    """
    first = re.sub(r"\d.*$", "", _common_start(names), flags=re.DOTALL)
    rest = [name[len(first) :] for name in names]
    last = _common_start([name[::-1] for name in rest])[::-1]
    last = re.sub(r"^.*\d", "", last, flags=re.DOTALL)
    return [name[: len(name) - len(last)] for name in rest]


def _common_start(names: Sequence[str]) -> str:
    start = 0
    for letters in zip(*names, strict=False):
        if len(set(letters)) > 1:
            break
        start += 1
    return names[0][:start] if names else ""
