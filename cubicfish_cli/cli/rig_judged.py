"""What ``evaluate`` and ``compare`` say of rigs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from cubicfish_cli.cli.figures import count, hold_gate, print_errors, px
from cubicfish_cli.cli.target_choice import TargetChoice
from cubicfish_cli.cli.terminal import print_json, print_table, result, say, working


def print_evaluation(
    path: Path,
    inputs: Sequence[Path],
    target: TargetChoice,
    jobs: int | None,
    *,
    no_cache: bool,
    max_rms: float | None,
    as_json: bool,
) -> None:
    """Measure a rig on the photos or corners of each of its cameras, and say what came of it."""
    from cubicfish_cli.cli.rig import loaded_camera, named_by
    from cubicfish_cli.formats.rig_yaml import load_rig
    from cubicfish_cli.library.rigs import evaluate_rig

    rig = load_rig(path)
    names = [one.name for one in rig.cameras]
    own = [named_by(one.absolute()) for one in inputs]
    if not set(own) <= set(names):
        if len(inputs) != len(names):
            raise click.UsageError(
                f"the rig has the cameras {', '.join(names)}: name photos of each in this order, "
                "or folders that are called as they are"
            )
        own = names
    if len(set(own)) < max(2, len(own)):
        raise click.UsageError(
            f"name photos or a corners.csv of two or more of the cameras {', '.join(names)}"
        )
    loaded = {
        name: loaded_camera((one,), target, jobs, no_cache)[0]
        for name, one in zip(own, inputs, strict=True)
    }
    pairs = {name: one.given for name, one in loaded.items()}
    with working("Placing shots"):
        evaluation = evaluate_rig(rig, pairs, loaded[own[0]].pairs.target)
    for one in evaluation.cameras:
        if one.outside:
            say(f"camera {one.name}: {count(one.outside, 'corner')} not counted: beyond its field.")
        for photo in one.unplaced:
            say(f"camera {one.name}, {photo}: too few corners to place it; not counted.")
    record = evaluation.as_record()
    if as_json:
        print_json({"model": str(path), **record})
    else:
        _print_evaluation(record)
    hold_gate(record["rms_px"], max_rms)


def _print_evaluation(record: dict[str, Any]) -> None:
    from cubicfish_cli.cli.rig import print_pairs

    result(f"{count(len(record['per_shot']), 'shot')}, {count(record['corners'], 'corner')}\n")
    meaning = "the same corners with each photo's own pose: what is more is the rig's"
    print_errors(record, [("each alone", record["alone_rms_px"], meaning)])
    result()
    print_table(
        ("camera", "photos", "RMS px", "alone px"),
        [
            (one["name"], str(one["images"]), px(one.get("rms_px")), px(one["alone_rms_px"]))
            for one in record["cameras"]
        ],
    )
    print_pairs(record)


def print_comparison(first: Path, second: Path, *, as_json: bool) -> None:
    """Say how far apart the cameras of two rigs stand, and how far apart their lenses are."""
    from cubicfish_cli.formats.rig_yaml import load_rig
    from cubicfish_cli.library.rigs import compare_rigs

    rig = load_rig(first)
    found = compare_rigs(rig, load_rig(second))
    if as_json:
        print_json({"units": rig.units, "cameras": [one.as_record() for one in found]})
        return
    units = f" {rig.units}" if rig.units else ""
    print_table(
        ("camera", f"shift{units}", "± shift", "turned °", "± turn °", "in σ", "lens RMS px"),
        [
            (
                one.name,
                f"{float((one.shift**2).sum()) ** 0.5:.3f}",
                _sigma(one.shift_sigma, 3),
                f"{one.turn_deg:.4f}",
                _sigma(one.turn_sigma_deg, 4),
                _sigma(one.sigmas, 1),
                px(one.lens.statistics.rms_px),
            )
            for one in found
        ],
    )
    result(
        f"\nPlaces are beside {found[0].name}, of the rays of the same pixels; ± is of both rigs "
        "together.\nDifferences of up to about 2 σ are what two calibrations of one rig have."
    )


def _sigma(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"
