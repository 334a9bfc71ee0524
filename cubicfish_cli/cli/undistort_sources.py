"""Which photos or videos ``cubicfish undistort`` is told to do, and where results go."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.progress import listening
from cubicfish_cli.cli.view_options import PlaneOptions, ViewOptions

if TYPE_CHECKING:
    from cubicfish_cli.library.undistorting import Plan


def plan_of(
    sources: Sequence[str], destination: Path, view: ViewOptions, plane: PlaneOptions
) -> tuple[Plan, bool]:
    """Which photo becomes which files, and whether a single file was named."""
    from cubicfish_cli.library.inputs import named_photos
    from cubicfish_cli.library.undistorting import Plan, videos_among
    from cubicfish_cli.photos import shown
    from cubicfish_cli.picture_headers import VIDEO_SUFFIXES

    names = _with_stdin(sources)
    found, others = videos_among(names)
    if found and others:
        raise click.UsageError("photos and videos together: do them one after the other")
    videos = [(path.name, path) for path in found]
    photos = videos
    if not videos:
        with listening() as listener:
            photos = [(photo.name, photo.path) for photo in named_photos(names, listener)]
    if videos and view.parts != ("",):
        raise click.UsageError("a cube of a video is one picture: add --layout cross")
    if videos and plane.board is not None:
        raise click.UsageError("--plane is for photos, each of which has its own pose")
    one = len(photos) == 1 and len(sources) == 1 and os.fspath(photos[0][1]) == sources[0]
    to_folder = not one or destination.is_dir() or os.fspath(destination).endswith(os.sep)
    if not one:
        refuse_a_file(destination, count(len(photos), "photo"))
    if videos and not to_folder and destination.suffix.lower() not in VIDEO_SUFFIXES:
        name = shown(destination.with_suffix(".mp4"))
        if not destination.suffix:
            name, kind = "flat.mp4", f"{shown(destination)}{os.sep} is a folder"
        else:
            kind = f"{shown(destination)} is no video"
        raise click.UsageError(f"{kind}: name a video such as {name}")
    plan = Plan.of(photos, destination, view.parts, to_folder=to_folder, videos=bool(videos))
    return plan, one


def refuse_a_file(destination: Path, several: str) -> None:
    """Refuse the name of a file for what becomes a folder.

    Raises:
        click.UsageError: it is one.

    """
    from cubicfish_cli.photos import SUFFIXES, shown
    from cubicfish_cli.picture_headers import VIDEO_SUFFIXES

    if destination.suffix.lower() in SUFFIXES | VIDEO_SUFFIXES and not destination.is_dir():
        raise click.UsageError(
            f"{shown(destination)} is the name of one file, and {several} become a folder: write "
            f"{shown(destination.with_suffix(''))}{os.sep}"
        )


def _with_stdin(sources: Sequence[str]) -> list[str]:
    """The sources, with the names that stdin lists in the place of '-'."""
    names: list[str] = []
    for source in sources:
        if source == "-":
            listed = [line.rstrip("\r\n") for line in sys.stdin]
            names += [name for name in listed if name]
            if not names:
                raise click.UsageError("stdin lists no photos: give one name a line")
        else:
            names.append(source)
    return names
