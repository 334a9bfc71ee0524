"""``cubicfish undistort``: photos to pictures in which straight lines are straight."""

from __future__ import annotations

from pathlib import Path

import click

from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import (
    FILE,
    common_options,
    examples,
    model_option,
    model_path,
    overwrite_option,
)
from cubicfish_cli.cli.terminal import progress, result
from cubicfish_cli.cli.view_options import ViewOptions, describe, view_options


@click.command(
    "undistort",
    short_help="Photos to pictures in which straight lines are straight.",
    epilog=examples(
        "cubicfish undistort photo.png flat.png",
        "cubicfish undistort photos/ flat/ --fov 90 --size 1920x1080",
        "cubicfish undistort photo.png left.png --yaw -60 --fov 80",
    ),
)
@click.argument("source", metavar="IN", type=FILE)
@click.argument("destination", metavar="OUT", type=FILE)
@model_option
@view_options
@overwrite_option
@common_options
def command(
    source: Path, destination: Path, model: Path | None, view: ViewOptions, overwrite: bool
) -> None:
    """Render a flat (perspective) picture OUT of the photo IN.

    With a folder or a quoted glob as IN, OUT is a folder and the pictures keep their names.
    Pixels that the camera does not see are black.
    """
    from cubicfish_cli.files import refuse_existing
    from cubicfish_cli.formats.camera_yaml import load_camera
    from cubicfish_cli.photos import find_photos
    from cubicfish_cli.undistortion.images import check_suffix, undistort_picture_file
    from cubicfish_cli.undistortion.maps import build_map

    photos = find_photos([source])
    one = len(photos) == 1 and photos[0].path == source
    if one and destination.is_dir():
        raise click.UsageError(f"OUT is a folder: name a file, such as {destination / 'flat.png'}")
    outputs = [destination if one else destination / photo.name for photo in photos]
    for output in outputs:
        check_suffix(output)
        refuse_existing(output, overwrite=overwrite)
    camera = load_camera(model_path(model)).camera
    chosen = view.view_of(camera)
    undistort_map = build_map(camera, chosen)
    with progress("Undistorting") as callback:
        for done, (photo, output) in enumerate(zip(photos, outputs, strict=True)):
            callback(done, len(photos))
            undistort_picture_file(photo.path, output, undistort_map, overwrite=overwrite)
    wrote = str(destination) if one else f"{count(len(photos), 'picture')} to {destination}"
    result(f"wrote {wrote}: {describe(chosen)}")
