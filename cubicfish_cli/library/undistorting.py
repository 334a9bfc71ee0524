"""Photos and videos in files -> undistorted files, with what failed and why.

A picture and a camera -> the undistorted picture.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import CubicfishError, OutputError, UsageError, ViewError
from cubicfish_cli.files import Content, refuse_existing, write_files
from cubicfish_cli.formats.calibrated import Calibrated
from cubicfish_cli.formats.camera_yaml import CameraFile, load_any_camera, load_camera
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.library.asked import (
    RUN,
    Run,
    StrPath,
    in_folder,
    named_photos,
    path_or_none,
    paths_of,
)
from cubicfish_cli.library.asked_pictures import PlaneOptions
from cubicfish_cli.library.views import (
    PlanesOfPhotos,
    Size,
    Views,
    ViewsBySize,
)
from cubicfish_cli.listener import Listener
from cubicfish_cli.photos import SUFFIXES, expanded, photo_size, shown
from cubicfish_cli.picture_headers import VIDEO_SUFFIXES
from cubicfish_cli.undistortion.batch import PhotoJob, undistort_photos
from cubicfish_cli.undistortion.choose import ChosenView, SeenField, build_view
from cubicfish_cli.undistortion.images import Rendering, check_suffix, remap_picture
from cubicfish_cli.undistortion.map_formats import part_name, view_files
from cubicfish_cli.undistortion.maps import (
    UndistortMap,
    build_map,
    camera_for_photos,
)
from cubicfish_cli.undistortion.options import ViewOptions
from cubicfish_cli.undistortion.video import DEFAULT_CRF, undistort_video, video_size
from cubicfish_cli.undistortion.view import View
from cubicfish_cli.words.codes import Code, Event, Severity
from cubicfish_cli.words.finding import Finding
from cubicfish_cli.words.phrases import plural

Image = npt.NDArray[Any]
Interpolation = Literal["nearest", "linear", "cubic", "lanczos"]


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
    rendering = Rendering(interpolation=interpolation)
    if isinstance(by, UndistortMap):
        if view is not None:
            raise ViewError("a map has its view already: leave the view out, or pass the camera")
        undistort_map = by
    else:
        camera = camera_for_photos(by, (picture.shape[1], picture.shape[0]))
        undistort_map = build_map(camera, build_view(camera) if view is None else view)
    flat = remap_picture(np.ascontiguousarray(picture), undistort_map, rendering)
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
    """What became of photos, of videos or of the shots of a rig.

    Attributes:
        kind: ``photo``, ``video`` or ``shot``.
        output: the folder of the results, or the file of one.
        written: each by its name -> its pictures or its video.
        failures: those that could not be done, and why.
        skipped: those whose results were there already.
        model: the file of the camera or the rig; None of one that is in none.
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
    view: View | ViewOptions | PlaneOptions | None = None,
    *,
    interpolation: Interpolation = "linear",
    quality: int | None = None,
    crf: int | None = None,
    mask: StrPath | None = None,
    virtual_camera: StrPath | None = None,
    skip_existing: bool = False,
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
        view: what to render, or what is asked of it; by default flat, as large as each photo and
            with its scale in the middle, up to 120° across.
        interpolation: how pixels are blended.
        quality: of JPEG and lossy WebP files, 1 to 100; None keeps that of the photo.
        crf: of videos: lower is better and larger; by default 18.
        mask: also writes where the results may be trusted: 255, and 0 elsewhere.
        virtual_camera: also writes the camera of the results: for flat.png, flat.view.yaml and
            flat.view.opencv.yaml.
        skip_existing: leaves out photos whose result is there.
        run: how the work is done.

    Returns:
        The ``files`` that were written, what was ``skipped``, and what ``failed`` and why.

    Raises:
        UsageError: what is asked does not go together, such as photos and videos.
        PhotoError: there are none.
        OutputError: a result exists, and it may be neither replaced nor left, or it would replace
            its own photo.
        ViewError: an option is not known, or photos have a mask or a camera each.
        CubicfishError: the camera, the target or the executor cannot be used.

    """
    rendering = Rendering(interpolation=interpolation, quality=quality)
    if skip_existing and run.overwrite:
        raise UsageError("--skip-existing and --overwrite exclude each other")
    plan = _planned(photos, Path(output), view, run.listener)
    if plan.videos and run.executor is not None:
        raise UsageError("--scheduler is for photos: do videos without it")
    path, loaded = _loaded(camera, in_planes=isinstance(view, PlaneOptions))
    views: Views
    if isinstance(view, PlaneOptions):
        views = PlanesOfPhotos(loaded, view)
    else:
        views = ViewsBySize(loaded.camera, view)
    plan = plan.free(skip_existing=skip_existing, overwrite=run.overwrite)
    if isinstance(views, PlanesOfPhotos):
        views.place([job.source for job in (*plan.jobs, *plan.skipped)], run)
    files = _extras(plan, views, path_or_none(mask), path_or_none(virtual_camera))
    if skip_existing:
        files = {path: content for path, content in files.items() if not path.is_file()}
    refuse_existing(*files, overwrite=run.overwrite, can_skip=not skip_existing)
    extras = write_files(files, overwrite=run.overwrite)
    if plan.videos:
        crf = DEFAULT_CRF if crf is None else crf
        made = plan.became(_videos(plan, views, rendering, crf, run))
    else:
        made = plan.became(_photos(plan, views, rendering, run))
    done = next((job for job in plan.jobs if job.name in made.written), None)
    if done is not None:
        there, shown_view = views.chosen(done.source, plan.size_of(done))
        made = replace(made, view=shown_view, seen=shown_view.seen_by(there))
    return replace(made, model=path, extras=extras)


def _loaded(
    camera: StrPath | Calibrated | CubicCamera, *, in_planes: bool
) -> tuple[Path | None, Any]:
    """The camera's file, where it has one, and what has the camera and its record."""
    if isinstance(camera, CubicCamera):
        return None, CameraFile(camera=camera, fit={}, made_by={})
    if isinstance(camera, Calibrated):
        return None, CameraFile(camera=camera.camera, fit=camera.as_record(), made_by={})
    path = in_folder(Path(camera))
    return path, load_any_camera(path) if in_planes else load_camera(path)


@dataclass(frozen=True, kw_only=True)
class _Plan:
    """Which photo or video becomes which files.

    Attributes:
        output: a folder or a file, as it was asked for.
        jobs: the photos or videos.
        videos: whether they are videos.
        skipped: those that are left out, since their results exist.

    """

    output: Path
    jobs: Sequence[PhotoJob]
    videos: bool
    skipped: Sequence[PhotoJob] = ()

    @property
    def kind(self) -> str:
        """What the jobs are, in a word."""
        return "video" if self.videos else "photo"

    def size_of(self, job: PhotoJob) -> Size:
        """(width, height) of a photo, or of a video's frames."""
        return video_size(job.source) if self.videos else photo_size(job.source)

    def free(self, *, skip_existing: bool, overwrite: bool) -> _Plan:
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

    def became(self, failures: Mapping[str, CubicfishError]) -> UndistortedFiles:
        """What was written where these could not be done."""
        return UndistortedFiles(
            kind=self.kind,
            output=self.output,
            written={one.name: one.wanted for one in self.jobs if one.name not in failures},
            failures=failures,
            skipped=tuple(job.name for job in self.skipped),
        )


def _planned(
    photos: StrPath | Sequence[StrPath],
    output: Path,
    view: View | ViewOptions | PlaneOptions | None,
    listener: Listener,
) -> _Plan:
    """The photos or videos that names, folders and patterns mean, and what they become.

    Raises:
        UsageError: photos and videos are mixed, or ``output`` is none for them.
        PhotoError: there are none.
        OutputError: two have one name, or one would be replaced by its own result.

    """
    alone = isinstance(photos, str | os.PathLike)
    names = [os.fspath(one) for one in paths_of(photos)]
    parts = view.parts if isinstance(view, ViewOptions) else ("",)
    videos, others = _videos_among(names)
    if videos and others:
        raise UsageError("photos and videos together: do them one after the other")
    if videos and parts != ("",):
        raise UsageError("a video becomes one video: choose another --view than cube")
    if videos and isinstance(view, PlaneOptions):
        raise UsageError("--plane is for photos, each of which has its own pose")
    sources = [(path.name, path) for path in videos]
    sources = sources or [(one.name, one.path) for one in named_photos(names, listener)]
    if len({name for name, _ in sources}) < len(sources):
        raise OutputError("two videos have the same name: do them one at a time")
    one = alone and len(sources) == 1 and os.fspath(sources[0][1]) == names[0]
    to_folder = is_folder(output, "" if one else plural(len(sources), "photo"))
    if videos and not to_folder and output.suffix.lower() not in VIDEO_SUFFIXES:
        raise UsageError(
            f"{shown(output)} is no video: name a video such as {shown(output.with_suffix('.mp4'))}"
        )
    jobs = []
    for name, source in sources:
        path = output / name if to_folder else output
        outputs = tuple(part_name(path, part) for part in parts)
        refuse_itself(outputs, [source])
        jobs.append(PhotoJob(name=name, source=source, outputs=outputs))
    return _Plan(output=output, jobs=jobs, videos=bool(videos))


def _videos_among(names: Sequence[str]) -> tuple[list[Path], bool]:
    """The videos that names and patterns mean, and whether they mean something else too."""
    paths = [path for name in names for path in expanded(name)]
    videos = [one for one in paths if one.suffix.lower() in VIDEO_SUFFIXES and not one.is_dir()]
    return videos, len(videos) < len(paths)


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


def _extras(
    plan: _Plan,
    views: Views,
    mask: Path | None,
    virtual_camera: Path | None,
) -> dict[Path, Content]:
    """The mask and the virtual camera, which are the same for all photos of one size."""
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
    _, shown_view = views.chosen(source, size)
    maps = dict(zip(shown_view.views, views.maps(source, size), strict=True))
    return view_files(maps, mask=mask, beside=virtual_camera)


def _photos(plan: _Plan, views: Views, rendering: Rendering, run: Run) -> dict[str, CubicfishError]:
    """All photos at once: what could not be done, and why."""
    executor = run.executor if plan.jobs else None
    failures = undistort_photos(
        plan.jobs,
        views.maps,
        rendering,
        workers=run.jobs or os.cpu_count() or 1,
        overwrite=run.overwrite,
        progress=run.listener.counting("Undistorting"),
        executor=executor,
    )
    for job in plan.jobs if executor is None else ():
        missing = next((path for path in job.wanted if not path.is_file()), None)
        if missing is not None and job.name not in failures:  # somebody removed their folder
            why = "is gone again: was its folder removed or renamed meanwhile?"
            failures[job.name] = OutputError(f"{missing} {why}")
    return failures


def _videos(
    plan: _Plan, views: Views, rendering: Rendering, crf: int, run: Run
) -> dict[str, CubicfishError]:
    """One video after the other: what could not be done, and why."""
    failures = {}
    for job in plan.jobs:
        try:
            done = undistort_video(
                job.source,
                job.outputs[0],
                partial(_first_map, views, job.source),
                rendering,
                crf=crf,
                overwrite=run.overwrite,
                progress=run.listener.counting(job.name),
            )
        except CubicfishError as error:
            failures[job.name] = error
            continue
        if done.turned_deg:
            told = {"video": job.outputs[0], "turned_deg": done.turned_deg}
            run.listener.tell(Event.VIDEO_TURNED, **told)
    return failures


def _first_map(views: Views, source: Path, size: Size) -> UndistortMap:
    return views.maps(source, size)[0]
