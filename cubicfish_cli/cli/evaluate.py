"""``cubicfish evaluate``: how well a camera explains other photos."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import (
    count,
    hold_gate,
    print_errors,
    print_figure,
    print_verdict,
    px,
)
from cubicfish_cli.cli.inputs import (
    check_inputs,
    load_pairs,
    photo_remarks,
    refuse_other_sizes,
    say_photo_problems,
    why_lost,
)
from cubicfish_cli.cli.options import as_command
from cubicfish_cli.cli.photo_table import corners_by_board, fitted_rows, print_photo_table
from cubicfish_cli.cli.target_choice import TargetChoice, target_options
from cubicfish_cli.cli.terminal import print_json, result, say, working

if TYPE_CHECKING:
    from cubicfish_cli.assess.verdict import Verdict
    from cubicfish_cli.cli.inputs import Pairs
    from cubicfish_cli.fitting.evaluate import Evaluation


@as_command(
    "evaluate",
    "Measure a camera on other photos, poses refitted.",
    "cubicfish evaluate new_photos/ --target target.yaml",
    "cubicfish evaluate corners.csv --target target.yaml --max-rms 0.5",
    "cubicfish evaluate rig/rig.yaml left/ right/ --target target.yaml",
)
@options.argument(
    "inputs",
    "Photos (files, folders or globs), or one corners.csv or correspondences.csv.",
    nargs=-1,
    metavar="PHOTOS|CSV...",
)
@target_options
@options.model_option
@options.size_option
@options.max_rms_option
@options.json_option("evaluate")
@options.jobs_option
@options.no_cache_option
def command(
    inputs: tuple[Path, ...],
    target: TargetChoice,
    model: Path | None,
    size: tuple[int, int] | None,
    max_rms: float | None,
    as_json: bool,
    jobs: int | None,
    no_cache: bool,
) -> None:
    """Measure the reprojection error of a camera on PHOTOS, corners.csv or correspondences.csv.

    The camera stays as it is; only the pose of each photo is fitted. No corner is dropped.

    With a rig (rig.yaml as the first name, or as --model), name photos or corners of each of its
    cameras: the rig stays as it is, and only where it was in each shot is fitted.
    """
    rig = _rig(inputs, model)
    if rig is not None:
        from cubicfish_cli.cli.rig_judged import print_evaluation

        if size is not None:
            raise click.UsageError("--size is for one camera: the rig knows its cameras' sizes")
        sources = inputs if model is not None else inputs[1:]
        print_evaluation(
            rig, sources, target, jobs, no_cache=no_cache, max_rms=max_rms, as_json=as_json
        )
        return
    check_inputs(inputs, correspondences=None, target=target)
    from cubicfish_cli.assess.field_uncertainty import uncertainty_at
    from cubicfish_cli.assess.verdict import evaluation_verdict
    from cubicfish_cli.fitting.evaluate import evaluate
    from cubicfish_cli.formats.camera_yaml import load_camera

    file = load_camera(options.model_path(model))
    camera = file.camera
    refuse_other_sizes(inputs, camera.image_size)
    loaded = load_pairs(
        inputs,
        correspondences=None,
        target=target,
        size=size or camera.image_size,
        jobs=jobs,
        no_cache=no_cache,
    )
    with working("Fitting poses"):
        evaluation = evaluate(camera, loaded.pairs)
    record = evaluation.as_record()
    record["uncertainty"] = uncertainty_at(file.fit, evaluation.pairs.pixel)
    record |= photo_remarks(loaded.detection)
    if evaluation.outside:
        say(
            f"{count(evaluation.outside, 'corner')} not counted: beyond the "
            f"{camera.max_angle_deg:.0f}° where the camera may be trusted."
        )
    if loaded.detection is not None:
        say_photo_problems(loaded.detection)
        for finding in loaded.detection.findings:
            say(f"warning: {finding.line}")
    for photo in evaluation.unplaced:
        say(f"{photo}: too few corners to place it; not counted.")
    if as_json:
        print_json(record)
    else:
        judged = evaluation_verdict(record, file.fit, camera.image_size)
        _print(record, judged, evaluation, loaded)
    hold_gate(record["rms_px"], max_rms)


def _rig(inputs: tuple[Path, ...], model: Path | None) -> Path | None:
    """The rig's file, where one is meant."""
    given = model or (inputs[0] if inputs and inputs[0].suffix in (".yaml", ".yml") else None)
    if given is None:
        return None

    return options.rig_path(given)


def _print(
    record: Mapping[str, Any], judged: Verdict, evaluation: Evaluation, loaded: Pairs
) -> None:
    lost = dict.fromkeys(evaluation.unplaced, "too few corners")
    if loaded.detection is not None:
        lost |= why_lost(loaded.detection)
    rows = fitted_rows(record, loaded.pairs.image_size, corners_by_board(evaluation.pairs), lost)
    print_photo_table(rows, loaded.pairs.boards, record)
    result(f"\n{count(record['images'], 'photo')}, {count(record['corners'], 'corner')}\n")
    print_errors(record, [])
    if record["uncertainty"] is not None:
        sigma = record["uncertainty"]
        meaning = (
            "of the camera itself: 1σ, median over these corners; 95 % of them within "
            f"{px(sigma['p95_px'])} px"
        )
        print_figure("uncertainty", px(sigma["median_px"]), meaning=meaning)
    result()
    print_verdict(judged)
