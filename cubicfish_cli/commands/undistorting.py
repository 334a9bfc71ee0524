"""Photos and videos in files -> undistorted files, with what failed and why.

A picture and a camera -> the undistorted picture.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.app.asked import (
    RUN,
    Run,
    StrPath,
    in_folder,
    named_photos,
    path_or_none,
    paths_of,
)
from cubicfish_cli.app.asked_pictures import (
    Interpolation,
    PictureOptions,
    PlaneOptions,
    UndistortOptions,
)
from cubicfish_cli.app.listener import SILENT, Listener
from cubicfish_cli.app.photos import SUFFIXES, expanded, photo_size, shown
from cubicfish_cli.app.picture_headers import VIDEO_SUFFIXES
from cubicfish_cli.app.undistortion.batch import Job, write_many, write_one
from cubicfish_cli.app.undistortion.images import check_suffix, remap_picture
from cubicfish_cli.app.undistortion.map_formats import part_name, view_files
from cubicfish_cli.app.undistortion.video import DEFAULT_CRF, undistort_video, video_size
from cubicfish_cli.commands.views import (
    PlanesOfPhotos,
    Size,
    Views,
    ViewsBySize,
)
from cubicfish_cli.core.assess.fit_record import FitRecord
from cubicfish_cli.core.codes import Code, Event, Severity
from cubicfish_cli.core.errors import CubicfishError, OutputError, PhotoError, UsageError, ViewError
from cubicfish_cli.core.files import Content, refuse_existing, refuse_outside, write_files
from cubicfish_cli.core.finding import Finding
from cubicfish_cli.core.io.calibrated import Calibrated
from cubicfish_cli.core.io.camera_yaml import CameraFile, load_any_camera, load_camera
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.phrases import plural
from cubicfish_cli.core.views.choose import ChosenView, SeenField, build_view
from cubicfish_cli.core.views.maps import (
    UndistortMap,
    build_map,
    camera_for_photos,
)
from cubicfish_cli.core.views.view import View

Image = npt.NDArray[Any]


def undistort(
    picture: Image,
    by: CubicCamera | UndistortMap,
    view: View | None = None,
    *,
    interpolation: Interpolation = "linear",
) -> Image:
    """Render a view from a photo, as ``cubicfish undistort`` does.

    For many photos make the map once with :func:`build_map` and pass it instead of the camera.

    Args:
        picture: (H, W) or (H, W, 1 to 4), uint8, uint16 or float32, of the size that the camera
            was calibrated for or an exact rescale of it (a map takes its own size alone).
        by: the camera, or a map.
        view: what to render; by default flat, as large as the photo and with the photo's scale in
            its middle, up to 120° across.
        interpolation: how pixels are blended.

    Returns:
        (h, w) or (h, w, channels), of the view's size and the picture's dtype.

    Raises:
        ViewError: the picture is not one that the camera or the map is for, or an option is not
            known.

    """
    _refuse_no_picture(picture)
    if isinstance(by, UndistortMap):
        if view is not None:
            raise ViewError("a map has its view already: leave the view out, or pass the camera")
        undistort_map = by
    else:
        camera = camera_for_photos(by, (picture.shape[1], picture.shape[0]))
        undistort_map = build_map(camera, build_view(camera) if view is None else view)
    flat = remap_picture(np.ascontiguousarray(picture), undistort_map, interpolation)
    return flat.reshape((*flat.shape[:2], *picture.shape[2:]))


def _refuse_no_picture(picture: object) -> None:
    if not isinstance(picture, np.ndarray):
        raise ViewError(f"the picture is no array but {type(picture).__name__}: read it first")
    if picture.ndim not in (2, 3) or (picture.ndim == 3 and not 1 <= picture.shape[2] <= 4):
        raise ViewError(f"the picture has the shape {picture.shape}, not (H, W) or (H, W, 1 to 4)")
    if picture.dtype not in (np.uint8, np.uint16, np.float32):
        raise ViewError(f"the picture holds {picture.dtype} numbers, not uint8, uint16 or float32")
    if not picture.size:
        raise ViewError(f"the picture has the shape {picture.shape}: it is empty")


@dataclass(frozen=True, kw_only=True)
class UndistortedFiles:
    """What became of photos or videos.

    Attributes:
        kind: what they are: ``photo``, ``video``, or what an extension calls its own.
        output: the folder of the results, or the file of one.
        written: each by its name -> its pictures or its video.
        failures: those that could not be done, and why.
        skipped: those whose results were there already.
        model: the file of the camera; None of one that is in none.
        view: what was rendered of the first; None where none was done.
        seen: what the camera sees of the view's field; None where it has none.
        extras: masks, virtual cameras and tables that were written.

    """

    kind: str
    output: Path
    written: Mapping[str, Sequence[Path]]
    failures: Mapping[str, CubicfishError]
    skipped: tuple[str, ...] = ()
    model: Path | None = None
    view: ChosenView | None = None
    seen: SeenField | None = None
    extras: Sequence[Path] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """The pictures or videos."""
        return tuple(path for own in self.written.values() for path in own)

    @property
    def failed(self) -> dict[str, str]:
        """Name -> why it could not be done, in a line."""
        return {name: str(why) for name, why in self.failures.items()}

    @property
    def names(self) -> tuple[str, ...]:
        """All that were to be done."""
        return (*self.written, *self.failures)

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish undistort --json`` prints."""
        return {
            **({} if self.model is None else {"model": self.model}),
            "images": len(self.written),
            "files": self.files,
            "skipped": self.skipped,
            "failed": [_failure_record(name, why) for name, why in self.failed.items()],
            "view": self.view and self.view.as_record(),
            "extra_files": self.extras,
        }


def _failure_record(name: str, problem: str) -> dict[str, Any]:
    """What could not be done, as plain data: a finding, and its name and problem."""
    told = Finding(
        code=Code.FAILED, severity=Severity.BAD, images=(name,), figures={"problem": problem}
    )
    return {**told.as_record(), "image": name, "problem": problem}


def undistort_files(
    photos: StrPath | Sequence[StrPath],
    output: StrPath,
    camera: StrPath | Calibrated | CubicCamera,
    options: UndistortOptions | None = None,
    *,
    run: Run = RUN,
) -> UndistortedFiles:
    """Undistort photos or videos in files, as ``cubicfish undistort`` does.

    Results in a folder keep the names of their photos, and all keep depth, channels and a JPEG's
    EXIF record. One that fails does not stop the others.

    Args:
        photos: files, folders and globs of photos, or files and globs of videos; of the size that
            the camera was calibrated for, or an exact rescale of it.
        output: a folder; of one photo or video that is named alone, also a name for its result.
        camera: its file or the folder of that, or the camera or a fit.
        options: what becomes of them.
        run: how the work is done.

    Returns:
        The ``files`` that were written, what was ``skipped``, and what ``failed`` and why.

    Raises:
        UsageError: what is asked does not go together, such as photos and videos.
        PhotoError: there are none.
        OutputError: a result exists, and it may be neither replaced nor left, or it would replace
            its own photo.
        ViewError: photos have a mask or a camera each.
        CubicfishError: the camera, the target or the executor cannot be used.

    """
    asked, goal = options or UndistortOptions(), Path(output)
    kind, sources, alone = _named_sources(photos, run.listener)
    jobs = {name: (name, {"": one}) for name, one in sources}
    plan = plan_pictures(kind, jobs, goal, asked, run, alone=alone)
    if kind == "video" and (run.executor is not None or run.jobs is not None):
        name = "--jobs" if run.executor is None else "--scheduler"
        raise UsageError(f"{name} is for photos: do videos without it")
    view = asked.view
    path, known = _loaded(camera, in_planes=isinstance(view, PlaneOptions))
    views: Views = (
        PlanesOfPhotos(known, view, asked.interpolation)
        if isinstance(view, PlaneOptions)
        else ViewsBySize(known.camera, view, asked.interpolation)
    )
    write = partial(_write_video, views=views, asked=asked, listener=run.listener)
    return write_pictures(plan, views, asked, run, path, write if kind == "video" else None)


def write_pictures(
    plan: Plan,
    views: Views,
    asked: PictureOptions,
    run: Run,
    model: Path | None,
    in_turn: Callable[..., None] | None = None,
) -> UndistortedFiles:
    """Write what a plan says, with what is asked beside it.

    Args:
        plan: which photos become which files.
        views: what is rendered of each.
        asked: how.
        run: how the work is done.
        model: the file of what took the photos, for the record.
        in_turn: writes one job after the other instead; None to do many at once.

    Raises:
        OutputError: a result exists, and it may be neither replaced nor left.
        ViewError: photos have a mask or a camera each.

    """
    plan = plan.free(skip_existing=asked.skip_existing, overwrite=run.overwrite)
    views.place([job.source for job in (*plan.jobs, *plan.skipped)], run)
    files = _files_beside(plan, views, asked)
    if asked.skip_existing:
        files = {path: content for path, content in files.items() if not path.is_file()}
    refuse_existing(*files, overwrite=run.overwrite, can_skip=not asked.skip_existing)
    extras = write_files(files, overwrite=run.overwrite)
    failures = _write_all(plan, views, asked, run, in_turn)
    written = {
        job.name: tuple(job.outputs.values()) for job in plan.jobs if job.name not in failures
    }
    view = seen = None
    done = next((job for job in plan.jobs if job.name in written), None)
    if done is not None:
        there, view = views.chosen(done.source, plan.size_of(done))
        seen = None if there is None else view.seen_by(there)
    return UndistortedFiles(
        kind=plan.kind,
        output=plan.output,
        written=written,
        failures=failures,
        skipped=tuple(job.name for job in plan.skipped),
        model=model,
        view=view,
        seen=seen,
        extras=extras,
    )


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Which photos, videos or shots become which files.

    Attributes:
        kind: what the jobs are, in a word.
        output: the folder of the results, or the file of one.
        jobs: those that are to be done.
        skipped: those that are left out, since their results exist.

    """

    kind: str
    output: Path
    jobs: Sequence[Job]
    skipped: Sequence[Job] = ()

    def size_of(self, job: Job) -> Size:
        """(width, height) of a photo, or of a video's frames."""
        return video_size(job.source) if self.kind == "video" else photo_size(job.source)

    def free(self, *, skip_existing: bool, overwrite: bool) -> Plan:
        """Leave out what exists, or refuse to go on.

        Raises:
            OutputError: a file cannot be written, or exists and may be neither replaced nor left.

        """
        jobs, skipped = [], []
        for job in self.jobs:
            for path in job.outputs.values():
                if self.kind != "video":
                    check_suffix(path)
            if skip_existing:  # a run that was killed may have left some of a cube's pictures
                left = {part: path for part, path in job.outputs.items() if not path.is_file()}
                if not left:
                    skipped.append(job)
                    continue
                job = replace(job, outputs=left)
            wanted = job.outputs.values()
            refuse_existing(*wanted, overwrite=overwrite, can_skip=not skip_existing)
            jobs.append(job)
        return replace(self, jobs=jobs, skipped=skipped)


def plan_pictures(
    kind: str,
    sources: Mapping[str, tuple[str, Mapping[str, Path]]],
    output: Path,
    asked: PictureOptions,
    run: Run,
    *,
    alone: bool,
) -> Plan:
    """What becomes of sources.

    Args:
        kind: what they are, in a word.
        sources: name -> the name of the result in a folder, and photos.
        output: a folder; of one that is named ``alone`` also a name for its result.
        asked: what becomes of them.
        run: how the work is done.
        alone: whether there is one, named by itself.

    Raises:
        UsageError: ``output`` is none for them, or something is asked that does not go together.
        OutputError: one would be replaced by its own result.

    """
    if asked.skip_existing and run.overwrite:
        raise UsageError("--skip-existing and --overwrite exclude each other")
    to_folder = is_folder(output, "" if alone else plural(len(sources), kind))
    if kind == "video" and not to_folder and output.suffix.lower() not in VIDEO_SUFFIXES:
        raise UsageError(
            f"{shown(output)} is no video: name a video such as {shown(output.with_suffix('.mp4'))}"
        )
    jobs = []
    for name, (result, photos) in sources.items():
        path = output / result if to_folder else output
        outputs = {part: part_name(path, part) for part in asked.parts}
        refuse_itself(list(outputs.values()), list(photos.values()))
        jobs.append(Job(name=name, photos=photos, outputs=outputs))
    if to_folder:
        refuse_outside(output, (path for job in jobs for path in job.outputs.values()))
    asked.refuse_unused(kind, {path.suffix for job in jobs for path in job.outputs.values()})
    return Plan(kind=kind, output=output, jobs=jobs)


def _named_sources(
    photos: StrPath | Sequence[StrPath], listener: Listener
) -> tuple[str, list[tuple[str, Path]], bool]:
    """What photos or videos are meant, by their names; and whether one was named alone.

    Raises:
        UsageError: photos and videos are mixed.
        PhotoError: there are none.
        OutputError: two videos have one name.

    """
    names = [os.fspath(one) for one in paths_of(photos)]
    paths = [path for name in names for path in expanded(name)]
    videos = [one for one in paths if one.suffix.lower() in VIDEO_SUFFIXES and not one.is_dir()]
    if videos and len(videos) < len(paths):
        raise UsageError("photos and videos together: do them one after the other")
    sources = [(path.name, path) for path in videos]
    sources = sources or [(one.name, one.path) for one in named_photos(names, listener)]
    if len({name for name, _ in sources}) < len(sources):
        raise OutputError("two videos have the same name: do them one at a time")
    alone = isinstance(photos, str | os.PathLike) and len(sources) == 1
    alone = alone and os.fspath(sources[0][1]) == names[0]
    return "video" if videos else "photo", sources, alone


def _loaded(
    camera: StrPath | Calibrated | CubicCamera, *, in_planes: bool
) -> tuple[Path | None, Any]:
    """The camera's file, where it has one, and what has the camera and its record."""
    if isinstance(camera, CubicCamera):
        return None, CameraFile(camera=camera, fit=FitRecord(), made_by={})
    if isinstance(camera, Calibrated):
        return None, CameraFile(camera=camera.camera, fit=camera.fit, made_by={})
    path = in_folder(Path(camera))
    return path, load_any_camera(path) if in_planes else load_camera(path)


def is_folder(output: Path, several: str) -> bool:
    """Whether results go into a folder: several do, and one where no file is named.

    Args:
        output: where they go.
        several: how many results there are, in words; empty for one.

    Raises:
        UsageError: several are to become a file.

    """
    if not several:
        return output.is_dir() or not output.suffix
    if output.suffix.lower() in SUFFIXES | VIDEO_SUFFIXES and not output.is_dir():
        raise UsageError(
            f"{shown(output)} is the name of one file, and {several} become a folder: write "
            f"{shown(output.with_suffix(''))}{os.sep}"
        )
    return True


def refuse_itself(outputs: Sequence[Path], photos: Sequence[Path]) -> None:
    """Refuse to replace a photo by its own result.

    Raises:
        OutputError: a result has the place of one.

    """
    for path in outputs:
        if path.exists() and any(path.samefile(photo) for photo in photos):
            raise OutputError(
                f"{shown(path)} is the photo itself: choose another name or folder for OUT"
            )


def _files_beside(plan: Plan, views: Views, asked: PictureOptions) -> dict[Path, Content]:
    """The mask and the virtual camera, which are the same for all photos of one size."""
    mask, virtual_camera = path_or_none(asked.mask), path_or_none(asked.virtual_camera)
    jobs = [*plan.jobs, *plan.skipped]
    if (mask is None and virtual_camera is None) or not jobs:
        return {}
    sizes = {job.source: plan.size_of(job) for job in jobs}
    if len({views.group(source, size) for source, size in sizes.items()}) > 1:
        raise ViewError(
            "these photos have a mask and a virtual camera each, since their sizes or planes "
            "differ: do them one at a time"
        )
    source, size = next(iter(sizes.items()))
    return view_files(views.maps(source, size), mask=mask, beside=virtual_camera)


def _write_all(
    plan: Plan,
    views: Views,
    asked: PictureOptions,
    run: Run,
    in_turn: Callable[..., None] | None,
) -> dict[str, CubicfishError]:
    """Photos at once, or what tells how far it is in turn: what could not be done, and why."""
    executor = run.executor if plan.jobs else None
    progress = (run.listener if in_turn is None else SILENT).counting("Undistorting")
    failures = write_many(
        plan.jobs,
        in_turn or partial(write_one, render=views, quality=asked.quality),
        workers=1 if in_turn else run.jobs or os.cpu_count() or 1,
        overwrite=run.overwrite,
        progress=progress,
        executor=executor,
    )
    for job in plan.jobs if executor is None else ():
        missing = next((path for path in job.outputs.values() if not path.is_file()), None)
        if missing is not None and job.name not in failures:  # somebody removed their folder
            why = "is gone again: was its folder removed or renamed meanwhile?"
            failures[job.name] = OutputError(f"{missing} {why}")
    return failures


def _write_video(
    job: Job,
    *,
    views: Views,
    asked: UndistortOptions,
    listener: Listener,
    overwrite: bool,
    slots: object,
) -> None:
    """A video, which tells by itself how far it is.

    Raises:
        PhotoError: the video is shorter than it announces; what there is of it is written.

    """
    output = job.outputs[""]
    done = undistort_video(
        job.source,
        output,
        lambda size: views.maps(job.source, size)[""],
        asked.interpolation,
        crf=DEFAULT_CRF if asked.crf is None else asked.crf,
        overwrite=overwrite,
        progress=listener.counting(job.name),
    )
    if done.turned_deg:
        listener.tell(Event.VIDEO_TURNED, video=output, turned_deg=done.turned_deg)
    if done.missing:
        raise PhotoError(
            f"{shown(job.source)} is cut short: it announces {done.frames + done.missing:,} frames "
            f"and has {done.frames:,}, which {shown(output)} holds: copy it again if you can"
        )
