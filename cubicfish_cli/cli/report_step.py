"""The pages that ``calibrate`` and ``rig`` write beside a camera and a rig."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli.cache_folder import keep_fonts
from cubicfish_cli.cli.inputs import Pairs
from cubicfish_cli.cli.options import option
from cubicfish_cli.cli.terminal import detail, say, working

if TYPE_CHECKING:
    from cubicfish_cli.assess.verdict import Verdict
    from cubicfish_cli.lenses.cubic import CubicCamera
    from cubicfish_cli.lenses.point_cubic import PointCamera
    from cubicfish_cli.target import Target

NAME = "report.html"

report_option = option(
    "--report/--no-report",
    "Also write report.html, one page about the calibration (takes a second or two; needs "
    "the extra 'report').",
    default=True,
)


def is_possible() -> bool:
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
        say(f"{NAME} could not be made ({what}): 'cubicfish report --debug' says where.")
        return None
    detail(f"{NAME} took {perf_counter() - start:.1f} seconds")
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


def say_if_missing(outputs: Mapping[str, Path], *, wanted: bool) -> None:
    """Say how to get a page where there is none, and that an old one is old."""
    if "report" in outputs:
        return
    old = outputs["camera"].with_name(NAME)
    if old.exists():
        say(f"note: {old} is of an earlier calibration")
    if wanted and not is_possible():
        from cubicfish_cli.printing.extra import INSTALL

        say(f"No {NAME} was written: {INSTALL}, then 'cubicfish report {old.parent}', makes it.")
