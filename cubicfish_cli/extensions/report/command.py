"""``cubicfish report``: a page about a calibration."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cubicfish import Run
from cubicfish.files import StrPath
from cubicfish_cli.inputs.paths import calibration_files, in_folder, path_or_none
from cubicfish_cli.plan import Plan
from cubicfish_cli.render import drawing as extra
from cubicfish_cli.render.pages import PAGE
from cubicfish_cli.render.pages.report_files import ReportFiles
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.figures import print_report
from cubicfish_cli.terminal.parameters import as_command, option, record
from cubicfish_cli.terminal.progress import How


@record
class ReportOptions:
    """Options of :func:`report_files`.

    Attributes:
        camera: the file or folder of the camera.
        target: the nominal calibration target, if it is not at its recorded place.
        photos: files, folders or patterns of the photos, if they are not at their recorded places.
        page: the page to write; by default report.html beside the camera.

    """

    camera: StrPath = parameters.camera_options
    target: StrPath | None = parameters.target_option
    photos: Sequence[StrPath] = option(
        "--photos PATH",
        "The photos (a folder, a file or a glob), where they are not at their old place. May be "
        "given again.",
        parameters.FILE,
        multiple=True,
    )
    page: StrPath | None = parameters.output_option(
        "The page. [default: report.html beside the camera]"
    )


def report_files(options: ReportOptions, *, run: Run = Run()) -> ReportFiles:
    """Write a page about a camera, as ``cubicfish report`` does.

    Raises:
        CubicfishError: the extra ``report`` is not installed, a file cannot be used, or the page
            exists and may not be replaced.

    """
    extra.require(extra.REPORT, "a report")
    model, target = in_folder(Path(options.camera)), path_or_none(options.target)
    path = path_or_none(options.page) or model.parent / PAGE
    plan = Plan(run).reads(calibration_files(model), target, options.photos)
    plan.writes(path)
    from cubicfish_cli.extensions.report.page import report_html
    from cubicfish_cli.inputs.calibration_facts import facts_of_files

    run.listener.progress("Making the report")
    facts = facts_of_files(model, target=target, photos=list(map(Path, options.photos)))
    plan.reads(facts.sources)
    plan.write({path: report_html(facts)})
    return ReportFiles(page=path, model=model, verdict=facts.known.verdict, absent=facts.absent)


@as_command(
    "report",
    "Make an HTML report of a calibration.",
    "cubicfish report",
    "cubicfish report calibration/ --photos photos/ -o lens.html",
    "cubicfish report --model camera.yaml --target target.yaml --overwrite",
    do=report_files,
    how=("overwrite", "as_json"),
)
def command(made: ReportFiles, given: ReportOptions, how: How) -> None:
    """Write one HTML page about the calibration in FOLDER (by default: calibration).

    The page holds every picture and needs no network and no other program. Corners, target and
    photos are looked for beside the camera and where the calibration found them; what is no
    longer there, or has changed, is left out, and the page says so. The errors are worked out
    again from camera.yaml and corners.csv.
    """
    print_report(made, how)
