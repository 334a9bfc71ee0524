"""A calibration's folder -> a page about it, and what to photograph next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cubicfish_cli.advice.advise import Advice, advise
from cubicfish_cli.assess.verdict import Verdict, rig_verdict
from cubicfish_cli.errors import CubicfishError, OutputError, UsageError
from cubicfish_cli.files import Content, refuse_existing, write_files, write_text
from cubicfish_cli.formats.rig_yaml import load_rig
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.library.asked import RUN, Run, StrPath, in_folder, path_or_none, rig_in
from cubicfish_cli.library.rigs import loaded_record
from cubicfish_cli.printing import extra
from cubicfish_cli.rendering.truth import pose_table_text
from cubicfish_cli.report.from_files import facts_of_files

PAGE = "report.html"
_PICTURES = (".svg", ".png", ".pdf")
# What to name, and how, where corners are lacking.
_WHAT = {
    "--corners": "the corners with --corners, and the target with --target",
    "--target": "the target with --target",
    "--corners and --target": "those of the fit with --corners and --target",
}


@dataclass(frozen=True, kw_only=True)
class ReportFiles:
    """What became of :func:`report_files`.

    Attributes:
        page: the page.
        model: the file that it is about.
        verdict: what the camera or the rig is worth.
        absent: what is not on the page, a line each.

    """

    page: Path
    model: Path
    verdict: Verdict
    absent: Sequence[str] = ()

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish report --json`` prints."""
        named = {"report": str(self.page), "model": str(self.model)}
        return {**named, "verdict": self.verdict.as_record(), "absent": self.absent}


def report_files(
    calibration: StrPath,
    page: StrPath | None = None,
    *,
    target: StrPath | None = None,
    photos: Sequence[StrPath] = (),
    run: Run = RUN,
) -> ReportFiles:
    """Write a page about a camera or a rig, as ``cubicfish report`` does.

    Args:
        calibration: the file of a camera or a rig, or the folder of that.
        page: where the page goes; by default report.html beside it.
        target: the calibration target as drawn, where it is not at its recorded place.
        photos: files, folders or patterns of the photos, where they are not at theirs.
        run: how the work is done.

    Raises:
        CubicfishError: the extra ``report`` is not installed, a file cannot be used, or the page
            exists and may not be replaced.

    """
    lacking = extra.missing(extra.REPORT)
    if lacking:
        raise CubicfishError(f"a report needs {' and '.join(lacking)}: {extra.INSTALL}")
    rig = rig_in(Path(calibration))
    model = rig or in_folder(Path(calibration))
    path = model.parent / PAGE if page is None else Path(page)
    refuse_existing(path, overwrite=run.overwrite)
    if rig is not None:
        return ReportFiles(page=path, model=model, verdict=write_rig_page(rig, path, run))
    with extra.quiet():
        from cubicfish_cli.report.page import report_html

    run.listener.progress("Making the report")
    facts = facts_of_files(model, target=path_or_none(target), photos=list(map(Path, photos)))
    write_text(path, report_html(facts), overwrite=run.overwrite)
    return ReportFiles(page=path, model=model, verdict=facts.known.verdict, absent=facts.absent)


def write_rig_page(rig: Path, page: Path, run: Run) -> Verdict:
    """Write the page about a rig's file, and judge the rig.

    Raises:
        CameraFileError: the rig cannot be read.
        OutputError: the page is there, or cannot be written.

    """
    with extra.quiet():
        from cubicfish_cli.report.rig_page import rig_html

    loaded = load_rig(rig)
    record = loaded_record(loaded)
    run.listener.progress("Making the report")
    write_text(page, rig_html(loaded, record), overwrite=run.overwrite)
    return rig_verdict(record)


@dataclass(frozen=True, kw_only=True, eq=False)
class AdviceFiles:
    """What became of :func:`advise_files`.

    Attributes:
        model: the camera's file.
        advice: what photos leave open, and which to take next.
        verdict: what the camera is worth.
        picture: the drawing; None where none was asked for.
        poses: the table of proposed poses; likewise.

    """

    model: Path
    advice: Advice
    verdict: Verdict
    picture: Path | None = None
    poses: Path | None = None

    @property
    def written(self) -> list[Path]:
        """The files."""
        return [path for path in (self.picture, self.poses) if path is not None]

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish advise --json`` prints."""
        files = {"model": self.model, "picture": self.picture, "poses": self.poses}
        return {**self.advice.as_record(), **files}


def advise_files(
    camera: StrPath,
    *,
    corners: StrPath | None = None,
    target: StrPath | None = None,
    picture: StrPath | None = None,
    poses: StrPath | None = None,
    goal_px: float | None = None,
    seed: int = 0,
    run: Run = RUN,
) -> AdviceFiles:
    """Say what the photos of a calibration leave open, as ``cubicfish advise`` does.

    Args:
        camera: its file, or the folder of that.
        corners: the corners.csv of the fit, where it is not beside the camera.
        target: the calibration target as drawn, where it is not at its recorded place.
        picture: also draws where the target should appear: .svg, .png or .pdf.
        poses: also writes the proposed poses.
        goal_px: the uncertainty wanted over the field; by default 0.2, more for large photos.
        seed: another one tries other poses.
        run: how the work is done.

    Raises:
        UsageError: corners are named without their target.
        CubicfishError: a file cannot be used, or exists and may not be replaced.

    """
    drawing, table, given, drawn = map(path_or_none, (picture, poses, corners, target))
    if drawing is not None and drawing.suffix.lower() not in _PICTURES:
        raise OutputError(f"{drawing}: end the name in {', '.join(_PICTURES)}")
    if drawing is not None and extra.missing(extra.PRINTING):
        raise CubicfishError(f"a picture needs matplotlib: {extra.INSTALL}")
    refuse_existing(*filter(None, (drawing, table)), overwrite=run.overwrite)
    path = in_folder(Path(camera))
    facts = facts_of_files(path, target=drawn, photos=(), corners=given)
    if corners is not None and facts.target is None:
        raise UsageError("name the target of these corners with --target target.yaml")
    if not isinstance(facts.camera, CubicCamera):
        raise CubicfishError(
            f"{path} is of lift 'point', which has no rays: its uncertainty over the field, "
            "and what would lower it, cannot be worked out; calibrate with --lift ray for this"
        )
    if facts.errors is None:
        why, name_it = "the corners are not at hand", "--corners"
        if facts.lack is not None:
            why, name_it = facts.lack.why, facts.lack.name_it
        raise CubicfishError(f"{path}: {why}: name {_WHAT[name_it]}")
    run.listener.progress("Looking for photos that would help")
    advice = advise(
        facts.camera, facts.fit, facts.errors.pairs, facts.target, goal_px=goal_px, seed=seed
    )
    files: dict[Path, Content] = {}
    if drawing is not None:
        with extra.quiet():
            from cubicfish_cli.advice.picture import advice_picture
        files[drawing] = advice_picture(advice, drawing.suffix.lower())
    if table is not None:
        named = {f"next_{i}.jpg": one.view.pose for i, one in enumerate(advice.proposals, start=1)}
        files[table] = pose_table_text(named)
    write_files(files, overwrite=run.overwrite)
    return AdviceFiles(
        model=path, advice=advice, verdict=facts.known.verdict, picture=drawing, poses=table
    )
