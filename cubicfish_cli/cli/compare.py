"""``cubicfish compare``: how far apart two cameras are, in pixels."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import hold_gate, print_figure, print_spread, px
from cubicfish_cli.cli.options import as_command, option
from cubicfish_cli.cli.terminal import print_json, print_table, result

_DRAWN_PIXELS = 150_000
_BOTH = "two cameras are needed: 'cubicfish compare a.yaml b.yaml'"

if TYPE_CHECKING:
    from cubicfish_cli.fitting.comparison import ComparedCamera, Comparison


@as_command(
    "compare",
    "How far apart two cameras are, in pixels.",
    "cubicfish compare last_year/camera.yaml calibration/camera.yaml",
    "cubicfish compare a.yaml b.yaml --picture difference.png --max-rms 0.3",
    "cubicfish compare simulated/true_camera.yaml calibration/camera.yaml",
    "cubicfish compare last_year/rig.yaml rig/rig.yaml",
)
@options.argument(
    "first",
    "The camera.yaml, or its folder, in whose pixels differences are.",
    metavar="A",
    missing=_BOTH,
)
@options.argument(
    "second",
    "The camera.yaml, or its folder, that is compared with it.",
    metavar="B",
    missing=_BOTH,
)
@option("--picture FILE", "Also draw the difference at every pixel of camera A.", options.FILE)
@options.max_rms_option
@options.overwrite_option
@options.json_option("compare")
def command(
    first: Path,
    second: Path,
    picture: Path | None,
    max_rms: float | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Say how far from A's pixels the camera B sees the same rays, over their common field.

    A and B are camera.yaml files, or lenses given by their formula, such as the true_camera.yaml
    that simulate writes beside its photos. The rotation between the two camera frames that makes
    the differences smallest is taken out first, since poses make up for it. Photos of one size, or
    of sizes that are an exact rescale; differences are in A's pixels.

    Two rigs (rig.yaml, or its folder) are compared camera by camera: how far apart they stand
    beside the first, with how sure that is, and how far apart their lenses are.
    """
    from cubicfish_cli.files import refuse_existing
    from cubicfish_cli.fitting.comparison import compare
    from cubicfish_cli.undistortion.images import check_suffix

    rigs = options.rig_path(first), options.rig_path(second)
    if rigs[0] is not None and rigs[1] is not None:
        from cubicfish_cli.cli.rig_judged import print_comparison

        if picture is not None or max_rms is not None:
            raise click.UsageError("--picture and --max-rms are for two cameras, not for two rigs")
        print_comparison(rigs[0], rigs[1], as_json=as_json)
        return
    for one, other, rig in ((first, second, rigs[0]), (second, first, rigs[1])):
        if rig is not None:
            raise click.UsageError(
                f"{one} is a rig and {other} is none: name two rigs, or one of the rig's cameras"
            )
    if picture is not None:
        refuse_existing(picture, overwrite=overwrite)
        check_suffix(picture)
    comparison = compare(_camera(options.in_folder(first)), _camera(options.in_folder(second)))
    if picture is not None:
        _draw(comparison, picture, overwrite=overwrite)
    record = comparison.as_record()
    if as_json:
        print_json({**record, **({"picture": str(picture)} if picture else {})})
    else:
        _print(record)
        if picture is not None:
            result(f"\nwrote {picture}")
    hold_gate(record["rms_px"], max_rms)


def _camera(path: Path) -> ComparedCamera:
    from cubicfish_cli.formats.camera_yaml import load_camera
    from cubicfish_cli.rendering.lens_file import is_lens_file, load_lens

    return load_lens(path) if is_lens_file(path) else load_camera(path).camera


def _draw(comparison: Comparison, path: Path, *, overwrite: bool) -> None:
    import numpy as np

    from cubicfish_cli.rendering.difference_picture import difference_picture
    from cubicfish_cli.undistortion.images import write_picture

    width, height = comparison.first.image_size
    # Differences are smooth: one in each small block tells all.
    step = max(1, round((width * height / _DRAWN_PIXELS) ** 0.5))
    y, x = np.mgrid[:height:step, :width:step] + (step - 1) / 2
    coarse = np.linalg.norm(comparison.difference(np.stack([x, y], axis=-1)), axis=-1)
    magnitude = np.kron(coarse, np.ones((step, step)))[:height, :width]
    write_picture(path, difference_picture(magnitude), overwrite=overwrite)


def _print(record: dict[str, Any]) -> None:
    meaning = "sqrt(mean(dx² + dy²)) over pixels"
    print_figure("RMS difference", px(record["rms_px"]), meaning=meaning)
    print_spread(record)
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
