"""``cubicfish rig report``, and the page that ``calibrate`` writes beside rig.yaml."""

from __future__ import annotations

from cubicfish import Run
from cubicfish.files import StrPath, write_files
from cubicfish_cli.extensions.rigs.options import rig_argument
from cubicfish_cli.inputs.paths import path_or_none
from cubicfish_cli.plan import Plan
from cubicfish_cli.render import drawing as extra
from cubicfish_cli.render.pages import PAGE
from cubicfish_cli.render.pages.report_files import ReportFiles
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.figures import print_report
from cubicfish_cli.terminal.parameters import as_command, record
from cubicfish_cli.terminal.progress import How


@record
class RigReportOptions:
    """A page about a rig.

    Attributes:
        rig: its rig.yaml, or the folder of that.
        page: where the page goes; by default report.html beside it.

    """

    rig: StrPath = rig_argument
    page: StrPath | None = parameters.output_option(
        "The page. [default: report.html beside the rig]"
    )


def report_rig_files(options: RigReportOptions, *, run: Run = Run()) -> ReportFiles:
    """Write a page about a rig, as ``cubicfish rig report`` does.

    Raises:
        CubicfishError: the extra ``report`` is not installed, the file cannot be used, or the page
            exists and may not be replaced.

    """
    from cubicfish import load_rig
    from cubicfish_cli.extensions.rigs.page import rig_html

    extra.require(extra.REPORT, "a report")
    rig = load_rig(options.rig)
    path = path_or_none(options.page) or rig.files[0].parent / PAGE
    Plan(run).reads(rig.files).writes(path)
    run.listener.progress("Making the report")
    write_files({path: rig_html(rig)}, overwrite=run.overwrite)
    return ReportFiles(page=path, model=rig.files[0], verdict=rig.verdict)


@as_command(
    "report",
    "Make an HTML report of a rig.",
    "cubicfish rig report",
    "cubicfish rig report rig/rig.yaml -o body.html",
    do=report_rig_files,
    how=("overwrite", "as_json"),
)
def command(made: ReportFiles, given: RigReportOptions, how: How) -> None:
    """Write one HTML page about RIG (by default: rig): where its cameras stand, what they see.

    The page holds every picture and needs no network and no other program.
    """
    print_report(made, how)
