"""``cubicfish compare``: how far apart two cameras are, in pixels."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.figures import hold_gate, print_figure, print_spread, px
from cubicfish_cli.app.terminal.options import as_command, option, record
from cubicfish_cli.app.terminal.progress import running
from cubicfish_cli.app.terminal.terminal import print_json, print_table, result

_BOTH = "two cameras are needed: 'cubicfish compare a.yaml b.yaml'"

if TYPE_CHECKING:
    from cubicfish_cli.core.fit.comparison import Comparison


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
)
def command(given: Asked) -> None:
    """Say how far from A's pixels the camera B sees the same rays, over their common field.

    A and B are camera.yaml files, such as the true_camera.yaml that simulate writes beside its
    photos. The rotation between the two camera frames that makes
    the differences smallest is taken out first, since poses make up for it. Photos of one size, or
    of sizes that are an exact rescale; differences are in A's pixels.
    """
    from cubicfish_cli.commands.describing import compare_files

    with running(overwrite=given.overwrite) as run:
        made = compare_files(given.first, given.second, picture=given.picture, run=run)
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
