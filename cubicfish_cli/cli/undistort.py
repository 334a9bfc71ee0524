"""``cubicfish undistort``: photos to pictures in which straight lines are straight."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import json_keys, options
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
    mask_option,
    trusted_within,
    uncertainty_of,
)
from cubicfish_cli.cli.options import as_command, option
from cubicfish_cli.cli.rendering_options import (
    RenderingOptions,
    crop_option,
    rendering_options,
)
from cubicfish_cli.cli.rig_options import RigOptions, rig_options
from cubicfish_cli.cli.scheduler_options import SchedulerOptions, scheduler_options
from cubicfish_cli.cli.terminal import print_json, progress, result, say, tell
from cubicfish_cli.cli.undistort_dry_run import (
    dry_run_of,
    print_dry_run,
    say_what_is_unseen,
    warn_of_limit,
)
from cubicfish_cli.cli.undistort_failures import ending, failure_lines, share_a_reason
from cubicfish_cli.cli.undistort_plan import Plan, plan_of
from cubicfish_cli.cli.video_options import EncodingOptions, encoding_options
from cubicfish_cli.cli.view_options import ViewOptions, view_options

if TYPE_CHECKING:
    from cubicfish_cli.cli.mask_limit import Trusted
    from cubicfish_cli.formats.camera_yaml import CameraFile, PointCameraFile
    from cubicfish_cli.undistortion.batch import FailedPhoto, PhotoJob
    from cubicfish_cli.undistortion.frames import Crop
    from cubicfish_cli.undistortion.maps import UndistortMap
    from cubicfish_cli.words.finding import Finding


@as_command(
    "undistort",
    "Photos and videos to pictures in which straight lines are straight.",
    "cubicfish undistort photo.png flat.png",
    "cubicfish undistort photos/ flat/ --hfov 90 --size 1920x1080",
    "cubicfish undistort photo.png left.png --rotate -60,0,0 --hfov 80",
    "cubicfish undistort photos/ all/ --view equidistant --fit outer --skip-existing",
    "find . -name '*.jpg' | cubicfish undistort - flat/ -j 4",
    "cubicfish undistort photo.jpg floor.png --plane floor --target target.yaml",
    "cubicfish undistort drive.mp4 flat.mp4 --hfov 100 --crf 20",
    "cubicfish undistort photos/ flat/ --scheduler tcp://node1:8786",
    "cubicfish undistort left/1.png right/1.png all.png --rig rig",
    "cubicfish undistort shots/ above/ --rig rig --ground 1200,-10",
)
@options.argument(
    "sources",
    "Photos or videos: files, folders or globs; '-' reads their names from stdin.",
    type=options.NAME,
    nargs=-1,
    required=True,
    metavar="IN...",
    missing="IN and OUT are both needed: 'cubicfish undistort in.png out.png', or for a folder "
    "'cubicfish undistort photos/ flat/'",
)
@options.argument(
    "destination", "The picture or video that is made of one; of several, a folder.", metavar="OUT"
)
@options.model_option
@rig_options
@view_options
@plane_options
@crop_option
@rendering_options
@encoding_options
@mask_option
@mask_limit_option
@option(
    "--camera FILE",
    "Also write the virtual camera of the result: for flat.png, flat.view.yaml and "
    "flat.view.opencv.yaml.",
    options.FILE,
    to="camera_out",
)
@option("--skip-existing", "Leave out photos whose result exists.")
@option("--dry-run", "Say what would be done, and write nothing.")
@options.overwrite_option
@options.json_option(json_keys.UNDISTORT)
@options.jobs_option
@scheduler_options
def command(
    sources: tuple[str, ...],
    destination: Path,
    model: Path | None,
    rig: RigOptions,
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
    as_json: bool,
    jobs: int | None,
    scheduler: SchedulerOptions,
) -> None:
    """Render a picture OUT of the photo IN, or a video of a video; flat unless --view says so.

    With several photos, a folder or a quoted glob as IN, OUT is a folder and the pictures keep
    their names; '-' reads the photos' names from stdin. Pixels that the camera does not see are
    black. Depth, channels, and a JPEG's EXIF record and quality are kept, and so are a video's
    audio and timestamps.

    With --rig the photos are those of a rig's cameras, and each shot becomes one picture: a
    panorama in any --view (equirectangular unless another is named), the ground from above with
    --ground or --plane, or with --view cube flat faces about each camera, with masks and poses.
    """
    from cubicfish_cli.undistortion.batch import undistort_photos

    if skip_existing and overwrite:
        raise click.UsageError("--skip-existing and --overwrite exclude each other")
    if rig.is_asked:
        refused = {
            "--crop": crop,
            "--mask-limit": mask_limit,
            "--skip-existing": skip_existing,
            "--dry-run": dry_run,
            "--scheduler": scheduler.address,
        }
        for name, given in refused.items():
            if given:
                raise click.UsageError(f"{name} is for the photos of one camera: leave it out")
        from cubicfish_cli.cli.undistort_rig import undistort_rig

        undistort_rig(
            sources,
            destination,
            rig,
            view,
            plane,
            pixels.rendering(),
            mask=mask,
            camera_out=camera_out,
            overwrite=overwrite,
            as_json=as_json,
        )
        return
    scheduler.check(jobs)
    check_mask_limit(mask_limit, mask)
    plane.check(view)
    planned = plan_of(sources, destination, view, plane)
    if planned.videos and scheduler.address is not None:
        raise click.UsageError("--scheduler is for photos: do videos without it")
    camera_file = options.model_path(model)
    chosen, loaded = _views(camera_file, crop, view, plane)
    trusted: Callable[[tuple[int, int]], Trusted] | None = None
    if mask_limit is not None:
        trusted = partial(_trusted, mask_limit, uncertainty_of(loaded, camera_file), loaded, crop)
    planned = planned.free(skip_existing=skip_existing, overwrite=overwrite)
    with scheduler.connected(needed=bool(planned.jobs) and not dry_run) as executor:
        if isinstance(chosen, PlanesOfPhotos):
            chosen.find_missing([*planned.jobs, *planned.skipped], executor)
        if dry_run:
            found = dry_run_of(planned, chosen)
            if as_json:
                print_json({"model": str(camera_file), **found.as_record(planned)})
            else:
                print_dry_run(planned, found)
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
                    executor=executor,
                )
                if executor is None:
                    failures = [*failures, *_gone(planned, failures)]
    if as_json:
        record = _record(planned, failures, chosen)
        extra_files = [str(path) for path in extras]
        print_json({"model": str(camera_file), **record, "extra_files": extra_files})
    else:
        _print(planned, failures, chosen)
        if not failures:
            for path in extras:
                result(f"wrote {path}")
    _end_with(planned, failures, as_json=as_json)


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


def _undistort_videos(
    planned: Plan,
    chosen: Views,
    pixels: RenderingOptions,
    encoding: EncodingOptions,
    *,
    overwrite: bool,
) -> list[FailedPhoto]:
    """One video after the other; one that fails does not stop the others."""
    from cubicfish_cli.errors import CubicfishError
    from cubicfish_cli.undistortion.batch import FailedPhoto
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
            failures.append(FailedPhoto(job=job, error=error))
            continue
        if done.turned_deg:
            say(
                f"{job.outputs[0]}: the source tells players to turn it by {done.turned_deg}°, "
                "which the result does not: turn it with --rotate 0,0,DEG"
            )
    return failures


def _first_map(chosen: Views, source: Path, size: tuple[int, int]) -> UndistortMap:
    return chosen.maps(source, size)[0]


def _extras(
    mask: Path | None,
    camera_out: Path | None,
    planned: Plan,
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


def _done(planned: Plan, failures: Sequence[FailedPhoto]) -> list[PhotoJob]:
    failed = {failure.job.source for failure in failures}
    return [job for job in planned.jobs if job.source not in failed]


def _gone(planned: Plan, failures: Sequence[FailedPhoto]) -> list[FailedPhoto]:
    """Photos whose results were written and are not there: somebody removed their folder."""
    from cubicfish_cli.errors import OutputError
    from cubicfish_cli.undistortion.batch import FailedPhoto

    lost = []
    for job in _done(planned, failures):
        missing = next((path for path in job.wanted if not path.is_file()), None)
        if missing is not None:
            why = "is gone again: was its folder removed or renamed meanwhile?"
            lost.append(FailedPhoto(job=job, error=OutputError(f"{missing} {why}")))
    return lost


def _record(planned: Plan, failures: Sequence[FailedPhoto], chosen: Views) -> dict[str, Any]:
    """What was done, as plain data for JSON."""
    done = _done(planned, failures)
    view = chosen.view(done[0].source, planned.size_of(done[0])) if done else None
    return {
        "dry_run": False,
        "images": len(done),
        "files": [str(path) for job in done for path in job.wanted],
        "skipped": [job.name for job in planned.skipped],
        "failed": [
            {
                **_told(failure).as_record(),
                "image": failure.job.name,
                "problem": str(failure.error),
            }
            for failure in failures
        ],
        "view": view and view.as_record(),
    }


def _told(failure: FailedPhoto) -> Finding:
    from cubicfish_cli.words.codes import Code, Severity
    from cubicfish_cli.words.finding import Finding

    return Finding(
        code=Code.FAILED,
        severity=Severity.BAD,
        images=(failure.job.name,),
        figures={"problem": str(failure.error)},
    )


def _print(planned: Plan, failures: Sequence[FailedPhoto], chosen: Views) -> None:
    """Say what was written."""
    done = _done(planned, failures)
    if done or not share_a_reason(failures):  # else the error at the end says it
        for line in failure_lines(failures, planned.kind):
            tell(f"failed: {line}")
    if planned.skipped:
        say(f"skipped {count(len(planned.skipped), planned.kind)} whose result exists")
    if done:
        view = chosen.view(done[0].source, planned.size_of(done[0]))
        files = sum(len(job.wanted) for job in done)
        single = planned.one and files == 1
        wrote = (
            str(done[0].wanted[0])
            if single
            else f"{count(files, 'video' if planned.videos else 'picture')}"
        )
        folder = planned.destination.parent if planned.one else planned.destination
        where = "" if single else f" to {folder}"
        result(f"wrote {wrote}{where}: {view.describe()}")
        say_what_is_unseen(chosen.seen(done[0].source, planned.size_of(done[0])))
        warn_of_limit(view)
    elif not failures:
        result("nothing to do")


def _end_with(planned: Plan, failures: Sequence[FailedPhoto], *, as_json: bool) -> None:
    """End with an error when a photo failed.

    Args:
        planned: what was to be done.
        failures: what was not.
        as_json: whether the reasons went to stdout.

    """
    from cubicfish_cli.errors import PhotoError

    if not failures:
        return
    if len(planned.jobs) == 1:
        raise failures[0].error
    told_in: str | None = "in the JSON" if as_json else "above"
    if not as_json and len(failures) == len(planned.jobs) and share_a_reason(failures):
        told_in = None
    raise PhotoError(ending(failures, len(planned.jobs), planned.kind, told_in=told_in))
