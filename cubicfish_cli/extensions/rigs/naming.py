"""Which input of a rig's commands is of which camera."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from glob import has_magic
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish import UsageError, quoted, shown
from cubicfish_cli.films.recordings import label_of
from cubicfish_cli.inputs.paths import in_folder, is_recording, paths_of
from cubicfish_cli.observe import films_among
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish import Calibration, CameraFile
    from cubicfish.files import StrPath


def named_cameras(
    cameras: Mapping[str, StrPath] | Sequence[StrPath], names: str | None
) -> dict[str, Path]:
    """Cameras by name, each with its input.

    Args:
        cameras: their inputs, by name or not.
        names: of cameras that come without, with commas between; None for those of their files.

    Raises:
        UsageError: they are fewer than two, or names are missing, double or none for files.

    """
    from cubicfish.rigs import RigCamera

    if isinstance(cameras, Mapping):
        inputs, called = paths_of(list(cameras.values())), list(cameras)
    else:
        inputs = paths_of(cameras)
        called = [*map(named_by, inputs)] if names is None else [*map(str.strip, names.split(","))]
    if len(inputs) < 2:
        raise UsageError("name two cameras or more: a folder of photos each, or a corners.csv")
    if len(called) != len(inputs):
        named = plural(len(called), "name")
        raise UsageError(f"--names has {named}, and there are {len(inputs)} cameras")
    for name in called:
        RigCamera.refuse_name(name, "camera", UsageError)
    RigCamera.refuse_same(called, "--names", UsageError)
    return dict(zip(called, inputs, strict=True))


def named_lenses(
    lenses: Mapping[str, Calibration | CameraFile | StrPath] | Sequence[Path], called: Iterable[str]
) -> dict[str, Calibration | CameraFile | Path]:
    """Cameras that are calibrated already, or their files, by name.

    Raises:
        UsageError: one names no camera.

    """
    if not isinstance(lenses, Mapping):  # left=left_calibration
        lenses = {name: path for name, _, path in (str(one).partition("=") for one in lenses)}
    for name in lenses:
        if name not in called:
            raise UsageError(
                f"--lens {quoted(name)} names no camera: write NAME=FILE with one of "
                f"{', '.join(called)}"
            )
    return {
        name: in_folder(Path(one)) if isinstance(one, str | os.PathLike) else one
        for name, one in lenses.items()
    }


def named_by(path: Path) -> str:
    """What a camera is called by where its photos are, or its calibration is."""
    path = path.absolute()
    path = path.parent if path.name in ("corners.csv", "camera.yaml") else path
    if is_recording(path):
        return label_of(path)
    if has_magic(path.name) and not path.exists():  # left*.png, or left/*.png
        begin = re.split(r"[*?[]", path.name)[0].rstrip("_-. ")
        return begin or path.parent.name
    return path.stem if path.suffix.lower() == ".csv" or films_among([path]) else path.name


def owners_of(paths: Sequence[Path], cameras: Sequence[str]) -> list[str]:
    """The camera that each photo, folder or table is of.

    They belong to the camera that their folder is called after, or their own name begins with;
    where each is called after the camera whose turn it is, or after none, they are in the cameras'
    order.

    Raises:
        UsageError: it is not known which camera one is of.

    """
    owners = [_find_owner(path.absolute(), cameras) for path in paths]
    in_order = zip(owners, cameras, strict=False)
    if len(paths) == len(cameras) and all(owner in ("", camera) for owner, camera in in_order):
        return list(cameras)
    for path, owner in zip(paths, owners, strict=True):
        if not owner:
            raise UsageError(
                f"which camera is {shown(path)} of? Call its folder after one of "
                f"{', '.join(cameras)}, or name one photo or folder of each, in that order"
            )
    return owners


def _find_owner(path: Path, cameras: Sequence[str]) -> str:
    """The camera that a photo, a folder or a table is called after; empty for none."""
    called = path.name if path.is_dir() else path.parent.name
    starts = [name for name in cameras if path.name.startswith(name)]
    return called if called in cameras else max(starts, key=len, default="")
