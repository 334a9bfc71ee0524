"""``cubicfish project``: points in the camera frame to pixels."""

from __future__ import annotations

from pathlib import Path

from cubicfish_cli.cli import options
from cubicfish_cli.cli.options import as_command
from cubicfish_cli.cli.points import PointsCommand, print_points, read_points


@as_command(
    "project",
    "Points in the camera frame to pixels.",
    "cubicfish project 0.2,0.1,1",
    "cubicfish project points.csv --model lens_a/",
    "echo 0.5,0,1 | cubicfish project",
    cls=PointsCommand,
)
@options.argument(
    "points",
    "A CSV file of points X,Y,Z, or one point such as 0.2,0.1,1. [default: stdin]",
    default=Path("-"),
)
@options.model_option
def command(points: Path, model: Path | None) -> None:
    """Project POINTS to pixels: X,Y,Z a line (a CSV file or stdin) in, x,y a line out. One
    point may stand on the command line: 0.2,0.1,1.

    Points are in the camera's frame: X to the right, Y down, Z forward, any unit. Pixel (0, 0)
    is the middle of the top-left pixel. Points outside the camera's valid field give nan,nan.
    A header in gives a header out. With a camera of lift 'point' the points are in its own frame
    (world or camera) and unit, and a point off the boards is refused where they did not
    determine the camera.
    """
    from cubicfish_cli.formats.camera_yaml import PointCameraFile, load_any_camera

    loaded = load_any_camera(options.model_path(model))
    read = read_points(points, ("X", "Y", "Z"))
    if isinstance(loaded, PointCameraFile):
        loaded.camera.refuse_off_boards(read.values)
    print_points(loaded.camera.project(read.values), ("x", "y") if read.has_header else None)
