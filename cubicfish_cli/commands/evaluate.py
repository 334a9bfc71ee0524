"""``cubicfish evaluate``: how well a camera explains other photos."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish import Run
from cubicfish.files import StrPath
from cubicfish_cli.inputs.paths import check_inputs, in_folder, kind_of_inputs, paths_of
from cubicfish_cli.inputs.target_source import TargetSource
from cubicfish_cli.terminal import figures, parameters
from cubicfish_cli.terminal.parameters import as_command, record, target_options
from cubicfish_cli.terminal.progress import How, report_found, report_left_out
from cubicfish_cli.terminal.terminal import print_message, result
from cubicfish_cli.words.phrases import plural
from cubicfish_cli.words.sentences import render

if TYPE_CHECKING:
    from cubicfish import CameraFile, CubicCamera, Evaluation, Target, Verdict
    from cubicfish.judge import FieldUncertainty, FitRecord
    from cubicfish_cli.observe import Inputs


@record
class EvaluateOptions:
    """Options of :func:`evaluate_files`.

    Attributes:
        inputs: photos (files, folders and globs), or one corners.csv or correspondences.csv.
        target: the calibration target, or its file; where none is known, that in the camera's
            folder. 2D-3D pairs have none.
        camera: the file or folder of the camera.
        image_size: (width, height) of the photos, for tables that do not say.
        exclude: photos that are left out, by their names or by patterns.

    """

    inputs: StrPath | Sequence[StrPath] = parameters.argument(
        "Photos (files, folders or globs), or one corners.csv or correspondences.csv.",
        nargs=-1,
        metavar="PHOTOS|CSV...",
    )
    target: TargetSource | Target | StrPath | None = target_options
    camera: StrPath = parameters.model_options
    image_size: tuple[int, int] | None = parameters.size_option
    exclude: StrPath | Sequence[StrPath] = parameters.exclude_option


@dataclass(frozen=True, kw_only=True, eq=False)
class EvaluatedFiles:
    """Result of :func:`evaluate_files`.

    Attributes:
        evaluation: the errors.
        inputs: what they were measured on.
        camera: the camera.
        uncertainty: of the camera where the corners are; None if it is not known.
        verdict: on the camera, by these errors.

    """

    evaluation: Evaluation
    inputs: Inputs
    camera: CubicCamera
    uncertainty: FieldUncertainty | None
    verdict: Verdict

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish evaluate --json`` prints.

        Keys:
            those of :class:`~cubicfish.judge.fit_record.ErrorStatistics`
            images: how many photos were used
            outside_field: corners that were not counted, beyond where the camera may be trusted
            unplaced: photos with too few corners to place them
            photo_problems: photos that gave nothing and grids that were left out, a line each;
                null where no photos were searched
            remarks: what else is told, a record each: photos and grids that were left out
            uncertainty: of the camera itself at these corners: median_px, p95_px, max_px; null
                where its file does not say
            per_image: a record per photo: image, its errors, corners, camera_from_world

        """
        sigma = self.uncertainty
        uncertainty = {"uncertainty": None if sigma is None else sigma.as_record()}
        return {**self.evaluation.as_record(), **uncertainty, **self.inputs.remarks()}


def evaluate_files(options: EvaluateOptions, *, run: Run = Run()) -> EvaluatedFiles:
    """Measure a camera on photos or tables in files, as ``cubicfish evaluate`` does.

    Raises:
        UsageError: the options do not go together.
        CubicfishError: an input cannot be used, or no photo can be placed.

    """
    paths, source = paths_of(options.inputs), TargetSource.of(options.target)
    kind, model = kind_of_inputs(paths), in_folder(Path(options.camera))
    if not source.is_known and kind != "points":
        source = TargetSource.beside(model)
    check_inputs(kind, paths, source, run, image_size=options.image_size)
    from cubicfish import evaluate, load_camera
    from cubicfish_cli.observe import load_inputs

    file = load_camera(model)
    size = options.image_size or file.camera.image_size
    exclude = paths_of(options.exclude)
    loaded = load_inputs(kind, paths, source, run, image_size=size, exclude=exclude)
    run.listener.progress("Fitting poses")
    evaluation = evaluate(file.camera, loaded.pairs)
    fit = _match_target(file, loaded, source)
    return EvaluatedFiles(
        evaluation=evaluation,
        inputs=loaded,
        camera=file.camera,
        uncertainty=evaluation.uncertainty(fit),
        verdict=evaluation.verdict(fit),
    )


def _match_target(file: CameraFile, loaded: Inputs, source: TargetSource) -> FitRecord:
    """Return the camera's fit, and its error on a target as little known as this one.

    If the target was refined, the nominal one leaves errors that are not the camera's.
    """
    from cubicfish.files import Fingerprint

    fit, given, nominal = file.fit, file.origin.target, loaded.nominal(source)
    digest = loaded.target_file and loaded.target_file.sha256
    if nominal is not None:
        digest = Fingerprint.of_text(Path(), nominal).sha256
    if given is None or digest != given.sha256 or fit.refine_target in (None, "off"):
        return fit
    # If that was not measured, errors are judged by themselves.
    nominal_error = fit.held_out_by_level.get("off", math.nan)
    return replace(fit, held_out_rms_px=nominal_error, rms_px=nominal_error)


@as_command(
    "evaluate",
    "Measure a camera on other photos, poses refitted.",
    "cubicfish evaluate new_photos/ --target target.yaml",
    "cubicfish evaluate corners.csv --target target.yaml --max-rms 0.5",
    do=evaluate_files,
    how=("max_rms", "as_json", "jobs", "no_cache"),
)
def command(made: EvaluatedFiles, given: EvaluateOptions, how: How) -> None:
    """Measure the reprojection error of a camera on PHOTOS, corners.csv or correspondences.csv.

    The camera stays as it is; only the pose of each photo is fitted. No corner is dropped.
    """
    evaluation = made.evaluation
    if evaluation.outside:
        print_message(
            f"{plural(evaluation.outside, 'corner')} not counted: beyond the "
            f"{made.camera.max_angle_deg:.0f}° where the camera may be trusted."
        )
    if made.inputs.detection is not None:
        report_found(made.inputs.photo_findings)
        for finding in made.inputs.detection.findings:
            print_message(f"warning: {render(finding).line}")
    report_unplaced(evaluation.unplaced)
    if not how.print(made):
        _print(made)
    figures.enforce_max_rms(evaluation.errors.rms_px, how.max_rms)


def report_unplaced(photos: Sequence[str], of: str = "") -> None:
    """Say which photos could not be placed; ``of`` names the camera."""
    from cubicfish import Finding
    from cubicfish.judge import Code, Severity

    too_few = Finding(code=Code.TOO_FEW_CORNERS, severity=Severity.CARE)
    report_left_out(dict.fromkeys(photos, too_few), of)


def _print(made: EvaluatedFiles) -> None:
    from cubicfish.judge import CameraFacts, FitRecord

    known, pairs = made.evaluation, made.inputs.pairs
    lost = dict.fromkeys(known.unplaced, "too few corners")
    lost |= figures.why_lost(made.inputs.detection)
    by_board = figures.corners_by_board(known.pairs)
    seen = CameraFacts(camera=made.camera, fit=FitRecord(per_image=known.photos))
    rows = figures.fitted_rows(seen, by_board, lost)
    figures.print_photo_table(rows, pairs.boards)
    photos = plural(len(known.pairs.images), "photo")
    result(f"\n{photos}, {plural(known.errors.corners, 'corner')}\n")
    figures.print_errors(known.errors, [])
    sigma = made.uncertainty
    if sigma is not None:
        meaning = (
            "of the camera itself: 1σ, median over these corners; 95 % of them within "
            f"{figures.px(sigma.p95_px)} px"
        )
        figures.print_figure("uncertainty", figures.px(sigma.median_px), meaning=meaning)
    result()
    figures.print_verdict(made.verdict)
