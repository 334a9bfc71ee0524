"""``cubicfish report``: one page about a calibration."""

from __future__ import annotations

from pathlib import Path

from cubicfish_cli.cli import json_keys, options, report_step
from cubicfish_cli.cli.cache_folder import keep_fonts
from cubicfish_cli.cli.figures import print_verdict
from cubicfish_cli.cli.options import as_command, option
from cubicfish_cli.cli.terminal import print_json, result, say, working


@as_command(
    "report",
    "One HTML page about a calibration: is it good, and why.",
    "cubicfish report",
    "cubicfish report calibration/ --photos photos/ -o lens.html",
    "cubicfish report rig/",
    "cubicfish report --model camera.yaml --target target.yaml --overwrite",
)
@options.calibration_argument
@options.model_option
@options.target_option
@option(
    "--photos PATH",
    "The photos (a folder, a file or a glob), where they are not at their old place. May be "
    "given again.",
    options.FILE,
    multiple=True,
)
@options.output_option("The page. [default: report.html beside the camera]")
@options.overwrite_option
@options.json_option(json_keys.REPORT)
def command(
    calibration: Path | None,
    model: Path | None,
    target: Path | None,
    photos: tuple[Path, ...],
    output: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
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
    rig = options.rig_path(calibration or model)
    camera = rig or options.model_path(calibration or model)
    page = output or camera.parent / "report.html"
    refuse_existing(page, overwrite=overwrite)

    keep_fonts()
    if rig is not None:
        judged = report_step.write_rig_page(rig, page, overwrite=overwrite)
        if as_json:
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
        facts = facts_of_files(camera, target=target, photos=photos)
        text = report_html(facts)
    write_text(page, text, overwrite=overwrite)
    for line in facts.absent:
        say(f"left out: {line}")
    if as_json:
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
