"""Photos and videos in files -> undistorted files, with what failed and why."""

from __future__ import annotations

import os
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from glob import glob, has_magic
from pathlib import Path
from typing import Any

from cubicfish_cli.errors import CubicfishError, OutputError, PhotoError
from cubicfish_cli.files import refuse_existing
from cubicfish_cli.formats.calibrated import Calibrated
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.library.asked import RUN, Run
from cubicfish_cli.library.pictures import Interpolation, rendering_of
from cubicfish_cli.library.views import Size, Views, ViewsBySize
from cubicfish_cli.listener import SILENT, Listener
from cubicfish_cli.photos import find_photos, photo_size, shown
from cubicfish_cli.picture_headers import VIDEO_SUFFIXES
from cubicfish_cli.undistortion.batch import FailedPhoto, PhotoJob, undistort_photos
from cubicfish_cli.undistortion.choose import ChosenView, SeenField
from cubicfish_cli.undistortion.images import Rendering, check_suffix
from cubicfish_cli.undistortion.video import Encoding, undistort_video, video_size
from cubicfish_cli.undistortion.view import Camera, View
from cubicfish_cli.undistortion.view_files import part_name
from cubicfish_cli.undistortion.views import default_view
from cubicfish_cli.words.codes import Code, Event, Severity
from cubicfish_cli.words.finding import Finding

StrPath = str | os.PathLike[str]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Which photo or video becomes which files.

    Attributes:
        jobs: the photos or videos.
        videos: whether they are videos.
        skipped: those that are left out, since their results exist.

    """

    jobs: Sequence[PhotoJob]
    videos: bool = False
    skipped: Sequence[PhotoJob] = ()

    @classmethod
    def of(
        cls,
        sources: Sequence[tuple[str, Path]],
        destination: Path,
        parts: Sequence[str] = ("",),
        *,
        to_folder: bool,
        videos: bool = False,
    ) -> Plan:
        """Files called after the photos or videos, or as ``destination`` is.

        Args:
            sources: names for messages and for files in a folder, and where they are.
            destination: a file or a folder.
            parts: of what is rendered of each, as in :class:`ChosenView`.
            to_folder: whether it is a folder.
            videos: whether they are videos.

        Raises:
            OutputError: two have one name, or one would be replaced by its own result.

        """
        if len({name for name, _ in sources}) < len(sources):
            raise OutputError("two videos have the same name: do them one at a time")
        jobs = []
        for name, source in sources:
            path = destination / name if to_folder else destination
            outputs = tuple(part_name(path, part) for part in parts)
            for output in outputs:
                if output.exists() and output.samefile(source):
                    raise OutputError(
                        f"{shown(output)} is the photo itself: choose another name or folder for "
                        "OUT"
                    )
            jobs.append(PhotoJob(name=name, source=source, outputs=outputs))
        return cls(jobs=jobs, videos=videos)

    @property
    def kind(self) -> str:
        """What the jobs are, in a word."""
        return "video" if self.videos else "photo"

    def size_of(self, job: PhotoJob) -> Size:
        """(width, height) of a photo, or of a video's frames."""
        return video_size(job.source) if self.videos else photo_size(job.source)

    def free(self, *, skip_existing: bool, overwrite: bool) -> Plan:
        """Leave out what exists, or refuse to go on.

        Raises:
            OutputError: a file cannot be written, or exists and may be neither replaced nor left.

        """
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
            refuse_existing(*job.wanted, overwrite=overwrite, can_skip=not skip_existing)
            jobs.append(job)
        return replace(self, jobs=jobs, skipped=skipped)

    def done(self, failures: Sequence[FailedPhoto]) -> list[PhotoJob]:
        """The jobs that did not fail."""
        failed = {failure.job.source for failure in failures}
        return [job for job in self.jobs if job.source not in failed]

    def as_record(
        self,
        done: Sequence[PhotoJob],
        failed: Sequence[dict[str, Any]],
        view: ChosenView | None,
        **more: Any,
    ) -> dict[str, Any]:
        """What was done or would be, as plain data."""
        return {
            "dry_run": False,
            "images": len(done),
            "files": [str(path) for job in done for path in job.wanted],
            "skipped": [job.name for job in self.skipped],
            "failed": failed,
            "view": view and view.as_record(),
            "extra_files": [],
            **more,
        }


@dataclass(frozen=True, kw_only=True)
class Undistorted:
    """What became of photos or videos.

    Attributes:
        files: the pictures or videos that were written.
        skipped: names of those whose result was there already.
        failed: name -> why it could not be done, in a line.

    """

    files: tuple[Path, ...]
    skipped: tuple[str, ...]
    failed: Mapping[str, str]


def undistort_files(
    photos: StrPath | Sequence[StrPath],
    folder: StrPath,
    camera: Calibrated | CubicCamera,
    view: View | None = None,
    *,
    interpolation: Interpolation = "linear",
    border: tuple[float, float, float] = (0.0, 0.0, 0.0),
    quality: int | None = None,
    jobs: int | None = 1,
    overwrite: bool = False,
    skip_existing: bool = False,
    listener: Listener = SILENT,
) -> Undistorted:
    """Undistort photos or videos into a folder, as ``cubicfish undistort`` does.

    Results keep the names of their photos, and with them depth, channels and a JPEG's EXIF record.
    One that fails does not stop the others.

    Args:
        photos: files, folders and globs of photos, or files and globs of videos; of the size that
            the camera was calibrated for, or an exact rescale of it.
        folder: where the results go; it is made if it is not there.
        camera: the camera or a fit.
        view: what to render; by default flat, as large as each photo and with its scale in the
            middle, up to 120° across.
        interpolation: how pixels are blended.
        border: (red, green, blue) of what the camera does not see, 0 to 1.
        quality: of JPEG and lossy WebP files, 1 to 100; None keeps that of the photo.
        jobs: photos to work on at a time; None for one per processor.
        overwrite: whether existing files may be replaced.
        skip_existing: leaves out photos whose result is there.
        listener: who is told how far it is.

    Returns:
        The ``files`` that were written, what was ``skipped``, and what ``failed`` and why.

    Raises:
        PhotoError: there are none, or photos and videos are mixed.
        OutputError: a result exists, and it may be neither replaced nor left; it would replace its
            own photo; or both may be done.
        ViewError: an option is not known.

    """
    rendering = rendering_of(interpolation, border, quality)
    if overwrite and skip_existing:
        raise OutputError("overwrite and skip_existing exclude each other: choose one")
    given = [photos] if isinstance(photos, str | os.PathLike) else list(photos)
    videos, others = videos_among([os.fspath(one) for one in given])
    if videos and others:
        raise PhotoError("photos and videos together: do them one after the other")
    sources = [(path.name, path) for path in videos]
    if not videos:
        sources = [(photo.name, photo.path) for photo in find_photos(given)]
    plan = Plan.of(sources, Path(folder), to_folder=True, videos=bool(videos))
    plan = plan.free(skip_existing=skip_existing, overwrite=overwrite)

    def chosen(camera: Camera) -> ChosenView:
        return ChosenView(views={"": default_view(camera) if view is None else view})

    own = camera.camera if isinstance(camera, Calibrated) else camera
    views = ViewsBySize(own, None, chosen)
    failures = undistort_plan(
        plan, views, rendering, Encoding(), Run(jobs=jobs, overwrite=overwrite, listener=listener)
    )
    return Undistorted(
        files=tuple(path for job in plan.done(failures) for path in job.wanted),
        skipped=tuple(job.name for job in plan.skipped),
        failed={failure.job.name: str(failure.error) for failure in failures},
    )


def videos_among(names: Sequence[str]) -> tuple[list[Path], bool]:
    """The videos that names and patterns mean, and whether they mean something else too."""
    paths = [
        Path(match)
        for name in names
        for match in (sorted(glob(name)) if has_magic(name) and not Path(name).exists() else [name])
    ]
    videos = [one for one in paths if one.suffix.lower() in VIDEO_SUFFIXES and not one.is_dir()]
    return videos, len(videos) < len(paths)


def undistort_plan(
    plan: Plan,
    views: Views,
    rendering: Rendering,
    encoding: Encoding | None = None,
    run: Run = RUN,
) -> list[FailedPhoto]:
    """Undistort photos or videos into files; one that fails does not stop the others.

    Args:
        plan: which.
        views: what is rendered of each.
        rendering: how pixels are made.
        encoding: of videos.
        run: how the work is done.

    Returns:
        What failed, in order.

    Raises:
        ClusterError: ``executor`` cannot do the work.

    """
    if plan.videos:
        return _videos(plan, views, rendering, encoding, run)
    failures = undistort_photos(
        plan.jobs,
        views.maps,
        rendering,
        workers=run.jobs or os.cpu_count() or 1,
        overwrite=run.overwrite,
        progress=run.listener.counting("Undistorting"),
        executor=run.executor,
    )
    return failures if run.executor is not None else [*failures, *_gone(plan, failures)]


def _videos(
    plan: Plan,
    views: Views,
    rendering: Rendering,
    encoding: Encoding | None,
    run: Run,
) -> list[FailedPhoto]:
    """One video after the other."""
    failures = []
    for job in plan.jobs:
        try:
            done = undistort_video(
                job.source,
                job.outputs[0],
                partial(_first_map, views, job.source),
                rendering,
                encoding,
                overwrite=run.overwrite,
                progress=run.listener.counting(job.name),
            )
        except CubicfishError as error:
            failures.append(FailedPhoto(job=job, error=error))
            continue
        if done.turned_deg:
            told = {"video": job.outputs[0], "turned_deg": done.turned_deg}
            run.listener.tell(Event.VIDEO_TURNED, **told)
    return failures


def _first_map(views: Views, source: Path, size: Size) -> Any:
    return views.maps(source, size)[0]


def _gone(plan: Plan, failures: Sequence[FailedPhoto]) -> list[FailedPhoto]:
    """Photos whose results were written and are not there: somebody removed their folder."""
    lost = []
    for job in plan.done(failures):
        missing = next((path for path in job.wanted if not path.is_file()), None)
        if missing is not None:
            why = "is gone again: was its folder removed or renamed meanwhile?"
            lost.append(FailedPhoto(job=job, error=OutputError(f"{missing} {why}")))
    return lost


def failure_record(failure: FailedPhoto) -> dict[str, Any]:
    """A photo that could not be done, as plain data: a finding, and its name and problem."""
    problem = str(failure.error)
    told = Finding(
        code=Code.FAILED,
        severity=Severity.BAD,
        images=(failure.job.name,),
        figures={"problem": problem},
    )
    return {**told.as_record(), "image": failure.job.name, "problem": problem}


@dataclass(frozen=True, kw_only=True)
class Group:
    """Photos that have one view.

    Attributes:
        images: their names.
        size: (width, height) of each, pixels.
        view: what would be rendered of the first; None where that cannot be done.
        seen: what the camera sees of the view's field; None where it has none.
        kept_share: of what the camera sees; None where nobody asks.
        empty_share: of the pixels.
        problem: why it cannot be done.

    """

    images: Sequence[str]
    size: Size
    view: ChosenView | None = None
    seen: SeenField | None = None
    kept_share: float | None = None
    empty_share: float | None = None
    problem: str | None = None


@dataclass(frozen=True, kw_only=True)
class DryRun:
    """What a run would do.

    Attributes:
        plan: the run.
        groups: which views.
        bad: photos that cannot be read.

    """

    plan: Plan
    groups: Sequence[Group]
    bad: Sequence[FailedPhoto]

    @property
    def problems(self) -> list[tuple[str, str]]:
        """Names of photos of which nothing can be made, and why."""
        told = [(failure.job.name, str(failure.error)) for failure in self.bad]
        for group in self.groups:
            told += [(name, group.problem) for name in group.images if group.problem is not None]
        return told

    @property
    def possible(self) -> list[PhotoJob]:
        """The photos of which something can be made."""
        left_out = {name for name, _ in self.problems}
        return [job for job in self.plan.jobs if job.name not in left_out]

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return self.plan.as_record(
            self.possible,
            [{"image": name, "problem": problem} for name, problem in self.problems],
            next((group.view for group in self.groups if group.view), None),
            dry_run=True,
            groups=[
                {
                    "images": len(group.images),
                    "image_size": group.size,
                    "view": group.view and group.view.as_record(),
                    "kept_share": group.kept_share,
                    "empty_share": group.empty_share,
                    "problem": group.problem,
                }
                for group in self.groups
            ],
        )


def dry_run_of(plan: Plan, views: Views) -> DryRun:
    """Look at every photo's size, and at one photo of each group."""
    members: dict[Hashable, list[tuple[PhotoJob, Size]]] = {}
    bad = []
    for job in plan.jobs:
        try:
            size = plan.size_of(job)
        except CubicfishError as error:
            bad.append(FailedPhoto(job=job, error=error))
            continue
        members.setdefault(views.group(job.source, size), []).append((job, size))
    groups = []
    for own in members.values():
        job, size = own[0]
        images = [one.name for one, _ in own]
        try:
            view, maps = views.view(job.source, size), views.maps(job.source, size)
            empty = 1 - sum(made.valid.sum() for made in maps) / sum(m.valid.size for m in maps)
            groups.append(
                Group(
                    images=images,
                    size=size,
                    view=view,
                    seen=views.seen(job.source, size),
                    kept_share=views.kept_share(job.source, size),
                    empty_share=float(empty),
                )
            )
        except CubicfishError as error:
            groups.append(Group(images=images, size=size, problem=str(error)))
    return DryRun(plan=plan, groups=groups, bad=bad)
