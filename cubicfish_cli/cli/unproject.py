"""``cubicfish unproject``: pixels to viewing rays."""

from __future__ import annotations

from pathlib import Path

from cubicfish_cli.cli import options
from cubicfish_cli.cli.options import as_command
from cubicfish_cli.cli.points import PointsCommand, print_points, read_points


@as_command(
    "unproject",
    "Pixels to unit viewing rays in the camera frame.",
    "cubicfish unproject 640,400",
    "echo 640,400 | cubicfish unproject --model lens_a/",
    cls=PointsCommand,
)
@options.argument(
    "pixels",
    "A CSV file of pixels x,y, or one pixel such as 640,400. [default: stdin]",
    default=Path("-"),
)
@options.model_option
def command(pixels: Path, model: Path | None) -> None:
    """Turn PIXELS into viewing rays: x,y a line (a CSV file or stdin) in, X,Y,Z a line out.
    One pixel may stand on the command line: 640,400.

    Rays are unit vectors in the camera's frame: X to the right, Y down, Z forward; Z is
    negative for rays more than 90 degrees off the axis. Pixels outside the camera's valid
    field give nan,nan,nan. A header in gives a header out.
    """
    from cubicfish_cli.formats.camera_yaml import load_camera

    camera = load_camera(options.model_path(model)).camera
    read = read_points(pixels, ("x", "y"))
    print_points(camera.unproject(read.values), ("X", "Y", "Z") if read.has_header else None)
