"""A calibration's folder -> a page about it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cubicfish_cli.app import drawing as extra
from cubicfish_cli.app.asked import RUN, Run, StrPath, in_folder, path_or_none
from cubicfish_cli.app.calibration_facts import facts_of_files
from cubicfish_cli.app.pages.report_files import PAGE, ReportFiles, refuse_without_extra
from cubicfish_cli.core.files import refuse_existing, write_text


def report_files(
    calibration: StrPath,
    page: StrPath | None = None,
    *,
    target: StrPath | None = None,
    photos: Sequence[StrPath] = (),
    run: Run = RUN,
) -> ReportFiles:
    """Write a page about a camera, as ``cubicfish report`` does.

    Args:
        calibration: the file of a camera, or the folder of that.
        page: where the page goes; by default report.html beside it.
        target: the calibration target as drawn, where it is not at its recorded place.
        photos: files, folders or patterns of the photos, where they are not at theirs.
        run: how the work is done.

    Raises:
        CubicfishError: the extra ``report`` is not installed, a file cannot be used, or the page
            exists and may not be replaced.

    """
    refuse_without_extra()
    model = in_folder(Path(calibration))
    path = model.parent / PAGE if page is None else Path(page)
    refuse_existing(path, overwrite=run.overwrite)
    with extra.quiet():
        from cubicfish_cli.extensions.report.page import report_html

    run.listener.progress("Making the report")
    facts = facts_of_files(model, target=path_or_none(target), photos=list(map(Path, photos)))
    write_text(path, report_html(facts), overwrite=run.overwrite)
    return ReportFiles(page=path, model=model, verdict=facts.known.verdict, absent=facts.absent)
