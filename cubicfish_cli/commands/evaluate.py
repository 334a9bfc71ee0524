"""``cubicfish evaluate``: how well a camera explains other photos."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.app.asked import check_inputs
from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.figures import (
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
from cubicfish_cli.app.terminal.options import as_command, record, target_options
from cubicfish_cli.app.terminal.progress import running, say_found, say_left_out
from cubicfish_cli.app.terminal.terminal import print_json, result, say

if TYPE_CHECKING:
    from cubicfish_cli.app.asked import TargetSource
    from cubicfish_cli.commands.calibration_files import EvaluatedFiles


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
)
def command(given: Asked) -> None:
    """Measure the reprojection error of a camera on PHOTOS, corners.csv or correspondences.csv.

    The camera stays as it is; only the pose of each photo is fitted. No corner is dropped.
    """
    check_inputs(given.inputs, None, given.target)
    from cubicfish_cli.commands.calibration_files import evaluate_files

    model = options.model_path(given.model)
    with running(jobs=given.jobs, no_cache=given.no_cache) as run:
        made = evaluate_files(
            model, given.inputs, given.target, image_size=given.image_size, run=run
        )
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
    say_unplaced(evaluation.unplaced)
    if given.as_json:
        print_json(made.record)
    else:
        _print(made)
    hold_gate(made.record["rms_px"], given.max_rms)


def say_unplaced(photos: Sequence[str], of: str = "") -> None:
    """Say which photos could not be placed; ``of`` says of which camera."""
    from cubicfish_cli.core.codes import Code, Severity
    from cubicfish_cli.core.finding import Finding

    too_few = Finding(code=Code.TOO_FEW_CORNERS, severity=Severity.CARE)
    say_left_out(dict.fromkeys(photos, too_few), of)


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
