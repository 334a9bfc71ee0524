"""The files and folders that a caller names, checked before anything is loaded or done."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from glob import has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cubicfish import (
    CameraFileError,
    CubicfishError,
    Listener,
    PhotoError,
    UsageError,
    did_you_mean,
    quoted,
    shown,
)
from cubicfish.files import StrPath

if TYPE_CHECKING:
    from cubicfish import Run
    from cubicfish.photos import Photo
    from cubicfish_cli.inputs.target_source import TargetSource

RECORDING_SUFFIXES = (".bag", ".mcap", ".db3")
InputKind = Literal["photos", "corners", "points"]
_WITH_TOPIC = re.compile(r"(?P<file>.+?):(?P<topic>/.*)")


def in_folder(path: Path) -> Path:
    """The camera file that is meant: a folder stands for the camera.yaml in it.

    Raises:
        CameraFileError: the folder has none.

    """
    if not path.is_dir():
        return path
    inside = path / "camera.yaml"
    if inside.exists():
        return inside
    if (path / "rig.yaml").exists():
        raise CameraFileError(
            f"{path} is the folder of a rig: name one of its cameras, a folder in it, or do this "
            "with 'cubicfish rig'"
        )
    raise CameraFileError(
        f"{path} is a folder without a {inside.name}: name the folder that 'cubicfish "
        "calibrate' wrote, or a camera file"
    )


def refuse_picture(path: Path) -> None:
    """Refuse a photo or a film where a camera is meant.

    Raises:
        CameraFileError: it is one, by its name.

    """
    if path.suffix.lower() in (".yaml", ".yml"):
        return
    from cubicfish.photos import PictureFile  # slow to load

    suffix, files = path.suffix.lower(), PictureFile
    if suffix in files.SUFFIXES | files.VIDEO_SUFFIXES and path.is_file():
        kind = "photo" if suffix in files.SUFFIXES else "video"
        raise CameraFileError(
            f"{shown(path)} is a {kind}, not a camera: name the folder that 'cubicfish calibrate' "
            "wrote, or the camera.yaml in it"
        )


def calibration_files(model: Path) -> list[Path]:
    """A camera's file, and the others of its calibration that may lie beside it."""
    beside = ("corners.csv", "target.yaml", "target.refined.yaml")
    return [model, *(model.with_name(name) for name in beside)]


def paths_of(given: StrPath | Iterable[StrPath]) -> list[Path]:
    """Names that may come alone or several together."""
    return [Path(given)] if isinstance(given, str | os.PathLike) else list(map(Path, given))


def path_or_none(given: StrPath | None) -> Path | None:
    """A name that may be left out."""
    return None if given is None else Path(given)


def file_and_topic(path: Path) -> tuple[Path, str | None]:
    """Split a recording's name into its file or folder and the topic, None where it names none."""
    found = _WITH_TOPIC.fullmatch(str(path))
    if found is None or path.exists():
        return path, None
    return Path(found["file"]), found["topic"]


def kind_of_inputs(inputs: Sequence[Path]) -> InputKind:
    """What a caller names: photos (or films), a table of named corners, or one of points.

    Raises:
        UsageError: nothing is named, or a table beside something else.

    """
    if not inputs:
        raise UsageError("name photos, a folder of photos, or a corners.csv")
    tables = tables_among(inputs)
    if not tables:
        return "photos"
    if len(inputs) > 1:
        raise UsageError(f"{quoted(str(tables[0]))} must be the only input, as all CSV files")
    return "points" if holds_world_points(tables[0]) else "corners"


def check_inputs(
    kind: InputKind,
    inputs: Sequence[Path],
    target: TargetSource,
    run: Run,
    *,
    image_size: tuple[int, int] | None = None,
) -> None:
    """Refuse at once, before anything is loaded or done, what cannot be read or says nothing here.

    Raises:
        UsageError: an option would have no effect.
        CubicfishError: an input is not there.

    """
    for file, _ in map(file_and_topic, inputs):
        if not os.path.lexists(file) and not has_magic(str(file)):
            raise CubicfishError.missing(file)
    if kind != "points":
        target.check()
    elif target.is_known and not target.by_default:
        raise UsageError(
            "--target, --board and --square say what photos show, and 2D-3D pairs know their "
            "points: leave it out"
        )
    if kind == "photos":
        if image_size is not None:
            raise UsageError("--size is of CSV files: photos have their own size")
        return
    for name, given in (("--jobs", run.jobs is not None), ("--no-cache", run.anew)):
        if given:
            raise UsageError(
                f"{name} goes with photos and films, which are searched, not with CSV files"
            )


def tables_among(inputs: Sequence[Path]) -> list[Path]:
    """Those of the inputs that are tables, by their names."""
    return [path for path in inputs if path.suffix.lower() == ".csv"]


def holds_world_points(path: Path) -> bool:
    """Whether the header of a CSV file is that of correspondences."""
    try:
        if not path.is_file():  # a pipe might be waited for
            return False
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            lines = [file.readline(10_000) for _ in range(2)]
    except OSError:
        return False  # the reader says what is wrong with it
    header = lines[1] if lines[0].startswith("#") else lines[0]
    return {"X", "Y", "Z"} <= {cell.strip() for cell in header.split(",")}


def is_video(path: Path) -> bool:
    """Whether a file is a video, by its name."""
    from cubicfish.photos import PictureFile

    return path.suffix.lower() in PictureFile.VIDEO_SUFFIXES and not path.is_dir()


def is_recording(path: Path) -> bool:
    """Return whether a name means a recording, with or without topic: ``run.bag:/cam0/image``."""
    file, _ = file_and_topic(path)
    if file.is_dir():
        return (file / "metadata.yaml").is_file() and any(
            part.suffix.lower() in RECORDING_SUFFIXES for part in file.iterdir()
        )
    return file.suffix.lower() in RECORDING_SUFFIXES


def named_photos(
    inputs: Sequence[StrPath], listener: Listener, exclude: Sequence[Path] = ()
) -> list[Photo]:
    """The photos that are named; what may be missed among them is reported.

    Raises:
        PhotoError: there are none, or one cannot be used; as :func:`not_excluded`.

    """
    from cubicfish import Event
    from cubicfish.photos import find_photos

    lines: list[str] = []
    photos = find_photos(inputs, lines)
    for line in lines:
        listener.tell(Event.PASSED_OVER, line=line)
    kept = not_excluded([(photo.name, photo.path) for photo in photos], exclude)
    return [photos[at] for at in kept]


def not_excluded(photos: Sequence[tuple[str, Path]], exclude: Sequence[Path]) -> list[int]:
    """Which photos, each by its name and its file, no name and no pattern leaves out.

    Raises:
        PhotoError: a pattern means none of the photos, or no photo is left.

    """
    kept = list(range(len(photos)))
    for pattern in exclude:
        meant = {at for at, photo in enumerate(photos) if _is_meant(pattern, *photo)}
        if not meant:
            near = did_you_mean(pattern.name, [name for name, _ in photos])
            raise PhotoError(f"--exclude {quoted(str(pattern))} names none of the photos: {near}")
        kept = [at for at in kept if at not in meant]
    if not kept:
        raise PhotoError("--exclude leaves no photo")
    return kept


def _is_meant(pattern: Path, name: str, path: Path) -> bool:
    """Whether a name or pattern is that of a photo, as it is called or where it is."""
    if not pattern.name:
        return False
    whole, absolute = Path(os.path.abspath(path)), Path(os.path.abspath(pattern))
    if name == str(pattern) or whole == absolute:  # brackets of a name are no pattern
        return True
    return any(one.match(str(by)) for one in (Path(name), whole) for by in (pattern, absolute))
