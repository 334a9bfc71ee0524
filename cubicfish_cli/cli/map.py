"""``cubicfish map``: the undistortion map alone."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.options import as_command, option
from cubicfish_cli.cli.rendering_options import MaskOptions, crop_option, mask_options
from cubicfish_cli.cli.terminal import print_json, print_wrote, result, say
from cubicfish_cli.cli.view_options import ViewOptions, say_what_is_unseen, view_options

if TYPE_CHECKING:
    from cubicfish_cli.undistortion.frames import Crop

SUFFIXES = (".npz", ".exr", ".png", ".pgm")

_HELP = """Write where each pixel of a view comes from in the photo, and the view's camera too.

\b
.npz  map_x and map_y (float32, -1 outside), valid, and the view as JSON text:
      cv2.remap(photo, map_x, map_y, cv2.INTER_LINEAR) renders the picture
.exr  STMap: x and y in R and G, 0 to 1 across the frame, 32-bit float
.png  the same as two 16-bit grey pictures, OUT_x.png and OUT_y.png
.pgm  the pair that ffmpeg's remap filter takes; the command is printed

With --pair two maps of a rig, OUT_left.npz and OUT_right.npz, after which what one camera shows in
a row the other shows in the same row. Flat pictures end before 180°; --view cylindrical and
equirectangular are then about the line between the cameras and go on all around it. OUT.stereo.yaml
has what it takes to get from disparities to points: baseline, focal length, and of flat ones P1,
P2 and Q.
"""


@as_command(
    "map",
    "The undistortion map alone: for cv2.remap, as an STMap, for ffmpeg.",
    "cubicfish map left.npz --rotate -60,0,0 --hfov 80 --size 800x600",
    "cubicfish map undistort.exr --fit outer",
    "cubicfish map redistort.exr --fit outer --redistort",
    "cubicfish map flat.pgm --size 1920x1080",
    "cubicfish map stereo.npz --pair left,right --rig rig --view equirectangular",
    help=_HELP,
)
@options.argument(
    "output",
    "Where the map goes: a name that ends in .npz, .exr, .png or .pgm.",
    metavar="OUT",
    missing="OUT is needed: 'cubicfish map undistort.npz', or a name in .exr, .png or .pgm",
)
@options.model_option
@options.rig_option
@options.pair_option
@view_options
@option(
    "--photo-size",
    "Size of the photos, when it is an exact rescale of the calibrated ones.",
    options.SIZE,
)
@crop_option
@option("--redistort", "The way back: from the view to the photo of the camera.")
@option("--fixed-point", "In .npz, map_1 and map_2 of cv2.convertMaps instead of floats.")
@option(
    "--origin",
    "Where y of an STMap (.exr, .png) is 0. [default: bottom-left, as in Nuke and Flame]",
    click.Choice(["bottom-left", "top-left"]),
    "bottom-left",
    show_default=False,
)
@mask_options
@options.overwrite_option
@options.json_option("map")
def command(
    output: Path,
    model: Path | None,
    rig: Path | None,
    pair: tuple[str, str] | None,
    view: ViewOptions,
    photo_size: tuple[int, int] | None,
    crop: Crop | None,
    redistort: bool,
    fixed_point: bool,
    origin: Any,
    mask: MaskOptions,
    overwrite: bool,
    as_json: bool,
) -> None:
    """See ``_HELP``."""
    from cubicfish_cli.files import Content, refuse_existing, write_files
    from cubicfish_cli.formats.camera_yaml import load_camera
    from cubicfish_cli.undistortion.frames import camera_for_photos
    from cubicfish_cli.undistortion.map_formats import (
        build_redistort_map,
        ffmpeg_command,
        map_writer,
    )
    from cubicfish_cli.undistortion.maps import build_map
    from cubicfish_cli.undistortion.view_files import part_name, view_files

    suffix = output.suffix.lower()
    if suffix not in SUFFIXES:
        raise click.UsageError(
            f"{output}: maps are written as {', '.join(SUFFIXES)}: choose a name that ends so"
        )
    if fixed_point and suffix != ".npz":
        raise click.UsageError("--fixed-point is for maps in .npz")
    mask.check()
    if redistort and mask.mask_limit is not None:
        raise click.UsageError(
            "--mask-limit is for the map that undistorts: leave it out, or --redistort"
        )
    writer = partial(map_writer, fixed_point=fixed_point, origin=origin)
    if rig is not None or pair is not None:
        options.refuse_given(
            "is for the map of one camera: leave it out",
            {"--redistort": redistort, "--crop": crop, "--mask-limit": mask.mask_limit},
        )
        from cubicfish_cli.cli.map_pair import write_pair

        write_pair(
            output,
            options.rig_file(rig),
            pair,
            view,
            photo_size,
            writer,
            mask=mask.mask,
            overwrite=overwrite,
            as_json=as_json,
        )
        return
    parts = {part: writer(part_name(output, part)) for part in view.parts}
    own = [path for paths, _ in parts.values() for path in paths]
    refuse_existing(*own, overwrite=overwrite)
    camera_file = options.model_path(model)
    loaded = load_camera(camera_file)
    size = photo_size or ((crop.width, crop.height) if crop else loaded.camera.image_size)
    camera = camera_for_photos(loaded.camera, size, crop)
    trusted = mask.trusted(loaded, camera_file, crop)
    masked = None if trusted is None else partial(trusted.mask, size=size)
    chosen = view.chosen(camera)
    maps = {
        part: build_redistort_map(camera, one) if redistort else build_map(camera, one)
        for part, one in chosen.views.items()
    }
    files: dict[Path, Content] = {
        path: partial(write, index, maps[part])
        for part, (paths, write) in parts.items()
        for index, path in enumerate(paths)
    }
    files |= view_files(maps, mask=mask.mask, beside=output, masked=masked)
    written = write_files(files, overwrite=overwrite)
    ffmpeg = [ffmpeg_command(*paths) for paths, _ in parts.values()] if suffix == ".pgm" else []
    if as_json:
        print_json(
            {
                "model": str(camera_file),
                "files": own,
                "extra_files": [path for path in written if path not in own],
                "image_size": size,
                "view": chosen.as_record(),
                "ffmpeg": ffmpeg,
            }
        )
        return
    result(f"wrote {written[0]}: {chosen.describe()}")
    if not redistort:
        say_what_is_unseen(chosen.seen_by(camera))
    print_wrote(written[1:])
    for line in ffmpeg:
        result(f"apply it with: {line}", whole=True)
    if ffmpeg:
        say(
            "note: ffmpeg's remap takes the nearest pixel, so edges are jagged: 'cubicfish "
            "undistort in.mp4 out.mp4' interpolates"
        )
