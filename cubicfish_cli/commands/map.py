"""``cubicfish map``: the undistortion map alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubicfish_cli.app.asked import Run
from cubicfish_cli.app.asked_pictures import MapOptions
from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.options import as_command, bundle, option, record
from cubicfish_cli.app.terminal.terminal import print_json, print_wrote, result, say
from cubicfish_cli.commands.view_options import say_what_is_unseen, view_options

if TYPE_CHECKING:
    from cubicfish_cli.commands.map_files import MapFiles

_HELP = """Write where each pixel of a view comes from in the photo, and the view's camera too.

\b
.npz  map_x and map_y (float32, -1 outside), valid, and the view as JSON text:
      cv2.remap(photo, map_x, map_y, cv2.INTER_LINEAR) renders the picture
.exr  STMap: x and y (upwards) in R and G, 0 to 1 across the frame, 32 bits
.png  the same as two 16-bit grey pictures, OUT_x.png and OUT_y.png
.pgm  the pair that ffmpeg's remap filter takes; the command is printed
"""

photo_size_option: Any = option(
    "--photo-size",
    "Size of the photos, when it is an exact rescale of the calibrated ones.",
    options.SIZE,
)
map_options: Any = bundle(
    MapOptions,
    view_options,
    photo_size_option,
    option("--redistort", "The way back: from the view to the photo of the camera."),
)


@record
class Asked:
    """What is asked of ``cubicfish map``."""

    output: Path = options.argument(
        "Where the map goes: a name that ends in .npz, .exr, .png or .pgm.",
        metavar="OUT",
        missing="OUT is needed: 'cubicfish map undistort.npz', or a name in .exr, .png or .pgm",
    )
    model: Path | None = options.model_option
    asked: MapOptions = map_options
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "map",
    "The undistortion map alone: for cv2.remap, as an STMap, for ffmpeg.",
    "cubicfish map left.npz --rotate -60,0,0 --hfov 80 --size 800x600",
    "cubicfish map undistort.exr --fit outer",
    "cubicfish map redistort.exr --fit outer --redistort",
    "cubicfish map flat.pgm --size 1920x1080",
    help=_HELP,
)
def command(given: Asked) -> None:
    """See ``_HELP``."""
    from cubicfish_cli.commands.map_files import map_files

    camera = options.model_path(given.model)
    made = map_files(camera, given.output, given.asked, run=Run(overwrite=given.overwrite))
    print_maps(made, as_json=given.as_json)


def print_maps(made: MapFiles, *, as_json: bool, more: str = "") -> None:
    """Print what was written and what it shows, and ``more`` of it in a line."""
    if as_json:
        print_json(made.as_record())
        return
    result(f"wrote {made.written[0]}: {made.view.describe()}")
    say_what_is_unseen(made.seen)
    print_wrote(made.written[1:])
    if more:
        result(more)
    for line in made.ffmpeg:
        result(f"apply it with: {line}", whole=True)
    if made.ffmpeg:
        say(
            "note: ffmpeg's remap takes the nearest pixel, so edges are jagged: 'cubicfish "
            "undistort in.mp4 out.mp4' interpolates"
        )
