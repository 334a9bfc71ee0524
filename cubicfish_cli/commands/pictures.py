"""Undistorting files: photos, videos or the shots of a rig."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import (
    CubicfishError,
    Event,
    Listener,
    OutputError,
    Run,
    UsageError,
    ViewError,
    shown,
)
from cubicfish.files import Content, Fingerprint, write_files
from cubicfish.photos import PictureFile
from cubicfish.views import ChosenView, ViewOptions
from cubicfish_cli.inputs.paths import path_or_none
from cubicfish_cli.plan import Plan
from cubicfish_cli.undistortion.batch import Job, Views, write_many
from cubicfish_cli.undistortion.images import check_suffix
from cubicfish_cli.words.phrases import plural

if TYPE_CHECKING:
    from cubicfish_cli.commands.undistort import PictureOptions


# Says in a folder of results whose they are.
_RECORD = ".undistorted.json"


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
        """Return plain data: what ``cubicfish undistort --json`` prints.

        Keys:
            model: the camera's file
            images: how many photos, videos or shots were rendered
            files: the pictures or videos
            skipped: those whose result existed (with --skip-existing)
            failed: those that could not be rendered, a record each: image, problem
            view: of the first one: what is shown: kind, size, words, parts (the six of a cube),
                hfov_deg and vfov_deg where it has them, cut (whether the camera sees more than
                this kind can show), and what else the kind has; null where nothing was rendered
            extra_files: the mask and the virtual camera, where they were asked for

        """
        return {
            **({} if self.model is None else {"model": self.model}),
            "images": len(self.written),
            "files": self.files,
            "skipped": self.skipped,
            "failed": [_record_failure(name, why) for name, why in self.failures.items()],
            "view": self.view and self.view.as_record(),
            "extra_files": self.extras,
        }


def _record_failure(name: str, error: CubicfishError) -> dict[str, Any]:
    """Return a failure as plain data: a finding, and its name and problem."""
    from cubicfish import Finding
    from cubicfish.judge import Code, Severity
    from cubicfish_cli.words.sentences import record_of, render_error

    problem = render_error(error)
    failed = Finding(
        code=Code.FAILED, severity=Severity.BAD, images=(name,), figures={"problem": problem}
    )
    return {**record_of(failed), "image": name, "problem": problem}


@dataclass(frozen=True, kw_only=True)
class PicturePlan:
    """Which pictures or videos are made of which sources, and how.

    Attributes:
        kind: the kind of source, in a word.
        jobs: the sources to render, and the files of their results.
        skipped: those that are left out since their results exist.
        beside: the masks and the virtual cameras to write.
        options: how they are rendered.
        register: what is read and written.
        folder: where results go that keep the names of their sources; None for one file.

    """

    kind: str
    jobs: Sequence[Job]
    skipped: Sequence[Job]
    beside: Sequence[Path]
    options: PictureOptions
    register: Plan
    folder: Path | None = None


def plan_pictures(
    kind: str,
    sources: Mapping[str, tuple[str, Mapping[str, Path]]],
    output: Path,
    options: PictureOptions,
    register: Plan,
    *,
    alone: bool,
) -> PicturePlan:
    """Plan the results of sources, and refuse before any work what cannot be done.

    Args:
        kind: the kind of source, in a word.
        sources: name -> the name of the result in a folder, and photos.
        output: a folder; for one source that is named ``alone`` also a name for its result.
        options: how they are rendered.
        register: what is read beside the sources; what is written is added.
        alone: whether there is one source, named by itself.

    Raises:
        UsageError: ``output`` does not suit them, or the options do not go together.
        OutputError: an input would be replaced by a result, or a result cannot be written, or
            exists and may be neither replaced nor skipped.

    """
    to_folder = _is_folder(output, "" if alone else plural(len(sources), kind))
    jobs, results = list[Job](), list[Path]()
    for name, (result, photos) in sources.items():
        path = output / result if to_folder else output
        jobs.append(Job(name=name, photos=photos, outputs=options.results(path)))
        results += jobs[-1].outputs.values()
    register.reads(*(job.photos for job in jobs))
    beside = register.writes(*options.files_beside())
    lacking = {*register.writes(*results, within=output if to_folder else None)}
    options.refuse_unused(kind, {path.suffix for path in results})
    _check_suffixes(lacking, kind)
    # A run that was killed may have left some of a cube's pictures.
    left = [job.lacking(lacking) for job in jobs]
    done = [job for job, own in zip(jobs, left, strict=True) if not own.outputs]
    return PicturePlan(
        kind=kind,
        jobs=[job for job in left if job.outputs],
        skipped=done,
        beside=beside,
        options=options,
        register=register,
        folder=output if to_folder else None,
    )


def _check_suffixes(paths: Iterable[Path], kind: str) -> None:
    for path in paths:
        if kind != "video":
            check_suffix(path)
        elif path.suffix.lower() not in PictureFile.VIDEO_SUFFIXES:
            raise UsageError(
                f"{shown(path)} is no video: name a video such as {shown(path.with_suffix('.mp4'))}"
            )


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
    if (
        output.suffix.lower() in PictureFile.SUFFIXES | PictureFile.VIDEO_SUFFIXES
        and not output.is_dir()
    ):
        raise UsageError(
            f"{shown(output)} is the name of one file, and {several} become a folder: write "
            f"{shown(output.with_suffix(''))}{os.sep}"
        )
    return True


def write_pictures(
    plan: PicturePlan, views: Views, run: Run, *, model: Path | None
) -> UndistortedFiles:
    """Render what was planned, and write masks and cameras beside it.

    Args:
        plan: the sources, and the files of their results.
        views: the view of each.
        run: how the work is done.
        model: the file of the camera or rig, for the record.

    Raises:
        OutputError: a file beside the results cannot be written.
        ViewError: a mask or a camera would be another one for each photo.
        OutputError: pictures that exist, and would be skipped, are another camera's.

    """
    record = _find_record(plan, model)
    if run.executor is None:  # a run that is killed has said whose its pictures are
        write_files(record, overwrite=True, folder=plan.folder)
    extras = plan.register.write(_draw_beside(plan, views)) if plan.beside else []
    work = run
    if plan.kind == "video":  # one after the other, and each reports its own progress
        work = replace(run, jobs=1, listener=Listener())
    try:
        failures = write_many(plan.jobs, views.writer(plan.options.quality), work)
    finally:  # a scheduler that is not there leaves nothing
        if run.executor is not None:
            _keep_record(plan, record)
    for size, photo in views.rescaled.items():
        own = views.calibrated_size
        run.listener.tell(
            Event.RESCALED,
            photo=photo,
            size="{}x{}".format(*size),
            calibrated="{}x{}".format(*own),
            times=size[0] / own[0],
            enlarged=size > own,
        )
    late = _list_written_meanwhile(plan, failures) if plan.options.skip_existing else []
    failures = {name: why for name, why in failures.items() if name not in late}
    done = [job for job in plan.jobs if job.name not in failures and job.name not in late]
    return UndistortedFiles(
        kind=plan.kind,
        written={job.name: tuple(job.outputs.values()) for job in done},
        failures=failures,
        skipped=(*(job.name for job in plan.skipped), *late),
        model=model,
        view=views.chosen_of(done[0]) if done else None,
        extras=extras,
    )


def _keep_record(plan: PicturePlan, record: Mapping[Path, Content]) -> None:
    """Write the record where anything was written at all."""
    if plan.folder is not None and plan.folder.is_dir():
        write_files(record, overwrite=True, folder=plan.folder)


def _list_written_meanwhile(plan: PicturePlan, failures: Mapping[str, CubicfishError]) -> list[str]:
    """List the jobs whose results another run has written since: they are as good."""
    return [
        job.name
        for job in plan.jobs
        if isinstance(failures.get(job.name), OutputError)
        and all(path.exists() for path in job.outputs.values())
    ]


def _find_record(plan: PicturePlan, model: Path | None) -> dict[Path, Content]:
    """Say in a folder of results by which camera and as which view they are made.

    Returns:
        The file to write; none where it says so already, or nobody knows what is there.

    Raises:
        OutputError: results that would be skipped are another camera's, or of another view.

    """
    if plan.folder is None or model is None:
        return {}
    path, digest = plan.folder / _RECORD, Fingerprint.of(model).sha256
    own = {"camera": str(model), "sha256": digest, "view": repr(plan.options.view or ViewOptions())}
    try:
        known = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        known = None
    if not isinstance(known, dict):
        return {} if plan.skipped else {path: json.dumps(own)}
    if all(known.get(key) == own[key] for key in ("sha256", "view")):
        return {}
    if plan.skipped:
        other = "view" if known.get("sha256") == digest else "camera"
        raise OutputError(
            f"{shown(plan.folder)} holds pictures of another {other} "
            f"({shown(str(known.get('camera')))}), which --skip-existing would mix with new ones: "
            "name another folder, or replace them with --overwrite"
        )
    return {path: json.dumps(own)}


def _draw_beside(plan: PicturePlan, views: Views) -> dict[Path, Content]:
    """Return the masks and the cameras that are to be written, of the one view of all sources."""
    from cubicfish_cli.undistortion.map_formats import view_files

    sources = [*plan.jobs, *plan.skipped]
    first, *others = (views.chosen_of(job) for job in sources)
    if any(one is not first for one in others):
        raise ViewError(
            "these photos have a mask and a virtual camera each, since their sizes or planes "
            "differ: do them one at a time"
        )
    source = sources[0].source
    maps = views.maps(source, views.size_of(source))
    mask, camera = map(path_or_none, (plan.options.mask, plan.options.virtual_camera))
    files = view_files(maps, mask=mask, beside=camera)
    return {path: files[path] for path in plan.beside}
