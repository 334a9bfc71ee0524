"""Photos, films or tables -> a fit, and the folder of the calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, Literal

from cubicfish_cli.advice.advise import summary
from cubicfish_cli.assess.camera_facts import CameraFacts
from cubicfish_cli.assess.verdict import Verdict
from cubicfish_cli.errors import UsageError
from cubicfish_cli.fitting.calibration import Calibration
from cubicfish_cli.fitting.climb import RefineTarget
from cubicfish_cli.fitting.model_comparison import compare_models
from cubicfish_cli.fitting.point_fit import PointCalibration, calibrate_points
from cubicfish_cli.library.asked import (
    RUN,
    Run,
    StrPath,
    TargetSource,
    check_inputs,
    made_at,
    made_by_record,
    paths_of,
)
from cubicfish_cli.library.calibration import calibrate
from cubicfish_cli.library.calibration_folder import NAMES, CalibrationFolder, contents_of
from cubicfish_cli.library.inputs import Inputs, load_inputs, recorded_as, with_frames
from cubicfish_cli.printing import extra
from cubicfish_cli.target import Target
from cubicfish_cli.words.codes import Event


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedFiles:
    """What became of :func:`calibrate_files`.

    Attributes:
        fitted: the fit; a :class:`PointCalibration` where the lift was ``point``.
        inputs: what it was fitted to.
        record: the fit as camera.yaml has it.
        facts: the camera in the figures that people ask for first.
        verdict: what it is worth.
        files: what was written, by its name in :data:`NAMES`.
        removed: what went of an earlier calibration.
        advice: what to photograph next, in a line; None for the lift ``point``.
        models: a record a lens model, where they were compared.

    """

    fitted: Calibration | PointCalibration
    inputs: Inputs
    record: dict[str, Any]
    facts: CameraFacts
    verdict: Verdict
    files: dict[str, Path]
    removed: list[Path]
    advice: str | None = None
    models: list[dict[str, Any]] | None = None

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish calibrate --json`` prints."""
        return {
            **self.record,
            **({} if self.models is None else {"models": self.models}),
            **self.inputs.remarks(self.fitted.remarks),
            **({} if self.advice is None else {"advice": self.advice}),
            "summary": self.facts.line,
            "verdict": self.verdict.as_record(),
            "report": self.files.get("report"),
            "files": self.files,
            "model": self.files["camera"],
        }


def calibrate_files(
    inputs: StrPath | Sequence[StrPath],
    target: TargetSource | Target | StrPath | None = None,
    folder: StrPath = "calibration",
    *,
    correspondences: StrPath | None = None,
    image_size: tuple[int, int] | None = None,
    refine_target: RefineTarget = "auto",
    hold_out: bool = True,
    lift: Literal["ray", "point"] = "ray",
    best: int | None = None,
    compare: bool = False,
    report: bool = True,
    title: str | None = None,
    command: str | None = None,
    run: Run = RUN,
) -> CalibratedFiles:
    """Calibrate a camera from files into a folder, as ``cubicfish calibrate`` does.

    Everything is written together at the end, or nothing is, but for frames of films.

    Args:
        inputs: photos (files, folders and globs), films, or one corners.csv or correspondences.csv.
        target: the calibration target, or its file; 2D-3D pairs need none.
        folder: where camera.yaml and what goes with it is written.
        correspondences: a table of 2D-3D pairs in the place of ``inputs``.
        image_size: (width, height) of the photos, for tables that do not say.
        refine_target: as in :func:`calibrate`.
        hold_out: likewise.
        lift: what the cubics are of: the viewing ray, or the 3D point itself.
        best: calibrates from so many of many photos, those that add most; of films 60 frames where
            it is None, and otherwise all.
        compare: also fits other lens models to the same corners.
        report: also writes report.html, where the extra ``report`` is installed.
        title: what the camera is called.
        command: what is run, for the record.
        run: how the work is done.

    Raises:
        UsageError: what is asked does not go together.
        CubicfishError: an input cannot be used, a file exists and may not be replaced, or no camera
            can be fitted.

    """
    paths, source = paths_of(inputs), TargetSource.of(target)
    pairs = None if correspondences is None else Path(correspondences)
    if lift == "point" and compare:
        raise UsageError("--compare is of cameras with rays: it goes with --lift ray")
    check_inputs(paths, pairs, source)
    made_at()  # said before the work if it cannot be
    read = [path for path in (*paths, source.path, pairs) if path is not None]
    place = CalibrationFolder(path=Path(folder), inputs=read)
    # Corners that were read from this very file need not be written again.
    with_corners = bool(paths) and not place.has_input("corners")
    with_page = report and not extra.missing(extra.REPORT)
    kinds = {"report": with_page, "corners": with_corners, "drawn": source.needs_file}
    own = [kind for kind, wanted in kinds.items() if wanted]
    place.refuse("camera", "map", "target", *own, overwrite=run.overwrite)
    if refine_target != "off":
        place.refuse_input("target")
    photos = with_frames(paths, place.path / "frames", source, best, run)
    loaded = load_inputs(
        photos, source, run, correspondences=pairs, image_size=image_size, best=best
    )
    fitted, asked = _fit(loaded, refine_target, lift, run, hold_out=hold_out)
    drawn = loaded.drawn(source)
    named = {} if title is None else {"title": title}
    made_by = {**named, **made_by_record(command, asked, loaded.target_file, loaded.files)}
    if drawn is not None:
        made_by["target"] = recorded_as(drawn, place.path / NAMES["drawn"])
    fitted = replace(fitted, made_by=made_by)
    loaded = loaded.named_by(fitted)
    contents = contents_of(fitted, loaded.corners if with_corners else None, drawn)
    if contents.get("map") is None and lift == "ray":
        width, height = fitted.camera.image_size
        run.listener.tell(Event.NO_MAP, width=width, height=height)
    if with_page:
        contents["report"] = _page(fitted, loaded, run)
    run.listener.progress("Writing")
    files, removed = place.write(contents, overwrite=run.overwrite)
    record, advice, models = fitted.as_record(), None, None
    if isinstance(fitted, Calibration):
        advice = summary(fitted.camera, record, fitted.pairs)
        if compare:
            run.listener.tell(Event.OTHER_MODELS)
            run.listener.progress("Fitting other lens models")
            rows = compare_models(fitted, drawn=loaded.pairs.target, hold_out=hold_out)
            models = [row.as_record() for row in rows]
    return CalibratedFiles(
        fitted=fitted,
        inputs=loaded,
        record=record,
        facts=fitted.facts,
        verdict=fitted.verdict,
        files=files,
        removed=removed,
        advice=advice,
        models=models,
    )


def _fit(
    loaded: Inputs, refine_target: RefineTarget, lift: str, run: Run, *, hold_out: bool
) -> tuple[Calibration | PointCalibration, dict[str, Any]]:
    """The fit, and what of its options camera.yaml is to keep."""
    run.listener.found(loaded.photo_findings)
    uncertain = loaded.pairs.uncertain_images
    if refine_target == "auto" and uncertain:
        run.listener.tell(Event.NOT_CERTAIN, photos=len(uncertain))
    run.listener.tell(Event.FITTING, corners=len(loaded.pairs.pixel))
    if lift == "point":
        run.listener.progress("Fitting")
        return calibrate_points(loaded.pairs, hold_out=hold_out), {"lift": lift}
    fitted = calibrate(
        loaded.given, refine_target=refine_target, hold_out=hold_out, listener=run.listener
    )
    return fitted, {"hold_out": hold_out, "refine_target": refine_target}


def _page(fitted: Calibration | PointCalibration, loaded: Inputs, run: Run) -> str | None:
    """The page about it.

    A camera that was hard to come by is not lost because a page about it cannot be made: then
    there is none, and that is told.
    """
    start = perf_counter()
    run.listener.progress("Making the report")
    try:
        with extra.quiet():
            from cubicfish_cli.report.from_files import facts_of_fit
            from cubicfish_cli.report.page import report_html

        page = report_html(facts_of_fit(fitted, loaded.pairs, loaded.photos))
    except Exception as problem:  # matplotlib may be broken in ways of its own
        what = f"{type(problem).__name__}: {problem}".splitlines()[0]
        run.listener.tell(Event.NO_PAGE, problem=what)
        return None
    run.listener.tell(Event.PAGE_TOOK, seconds=perf_counter() - start)
    return page
