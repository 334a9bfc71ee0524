"""``cubicfish report``, and the pages that ``calibrate`` and ``rig`` write beside their files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import print_verdict
from cubicfish_cli.cli.options import as_command, bundle, option, record
from cubicfish_cli.cli.progress import keep_fonts, running
from cubicfish_cli.cli.terminal import print_json, result, say
from cubicfish_cli.library.asked import Run

PAGE = "report.html"


@record
class Asked:
    """What is asked of ``cubicfish report``."""

    calibration: Path | None = options.calibration_argument
    model: Path | None = options.model_option
    target: Path | None = options.target_option
    photos: tuple[Path, ...] = option(
        "--photos PATH",
        "The photos (a folder, a file or a glob), where they are not at their old place. May be "
        "given again.",
        options.FILE,
        multiple=True,
    )
    output: Path | None = options.output_option(
        "The page. [default: report.html beside the camera]"
    )
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option("report")


@as_command(
    "report",
    "One HTML page about a calibration: is it good, and why.",
    "cubicfish report",
    "cubicfish report calibration/ --photos photos/ -o lens.html",
    "cubicfish report rig/",
    "cubicfish report --model camera.yaml --target target.yaml --overwrite",
)
def command(given: Asked) -> None:
    """Write one HTML page about the calibration in FOLDER (by default: calibration).

    The page stands alone: no network, no program, every picture inside. Corners, target and
    photos are looked for beside the camera and where the calibration found them; what is no
    longer there, or has changed, is left out, and the page says so. The errors are worked out
    again from camera.yaml and corners.csv.

    Of a rig (its folder or rig.yaml) the page shows where the cameras stand and what they see.
    """
    from cubicfish_cli.library.report_files import report_files

    keep_fonts()
    named = given.calibration or given.model
    camera = options.rig_path(named) or options.model_path(named)
    with running(overwrite=given.overwrite) as run:
        made = report_files(camera, given.output, target=given.target, photos=given.photos, run=run)
    for line in made.absent:
        say(f"left out: {line}")
    if given.as_json:
        print_json(made.as_record())
        return
    print_verdict(made.verdict)
    result(f"\nwrote {made.page}")


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """What is asked of every fit: how it is done, and what comes of it."""

    report: bool
    max_rms: float | None
    overwrite: bool
    as_json: bool
    jobs: int | None
    no_cache: bool

    @contextmanager
    def running(self) -> Iterator[Run]:
        """How the library is to work while the block runs."""
        keep_fonts(not self.no_cache)
        with running(jobs=self.jobs, no_cache=self.no_cache, overwrite=self.overwrite) as run:
            yield run


def fit_options(command: str) -> Any:
    """:class:`FitOptions` of a command, as one field of its record."""
    return bundle(
        FitOptions,
        option(
            "--report/--no-report",
            "Also write report.html, one page about the calibration (takes a second or two; needs "
            "the extra 'report').",
            default=True,
        ),
        options.max_rms_option,
        options.overwrite_option,
        options.json_option(command),
        options.jobs_option,
        options.no_cache_option,
    )


def say_if_no_page(outputs: Mapping[str, Path], *, wanted: bool) -> None:
    """Say how to get a page where there is none, and that an old one is old."""
    from cubicfish_cli.printing.extra import INSTALL, REPORT, missing

    if "report" in outputs:
        return
    old = outputs["camera"].with_name(PAGE)
    if old.exists():
        say(f"note: {old} is of an earlier calibration")
    if wanted and missing(REPORT):
        say(f"No {PAGE} was written: {INSTALL}, then 'cubicfish report {old.parent}', makes it.")
