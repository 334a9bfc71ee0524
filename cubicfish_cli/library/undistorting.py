"""Photos and videos in files -> undistorted files, with what failed and why."""

from __future__ import annotations

import os
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from cubicfish_cli.errors import CubicfishError, OutputError, UsageError, ViewError
from cubicfish_cli.files import Content, refuse_existing, write_files
from cubicfish_cli.formats.calibrated import Calibrated
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.library.asked import RUN, Run, StrPath, named_photos, paths_of
from cubicfish_cli.library.pictures import Interpolation, rendering_of
from cubicfish_cli.library.views import Size, TrustedWithin, Views, ViewsBySize
from cubicfish_cli.listener import SILENT, Listener
from cubicfish_cli.photos import SUFFIXES, expanded, photo_size, shown
from cubicfish_cli.picture_headers import VIDEO_SUFFIXES
from cubicfish_cli.undistortion.batch import FailedPhoto, PhotoJob, undistort_photos
from cubicfish_cli.undistortion.choose import ChosenView, SeenField
from cubicfish_cli.undistortion.images import Rendering, check_suffix
from cubicfish_cli.undistortion.video import Encoding, undistort_video, video_size
from cubicfish_cli.undistortion.view import Camera, View
from cubicfish_cli.undistortion.view_files import part_name, view_files
from cubicfish_cli.undistortion.views import default_view
from cubicfish_cli.words.codes import Code, Event, Severity
from cubicfish_cli.words.finding import Finding
from cubicfish_cli.words.phrases import plural


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Which photo or video becomes which files.

    Attributes:
        jobs: the photos or videos.
        videos: whether they are videos.
        skipped: those that are left out, since their results exist.
        one: whether a single file was named.

    """

    jobs: Sequence[PhotoJob]
    videos: bool = False
    skipped: Sequence[PhotoJob] = ()
    one: bool = False

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

    @classmethod
    def of_names(
        cls,
        names: Sequence[str],
        destination: Path,
        parts: Sequence[str] = ("",),
        *,
        to_folder: bool = False,
        listed: bool = False,
        planes: bool = False,
        listener: Listener = SILENT,
    ) -> Plan:
        """The photos or videos that names, folders and patterns mean, and what they become.

        Args:
            names: files, folders and globs.
            destination: a file for one that is named; of several, a folder.
            parts: as in :meth:`of`.
            to_folder: whether it is a folder in any case.
            listed: whether the names are of a list, which may be long.
            planes: whether each has a plane of its own.
            listener: who is told what was passed over.

        Raises:
            UsageError: photos and videos are mixed, or ``destination`` is none for them.
            PhotoError: there are none.
            OutputError: as :meth:`of`.

        """
        videos, others = videos_among(names)
        if videos and others:
            raise UsageError("photos and videos together: do them one after the other")
        if videos and tuple(parts) != ("",):
            raise UsageError("a cube of a video is one picture: add --layout cross")
        if videos and planes:
            raise UsageError("--plane is for photos, each of which has its own pose")
        sources = [(path.name, path) for path in videos]
        sources = sources or [(one.name, one.path) for one in named_photos(names, listener)]
        alone = not listed and len(sources) == len(names) == 1
        one = alone and os.fspath(sources[0][1]) == names[0]
        if not (one or to_folder):
            refuse_a_file(destination, plural(len(sources), "photo"))
        ends = os.fspath(destination).endswith(os.sep)
        to_folder = to_folder or not one or destination.is_dir() or ends
        if videos and not to_folder and destination.suffix.lower() not in VIDEO_SUFFIXES:
            name = shown(destination.with_suffix(".mp4"))
            if not destination.suffix:
                name, kind = "flat.mp4", f"{shown(destination)}{os.sep} is a folder"
            else:
                kind = f"{shown(destination)} is no video"
            raise UsageError(f"{kind}: name a video such as {name}")
        plan = cls.of(sources, destination, parts, to_folder=to_folder, videos=bool(videos))
        return replace(plan, one=one)

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
        plan: which were to become what.
        failures: those that could not be done, and why.
        view: what was rendered of the first; None where none was done.
        seen: what the camera sees of the view's field; None where it has none.
        extras: masks and virtual cameras that were written.

    """

    plan: Plan
    failures: Sequence[FailedPhoto]
    view: ChosenView | None = None
    seen: SeenField | None = None
    extras: Sequence[Path] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """The pictures or videos that were written."""
        return tuple(path for job in self.plan.done(self.failures) for path in job.wanted)

    @property
    def skipped(self) -> tuple[str, ...]:
        """Names of those whose result was there already."""
        return tuple(job.name for job in self.plan.skipped)

    @property
    def failed(self) -> dict[str, str]:
        """Name -> why it could not be done, in a line."""
        return {failure.job.name: str(failure.error) for failure in self.failures}

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        done = self.plan.done(self.failures)
        failed = [_failure_record(failure) for failure in self.failures]
        extras = [str(path) for path in self.extras]
        return self.plan.as_record(done, failed, self.view, extra_files=extras)


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
        PhotoError: there are none.
        UsageError: photos and videos are mixed.
        OutputError: a result exists, and it may be neither replaced nor left; it would replace its
            own photo; or both may be done.
        ViewError: an option is not known.

    """
    rendering = rendering_of(interpolation, border, quality)
    if overwrite and skip_existing:
        raise OutputError("overwrite and skip_existing exclude each other: choose one")
    names = [os.fspath(one) for one in paths_of(photos)]
    plan = Plan.of_names(names, Path(folder), to_folder=True, listener=listener)
    plan = plan.free(skip_existing=skip_existing, overwrite=overwrite)

    def chosen(camera: Camera) -> ChosenView:
        return ChosenView(views={"": default_view(camera) if view is None else view})

    own = camera.camera if isinstance(camera, Calibrated) else camera
    run = Run(jobs=jobs, overwrite=overwrite, listener=listener)
    return undistort_plan(plan, ViewsBySize(own, None, chosen), rendering, Encoding(), run)


def videos_among(names: Sequence[str]) -> tuple[list[Path], bool]:
    """The videos that names and patterns mean, and whether they mean something else too."""
    paths = [path for name in names for path in expanded(name)]
    videos = [one for one in paths if one.suffix.lower() in VIDEO_SUFFIXES and not one.is_dir()]
    return videos, len(videos) < len(paths)


def refuse_a_file(destination: Path, several: str) -> None:
    """Refuse the name of a file for what becomes a folder.

    Raises:
        UsageError: it is one.

    """
    if destination.suffix.lower() in SUFFIXES | VIDEO_SUFFIXES and not destination.is_dir():
        raise UsageError(
            f"{shown(destination)} is the name of one file, and {several} become a folder: write "
            f"{shown(destination.with_suffix(''))}{os.sep}"
        )


def undistort_plan(
    plan: Plan,
    views: Views,
    rendering: Rendering,
    encoding: Encoding,
    run: Run = RUN,
    *,
    mask: Path | None = None,
    masked: TrustedWithin | None = None,
    camera_out: Path | None = None,
    skip_existing: bool = False,
) -> Undistorted:
    """Undistort photos or videos into files; one that fails does not stop the others.

    Args:
        plan: which.
        views: what is rendered of each.
        rendering: how pixels are made.
        encoding: of videos.
        run: how the work is done.
        mask: also writes where the result may be trusted.
        masked: says where that is, beside what the camera sees.
        camera_out: also writes the virtual camera of the result.
        skip_existing: whether a mask or a virtual camera that is there is left.

    Raises:
        ClusterError: ``run.executor`` cannot do the work.
        ViewError: photos that have a mask or a camera each.
        OutputError: one exists, and may be neither replaced nor left.

    """
    files = _extras(plan, views, mask, masked, camera_out)
    if skip_existing:
        files = {path: content for path, content in files.items() if not path.is_file()}
    refuse_existing(*files, overwrite=run.overwrite, can_skip=not skip_existing)
    extras = write_files(files, overwrite=run.overwrite)
    if plan.videos:
        failures = _videos(plan, views, rendering, encoding, run)
    else:
        failures = undistort_photos(
            plan.jobs,
            views.maps,
            rendering,
            workers=run.jobs or os.cpu_count() or 1,
            overwrite=run.overwrite,
            progress=run.listener.counting("Undistorting"),
            executor=run.executor,
        )
        if run.executor is None:
            failures = [*failures, *_gone(plan, failures)]
    made = Undistorted(plan=plan, failures=failures, extras=extras)
    for job in plan.done(failures)[:1]:
        size = plan.size_of(job)
        view, seen = views.view(job.source, size), views.seen(job.source, size)
        made = replace(made, view=view, seen=seen)
    return made


def _extras(
    plan: Plan,
    views: Views,
    mask: Path | None,
    masked: TrustedWithin | None,
    camera_out: Path | None,
) -> dict[Path, Content]:
    """The mask and the virtual camera, which are the same for all photos of one size."""
    jobs = [*plan.jobs, *plan.skipped]
    if (mask is None and camera_out is None) or not jobs:
        return {}
    sizes = {job.source: plan.size_of(job) for job in jobs}
    if len({views.group(source, size) for source, size in sizes.items()}) > 1:
        raise ViewError(
            "these photos have a mask and a virtual camera each, since their sizes or planes "
            "differ: do them one at a time"
        )
    source, size = next(iter(sizes.items()))
    maps = dict(zip(views.view(source, size).views, views.maps(source, size), strict=True))
    trusted = None if masked is None else partial(masked.mask, size=size)
    return view_files(maps, mask=mask, beside=camera_out, masked=trusted)


def _videos(
    plan: Plan,
    views: Views,
    rendering: Rendering,
    encoding: Encoding,
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


def _failure_record(failure: FailedPhoto) -> dict[str, Any]:
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
