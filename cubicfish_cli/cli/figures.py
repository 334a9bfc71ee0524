"""The figures of a fit in words: the same words wherever an RMS is shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli.terminal import Column, Row, print_columns, result, tell

if TYPE_CHECKING:
    from cubicfish_cli.assess.verdict import Verdict
    from cubicfish_cli.words.finding import Finding

EXIT_GATE = 3


def px(value: float | None) -> str:
    """Pixels to three decimals; a dash for what is not known."""
    return "-" if value is None else f"{value:.3f}"


def count(number: int, what: str) -> str:
    """``1 photo``, ``2 photos``."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def print_figure(name: str, value: str, unit: str = "px", meaning: str = "") -> None:
    """Print what a figure is called, its value and what it means, in columns."""
    result(f"{name:<24}{value:>7} {unit:<2}  {meaning}".rstrip())


def print_errors(record: Mapping[str, Any], more: Sequence[tuple[str, float | None, str]]) -> None:
    """Print reprojection errors: the RMS and what it means, other RMS beside it, the spread."""
    lines = [
        ("RMS reprojection error", record["rms_px"], "sqrt(mean(dx² + dy²)) over all corners used"),
        *more,
    ]
    for name, value, meaning in lines:
        print_figure(name, px(value), "" if value is None else "px", meaning)
    print_spread(record)


def print_spread(record: Mapping[str, Any]) -> None:
    """Print the median, what 95 % are within and the largest, a line each."""
    for name, key in (("median", "median_px"), ("95 % within", "p95_px"), ("largest", "max_px")):
        print_figure(name, px(record[key]))


def print_verdict(judged: Verdict) -> None:
    """Print the verdict in a line, and what else is against the camera in a line each."""
    result(f"verdict: {judged.line}", mark=(judged.words, judged.level))
    for reason in judged.reasons[1:]:
        result(f"  also: {reason.why}; {reason.do}")


def print_models(records: Sequence[Mapping[str, Any]]) -> None:
    """Print one row per lens model: how large it is, how well it does, how far it reaches."""
    result("Lens models: the same corners, loss and folds, the target as drawn")
    print_columns(
        [
            "model",
            Column(title="parameters", drop=2),
            "rms px",
            "held-out px",
            Column(title="usable to °", drop=1),
            Column(title="seconds", drop=3),
        ],
        [
            Row(
                cells=(
                    str(record["model"]),
                    str(record["parameters"]),
                    px(record["rms_px"]),
                    px(record["held_out_rms_px"]),
                    _degrees(record["largest_angle_deg"]),
                    f"{record['seconds']:.2f}",
                )
            )
            for record in records
        ],
    )


def _degrees(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def mark_of(finding: Finding) -> str:
    """How a line about a finding begins."""
    return "note" if finding.severity.value == "note" else "warning"


def hold_gate(rms_px: float, max_rms: float | None) -> None:
    """Exit with 3 when the RMS is above the gate that the user set."""
    if max_rms is not None and not rms_px <= max_rms:
        tell(f"The RMS of {rms_px:.3f} px is above --max-rms {max_rms:g}.")
        click.get_current_context().exit(EXIT_GATE)
