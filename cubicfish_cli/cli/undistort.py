"""``cubicfish undistort``: photos to pictures in which straight lines are straight."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import as_command, changed, option, record
from cubicfish_cli.cli.progress import (
    SchedulerOptions,
    listening,
    running,
    scheduler_options,
)
from cubicfish_cli.cli.rendering_options import (
    EncodingOptions,
    MaskOptions,
    RenderingOptions,
    crop_option,
    encoding_options,
    mask_options,
    rendering_options,
)
from cubicfish_cli.cli.terminal import print_json, print_wrote, result, say, tell
from cubicfish_cli.cli.view_options import (
    PlaneOptions,
    RigOptions,
    ViewOptions,
    plane_options,
    rig_options,
    say_what_is_unseen,
    view_options,
)
from cubicfish_cli.errors import OutputError, PhotoError

if TYPE_CHECKING:
    from cubicfish_cli.library.rig_shots import Done, PlaneOfGround
    from cubicfish_cli.library.undistorting import DryRun, Plan, Undistorted
    from cubicfish_cli.undistortion.batch import FailedPhoto
    from cubicfish_cli.undistortion.choose import ChosenView
    from cubicfish_cli.undistortion.frames import Crop


_MOST_NAMES = 10


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
        _undistort_rig(given)
        return
    from cubicfish_cli.formats.camera_yaml import load_any_camera, load_camera
    from cubicfish_cli.library.undistorting import Plan, dry_run_of, undistort_plan
    from cubicfish_cli.library.views import ViewsBySize

    view, mask = given.view, given.mask
    given.scheduler.check(given.jobs)
    mask.check()
    given.plane.check(view)
    in_planes = given.plane.board is not None
    names = _with_stdin(given.sources)
    with listening() as listener:
        plan = Plan.of_names(
            names,
            given.destination,
            view.parts,
            listed=names != [*given.sources],
            planes=in_planes,
            listener=listener,
        )
    if plan.videos and given.scheduler.address is not None:
        raise click.UsageError("--scheduler is for photos: do videos without it")
    path = options.model_path(given.model)
    loaded: Any = load_any_camera(path) if in_planes else load_camera(path)
    planes = given.plane.views(loaded, given.crop) if in_planes else None
    views = planes or ViewsBySize(loaded.camera, given.crop, view.chosen)
    trusted = mask.trusted(loaded, path, given.crop)
    plan = plan.free(skip_existing=given.skip_existing, overwrite=given.overwrite)
    with running(
        jobs=given.jobs,
        overwrite=given.overwrite,
        scheduler=given.scheduler,
        needed=bool(plan.jobs) and not given.dry_run,
    ) as run:
        if planes is not None:
            planes.place([job.source for job in (*plan.jobs, *plan.skipped)], run)
        if not given.dry_run:
            made = undistort_plan(
                plan,
                views,
                given.pixels.rendering(),
                given.encoding.encoding(),
                run,
                mask=mask.mask,
                masked=trusted,
                camera_out=given.camera_out,
                skip_existing=given.skip_existing,
            )
    if given.dry_run:
        found = dry_run_of(plan, views)
        if given.as_json:
            print_json({"model": str(path), **found.as_record()})
        else:
            _print_dry_run(found)
        return
    if given.as_json:
        print_json({"model": str(path), **made.as_record()})
    else:
        _print(made, given.destination)
    _end_with(plan, made.failures, as_json=given.as_json)


def _undistort_rig(given: Asked) -> None:
    """Make a picture of every shot of a rig, and say what came of it."""
    from cubicfish_cli.library.rig_shots import undistort_shots

    view, plane, asked = given.view, given.plane, given.rig
    mask, camera_out = given.mask.mask, given.camera_out
    above = asked.ground is not None or plane.board is not None
    if plane.board is None:
        options.refuse_given("goes with --plane", {"--shot": asked.shot is not None})
    if not above:
        ways = {"--margin": plane.margin, "--pixels-per-unit": plane.pixels_a_unit}
        named = {name: value is not None for name, value in ways.items()}
        options.refuse_given("goes with --ground or --plane", named)
    elif asked.distance is not None:
        raise click.UsageError("the ground has a distance of its own: leave out --distance")
    path = options.rig_file(asked.rig)
    if view.kind == "perspective" and not options.is_given("kind"):
        view = changed(view, kind="equirectangular")
    faces = not above and view.kind == "cube" and view.layout != "cross"
    if faces and (mask is not None or camera_out is not None):
        raise click.UsageError(
            "the faces of a rig's cube have masks and cameras beside them: leave out "
            f"{'--mask' if mask is not None else '--camera'}"
        )
    with running(overwrite=given.overwrite) as run:
        made = undistort_shots(
            path,
            given.sources,
            given.destination,
            view.chosen,
            given.pixels.rendering(),
            run,
            faces=faces,
            ground=_ground(view, plane, asked) if above else None,
            distance=asked.distance,
            mask=mask,
            camera_out=camera_out,
        )
    files = made.done.files
    if given.as_json:
        print_json(made.as_record())
    elif files:
        where = f"{count(len(files), 'picture')} to {given.destination}"
        if faces:
            side = made.faces[0].map.view.size[0]
            wrote = (
                f"{count(len(files), 'shot')} to {given.destination}: "
                f"{count(len(made.faces), 'face')} of {side}x{side} pixels each, with masks"
            )
        else:
            if len(files) == 1:
                where = str(next(iter(files.values()))[0])
            wrote = f"{where}: {made.view.describe()}"
        result(f"wrote {wrote}")
        print_wrote(made.extras)
    _end_of_shots(made.done, told=given.as_json)


def _ground(view: ViewOptions, plane: PlaneOptions, asked: RigOptions) -> PlaneOfGround:
    """The ground that is asked for."""
    from cubicfish_cli.library.rig_shots import PlaneOfGround

    if any(view.rotate) or view.hfov_deg or view.vfov_deg or view.focal or view.fit is not None:
        raise click.UsageError(
            "the ground's picture is set by --pixels-per-unit and --margin: leave out the view's "
            "options"
        )
    if view.size is not None:
        raise click.UsageError("the ground's picture has the size that --pixels-per-unit gives it")
    if asked.ground is not None and plane.board is not None:
        raise click.UsageError("--ground and --plane say the same thing twice: leave one out")
    return PlaneOfGround(
        below=asked.ground or (0.0, 0.0, 0.0),
        board=None if plane.board is None else (plane.loaded(), plane.board),
        shot=asked.shot,
        margin=plane.margin,
        pixels_per_unit=plane.pixels_a_unit,
    )


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


def _print(made: Undistorted, destination: Path) -> None:
    """Print what was written, and on stderr what was not."""
    plan, failures, files = made.plan, made.failures, made.files
    if files or not _share_a_reason(failures):  # else the error at the end says it
        for line in _failure_lines(failures, plan.kind):
            tell(f"failed: {line}")
    if plan.skipped:
        say(f"skipped {count(len(plan.skipped), plan.kind)} whose result exists")
    if made.view is not None:
        folder = destination.parent if plan.one else destination
        what = f"{count(len(files), 'video' if plan.videos else 'picture')} to {folder}"
        named = files[0] if plan.one and len(files) == 1 else what
        result(f"wrote {named}: {made.view.describe()}")
        say_what_is_unseen(made.seen)
        _warn_of_limit(made.view)
    elif not failures:
        result("nothing to do")
    if not failures:
        print_wrote(made.extras)


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
    for line in _failure_lines(found.bad, plan.kind):
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
    if not failures:
        return
    if len(plan.jobs) == 1:
        raise failures[0].error
    told_in: str | None = "in the JSON" if as_json else "above"
    if not as_json and len(failures) == len(plan.jobs) and _share_a_reason(failures):
        told_in = None
    raise PhotoError(_ending(failures, len(plan.jobs), plan.kind, told_in=told_in))


def _failure_lines(failures: Sequence[FailedPhoto], kind: str) -> list[str]:
    """A line for each reason, and for which photos it holds.

    Args:
        failures: photos, and why.
        kind: what they are, in a word.

    """
    return [
        str(own[0].error) if len(own) == 1 else f"{_several(own, kind)}: {reason}"
        for reason, own in _by_reason(failures).items()
    ]


def _ending(failures: Sequence[FailedPhoto], total: int, kind: str, *, told_in: str | None) -> str:
    """What a run says at its end: how many failed, where the reasons are, and what is done.

    Args:
        failures: photos, and why; one at least.
        total: how many there were.
        kind: what they are, in a word.
        told_in: where the reasons are, None where they are still to be told.

    """
    done = total - len(failures)
    if not done:
        reasons = list(_by_reason(failures))
        why = reasons[0] if told_in is None and len(reasons) == 1 else f"the reasons are {told_in}"
        return f"none of {count(total, kind)} could be undistorted: {why}"
    rest = "the other is done" if done == 1 else f"the other {done:,} are done"
    why = f"{'the reason is' if len(failures) == 1 else 'the reasons are'} {told_in}"
    return f"{len(failures):,} of {count(total, kind)} could not be undistorted: {why}, {rest}"


def _share_a_reason(failures: Sequence[FailedPhoto]) -> bool:
    """Whether one sentence is true of all of them."""
    return len(_by_reason(failures)) == 1


def _by_reason(failures: Sequence[FailedPhoto]) -> dict[str, list[FailedPhoto]]:
    groups: dict[str, list[FailedPhoto]] = {}
    for failure in failures:
        groups.setdefault(_reason(failure), []).append(failure)
    return groups


def _reason(failure: FailedPhoto) -> str:
    """Why, without what is the photo's own: "each is empty: ..." for "a.png is empty: ..."."""
    error = failure.error
    if not error.about:
        return str(error)
    text = f"{error.what}: {error.do}" if error.do else error.what
    if error.apart:
        return text
    return f"{'each result' if isinstance(error, OutputError) else 'each'} {text}"


def _several(failures: Sequence[FailedPhoto], kind: str) -> str:
    names = [failure.job.name for failure in failures]
    listed = ", ".join(names[:_MOST_NAMES])
    more = f" and {len(names) - _MOST_NAMES:,} more" * (len(names) > _MOST_NAMES)
    return f"{count(len(names), kind)} ({listed}{more})"


def _end_of_shots(done: Done, *, told: bool) -> None:
    """End with an error when a shot failed."""
    failures, total = done.failures, len(done.files) + len(done.failures)
    if not failures:
        return
    if total == 1:
        raise next(iter(failures.values()))
    if not told:
        for shot, problem in failures.items():
            tell(f"failed: shot {shot}: {problem}")
    where = "in the JSON" if told else "above"
    raise PhotoError(
        f"{len(failures)} of {total} shots could not be done, for the reasons {where}; the others "
        "are done"
    )
