"""What is printed of rigs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from cubicfish_cli.app.terminal.figures import count, print_errors, px
from cubicfish_cli.app.terminal.terminal import print_table, result

if TYPE_CHECKING:
    from cubicfish_cli.extensions.rigs.fit.evaluate import RigEvaluation


def print_rig(record: Mapping[str, Any]) -> None:
    """Print where the cameras stand, and how well it fits."""
    from cubicfish_cli.core.assess.fit_record import ErrorStatistics
    from cubicfish_cli.core.assess.records import read_record

    units, fit = record["units"] or "", record["fit"]
    result(
        f"{count(len(record['cameras']), 'camera')}, {count(fit['shots'], 'shot')}, "
        f"{count(fit['corners'], 'corner')} used\n"
    )
    out, errors = fit["held_out_rms_px"], read_record(ErrorStatistics, fit) or ErrorStatistics()
    meaning = "shots judged by rigs that never saw them" if out else ""
    print_errors(errors, [("held-out RMS", out or math.nan, meaning)])
    result()
    print_table(
        ("camera", f"x {units}".strip(), "y", "z", "± shift", "turned °", "± turn °", "photos",
         "RMS px", "alone px"),
        [
            (
                one["name"],
                *(f"{value:.2f}" for value in one["position"]),
                f"{one['shift_sigma']:.3f}",
                f"{_turn_deg(one['camera_from_rig']['rotation']):.3f}",
                f"{one['turn_sigma_deg']:.4f}",
                str(one["fit"]["images"]),
                px(one["fit"]["rms_px"]),
                px(one["fit"]["alone_rms_px"]),
            )
            for one in record["cameras"]
        ],
    )  # fmt: skip
    print_pairs(record)


def print_pairs(record: Mapping[str, Any]) -> None:
    """Print what connects every two cameras."""
    result()
    print_table(
        ("cameras", "shots in common", "RMS px"),
        [
            (" + ".join(one["cameras"]), str(one["shots"]), px(one["rms_px"]))
            for one in record["pairs"]
        ],
    )


def _turn_deg(rotation: Sequence[Sequence[float]]) -> float:
    """By how much a camera is turned against the first, degrees."""
    trace = sum(rotation[axis][axis] for axis in range(3))
    return math.degrees(math.acos(max(-1.0, min(1.0, (trace - 1) / 2))))


def print_evaluation(evaluation: RigEvaluation) -> None:
    """Print how well a rig explains other shots."""
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
