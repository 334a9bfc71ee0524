"""``cubicfish report``, and the pages that ``calibrate`` and ``rig`` write beside their files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from cubicfish_cli.cli import options
from cubicfish_cli.cli.cache_folder import keep_fonts
from cubicfish_cli.cli.figures import print_verdict
from cubicfish_cli.cli.options import as_command, option, record
from cubicfish_cli.cli.progress import listening, working
from cubicfish_cli.cli.terminal import print_json, result, say

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
    from cubicfish_cli.errors import CubicfishError
    from cubicfish_cli.files import refuse_existing, write_text
    from cubicfish_cli.printing.extra import INSTALL, REPORT, missing, quiet

    lacking = missing(REPORT)
    if lacking:
        raise CubicfishError(f"a report needs {' and '.join(lacking)}: {INSTALL}")
    rig = options.rig_path(given.calibration or given.model)
    camera = rig or options.model_path(given.calibration or given.model)
    page = given.output or camera.parent / "report.html"
    refuse_existing(page, overwrite=given.overwrite)

    keep_fonts()
    if rig is not None:
        from cubicfish_cli.library.rig_files import write_rig_page

        with listening() as listener:
            judged = write_rig_page(rig, page, overwrite=given.overwrite, listener=listener)
        if given.as_json:
            named = {"report": str(page), "model": str(rig)}
            print_json({**named, "verdict": judged.as_record(), "absent": []})
            return
        print_verdict(judged)
        result(f"\nwrote {page}")
        return
    with quiet():
        from cubicfish_cli.report.from_files import facts_of_files
        from cubicfish_cli.report.page import report_html

    with working("Making the report"):
        facts = facts_of_files(camera, target=given.target, photos=given.photos)
        text = report_html(facts)
    write_text(page, text, overwrite=given.overwrite)
    for line in facts.absent:
        say(f"left out: {line}")
    if given.as_json:
        print_json(
            {
                "report": str(page),
                "model": str(camera),
                "verdict": facts.verdict.as_record(),
                "absent": facts.absent,
            }
        )
        return
    print_verdict(facts.verdict)
    result(f"\nwrote {page}")


report_option = option(
    "--report/--no-report",
    "Also write report.html, one page about the calibration (takes a second or two; needs "
    "the extra 'report').",
    default=True,
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
