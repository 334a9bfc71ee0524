"""``cubicfish undistort``: photos to pictures in which straight lines are straight."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import as_command, option, record
from cubicfish_cli.cli.progress import listening, running
from cubicfish_cli.cli.rendering_options import (
    EncodingOptions,
    MaskOptions,
    RenderingOptions,
    crop_option,
    encoding_options,
    mask_options,
    rendering_options,
)
from cubicfish_cli.cli.scheduler_options import SchedulerOptions, scheduler_options
from cubicfish_cli.cli.terminal import print_json, print_wrote, result, say, tell
from cubicfish_cli.cli.undistort_failures import ending, failure_lines, share_a_reason
from cubicfish_cli.cli.undistort_sources import plan_of
from cubicfish_cli.cli.view_options import (
    PlaneOptions,
    RigOptions,
    ViewOptions,
    plane_options,
    rig_options,
    say_what_is_unseen,
    view_options,
)

if TYPE_CHECKING:
    from cubicfish_cli.executors.executor import Executor
    from cubicfish_cli.formats.camera_yaml import CameraFile, PointCameraFile
    from cubicfish_cli.library.masks import TrustedWithin
    from cubicfish_cli.library.planes import PlanesOfPhotos
    from cubicfish_cli.library.undistorting import DryRun, Plan
    from cubicfish_cli.library.views import Views
    from cubicfish_cli.undistortion.batch import FailedPhoto
    from cubicfish_cli.undistortion.choose import ChosenView
    from cubicfish_cli.undistortion.frames import Crop


@record
class Asked:
    """What is asked of ``cubicfish undistort``."""

    sources: tuple[str, ...] = options.argument(
        "Photos or videos: files, folders or globs; '-' reads their names from stdin.",
        type=options.NAME,
        nargs=-1,
        required=True,
        metavar="IN...",
        missing="IN and OUT are both needed: 'cubicfish undistort in.png out.png', or for a folder "
        "'cubicfish undistort photos/ flat/'",
    )
    destination: Path = options.argument(
        "The picture or video that is made of one; of several, a folder.", metavar="OUT"
    )
    model: Path | None = options.model_option
    rig: RigOptions = rig_options
    view: ViewOptions = view_options
    plane: PlaneOptions = plane_options
    crop: Crop | None = crop_option
    pixels: RenderingOptions = rendering_options
    encoding: EncodingOptions = encoding_options
    mask: MaskOptions = mask_options
    camera_out: Path | None = option(
        "--camera FILE",
        "Also write the virtual camera of the result: for flat.png, flat.view.yaml and "
        "flat.view.opencv.yaml.",
        options.FILE,
    )
    skip_existing: bool = option("--skip-existing", "Leave out photos whose result exists.")
    dry_run: bool = option("--dry-run", "Say what would be done, and write nothing.")
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option("undistort")
    jobs: int | None = options.jobs_option
    scheduler: SchedulerOptions = scheduler_options


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
def command(given: Asked) -> None:
    """Render a picture OUT of the photo IN, or a video of a video; flat unless --view says so.

    With several photos, a folder or a quoted glob as IN, OUT is a folder and the pictures keep
    their names; '-' reads the photos' names from stdin. Pixels that the camera does not see are
    black. Depth, channels, and a JPEG's EXIF record and quality are kept, and so are a video's
    audio and timestamps.

    With --rig the photos are those of a rig's cameras, and each shot becomes one picture: a
    panorama in any --view (equirectangular unless another is named), the ground from above with
    --ground or --plane, or with --view cube flat faces about each camera, with masks and poses.
    """
    if given.skip_existing and given.overwrite:
        raise click.UsageError("--skip-existing and --overwrite exclude each other")
    if given.rig.is_asked:
        options.refuse_given(
            "is for the photos of one camera: leave it out",
            {
                "--crop": given.crop,
                "--mask-limit": given.mask.mask_limit,
                "--skip-existing": given.skip_existing,
                "--dry-run": given.dry_run,
                "--scheduler": given.scheduler.address,
            },
        )
        from cubicfish_cli.cli.undistort_rig import undistort_rig

        undistort_rig(
            given.sources,
            given.destination,
            given.rig,
            given.view,
            given.plane,
            given.pixels.rendering(),
            mask=given.mask.mask,
            camera_out=given.camera_out,
            overwrite=given.overwrite,
            as_json=given.as_json,
        )
        return
    from cubicfish_cli.formats.camera_yaml import load_any_camera, load_camera
    from cubicfish_cli.library.undistorting import dry_run_of, failure_record, undistort_plan
    from cubicfish_cli.library.views import ViewsBySize

    given.scheduler.check(given.jobs)
    given.mask.check()
    given.plane.check(given.view)
    plan, one = plan_of(given.sources, given.destination, given.view, given.plane)
    if plan.videos and given.scheduler.address is not None:
        raise click.UsageError("--scheduler is for photos: do videos without it")
    path = options.model_path(given.model)
    planes: PlanesOfPhotos | None = None
    views: Views
    loaded: CameraFile | PointCameraFile
    if given.plane.board is not None:
        loaded = load_any_camera(path)
        views = planes = given.plane.views(loaded, given.crop)
    else:
        loaded = central = load_camera(path)
        views = ViewsBySize(central.camera, given.crop, given.view.chosen)
    trusted = given.mask.trusted(loaded, path, given.crop)
    plan = plan.free(skip_existing=given.skip_existing, overwrite=given.overwrite)
    with given.scheduler.connected(needed=bool(plan.jobs) and not given.dry_run) as executor:
        if planes is not None:
            _place(planes, [job.source for job in (*plan.jobs, *plan.skipped)], executor)
        if given.dry_run:
            found = dry_run_of(plan, views)
            if given.as_json:
                print_json({"model": str(path), **found.as_record()})
            else:
                _print_dry_run(found)
            return
        extras = _extras(
            plan,
            views,
            given.mask.mask,
            given.camera_out,
            trusted,
            given.overwrite,
            given.skip_existing,
        )
        with running(jobs=given.jobs, overwrite=given.overwrite, executor=executor) as run:
            failures = undistort_plan(
                plan, views, given.pixels.rendering(), given.encoding.encoding(), run
            )
    done = plan.done(failures)
    shown = views.view(done[0].source, plan.size_of(done[0])) if done else None
    if given.as_json:
        failed = [failure_record(failure) for failure in failures]
        record = plan.as_record(done, failed, shown, extra_files=[str(path) for path in extras])
        print_json({"model": str(path), **record})
    else:
        if done or not share_a_reason(failures):  # else the error at the end says it
            for line in failure_lines(failures, plan.kind):
                tell(f"failed: {line}")
        if plan.skipped:
            say(f"skipped {count(len(plan.skipped), plan.kind)} whose result exists")
        if shown is not None:
            files = [path for job in done for path in job.wanted]
            folder = given.destination.parent if one else given.destination
            what = f"{count(len(files), 'video' if plan.videos else 'picture')} to {folder}"
            result(f"wrote {files[0] if one and len(files) == 1 else what}: {shown.describe()}")
            say_what_is_unseen(views.seen(done[0].source, plan.size_of(done[0])))
            _warn_of_limit(shown)
        elif not failures:
            result("nothing to do")
        if not failures:
            print_wrote(extras)
    _end_with(plan, failures, as_json=given.as_json)


def _place(planes: PlanesOfPhotos, photos: Sequence[Path], executor: Executor | None) -> None:
    missing = planes.without_pose(photos)
    if missing:
        say(f"Looking for corners in {count(len(missing), 'photo')} that have no known pose.")
        with listening() as listener:
            planes.place(missing, listener.counting("Finding corners"), executor)


def _extras(
    plan: Plan,
    views: Views,
    mask: Path | None,
    camera_out: Path | None,
    trusted: TrustedWithin | None,
    overwrite: bool,
    skip_existing: bool,
) -> list[Path]:
    """Write the mask and the virtual camera, which are the same for all photos of one size."""
    jobs = [*plan.jobs, *plan.skipped]
    if (mask is None and camera_out is None) or not jobs:
        return []
    from cubicfish_cli.errors import ViewError
    from cubicfish_cli.files import refuse_existing, write_files
    from cubicfish_cli.undistortion.view_files import view_files

    sizes = {job.source: plan.size_of(job) for job in jobs}
    if len({views.group(source, size) for source, size in sizes.items()}) > 1:
        raise ViewError(
            "these photos have a mask and a virtual camera each, since their sizes or planes "
            "differ: do them one at a time"
        )
    source, size = next(iter(sizes.items()))
    maps = dict(zip(views.view(source, size).views, views.maps(source, size), strict=True))
    masked = None if trusted is None else partial(trusted.mask, size=size)
    files = view_files(maps, mask=mask, beside=camera_out, masked=masked)
    if skip_existing:
        files = {path: content for path, content in files.items() if not path.is_file()}
    refuse_existing(*files, overwrite=overwrite, can_skip=not skip_existing)
    return write_files(files, overwrite=overwrite)


def _print_dry_run(found: DryRun) -> None:
    """Print how many files, which fields, and how much of them is empty."""
    plan, jobs = found.plan, found.possible
    files = sum(len(job.wanted) for job in jobs)
    skipped = f", {len(plan.skipped)} skipped" * bool(plan.skipped)
    given = count(len(plan.jobs), plan.kind)
    if len(jobs) < len(plan.jobs):
        given = f"{len(jobs):,} of {given}"
    result(f"would write {count(files, 'file')} from {given}{skipped}")
    for group in found.groups:
        result(f"{count(len(group.images), plan.kind)} of {{}}x{{}} pixels:".format(*group.size))
        if group.view is None or group.empty_share is None:
            result(f"  cannot be done: {group.problem}")
            continue
        result(f"  view          {group.view.describe()}")
        if group.seen is not None:
            result(f"  camera sees   {group.seen.describe()}")
        if group.kept_share is not None:
            result(f"  kept field    {100 * group.kept_share:.1f} % of what the camera sees")
        result(f"  empty pixels  {100 * group.empty_share:.1f} %")
        _warn_of_limit(group.view)
    for line in failure_lines(found.bad, plan.kind):
        say(f"would fail: {line}")


def _warn_of_limit(view: ChosenView) -> None:
    """Tell the user where the view ends before the camera's field does."""
    if view.at_limit:
        say(
            f"the camera sees more than a {view.first.kind} picture can show: its field ends at "
            "the view's own limit, and --view stereographic or equidistant shows all"
        )


def _end_with(plan: Plan, failures: Sequence[FailedPhoto], *, as_json: bool) -> None:
    """End with an error when a photo failed.

    Args:
        plan: what was to be done.
        failures: what was not.
        as_json: whether the reasons went to stdout.

    """
    from cubicfish_cli.errors import PhotoError

    if not failures:
        return
    if len(plan.jobs) == 1:
        raise failures[0].error
    told_in: str | None = "in the JSON" if as_json else "above"
    if not as_json and len(failures) == len(plan.jobs) and share_a_reason(failures):
        told_in = None
    raise PhotoError(ending(failures, len(plan.jobs), plan.kind, told_in=told_in))
