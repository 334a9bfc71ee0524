"""``cubicfish evaluate``: how well a camera explains other photos."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import (
    corners_by_board,
    count,
    fitted_rows,
    hold_gate,
    print_errors,
    print_figure,
    print_photo_table,
    print_verdict,
    px,
    why_lost,
)
from cubicfish_cli.cli.options import as_command, record, target_options
from cubicfish_cli.cli.progress import call, say_found, say_left_out
from cubicfish_cli.cli.terminal import print_json, print_table, result, say
from cubicfish_cli.library.asked import check_inputs

if TYPE_CHECKING:
    from cubicfish_cli.fitting.rig.evaluate import RigEvaluation
    from cubicfish_cli.library.asked import TargetSource
    from cubicfish_cli.library.calibration_files import EvaluatedFiles
    from cubicfish_cli.words.finding import Finding


@record
class Asked:
    """What is asked of ``cubicfish evaluate``."""

    inputs: tuple[Path, ...] = options.argument(
        "Photos (files, folders or globs), or one corners.csv or correspondences.csv.",
        nargs=-1,
        metavar="PHOTOS|CSV...",
    )
    target: TargetSource = target_options
    model: Path | None = options.model_option
    image_size: tuple[int, int] | None = options.size_option
    max_rms: float | None = options.max_rms_option
    as_json: bool = options.json_option
    jobs: int | None = options.jobs_option
    no_cache: bool = options.no_cache_option


@as_command(
    "evaluate",
    "Measure a camera on other photos, poses refitted.",
    "cubicfish evaluate new_photos/ --target target.yaml",
    "cubicfish evaluate corners.csv --target target.yaml --max-rms 0.5",
    "cubicfish evaluate rig/rig.yaml left/ right/ --target target.yaml",
)
def command(given: Asked) -> None:
    """Measure the reprojection error of a camera on PHOTOS, corners.csv or correspondences.csv.

    The camera stays as it is; only the pose of each photo is fitted. No corner is dropped.

    With a rig (rig.yaml or its folder as the first name, or as --model), name photos or corners of
    each of its cameras: the rig stays as it is, and only where it was in each shot is fitted.
    """
    rig = _rig(given.inputs, given.model)
    if rig is not None:
        _evaluate_rig(rig, given)
        return
    check_inputs(given.inputs, None, given.target)
    from cubicfish_cli.library.calibration_files import evaluate_files

    model = options.model_path(given.model)
    made = call(evaluate_files, given, camera=model)
    evaluation = made.evaluation
    if evaluation.outside:
        say(
            f"{count(evaluation.outside, 'corner')} not counted: beyond the "
            f"{made.camera.max_angle_deg:.0f}° where the camera may be trusted."
        )
    if made.inputs.detection is not None:
        say_found(made.inputs.photo_findings)
        for finding in made.inputs.detection.findings:
            say(f"warning: {finding.line}")
    say_left_out(_unplaced(evaluation.unplaced))
    if given.as_json:
        print_json(made.record)
    else:
        _print(made)
    hold_gate(made.record["rms_px"], given.max_rms)


def _rig(inputs: tuple[Path, ...], model: Path | None) -> Path | None:
    """The rig's file, where one is meant."""
    first = inputs[0] if inputs else None
    named = first is not None and (first.suffix in (".yaml", ".yml") or first.is_dir())
    return options.rig_path(model or (first if named else None))


def _evaluate_rig(path: Path, given: Asked) -> None:
    """Measure a rig on the photos or corners of each of its cameras, and say what came of it."""
    from cubicfish_cli.library.rig_files import evaluate_rig_files

    if given.image_size is not None:
        raise click.UsageError("--size is for one camera: the rig knows its cameras' sizes")
    sources = given.inputs if given.model is not None else given.inputs[1:]
    evaluation = call(evaluate_rig_files, given, rig=path, cameras=sources)
    for one in evaluation.cameras:
        if one.outside:
            say(f"camera {one.name}: {count(one.outside, 'corner')} not counted: beyond its field.")
        say_left_out(_unplaced(one.unplaced), f"camera {one.name}: ")
    record = evaluation.as_record()
    if given.as_json:
        print_json({"model": str(path), **record})
    else:
        _print_rig(evaluation)
    hold_gate(record["rms_px"], given.max_rms)


def _unplaced(photos: Sequence[str]) -> dict[str, Finding]:
    """What is said of photos that could not be placed."""
    from cubicfish_cli.words.codes import Code, Severity
    from cubicfish_cli.words.finding import Finding

    too_few = Finding(code=Code.TOO_FEW_CORNERS, severity=Severity.CARE)
    return dict.fromkeys(photos, too_few)


def _print_rig(evaluation: RigEvaluation) -> None:
    from cubicfish_cli.cli.rig import print_pairs

    record = evaluation.as_record()

    result(f"{count(len(record['per_shot']), 'shot')}, {count(record['corners'], 'corner')}\n")
    meaning = "the same corners with each photo's own pose: what is more is the rig's"
    print_errors(evaluation.errors, [("each alone", evaluation.alone_rms_px, meaning)])
    result()
    print_table(
        ("camera", "photos", "RMS px", "alone px"),
        [
            (one["name"], str(one["images"]), px(one.get("rms_px")), px(one["alone_rms_px"]))
            for one in record["cameras"]
        ],
    )
    print_pairs(record)


def _print(made: EvaluatedFiles) -> None:
    known, pairs = made.evaluation, made.inputs.pairs
    lost = dict.fromkeys(known.unplaced, "too few corners")
    lost |= why_lost(made.inputs.detection)
    by_board = corners_by_board(known.pairs)
    rows = fitted_rows(known.photos, (), pairs.image_size, by_board, lost)
    print_photo_table(rows, pairs.boards, known.errors)
    photos = count(len(known.pairs.images), "photo")
    result(f"\n{photos}, {count(known.errors.corners, 'corner')}\n")
    print_errors(known.errors, [])
    sigma = made.uncertainty
    if sigma is not None:
        meaning = (
            "of the camera itself: 1σ, median over these corners; 95 % of them within "
            f"{px(sigma.p95_px)} px"
        )
        print_figure("uncertainty", px(sigma.median_px), meaning=meaning)
    result()
    print_verdict(made.verdict)
