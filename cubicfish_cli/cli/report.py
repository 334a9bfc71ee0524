"""``cubicfish report``, and the pages that ``calibrate`` and ``rig`` write beside their files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.cache_folder import keep_fonts
from cubicfish_cli.cli.figures import print_verdict
from cubicfish_cli.cli.inputs import Pairs
from cubicfish_cli.cli.options import as_command, option
from cubicfish_cli.cli.terminal import detail, print_json, result, say, working

if TYPE_CHECKING:
    from cubicfish_cli.assess.verdict import Verdict
    from cubicfish_cli.lenses.cubic import CubicCamera
    from cubicfish_cli.lenses.point_cubic import PointCamera
    from cubicfish_cli.target import Target


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
@options.json_option("report")
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
        judged = write_rig_page(rig, page, overwrite=overwrite)
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


PAGE = "report.html"

report_option = option(
    "--report/--no-report",
    "Also write report.html, one page about the calibration (takes a second or two; needs "
    "the extra 'report').",
    default=True,
)


def can_make_pages() -> bool:
    """Whether the libraries that a report needs are there."""
    from cubicfish_cli.printing.extra import REPORT, missing

    return not missing(REPORT)


def make_page(
    camera: CubicCamera | PointCamera,
    fit: Mapping[str, Any],
    made_by: Mapping[str, Any],
    loaded: Pairs,
    target: Target | None,
) -> str | None:
    """The page.

    A camera that was hard to come by is not lost because a page about it cannot be made: then
    there is none, and the user is told.

    Args:
        camera: the camera.
        fit: how well it fits, as camera.yaml will have it.
        made_by: how it was made, likewise.
        loaded: what was fitted to.
        target: the object as fitted.

    """
    from time import perf_counter

    from cubicfish_cli.printing.extra import quiet

    start = perf_counter()
    _keep_fonts()
    photos = [file.path for file in loaded.files] if loaded.detection is not None else []
    try:
        with working("Making the report"):
            with quiet():
                from cubicfish_cli.report.from_files import facts_of_fit
                from cubicfish_cli.report.page import report_html

            facts = facts_of_fit(
                camera, fit, made_by, pairs=loaded.pairs, target=target, photos=photos
            )
            page = report_html(facts)
    except Exception as problem:  # matplotlib may be broken in ways of its own
        what = f"{type(problem).__name__}: {problem}".splitlines()[0]
        say(f"{PAGE} could not be made ({what}): 'cubicfish report --debug' says where.")
        return None
    detail(f"{PAGE} took {perf_counter() - start:.1f} seconds")
    return page


def write_rig_page(rig: Path, page: Path, *, overwrite: bool) -> Verdict:
    """Write the page about a rig's file, and judge the rig.

    Raises:
        CameraFileError: the rig cannot be read.
        OutputError: the page is there, or cannot be written.

    """
    from cubicfish_cli.assess.rig_verdict import rig_verdict
    from cubicfish_cli.files import write_text
    from cubicfish_cli.formats.rig_yaml import load_rig
    from cubicfish_cli.library.rigs import loaded_record
    from cubicfish_cli.printing.extra import quiet

    _keep_fonts()
    with quiet():
        from cubicfish_cli.report.rig_page import rig_html

    loaded = load_rig(rig)
    record = loaded_record(loaded)
    with working("Making the report"):
        text = rig_html(loaded, record)
    write_text(page, text, overwrite=overwrite)
    return rig_verdict(record)


def _keep_fonts() -> None:
    context = click.get_current_context(silent=True)
    keep_fonts(context is None or not context.params.get("no_cache"))


def say_if_no_page(outputs: Mapping[str, Path], *, wanted: bool) -> None:
    """Say how to get a page where there is none, and that an old one is old."""
    if "report" in outputs:
        return
    old = outputs["camera"].with_name(PAGE)
    if old.exists():
        say(f"note: {old} is of an earlier calibration")
    if wanted and not can_make_pages():
        from cubicfish_cli.printing.extra import INSTALL

        say(f"No {PAGE} was written: {INSTALL}, then 'cubicfish report {old.parent}', makes it.")
