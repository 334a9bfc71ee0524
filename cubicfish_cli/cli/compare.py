"""``cubicfish compare``: how far apart two cameras are, in pixels."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import hold_gate, print_figure, print_spread, px
from cubicfish_cli.cli.options import as_command, option, record
from cubicfish_cli.cli.progress import call
from cubicfish_cli.cli.terminal import print_json, print_table, result

_BOTH = "two cameras are needed: 'cubicfish compare a.yaml b.yaml'"

if TYPE_CHECKING:
    from cubicfish_cli.fitting.comparison import Comparison
    from cubicfish_cli.library.describing import ComparedRigFiles


@record
class Asked:
    """What is asked of ``cubicfish compare``."""

    first: Path = options.argument(
        "The camera.yaml, or its folder, in whose pixels differences are.",
        metavar="A",
        missing=_BOTH,
    )
    second: Path = options.argument(
        "The camera.yaml, or its folder, that is compared with it.", metavar="B", missing=_BOTH
    )
    picture: Path | None = option(
        "--picture FILE", "Also draw the difference at every pixel of camera A.", options.FILE
    )
    max_rms: float | None = options.max_rms_option
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "compare",
    "How far apart two cameras are, in pixels.",
    "cubicfish compare last_year/camera.yaml calibration/camera.yaml",
    "cubicfish compare a.yaml b.yaml --picture difference.png --max-rms 0.3",
    "cubicfish compare simulated/true_camera.yaml calibration/camera.yaml",
    "cubicfish compare last_year/rig.yaml rig/rig.yaml",
)
def command(given: Asked) -> None:
    """Say how far from A's pixels the camera B sees the same rays, over their common field.

    A and B are camera.yaml files, such as the true_camera.yaml that simulate writes beside its
    photos. The rotation between the two camera frames that makes
    the differences smallest is taken out first, since poses make up for it. Photos of one size, or
    of sizes that are an exact rescale; differences are in A's pixels.

    Two rigs (rig.yaml, or its folder) are compared camera by camera: how far apart they stand
    beside the first, with how sure that is, and how far apart their lenses are.
    """
    from cubicfish_cli.library.describing import compare_files, compare_rig_files

    rigs = options.rig_path(given.first), options.rig_path(given.second)
    if rigs[0] is not None and rigs[1] is not None:
        if given.picture is not None or given.max_rms is not None:
            raise click.UsageError("--picture and --max-rms are for two cameras, not for two rigs")
        of_rigs = compare_rig_files(rigs[0], rigs[1])
        if given.as_json:
            print_json(of_rigs.as_record())
        else:
            _print_rigs(of_rigs)
        return
    for one, other, rig in (
        (given.first, given.second, rigs[0]),
        (given.second, given.first, rigs[1]),
    ):
        if rig is not None:
            raise click.UsageError(
                f"{one} is a rig and {other} is none: name two rigs, or one of the rig's cameras"
            )
    made = call(compare_files, given)
    record = made.as_record()
    if given.as_json:
        print_json(record)
    else:
        _print(made.comparison)
        if made.picture is not None:
            result(f"\nwrote {made.picture}")
    hold_gate(record["rms_px"], given.max_rms)


def _print(comparison: Comparison) -> None:
    record, spread = comparison.as_record(), comparison.statistics
    meaning = "sqrt(mean(dx² + dy²)) over pixels"
    print_figure("RMS difference", px(spread.rms_px), meaning=meaning)
    print_spread(spread)
    share = 100 * record["common_share"]
    print_figure("common field", f"{share:.1f}", "%", "of what A sees")
    result(f"{'rotation taken out':<24}{record['rotation_deg']:>7.3f}°")
    if record["scale"] != 1:
        result(f"{'scale taken out':<24}{record['scale']:>7.3f}    A's pixels for one of B's")
    result()
    print_table(
        ("from °", "to °", "rms px", "largest"),
        [
            (
                f"{ring['from_deg']:.0f}",
                f"{ring['to_deg']:.0f}",
                px(ring["rms_px"]),
                px(ring["max_px"]),
            )
            for ring in record["by_angle"]
        ],
    )


def _print_rigs(made: ComparedRigFiles) -> None:
    found, units = made.cameras, f" {made.units}" if made.units else ""
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
