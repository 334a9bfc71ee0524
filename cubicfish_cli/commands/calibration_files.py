"""Photos or tables -> how a camera does on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cubicfish_cli.app.asked import (
    RUN,
    Run,
    StrPath,
    TargetSource,
    check_inputs,
    in_folder,
    paths_of,
)
from cubicfish_cli.app.inputs import (
    Inputs,
    load_inputs,
    recorded_as,
    refuse_other_sizes,
)
from cubicfish_cli.core.assess.fit_record import FitRecord, origin_of
from cubicfish_cli.core.assess.records import plain_record
from cubicfish_cli.core.assess.uncertainty import PixelUncertainty
from cubicfish_cli.core.assess.verdict import Verdict, evaluation_verdict
from cubicfish_cli.core.fit.evaluate import Evaluation, evaluate
from cubicfish_cli.core.io.camera_yaml import CameraFile, load_camera
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.target import Target


@dataclass(frozen=True, kw_only=True, eq=False)
class EvaluatedFiles:
    """What became of :func:`evaluate_files`.

    Attributes:
        evaluation: the errors.
        inputs: what they were measured on.
        record: both as plain data: what ``cubicfish evaluate --json`` prints.
        camera: the camera.
        uncertainty: of the camera where the corners are; None where it is not known.
        verdict: how well it does there.

    """

    evaluation: Evaluation
    inputs: Inputs
    record: dict[str, Any]
    camera: CubicCamera
    uncertainty: PixelUncertainty | None
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
    sigma = file.fit.uncertainty.over(evaluation.pairs.pixel)
    record = {**evaluation.as_record(), "uncertainty": plain_record(sigma), **loaded.remarks()}
    return EvaluatedFiles(
        evaluation=evaluation,
        inputs=loaded,
        record=record,
        camera=file.camera,
        uncertainty=sigma,
        verdict=evaluation_verdict(
            evaluation.errors, sigma, _with_this_target(file, loaded, source), size
        ),
    )


def _with_this_target(file: CameraFile, loaded: Inputs, source: TargetSource) -> FitRecord:
    """The camera's fit, and what it was off by on a target that was no better known than this one.

    Where the target was refined, the drawn one leaves errors that are not the camera's.
    """
    fit, given, drawn = file.fit, origin_of(file.made_by).target, loaded.drawn(source)
    digest = loaded.target_file and loaded.target_file.sha256
    if drawn is not None:
        digest = recorded_as(drawn, Path())["sha256"]
    if given is None or digest != given.sha256 or fit.refine_target in (None, "off"):
        return fit
    # Where nobody measured that, errors are judged by themselves.
    as_drawn = fit.held_out_by_level.get("off", math.nan)
    return replace(fit, held_out_rms_px=as_drawn, rms_px=as_drawn)
