"""The report that ``cubicfish calibrate`` writes beside the camera."""

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
    from cubicfish_cli.model.cubic import CubicCamera
    from cubicfish_cli.model.point_cubic import PointCamera
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
    from cubicfish_cli.report.extra import missing

    return not missing()


def make_page(
    outputs: dict[str, Path],
    camera: CubicCamera | PointCamera,
    fit: Mapping[str, Any],
    made_by: Mapping[str, Any],
    loaded: Pairs,
    target: Target | None,
) -> str | None:
    """The page, where ``outputs`` has a place for it.

    A camera that was hard to come by is not lost because a page about it cannot be made: then
    the place is taken out of ``outputs``, and the user is told.

    Args:
        outputs: where things go; ``report`` is the page.
        camera: the camera.
        fit: how well it fits, as camera.yaml will have it.
        made_by: how it was made, likewise.
        loaded: what was fitted to.
        target: the object as fitted.

    """
    if "report" not in outputs:
        return None
    from time import perf_counter

    start = perf_counter()
    try:
        with working("Making the report"):
            page = _page(camera, fit, made_by, loaded, target)
    except Exception as problem:  # matplotlib may be broken in ways of its own
        path = outputs.pop("report")
        what = f"{type(problem).__name__}: {problem}".splitlines()[0]
        say(f"{path.name} could not be made ({what}): 'cubicfish report --debug' says where.")
        return None
    detail(f"{NAME} took {perf_counter() - start:.1f} seconds")
    return page


def _page(
    camera: CubicCamera | PointCamera,
    fit: Mapping[str, Any],
    made_by: Mapping[str, Any],
    loaded: Pairs,
    target: Target | None,
) -> str:
    from dataclasses import replace

    from cubicfish_cli.report.extra import quiet

    context = click.get_current_context(silent=True)
    keep_fonts(context is None or not context.params.get("no_cache"))
    with quiet():
        from cubicfish_cli.report.facts import gather
        from cubicfish_cli.report.page import report_html
        from cubicfish_cli.report.pictures import matched

    pairs = loaded.pairs
    if target is not None:
        world = target.world_points(pairs.board, pairs.column, pairs.row)
        pairs = replace(pairs, world=world)
    photos = [file.path for file in loaded.files] if loaded.detection is not None else []
    files = matched([record["image"] for record in fit["per_image"]], photos)
    facts = gather(camera, fit, made_by, pairs=pairs, target=target, files=files)
    return report_html(facts)


def as_record(judged: Verdict, outputs: Mapping[str, Path]) -> dict[str, Any]:
    """What calibrate's JSON has of it."""
    page = outputs.get("report")
    return {
        "verdict": judged.as_record(),
        "report": str(page) if page else None,
        "files": {name: str(path) for name, path in outputs.items()},
    }


def say_if_missing(outputs: Mapping[str, Path], *, wanted: bool) -> None:
    """Say how to get a page where there is none, and that an old one is old."""
    if "report" in outputs:
        return
    old = outputs["camera"].with_name(NAME)
    if old.exists():
        say(f"note: {old} is of an earlier calibration")
    if wanted and not is_possible():
        from cubicfish_cli.report.extra import INSTALL

        say(f"No {NAME} was written: {INSTALL}, then 'cubicfish report {old.parent}', makes it.")
