"""``cubicfish map``: the undistortion map alone."""

from __future__ import annotations

from pathlib import Path

import click

from cubicfish_cli.cli.options import (
    FILE,
    common_options,
    examples,
    model_option,
    model_path,
    overwrite_option,
)
from cubicfish_cli.cli.terminal import result
from cubicfish_cli.cli.view_options import ViewOptions, describe, view_options


@click.command(
    "map",
    short_help="The undistortion map alone, as cv2.remap takes it.",
    epilog=examples("cubicfish map left.npz --yaw -60 --fov 80 --size 800x600"),
)
@click.argument("output", metavar="OUT.npz", type=FILE)
@model_option
@view_options
@overwrite_option
@common_options
def command(output: Path, model: Path | None, view: ViewOptions, overwrite: bool) -> None:
    """Write where each pixel of a flat picture comes from in the photo.

    OUT.npz holds map_x and map_y (float32, -1 outside), valid, and the view as JSON text:
    cv2.remap(photo, map_x, map_y, cv2.INTER_LINEAR) renders the picture.
    """
    from cubicfish_cli.files import refuse_existing
    from cubicfish_cli.formats.camera_yaml import load_camera
    from cubicfish_cli.undistortion.maps import build_map, save_map

    if output.suffix.lower() != ".npz":
        raise click.UsageError(f"{output}: maps are written as .npz: choose a name that ends so")
    refuse_existing(output, overwrite=overwrite)
    camera = load_camera(model_path(model)).camera
    chosen = view.view_of(camera)
    save_map(output, build_map(camera, chosen), overwrite=overwrite)
    result(f"wrote {output}: {describe(chosen)}")
