"""Which photo or video becomes which files, as ``cubicfish undistort`` is told."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from glob import glob, has_magic
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli.chosen_views import PlaneOptions
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.inputs import photos_of
from cubicfish_cli.cli.video_options import is_video_name
from cubicfish_cli.cli.view_options import ViewOptions

if TYPE_CHECKING:
    from cubicfish_cli.undistortion.batch import PhotoJob


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is to be done.

    Attributes:
        jobs: the photos or videos.
        destination: OUT.
        one: whether a single file was named.
        videos: whether they are videos.
        skipped: those that are left out, since their results exist.

    """

    jobs: Sequence[PhotoJob]
    destination: Path
    one: bool
    videos: bool
    skipped: Sequence[PhotoJob] = ()

    @property
    def kind(self) -> str:
        """What the jobs are, in a word."""
        return "video" if self.videos else "photo"

    def size_of(self, job: PhotoJob) -> tuple[int, int]:
        """(width, height) of a photo, or of a video's frames."""
        if self.videos:
            from cubicfish_cli.undistortion.video import video_size

            return video_size(job.source)
        from cubicfish_cli.photos import photo_size

        return photo_size(job.source)

    def free(self, *, skip_existing: bool, overwrite: bool) -> Plan:
        """Leave out what exists, or refuse to go on."""
        from cubicfish_cli.files import refuse_existing
        from cubicfish_cli.undistortion.images import check_suffix

        jobs, skipped = [], []
        for job in self.jobs:
            for path in job.outputs:
                if not self.videos:
                    check_suffix(path)
            if skip_existing:  # a run that was killed may have left some of a cube's pictures
                there = frozenset(n for n, path in enumerate(job.outputs) if path.is_file())
                if len(there) == len(job.outputs):
                    skipped.append(job)
                    continue
                job = replace(job, kept=there)
            for path in job.wanted:
                refuse_existing(path, overwrite=overwrite, can_skip=not skip_existing)
            jobs.append(job)
        return replace(self, jobs=jobs, skipped=skipped)


def plan_of(
    sources: Sequence[str], destination: Path, view: ViewOptions, plane: PlaneOptions
) -> Plan:
    """Which photo becomes which files."""
    from cubicfish_cli.errors import OutputError
    from cubicfish_cli.photos import SUFFIXES, Photo, shown
    from cubicfish_cli.picture_headers import VIDEO_SUFFIXES
    from cubicfish_cli.undistortion.batch import PhotoJob

    names = _with_stdin(sources)
    videos = _videos(names)
    photos = [Photo(name=path.name, path=path) for path in videos] or photos_of(names)
    if len({photo.name for photo in photos}) < len(photos):
        raise OutputError("two videos have the same name: do them one at a time")
    if videos and view.parts != ("",):
        raise click.UsageError("a cube of a video is one picture: add --layout cross")
    if videos and plane.board is not None:
        raise click.UsageError("--plane is for photos, each of which has its own pose")
    one = len(photos) == 1 and len(sources) == 1 and os.fspath(photos[0].path) == sources[0]
    to_folder = not one or destination.is_dir() or os.fspath(destination).endswith(os.sep)
    parts = view.parts
    a_file = destination.suffix.lower() in SUFFIXES | VIDEO_SUFFIXES
    if a_file and not one and not destination.is_dir():
        raise click.UsageError(
            f"{shown(destination)} is the name of one file, and {count(len(photos), 'photo')} "
            f"become a folder: write {shown(destination.with_suffix(''))}{os.sep}"
        )
    if videos and not to_folder and destination.suffix.lower() not in VIDEO_SUFFIXES:
        name = shown(destination.with_suffix(".mp4"))
        if not destination.suffix:
            name, kind = "flat.mp4", f"{shown(destination)}{os.sep} is a folder"
        else:
            kind = f"{shown(destination)} is no video"
        raise click.UsageError(f"{kind}: name a video such as {name}")
    jobs: list[PhotoJob] = []
    for photo in photos:
        path = destination / photo.name if to_folder else destination
        outputs = tuple(
            path.with_name(f"{path.stem}_{part}{path.suffix}") if part else path for part in parts
        )
        for output in outputs:
            if output.exists() and output.samefile(photo.path):
                raise OutputError(
                    f"{shown(output)} is the photo itself: choose another name or folder for OUT"
                )
        jobs.append(PhotoJob(name=photo.name, source=photo.path, outputs=outputs))
    return Plan(jobs=jobs, destination=destination, one=one, videos=bool(videos))


def _videos(names: Sequence[str]) -> list[Path]:
    """The videos that the names and patterns mean; none when they mean photos.

    Raises:
        click.UsageError: they mean both.

    """
    paths = [
        Path(match)
        for name in names
        for match in (sorted(glob(name)) if has_magic(name) and not Path(name).exists() else [name])
    ]
    videos = [path for path in paths if is_video_name(path) and not path.is_dir()]
    if videos and len(videos) < len(paths):
        raise click.UsageError("photos and videos together: do them one after the other")
    return videos


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
