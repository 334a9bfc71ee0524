"""``cubicfish map``: the undistortion map alone."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.options import as_command, option, record
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


@record
class Asked:
    """What is asked of ``cubicfish map``."""

    output: Path = options.argument(
        "Where the map goes: a name that ends in .npz, .exr, .png or .pgm.",
        metavar="OUT",
        missing="OUT is needed: 'cubicfish map undistort.npz', or a name in .exr, .png or .pgm",
    )
    model: Path | None = options.model_option
    rig: Path | None = options.rig_option
    pair: tuple[str, str] | None = options.pair_option
    view: ViewOptions = view_options
    photo_size: tuple[int, int] | None = option(
        "--photo-size",
        "Size of the photos, when it is an exact rescale of the calibrated ones.",
        options.SIZE,
    )
    crop: Crop | None = crop_option
    redistort: bool = option(
        "--redistort", "The way back: from the view to the photo of the camera."
    )
    fixed_point: bool = option(
        "--fixed-point", "In .npz, map_1 and map_2 of cv2.convertMaps instead of floats."
    )
    origin: Any = option(
        "--origin",
        "Where y of an STMap (.exr, .png) is 0. [default: bottom-left, as in Nuke and Flame]",
        click.Choice(["bottom-left", "top-left"]),
        "bottom-left",
        show_default=False,
    )
    mask: MaskOptions = mask_options
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option("map")


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
def command(given: Asked) -> None:
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

    suffix = given.output.suffix.lower()
    if suffix not in SUFFIXES:
        raise click.UsageError(
            f"{given.output}: maps are written as {', '.join(SUFFIXES)}: choose a name that ends so"
        )
    if given.fixed_point and suffix != ".npz":
        raise click.UsageError("--fixed-point is for maps in .npz")
    given.mask.check()
    if given.redistort and given.mask.mask_limit is not None:
        raise click.UsageError(
            "--mask-limit is for the map that undistorts: leave it out, or --redistort"
        )
    writer = partial(map_writer, fixed_point=given.fixed_point, origin=given.origin)
    if given.rig is not None or given.pair is not None:
        options.refuse_given(
            "is for the map of one camera: leave it out",
            {
                "--redistort": given.redistort,
                "--crop": given.crop,
                "--mask-limit": given.mask.mask_limit,
            },
        )
        from cubicfish_cli.cli.map_pair import write_pair

        write_pair(
            given.output,
            options.rig_file(given.rig),
            given.pair,
            given.view,
            given.photo_size,
            writer,
            mask=given.mask.mask,
            overwrite=given.overwrite,
            as_json=given.as_json,
        )
        return
    parts = {part: writer(part_name(given.output, part)) for part in given.view.parts}
    own = [path for paths, _ in parts.values() for path in paths]
    refuse_existing(*own, overwrite=given.overwrite)
    camera_file = options.model_path(given.model)
    loaded = load_camera(camera_file)
    size = given.photo_size or (
        (given.crop.width, given.crop.height) if given.crop else loaded.camera.image_size
    )
    camera = camera_for_photos(loaded.camera, size, given.crop)
    trusted = given.mask.trusted(loaded, camera_file, given.crop)
    masked = None if trusted is None else partial(trusted.mask, size=size)
    chosen = given.view.chosen(camera)
    maps = {
        part: build_redistort_map(camera, one) if given.redistort else build_map(camera, one)
        for part, one in chosen.views.items()
    }
    files: dict[Path, Content] = {
        path: partial(write, index, maps[part])
        for part, (paths, write) in parts.items()
        for index, path in enumerate(paths)
    }
    files |= view_files(maps, mask=given.mask.mask, beside=given.output, masked=masked)
    written = write_files(files, overwrite=given.overwrite)
    ffmpeg = [ffmpeg_command(*paths) for paths, _ in parts.values()] if suffix == ".pgm" else []
    if given.as_json:
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
    if not given.redistort:
        say_what_is_unseen(chosen.seen_by(camera))
    print_wrote(written[1:])
    for line in ffmpeg:
        result(f"apply it with: {line}", whole=True)
    if ffmpeg:
        say(
            "note: ffmpeg's remap takes the nearest pixel, so edges are jagged: 'cubicfish "
            "undistort in.mp4 out.mp4' interpolates"
        )
