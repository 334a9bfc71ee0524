"""Photos, films or tables -> a fit and its folder, or how a camera does on them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Literal

from cubicfish_cli.advice.enough import summary
from cubicfish_cli.assess.camera_facts import CameraFacts
from cubicfish_cli.assess.uncertainty import uncertainty_at
from cubicfish_cli.assess.verdict import Verdict, evaluation_verdict
from cubicfish_cli.corner_files.observations_csv import save_corners
from cubicfish_cli.errors import OutputError, UsageError
from cubicfish_cli.files import Content, Fingerprint, refuse_existing, write_files
from cubicfish_cli.fitting.calibration import Calibration
from cubicfish_cli.fitting.climb import RefineTarget
from cubicfish_cli.fitting.evaluate import Evaluation, evaluate
from cubicfish_cli.formats.camera_yaml import CameraFile, load_camera
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.library.asked import (
    RUN,
    Run,
    StrPath,
    TargetSource,
    check_inputs,
    in_folder,
    made_at,
    made_by_record,
    paths_of,
)
from cubicfish_cli.library.calibration import calibrate
from cubicfish_cli.library.inputs import (
    Inputs,
    load_inputs,
    recorded_as,
    refuse_other_sizes,
    with_frames,
)
from cubicfish_cli.observations import Observations
from cubicfish_cli.photos import MAX_PIXELS
from cubicfish_cli.printing import extra
from cubicfish_cli.target import Target, target_text
from cubicfish_cli.undistortion.choose import build_view
from cubicfish_cli.undistortion.maps import build_map, save_map
from cubicfish_cli.words.codes import Event

if TYPE_CHECKING:
    from cubicfish_cli.fitting.point_fit import PointCalibration

NAMES = {
    "camera": "camera.yaml",
    "map": "undistort_map.npz",
    "target": "target.refined.yaml",
    "report": "report.html",
    "corners": "corners.csv",
    "drawn": "target.yaml",
}
"""Of its files by what they hold; the camera is the first to go and the last to be there."""

# Made by a calibration only, and true of its camera only. A corners.csv may be the user's own.
_ITS_OWN = ("map", "target", "report")


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
            "chosen": self.fitted.made_by.get("chosen"),
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
    goals = {kind: Path(folder) / name for kind, name in NAMES.items()}
    # Corners that were read from this very file need not be written again.
    with_corners = bool(paths) and not _is_among(read, goals["corners"])
    with_page = report and not extra.missing(extra.REPORT)
    kinds = {"report": with_page, "corners": with_corners, "drawn": source.needs_file}
    own = [kind for kind, wanted in kinds.items() if wanted]
    kinds_refused = ("camera", "map", "target", *own)
    refuse_existing(*(goals[kind] for kind in kinds_refused), overwrite=run.overwrite)
    if refine_target != "off" and _is_among(read, goals["target"]):
        raise OutputError(
            f"{goals['target']} would be replaced, and is what this calibration is made from: "
            "choose another folder with -o"
        )
    photos, chosen = with_frames(paths, Path(folder) / "frames", source, best, run)
    loaded = load_inputs(
        photos, source, run, correspondences=pairs, image_size=image_size, best=best
    )
    fitted, asked = _fit(loaded, refine_target, lift, run, hold_out=hold_out)
    drawn = loaded.drawn(source)
    named = {} if title is None else {"title": title}
    made_by = {**named, **made_by_record(command, asked, loaded.target_file, loaded.files)}
    chosen = loaded.chosen or chosen
    if chosen is not None:
        made_by["chosen"] = chosen
    if drawn is not None:
        made_by["target"] = recorded_as(drawn, goals["drawn"])
    fitted = replace(fitted, made_by=made_by)
    loaded = loaded.named_by(fitted)
    contents = _contents(fitted, loaded.corners if with_corners else None, drawn)
    if contents.get("map") is None and lift == "ray":
        width, height = fitted.camera.image_size
        run.listener.tell(Event.NO_MAP, width=width, height=height)
    if with_page:
        contents["report"] = _page(fitted, loaded, run)
    run.listener.progress("Writing")
    files = {kind: path for kind, path in goals.items() if contents.get(kind) is not None}
    others = [goals[kind] for kind in _ITS_OWN if kind not in files]
    obsolete = [path for path in others if path.is_file() and not _is_among(read, path)]
    write_files(
        {path: contents[kind] or "" for kind, path in files.items()},
        overwrite=run.overwrite,
        obsolete=obsolete if run.overwrite else (),
    )
    record, advice, models = fitted.as_record(), None, None
    if isinstance(fitted, Calibration):
        advice = summary(fitted.camera, record, fitted.pairs)
        if compare:
            from cubicfish_cli.fitting.model_comparison import compare_models  # all lens models

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
        removed=[path for path in obsolete if not path.exists()],
        advice=advice,
        models=models,
    )


def _is_among(inputs: Sequence[Path], path: Path) -> bool:
    """Whether a file is one of those that the calibration is made from."""
    return path.exists() and any(one.exists() and path.samefile(one) for one in inputs)


def _contents(
    fitted: Calibration | PointCalibration,
    corners: Observations | None,
    drawn: str | None,
) -> dict[str, Content | None]:
    """What is written of a fit of either lift, but for the report, by the names in :data:`NAMES`.

    ``map`` is None where it would take gigabytes.
    """
    contents: dict[str, Content | None] = {"drawn": drawn, "camera": fitted.text()}
    if corners is not None:
        contents["corners"] = partial(save_corners, corners=corners, overwrite=False)
    if isinstance(fitted, Calibration):
        contents["map"] = _map(fitted.camera)
        if fitted.refined != "off" and fitted.target is not None:
            contents["target"] = target_text(fitted.target)
    return contents


def _map(camera: CubicCamera) -> Content | None:
    if math.prod(camera.image_size) > MAX_PIXELS:
        return None
    return lambda path: save_map(path, build_map(camera, build_view(camera)), overwrite=False)


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
        from cubicfish_cli.fitting.point_fit import calibrate_points

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


@dataclass(frozen=True, kw_only=True, eq=False)
class EvaluatedFiles:
    """What became of :func:`evaluate_files`.

    Attributes:
        evaluation: the errors.
        inputs: what they were measured on.
        record: both as plain data: what ``cubicfish evaluate --json`` prints.
        camera: the camera.
        verdict: how well it does there.

    """

    evaluation: Evaluation
    inputs: Inputs
    record: dict[str, Any]
    camera: CubicCamera
    verdict: Verdict


def evaluate_files(
    camera: StrPath,
    inputs: StrPath | Sequence[StrPath],
    target: TargetSource | Target | StrPath | None = None,
    *,
    image_size: tuple[int, int] | None = None,
    run: Run = RUN,
) -> EvaluatedFiles:
    """Measure a camera on photos or tables in files, as ``cubicfish evaluate`` does.

    Args:
        camera: its file, or the folder of that.
        inputs: photos (files, folders and globs), or one corners.csv or correspondences.csv.
        target: the calibration target, or its file; 2D-3D pairs need none.
        image_size: (width, height) of the photos, for tables that do not say.
        run: how the work is done.

    Raises:
        UsageError: what is asked does not go together.
        CubicfishError: an input cannot be used, or no photo can be placed.

    """
    paths, source = paths_of(inputs), TargetSource.of(target)
    check_inputs(paths, None, source)
    file = load_camera(in_folder(Path(camera)))
    size = file.camera.image_size
    refuse_other_sizes(paths, size)
    loaded = load_inputs(paths, source, run, image_size=image_size or size)
    run.listener.progress("Fitting poses")
    evaluation = evaluate(file.camera, loaded.pairs)
    sigma = uncertainty_at(file.fit, evaluation.pairs.pixel)
    record = {**evaluation.as_record(), "uncertainty": sigma, **loaded.remarks()}
    return EvaluatedFiles(
        evaluation=evaluation,
        inputs=loaded,
        record=record,
        camera=file.camera,
        verdict=evaluation_verdict(record, _with_this_target(file, loaded.target_file), size),
    )


def _with_this_target(file: CameraFile, target: Fingerprint | None) -> Mapping[str, Any]:
    """The camera's fit, and what it was off by on a target that was no better known than this one.

    Where the target was refined, its file as drawn leaves errors that are not the camera's.
    """
    given, levels = file.made_by.get("target"), file.fit.get("held_out_by_level")
    drawn = target and isinstance(given, Mapping) and given.get("sha256") == target.sha256
    if drawn and isinstance(levels, Mapping) and "off" in levels:
        return {**file.fit, "held_out_rms_px": levels["off"]}
    return file.fit
