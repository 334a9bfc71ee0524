"""``cubicfish report``: a page about a calibration."""

from __future__ import annotations

from pathlib import Path

from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.figures import print_verdict
from cubicfish_cli.app.terminal.options import as_command, option, record
from cubicfish_cli.app.terminal.progress import keep_fonts, running
from cubicfish_cli.app.terminal.terminal import print_json, result, say


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
    page: Path | None = options.output_option("The page. [default: report.html beside the camera]")
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "report",
    "One HTML page about a calibration: is it good, and why.",
    "cubicfish report",
    "cubicfish report calibration/ --photos photos/ -o lens.html",
    "cubicfish report --model camera.yaml --target target.yaml --overwrite",
)
def command(given: Asked) -> None:
    """Write one HTML page about the calibration in FOLDER (by default: calibration).

    The page stands alone: no network, no program, every picture inside. Corners, target and
    photos are looked for beside the camera and where the calibration found them; what is no
    longer there, or has changed, is left out, and the page says so. The errors are worked out
    again from camera.yaml and corners.csv.
    """
    from cubicfish_cli.extensions.report.report_files import report_files

    keep_fonts()
    with running(overwrite=given.overwrite) as run:
        made = report_files(
            options.model_path(given.calibration or given.model),
            given.page,
            target=given.target,
            photos=given.photos,
            run=run,
        )
    for line in made.absent:
        say(f"left out: {line}")
    if given.as_json:
        print_json(made.as_record())
        return
    print_verdict(made.verdict)
    result(f"\nwrote {made.page}")
