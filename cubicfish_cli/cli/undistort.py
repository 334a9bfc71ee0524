"""``cubicfish undistort``: photos to pictures in which straight lines are straight."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from glob import glob, has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli.chosen_views import (
    PlaneOptions,
    PlanesOfPhotos,
    Views,
    ViewsBySize,
    plane_options,
)
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.mask_limit import (
    check_mask_limit,
    mask_limit_option,
    trusted_within,
    uncertainty_of,
)
from cubicfish_cli.cli.options import (
    FILE,
    common_options,
    examples,
    jobs_option,
    model_option,
    model_path,
    overwrite_option,
)
from cubicfish_cli.cli.rendering_options import (
    RenderingOptions,
    crop_option,
    rendering_options,
)
from cubicfish_cli.cli.scheduler_options import SchedulerOptions, scheduler_options
from cubicfish_cli.cli.terminal import progress, result, say
from cubicfish_cli.cli.video_options import EncodingOptions, encoding_options, is_video_name
from cubicfish_cli.cli.view_options import ChosenView, ViewOptions, view_options

if TYPE_CHECKING:
    from cubicfish_cli.cli.mask_limit import Trusted
    from cubicfish_cli.formats.camera_yaml import CameraFile, PointCameraFile
    from cubicfish_cli.undistortion.batch import Failure, PhotoJob
    from cubicfish_cli.undistortion.frames import Crop
    from cubicfish_cli.undistortion.maps import UndistortMap


@click.command(
    "undistort",
    short_help="Photos and videos to pictures in which straight lines are straight.",
    epilog=examples(
        "cubicfish undistort photo.png flat.png",
        "cubicfish undistort photos/ flat/ --hfov 90 --size 1920x1080",
        "cubicfish undistort photo.png left.png --rotate -60,0,0 --hfov 80",
        "cubicfish undistort photos/ all/ --view equidistant --fit outer --skip-existing",
        "find . -name '*.jpg' | cubicfish undistort - flat/ -j 4",
        "cubicfish undistort photo.jpg floor.png --plane floor --target target.yaml",
        "cubicfish undistort drive.mp4 flat.mp4 --hfov 100 --crf 20",
        "cubicfish undistort photos/ flat/ --scheduler tcp://node1:8786",
    ),
)
@click.argument("sources", metavar="IN...", nargs=-1, required=True)
@click.argument("destination", metavar="OUT", type=FILE)
@model_option
@view_options
@plane_options
@crop_option
@rendering_options
@encoding_options
@click.option(
    "--mask",
    type=FILE,
    metavar="FILE",
    help="Also write where the result may be trusted: 255, and 0 elsewhere.",
)
@mask_limit_option
@click.option(
    "--camera",
    "camera_out",
    type=FILE,
    metavar="FILE",
    help="Also write the virtual camera of the result: for flat.png, flat.view.yaml and "
    "flat.view.opencv.yaml.",
)
@click.option("--skip-existing", is_flag=True, help="Leave out photos whose result exists.")
@click.option("--dry-run", is_flag=True, help="Say what would be done, and write nothing.")
@overwrite_option
@jobs_option
@scheduler_options
@common_options
def command(
    sources: tuple[str, ...],
    destination: Path,
    model: Path | None,
    view: ViewOptions,
    plane: PlaneOptions,
    crop: Crop | None,
    pixels: RenderingOptions,
    encoding: EncodingOptions,
    mask: Path | None,
    mask_limit: float | None,
    camera_out: Path | None,
    skip_existing: bool,
    dry_run: bool,
    overwrite: bool,
    jobs: int | None,
    scheduler: SchedulerOptions,
) -> None:
    """Render a picture OUT of the photo IN, or a video of a video; flat unless --view says so.

    With several photos, a folder or a quoted glob as IN, OUT is a folder and the pictures keep
    their names; '-' reads the photos' names from stdin. Pixels that the camera does not see are
    black. Depth, channels, and a JPEG's EXIF record and quality are kept, and so are a video's
    audio and timestamps.
    """
    from cubicfish_cli.undistortion.batch import undistort_photos

    if skip_existing and overwrite:
        raise click.UsageError("--skip-existing and --overwrite exclude each other")
    scheduler.check(jobs)
    check_mask_limit(mask_limit, mask)
    plane.check(view)
    planned = _plan(sources, destination, view, plane)
    if planned.videos and scheduler.address is not None:
        raise click.UsageError("--scheduler is for photos: do videos without it")
    chosen, loaded = _views(model_path(model), crop, view, plane)
    trusted: Callable[[tuple[int, int]], Trusted] | None = None
    if mask_limit is not None:
        trusted = partial(
            _trusted, mask_limit, uncertainty_of(loaded, model_path(model)), loaded, crop
        )
    planned = planned.free(skip_existing=skip_existing, overwrite=overwrite)
    with scheduler.connected(needed=bool(planned.jobs) and not dry_run) as machines:
        if isinstance(chosen, PlanesOfPhotos):
            chosen.find_missing([*planned.jobs, *planned.skipped], machines)
        if dry_run:
            _describe_plan(planned, chosen)
            return
        extras = _extras(
            mask,
            camera_out,
            planned,
            chosen,
            overwrite=overwrite,
            skip_existing=skip_existing,
            trusted=trusted,
        )
        if planned.videos:
            failures = _undistort_videos(planned, chosen, pixels, encoding, overwrite=overwrite)
        else:
            with progress("Undistorting") as callback:
                failures = undistort_photos(
                    planned.jobs,
                    chosen.maps,
                    pixels.rendering(),
                    workers=jobs or os.cpu_count() or 1,
                    overwrite=overwrite,
                    progress=callback,
                    machines=machines,
                )
    _report(planned, failures, chosen)
    for path in extras:
        result(f"wrote {path}")


@dataclass(frozen=True, kw_only=True)
class _Plan:
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

    def free(self, *, skip_existing: bool, overwrite: bool) -> _Plan:
        """Leave out what exists, or refuse to go on."""
        from cubicfish_cli.files import refuse_existing
        from cubicfish_cli.undistortion.images import check_suffix

        jobs, skipped = [], []
        for job in self.jobs:
            for path in job.outputs:
                if not self.videos:
                    check_suffix(path)
            if skip_existing and all(path.is_file() for path in job.outputs):
                skipped.append(job)
                continue
            for path in job.outputs:
                refuse_existing(path, overwrite=overwrite)
            jobs.append(job)
        return replace(self, jobs=jobs, skipped=skipped)


def _views(
    model: Path, crop: Crop | None, view: ViewOptions, plane: PlaneOptions
) -> tuple[Views, CameraFile | PointCameraFile]:
    """What is rendered of each photo, and the camera file that it is rendered by."""
    from cubicfish_cli.formats.camera_yaml import load_any_camera, load_camera

    if plane.board is not None:
        loaded = load_any_camera(model)
        return PlanesOfPhotos(loaded, crop, plane), loaded
    central = load_camera(model)
    return ViewsBySize(central.camera, crop, view), central


def _trusted(
    limit: float,
    record: dict[str, Any],
    loaded: CameraFile | PointCameraFile,
    crop: Crop | None,
    size: tuple[int, int],
) -> Trusted:
    """What makes the mask of photos of ``size``."""
    whole = loaded.camera.image_size
    return trusted_within(limit, record, calibrated_size=whole, size=size, crop=crop)


def _plan(
    sources: Sequence[str], destination: Path, view: ViewOptions, plane: PlaneOptions
) -> _Plan:
    """Which photo becomes which files."""
    from cubicfish_cli.errors import OutputError
    from cubicfish_cli.photos import Photo, find_photos, shown
    from cubicfish_cli.undistortion.batch import PhotoJob

    names = _with_stdin(sources)
    videos = _videos(names)
    photos = [Photo(name=path.name, path=path) for path in videos] or find_photos(names)
    if len({photo.name for photo in photos}) < len(photos):
        raise OutputError("two videos have the same name: do them one at a time")
    if videos and view.parts != ("",):
        raise click.UsageError("a cube of a video is one picture: add --layout cross")
    if videos and plane.board is not None:
        raise click.UsageError("--plane is for photos, each of which has its own pose")
    one = len(photos) == 1 and len(sources) == 1 and os.fspath(photos[0].path) == sources[0]
    to_folder = not one or destination.is_dir() or os.fspath(destination).endswith(os.sep)
    parts = view.parts
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
    return _Plan(jobs=jobs, destination=destination, one=one, videos=bool(videos))


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


def _undistort_videos(
    planned: _Plan,
    chosen: Views,
    pixels: RenderingOptions,
    encoding: EncodingOptions,
    *,
    overwrite: bool,
) -> list[Failure]:
    """One video after the other; one that fails does not stop the others."""
    from cubicfish_cli.errors import CubicfishError
    from cubicfish_cli.undistortion.batch import Failure
    from cubicfish_cli.undistortion.video import undistort_video

    failures = []
    for job in planned.jobs:
        try:
            with progress(job.name) as callback:
                done = undistort_video(
                    job.source,
                    job.outputs[0],
                    partial(_first_map, chosen, job.source),
                    pixels.rendering(),
                    encoding.encoding(),
                    overwrite=overwrite,
                    progress=callback,
                )
        except CubicfishError as error:
            failures.append(Failure(job=job, error=error))
            continue
        if done.turned_deg:
            say(
                f"{job.outputs[0]}: the source tells players to turn it by {done.turned_deg}°, "
                "which the result does not: turn it with --rotate 0,0,DEG"
            )
    return failures


def _first_map(chosen: Views, source: Path, size: tuple[int, int]) -> UndistortMap:
    return chosen.maps(source, size)[0]


def _describe_plan(planned: _Plan, chosen: Views) -> None:
    """What a run would do: how many files, which field, and how much of it is empty."""
    from cubicfish_cli.errors import CubicfishError

    groups: dict[object, list[tuple[Path, tuple[int, int]]]] = {}
    bad = []
    for job in planned.jobs:
        try:
            size = planned.size_of(job)
        except CubicfishError as error:
            bad.append(str(error))
            continue
        groups.setdefault(chosen.group(job.source, size), []).append((job.source, size))
    files = sum(len(job.outputs) for job in planned.jobs)
    skipped = f", {len(planned.skipped)} skipped" * bool(planned.skipped)
    given = count(len(planned.jobs), planned.kind)
    result(f"would write {count(files, 'file')} from {given}{skipped}")
    for members in groups.values():
        source, size = members[0]
        result(f"{count(len(members), planned.kind)} of {size[0]}x{size[1]} pixels:")
        try:
            _describe_group(chosen, source, size)
        except CubicfishError as error:
            bad.append(f"{source}: {error}")
            result(f"  cannot be done: {error}")
    for problem in bad:
        say(f"would fail: {problem}")


def _describe_group(chosen: Views, source: Path, size: tuple[int, int]) -> None:
    view, maps = chosen.view(source, size), chosen.maps(source, size)
    kept = chosen.kept_share(source, size)
    empty = 1 - sum(made.valid.sum() for made in maps) / sum(made.valid.size for made in maps)
    result(f"  view          {view.describe()}")
    if kept is not None:
        result(f"  kept field    {_field(view)}{100 * kept:.1f} % of what the camera sees")
    result(f"  empty pixels  {100 * empty:.1f} %")
    _warn_of_limit(view)


def _field(view: ChosenView) -> str:
    from cubicfish_cli.undistortion.view import CentralView

    if len(view.views) == 1 and isinstance(view.first, CentralView):
        return f"{view.first.hfov_deg:.1f}° x {view.first.vfov_deg:.1f}°, "
    return ""


def _warn_of_limit(view: ChosenView) -> None:
    if view.at_limit:
        say(
            f"the camera sees more than a {view.first.kind} picture can show: its field ends at "
            "the view's own limit, and --view stereographic or equidistant shows all"
        )


def _extras(
    mask: Path | None,
    camera_out: Path | None,
    planned: _Plan,
    chosen: Views,
    *,
    overwrite: bool,
    skip_existing: bool,
    trusted: Callable[[tuple[int, int]], Trusted] | None,
) -> list[Path]:
    """Write the mask and the virtual camera, which are the same for all photos of one size."""
    jobs = [*planned.jobs, *planned.skipped]
    if (mask is None and camera_out is None) or not jobs:
        return []
    from cubicfish_cli.cli.view_outputs import write_view_outputs
    from cubicfish_cli.errors import ViewError

    sizes = {job.source: planned.size_of(job) for job in jobs}
    if len({chosen.group(source, size) for source, size in sizes.items()}) > 1:
        raise ViewError(
            "these photos have a mask and a virtual camera each, since their sizes or planes "
            "differ: do them one at a time"
        )
    source, size = next(iter(sizes.items()))
    view, maps = chosen.view(source, size), chosen.maps(source, size)
    named = dict(zip(view.views, maps, strict=True))
    return write_view_outputs(
        named,
        mask=mask,
        beside=camera_out,
        overwrite=overwrite,
        skip_existing=skip_existing,
        trusted=trusted(size) if trusted else None,
    )


def _report(planned: _Plan, failures: Sequence[Failure], chosen: Views) -> None:
    """Say what was written; end with an error when a photo failed."""
    from cubicfish_cli.errors import PhotoError

    if len(planned.jobs) == 1 and failures:
        raise failures[0].error
    for failure in failures:
        click.echo(f"failed: {failure.error}", err=True)
    failed = {failure.job.source for failure in failures}
    done = [job for job in planned.jobs if job.source not in failed]
    if planned.skipped:
        say(f"skipped {count(len(planned.skipped), planned.kind)} whose result exists")
    if done:
        view = chosen.view(done[0].source, planned.size_of(done[0]))
        files = sum(len(job.outputs) for job in done)
        single = planned.one and files == 1
        wrote = (
            str(done[0].outputs[0])
            if single
            else f"{count(files, 'video' if planned.videos else 'picture')}"
        )
        folder = planned.destination.parent if planned.one else planned.destination
        where = "" if single else f" to {folder}"
        result(f"wrote {wrote}{where}: {view.describe()}")
        _warn_of_limit(view)
    elif not failures:
        result("nothing to do")
    if failures:
        names = ", ".join(failure.job.name for failure in failures[:10])
        more = f" and {len(failures) - 10} more" * (len(failures) > 10)
        raise PhotoError(
            f"{len(failures)} of {count(len(planned.jobs), planned.kind)} could not be undistorted "
            f"({names}{more}): the reasons are above, the others are done"
        )
