"""What a run of ``cubicfish undistort`` would do: ``--dry-run``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cubicfish_cli.cli.chosen_views import Views
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.terminal import result, say
from cubicfish_cli.cli.undistort_failures import failure_lines
from cubicfish_cli.cli.undistort_plan import Plan
from cubicfish_cli.cli.view_options import ChosenView, SeenField

if TYPE_CHECKING:
    from cubicfish_cli.undistortion.batch import FailedPhoto, PhotoJob


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
    size: tuple[int, int]
    view: ChosenView | None = None
    seen: SeenField | None = None
    kept_share: float | None = None
    empty_share: float | None = None
    problem: str | None = None


@dataclass(frozen=True, kw_only=True)
class DryRun:
    """What a run would do.

    Attributes:
        groups: which views.
        bad: photos that cannot be read.

    """

    groups: Sequence[Group]
    bad: Sequence[FailedPhoto]

    def possible(self, planned: Plan) -> list[PhotoJob]:
        """The photos of which something can be made."""
        left_out = {failure.job.name for failure in self.bad}
        for group in self.groups:
            if group.problem is not None:
                left_out.update(group.images)
        return [job for job in planned.jobs if job.name not in left_out]

    def as_record(self, planned: Plan) -> dict[str, Any]:
        """Plain data for JSON."""
        bad = [(failure.job.name, str(failure.error)) for failure in self.bad]
        for group in self.groups:
            bad += [(name, group.problem) for name in group.images if group.problem is not None]
        jobs = self.possible(planned)
        return {
            "dry_run": True,
            "images": len(jobs),
            "files": [str(path) for job in jobs for path in job.wanted],
            "skipped": [job.name for job in planned.skipped],
            "failed": [{"image": name, "problem": problem} for name, problem in bad],
            "view": next((group.view.as_record() for group in self.groups if group.view), None),
            "extra_files": [],
            "groups": [
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
        }


def dry_run_of(planned: Plan, chosen: Views) -> DryRun:
    """Look at every photo's size, and at one photo of each group."""
    from cubicfish_cli.errors import CubicfishError
    from cubicfish_cli.undistortion.batch import FailedPhoto

    members: dict[object, list[tuple[PhotoJob, tuple[int, int]]]] = {}
    bad = []
    for job in planned.jobs:
        try:
            size = planned.size_of(job)
        except CubicfishError as error:
            bad.append(FailedPhoto(job=job, error=error))
            continue
        members.setdefault(chosen.group(job.source, size), []).append((job, size))
    groups = []
    for own in members.values():
        job, size = own[0]
        images = [one.name for one, _ in own]
        try:
            view, maps = chosen.view(job.source, size), chosen.maps(job.source, size)
            empty = 1 - sum(made.valid.sum() for made in maps) / sum(m.valid.size for m in maps)
            groups.append(
                Group(
                    images=images,
                    size=size,
                    view=view,
                    seen=chosen.seen(job.source, size),
                    kept_share=chosen.kept_share(job.source, size),
                    empty_share=float(empty),
                )
            )
        except CubicfishError as error:
            groups.append(Group(images=images, size=size, problem=str(error)))
    return DryRun(groups=groups, bad=bad)


def print_dry_run(planned: Plan, dry_run: DryRun) -> None:
    """Print how many files, which fields, and how much of them is empty."""
    jobs = dry_run.possible(planned)
    files = sum(len(job.wanted) for job in jobs)
    skipped = f", {len(planned.skipped)} skipped" * bool(planned.skipped)
    given = count(len(planned.jobs), planned.kind)
    if len(jobs) < len(planned.jobs):
        given = f"{len(jobs):,} of {given}"
    result(f"would write {count(files, 'file')} from {given}{skipped}")
    for group in dry_run.groups:
        width, height = group.size
        result(f"{count(len(group.images), planned.kind)} of {width}x{height} pixels:")
        if group.view is None or group.empty_share is None:
            result(f"  cannot be done: {group.problem}")
            continue
        result(f"  view          {group.view.describe()}")
        if group.seen is not None:
            result(f"  camera sees   {group.seen.describe()}")
        if group.kept_share is not None:
            result(f"  kept field    {100 * group.kept_share:.1f} % of what the camera sees")
        result(f"  empty pixels  {100 * group.empty_share:.1f} %")
        warn_of_limit(group.view)
    for line in failure_lines(dry_run.bad, planned.kind):
        say(f"would fail: {line}")


def say_what_is_unseen(seen: SeenField | None) -> None:
    """Tell the user where the camera's field ends before the view's does."""
    if seen is not None and not seen.is_whole:
        say(f"the camera sees {seen.describe()}: the rest is empty")


def warn_of_limit(view: ChosenView) -> None:
    """Tell the user where the view ends before the camera's field does."""
    if view.at_limit:
        say(
            f"the camera sees more than a {view.first.kind} picture can show: its field ends at "
            "the view's own limit, and --view stereographic or equidistant shows all"
        )
