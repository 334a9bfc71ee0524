"""Undistorting files: photos, videos or the shots of a rig."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.app.paths import path_or_none
from cubicfish_cli.app.photos import SUFFIXES, VIDEO_SUFFIXES, photo_size, shown
from cubicfish_cli.app.run import Run
from cubicfish_cli.app.undistortion.batch import Job, Size, Views, Write, write_many, write_one
from cubicfish_cli.app.undistortion.choose import ChosenView
from cubicfish_cli.app.undistortion.images import check_suffix, part_name
from cubicfish_cli.app.words.phrases import plural
from cubicfish_cli.core.errors import CubicfishError, OutputError, UsageError, ViewError
from cubicfish_cli.core.files import Content, refuse_existing, refuse_outside, write_files

if TYPE_CHECKING:
    from cubicfish_cli.commands.undistort import PictureOptions


@dataclass(frozen=True, kw_only=True)
class UndistortedFiles:
    """Result of undistorting photos or videos.

    Attributes:
        kind: of the sources: ``photo``, ``video``, or what an extension calls its own.
        written: name of a source -> its pictures or its video.
        failures: those that failed, and why.
        skipped: those whose results existed already.
        model: the file of the camera; None for one without a file.
        view: the view of the first; None if none was rendered.
        extras: masks, virtual cameras and tables that were written.

    """

    kind: str
    written: Mapping[str, Sequence[Path]]
    failures: Mapping[str, CubicfishError]
    skipped: tuple[str, ...] = ()
    model: Path | None = None
    view: ChosenView | None = None
    extras: Sequence[Path] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """The pictures or videos."""
        return tuple(path for own in self.written.values() for path in own)

    @property
    def failed(self) -> dict[str, str]:
        """Name of a source -> why it failed, in a line."""
        return {name: str(why) for name, why in self.failures.items()}

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish undistort --json`` prints."""
        return {
            **({} if self.model is None else {"model": self.model}),
            "images": len(self.written),
            "files": self.files,
            "skipped": self.skipped,
            "failed": [_failure_record(name, why) for name, why in self.failures.items()],
            "view": self.view and self.view.as_record(),
            "extra_files": self.extras,
        }


def _failure_record(name: str, error: CubicfishError) -> dict[str, Any]:
    """Return a failure as plain data: a finding, and its name and problem."""
    from cubicfish_cli.app.words.catalogue import say_error
    from cubicfish_cli.core.codes import Code, Severity
    from cubicfish_cli.core.finding import Finding

    problem = say_error(error)
    told = Finding(
        code=Code.FAILED, severity=Severity.BAD, images=(name,), figures={"problem": problem}
    )
    return {**told.as_record(), "image": name, "problem": problem}


Jobs = tuple[Sequence[Job], Sequence[Job]]
"""The sources to render, and those that are left out since their results exist."""


def plan_jobs(
    kind: str,
    sources: Mapping[str, tuple[str, Mapping[str, Path]]],
    output: Path,
    options: PictureOptions,
    run: Run,
    *,
    alone: bool,
) -> Jobs:
    """Plan the results of sources, and refuse before any work what cannot be done.

    Args:
        kind: the kind of source, in a word.
        sources: name -> the name of the result in a folder, and photos.
        output: a folder; for one source that is named ``alone`` also a name for its result.
        options: how they are rendered.
        run: how the work is done.
        alone: whether there is one source, named by itself.

    Raises:
        UsageError: ``output`` does not suit them, or the options do not go together.
        OutputError: a source would be replaced by its own result, or a result cannot be written,
            or exists and may be neither replaced nor skipped.

    """
    if options.skip_existing and run.overwrite:
        raise UsageError("--skip-existing and --overwrite exclude each other")
    to_folder = _is_folder(output, "" if alone else plural(len(sources), kind))
    if kind == "video" and not to_folder and output.suffix.lower() not in VIDEO_SUFFIXES:
        raise UsageError(
            f"{shown(output)} is no video: name a video such as {shown(output.with_suffix('.mp4'))}"
        )
    jobs = []
    for name, (result, photos) in sources.items():
        path = output / result if to_folder else output
        outputs = {part: part_name(path, part) for part in options.parts}
        for one in outputs.values():
            if one.exists() and any(one.samefile(photo) for photo in photos.values()):
                raise OutputError(
                    f"{shown(one)} is the photo itself: choose another name or folder for OUT"
                )
        jobs.append(Job(name=name, photos=photos, outputs=outputs))
    if to_folder:
        refuse_outside(output, (path for job in jobs for path in job.outputs.values()))
    options.refuse_unused(kind, {path.suffix for job in jobs for path in job.outputs.values()})
    left: list[Job] = []
    skipped: list[Job] = []
    for job in jobs:
        # A run that was killed may have left some of a cube's pictures.
        lacking = {
            part: path
            for part, path in job.outputs.items()
            if not (options.skip_existing and path.is_file())
        }
        for path in lacking.values() if kind != "video" else ():
            check_suffix(path)
        refuse_existing(
            *lacking.values(), overwrite=run.overwrite, can_skip=not options.skip_existing
        )
        (left if lacking else skipped).append(replace(job, outputs=lacking or job.outputs))
    return left, skipped


def _is_folder(output: Path, several: str) -> bool:
    """Return whether results go into a folder: several do, and one if no file is named.

    Args:
        output: the folder or file.
        several: how many results there are, in words; empty for one.

    Raises:
        UsageError: several results would go into one file.

    """
    if not several:
        return output.is_dir() or not output.suffix
    if output.suffix.lower() in SUFFIXES | VIDEO_SUFFIXES and not output.is_dir():
        raise UsageError(
            f"{shown(output)} is the name of one file, and {several} become a folder: write "
            f"{shown(output.with_suffix(''))}{os.sep}"
        )
    return True


def write_pictures(
    kind: str,
    jobs: Jobs,
    views: Views,
    options: PictureOptions,
    run: Run,
    *,
    model: Path | None,
    write: Write | None = None,
    size_of: Callable[[Path], Size] = photo_size,
) -> UndistortedFiles:
    """Render what was planned, and write masks and cameras beside it.

    Args:
        kind: the kind of source, in a word.
        jobs: the sources, and the files of their results.
        views: the view of each.
        options: how they are rendered.
        run: how the work is done.
        model: the file of the camera or rig, for the record.
        write: writes the result of a source that is no photo.
        size_of: returns the size of a source.

    Raises:
        OutputError: a file beside the results exists, and it may be neither replaced nor skipped.
        ViewError: a mask or a camera would be another one for each photo.

    """
    left, skipped = jobs
    files: dict[Path, Content] = {}
    if (options.mask is not None or options.virtual_camera is not None) and (left or skipped):
        sources = [job.source for job in (*left, *skipped)]
        views_of = [views.chosen(source, size_of(source)) for source in sources]
        if any(one is not views_of[0] for one in views_of):
            raise ViewError(
                "these photos have a mask and a virtual camera each, since their sizes or planes "
                "differ: do them one at a time"
            )
        from cubicfish_cli.app.undistortion.map_formats import view_files

        maps = views.maps(sources[0], size_of(sources[0]))
        mask, virtual_camera = path_or_none(options.mask), path_or_none(options.virtual_camera)
        files = view_files(maps, mask=mask, beside=virtual_camera)
        if options.skip_existing:
            files = {path: content for path, content in files.items() if not path.is_file()}
        refuse_existing(*files, overwrite=run.overwrite, can_skip=not options.skip_existing)
    extras = write_files(files, overwrite=run.overwrite)
    # Videos are rendered one after the other, and each reports its own progress.
    counted = None if write else run.listener.counting("Undistorting")
    failures = write_many(
        left,
        write or partial(write_one, render=views, quality=options.quality),
        workers=1 if write else run.jobs or os.cpu_count() or 1,
        overwrite=run.overwrite,
        progress=counted or (lambda done, total: None),
        executor=run.executor if left else None,
    )
    written = {job.name: tuple(job.outputs.values()) for job in left if job.name not in failures}
    done = next((job.source for job in left if job.name in written), None)
    return UndistortedFiles(
        kind=kind,
        written=written,
        failures=failures,
        skipped=tuple(job.name for job in skipped),
        model=model,
        view=None if done is None else views.chosen(done, size_of(done)),
        extras=extras,
    )
