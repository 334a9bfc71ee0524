"""Which photos are of which camera of a rig, and of one shot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.inputs import photos_of

if TYPE_CHECKING:
    from cubicfish_cli.library.rig_shots import Shot


def shots_of(sources: Sequence[str], cameras: Sequence[str]) -> dict[str, Shot]:
    """The shots that the user named: name -> the photo of each camera.

    A source is a folder with a folder for each camera, a camera's own folder, or a photo. Photos
    belong to the camera that their folder is called after, or their own name begins with; where
    nothing is called after a camera, sources are in the cameras' order.

    Raises:
        click.UsageError: it is not known which camera a source is of.
        PhotoError: one holds no photo.
        FitError: a camera's photos would be of one shot twice.

    """
    from cubicfish_cli.fitting.rig.shots import shots_by_name
    from cubicfish_cli.photos import natural_key, shown

    paths = [Path(source) for source in sources]
    inside = [path / name for path in paths for name in cameras if (path / name).is_dir()]
    if inside and len(paths) == 1:
        paths = inside
    owners = [_owner(path, cameras) for path in paths]
    if not any(owners) and len(paths) == len(cameras):
        owners = list(cameras)
    for path, owner in zip(paths, owners, strict=True):
        if owner is None:
            raise click.UsageError(
                f"which camera is {shown(path)} of? Call its folder after one of "
                f"{', '.join(cameras)}, or name one photo or folder of each, in that order"
            )
    photos: dict[str, list[Path]] = {name: [] for name in cameras}
    for path, owner in zip(paths, owners, strict=True):
        photos[str(owner)] += [photo.path for photo in photos_of([str(path)])]
    there = {name: own for name, own in photos.items() if own}
    if all(len(own) == 1 for own in there.values()):
        one = next(iter(there.values()))[0].stem
        return {one: {name: own[0] for name, own in there.items()}}
    if len(there) == 1:
        ((name, own),) = there.items()
        return {path.stem: {name: path} for path in own}
    matched = shots_by_name(list(there), [[str(path) for path in own] for own in there.values()])
    shots: dict[str, dict[str, Path]] = {}
    for name, index_of in zip(there, matched.photos, strict=True):
        for photo, index in index_of.items():
            shots.setdefault(matched.names[index], {})[name] = Path(photo)
    return dict(sorted(shots.items(), key=lambda item: natural_key(item[0])))


def _owner(path: Path, cameras: Sequence[str]) -> str | None:
    """The camera that a photo or a folder is called after."""
    own = path.absolute()
    called = own.name if own.is_dir() else own.parent.name
    if called in cameras:
        return called
    starts = [name for name in cameras if own.name.startswith(name)]
    return max(starts, key=len, default=None)
