"""``cubicfish undistort``: photos to pictures in which straight lines are straight."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.app.asked_pictures import UndistortOptions
from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.figures import count
from cubicfish_cli.app.terminal.options import as_command, record
from cubicfish_cli.app.terminal.progress import SchedulerOptions, running, scheduler_options
from cubicfish_cli.app.terminal.terminal import print_json, print_wrote, result, say, tell
from cubicfish_cli.commands.view_options import say_what_is_unseen, undistort_options
from cubicfish_cli.core.errors import CubicfishError, OutputError, PhotoError
from cubicfish_cli.core.phrases import listed

if TYPE_CHECKING:
    from cubicfish_cli.commands.undistorting import UndistortedFiles
    from cubicfish_cli.core.views.choose import ChosenView


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
    output: Path = options.argument(
        "The picture or video that is made of one; of several, or without a suffix, a folder.",
        metavar="OUT",
    )
    model: Path | None = options.model_option
    asked: UndistortOptions = undistort_options
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option
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
    "cubicfish undistort photo.jpg floor.png --view plane:floor --target target.yaml",
    "cubicfish undistort drive.mp4 flat.mp4 --hfov 100 --crf 20",
    "cubicfish undistort photos/ flat/ --scheduler tcp://node1:8786",
)
def command(given: Asked) -> None:
    """Render a picture OUT of the photo IN, or a video of a video; flat unless --view says so.

    With several photos, a folder or a quoted glob as IN, OUT is a folder and the pictures keep
    their names; '-' reads the photos' names from stdin. Pixels that the camera does not see are
    black. Depth, channels, and a JPEG's EXIF record and quality are kept, and so are a video's
    audio and timestamps.
    """
    from cubicfish_cli.commands.undistorting import undistort_files

    given.scheduler.check(given.jobs)
    photos = named_sources(given.sources)
    camera = options.model_path(given.model)
    with running(jobs=given.jobs, overwrite=given.overwrite, scheduler=given.scheduler) as run:
        made = undistort_files(photos, given.output, camera, given.asked, run=run)
    end_with_pictures(made, as_json=given.as_json)


def end_with_pictures(made: UndistortedFiles, *, as_json: bool) -> None:
    """Print what was written, and end with an error when something failed."""
    if as_json:
        print_json(made.as_record())
    else:
        _print(made)
    _end_with(made, as_json=as_json)


def named_sources(sources: Sequence[str]) -> str | list[str]:
    """The sources, with the names that stdin lists in the place of '-'; one that is named alone."""
    if len(sources) == 1 and sources[0] != "-":
        return sources[0]
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


def _print(made: UndistortedFiles) -> None:
    """Print what was written, and on stderr what was not."""
    if made.files or len(_by_reason(made.failures)) > 1:  # else the error at the end says it
        for line in _failure_lines(made.failures, made.kind):
            tell(f"failed: {line}")
    if made.skipped:
        say(f"skipped {count(len(made.skipped), made.kind)} whose result exists")
    if made.view is not None:
        result(f"wrote {_wrote(made, made.view)}")
        say_what_is_unseen(made.seen)
        _warn_of_limit(made.view)
    elif not made.failures:
        result("nothing to do")
    if not made.failures:
        print_wrote(made.extras)


def _wrote(made: UndistortedFiles, view: ChosenView) -> str:
    """The picture or how many there are, where they are, and what they show."""
    folder = made.output if made.output.is_dir() else made.output.parent
    what = count(len(made.files), "video" if made.kind == "video" else "picture")
    alone = len(made.files) == len(made.names) == 1
    return f"{made.files[0] if alone else f'{what} to {folder}'}: {view.describe()}"


def _warn_of_limit(view: ChosenView) -> None:
    """Tell the user where the view ends before the camera's field does."""
    if view.at_limit:
        say(
            f"the camera sees more than a {view.first.kind} picture can show: its field ends at "
            "the view's own limit, and --view stereographic or equidistant shows all"
        )


def _end_with(made: UndistortedFiles, *, as_json: bool) -> None:
    """End with an error when something failed: how many, where the reasons are, what is done.

    Args:
        made: what was done, and what was not.
        as_json: whether the reasons went to stdout.

    """
    failures, total = made.failures, count(len(made.names), made.kind)
    if not failures:
        return
    if len(made.names) == 1:
        raise next(iter(failures.values()))
    told_in, done = "in the JSON" if as_json else "above", len(made.written)
    if not done:
        reasons = list(_by_reason(failures))
        shared = len(reasons) == 1 and not as_json
        why = reasons[0] if shared else f"the reasons are {told_in}"
        raise PhotoError(f"none of {total} could be undistorted: {why}")
    rest = "the other is done" if done == 1 else f"the other {done:,} are done"
    why = f"{'the reason is' if len(failures) == 1 else 'the reasons are'} {told_in}"
    raise PhotoError(f"{len(failures):,} of {total} could not be undistorted: {why}, {rest}")


Failures = Mapping[str, CubicfishError]


def _failure_lines(failures: Failures, kind: str) -> list[str]:
    """A line for each reason, and for which photos it holds.

    Args:
        failures: photos, and why.
        kind: what they are, in a word.

    """
    lines = []
    for reason, names in _by_reason(failures).items():
        if len(names) > 1:
            named = f"{count(len(names), kind)} ({listed(names, f'{kind}s')})"
            lines.append(f"{named}: {reason}")
        else:
            lines.append(f"shot {names[0]}: " * (kind == "shot") + str(failures[names[0]]))
    return lines


def _by_reason(failures: Failures) -> dict[str, list[str]]:
    groups: dict[str, list[str]] = {}
    for name, error in failures.items():
        groups.setdefault(_reason(error), []).append(name)
    return groups


def _reason(error: CubicfishError) -> str:
    """Why, without what is the photo's own: "each is empty: ..." for "a.png is empty: ..."."""
    if not error.about:
        return str(error)
    text = f"{error.what}: {error.do}" if error.do else error.what
    if error.apart:
        return text
    return f"{'each result' if isinstance(error, OutputError) else 'each'} {text}"
