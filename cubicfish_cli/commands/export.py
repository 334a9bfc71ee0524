"""``cubicfish export``: the camera in another tool's format, and how near it comes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish_cli.app.extensions import written_formats
from cubicfish_cli.app.terminal import options
from cubicfish_cli.app.terminal.options import FloatRange, as_command, option, record
from cubicfish_cli.app.terminal.progress import running
from cubicfish_cli.app.terminal.terminal import print_json, print_wrote, result, say

if TYPE_CHECKING:
    from cubicfish_cli.commands.exporting import ExportedFiles

# Maps are of no lens model, and so not among the registered formats.
FORMATS = {**written_formats(), "maps": ".npz for cv2.remap; holds any lens"}

_HELP = f"""Write the camera for another tool, and say how near its lens model comes.

\b
{chr(10).join(f"{name:<35}{what}" for name, what in FORMATS.items())}

None of these formats holds a 3x20 matrix: each one's own lens is fitted to the camera over its
field, in pixels. The RMS, the largest error and the angle up to which they hold are printed,
and written into the file where it takes comments. They count up to where the calibration's
corners reach; the last degrees of the field are a guess of the camera's own, and their error is
stated apart. A camera that was imported has no corners: its whole field counts.

Most programs read OPENCV_FISHEYE, which colmap writes; colmap-rad-tan-thin-prism-fisheye needs
COLMAP 3.11 or newer.

Symmetric lens models get the frame in which the camera looks most symmetric; the turn from
camera.yaml's frame is printed, and poses that go into the file are turned along.
"""

max_error_option: Any = option(
    "--max-error PX",
    "Write nothing when the format's lens is farther than this from the camera anywhere up "
    "to where the calibration's corners reach. Beyond, the error is printed alone.",
    FloatRange(min=0, min_open=True),
    0.5,
)
max_angle_option: Any = option(
    "--max-angle DEG",
    "Leave out of the conversion what is farther from the axis, so that the rest is met more "
    "nearly. [default: the whole field]",
    FloatRange(min=0, max=180, min_open=True),
)


@record
class Asked:
    """What is asked of ``cubicfish export``."""

    calibration: Path | None = options.calibration_argument
    to: str = option(
        "--to FORMAT",
        "What to write: a name of the list above.",
        click.Choice(list(FORMATS)),
        required=True,
    )
    output: Path | None = options.output_option(
        "Where it goes. [default: the format's usual name, in the current folder]", folder=None
    )
    model: Path | None = options.model_option
    max_error: float = max_error_option
    max_angle_deg: float | None = max_angle_option
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "export",
    "The camera for OpenCV, ROS, Kalibr, COLMAP, mrcal and others.",
    "cubicfish export --to opencv",
    "cubicfish export --to kalibr-ds -o camchain.yaml --max-angle 90",
    "cubicfish export --to mrcal -m lens_a/camera.yaml",
    help=_HELP,
)
def command(given: Asked) -> None:
    """See ``_HELP``."""
    from cubicfish_cli.commands.exporting import export_files

    with running(overwrite=given.overwrite) as run:
        made = export_files(
            options.model_path(given.calibration or given.model),
            given.to,
            given.output,
            max_error=given.max_error,
            max_angle_deg=given.max_angle_deg,
            run=run,
        )
    print_exported(made, as_json=given.as_json)


def print_exported(made: ExportedFiles, *, as_json: bool) -> None:
    """Print what was written, and how near it comes."""
    if as_json:
        print_json(made.record)
        return
    print_wrote(made.files)
    for line in made.lines:
        result(line)
    for line in made.warnings:
        say(f"warning: {line}")
