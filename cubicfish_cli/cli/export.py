"""``cubicfish export``: the camera in another tool's format, and how near it comes."""

from __future__ import annotations

from pathlib import Path

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.options import FloatRange, as_command, option, record
from cubicfish_cli.cli.progress import call
from cubicfish_cli.cli.terminal import print_json, print_wrote, result, say
from cubicfish_cli.formats.registry import WRITABLE

# Maps are of no lens model, and so not among the registered formats.
FORMATS = {**WRITABLE, "maps": ".npz for cv2.remap; holds any lens"}

_HELP = f"""Write the camera for another tool, and say how near its lens model comes.

\b
{chr(10).join(f"{name:<35}{what}" for name, what in FORMATS.items())}

Of a rig.yaml each camera's lens is written with its place on the body: opencv as stereo.opencv.yaml
with R, T and, for flat pictures, R1, R2, P1, P2 and Q; ros as a folder of camera_info.yaml, static
transforms and URDF; Kalibr's as one camchain.yaml; COLMAP's as rig_config.json; nerfstudio's as one
transforms.json; nvidia as one rig.json; mrcal as a folder of .cameramodel. ros, Kalibr's, nvidia
and mrcal are in metres.

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


@record
class Asked:
    """What is asked of ``cubicfish export``."""

    calibration: Path | None = options.argument(
        "The folder that calibrate or rig wrote, or the camera's or the rig's file. "
        "[default: --model]",
        required=False,
        metavar="[CAMERA|RIG]",
    )
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
    max_error: float = option(
        "--max-error PX",
        "Write nothing when the format's lens is farther than this from the camera anywhere up "
        "to where the calibration's corners reach. Beyond, the error is printed alone.",
        FloatRange(min=0, min_open=True),
        0.5,
    )
    max_angle_deg: float | None = option(
        "--max-angle DEG",
        "Leave out of the conversion what is farther from the axis, so that the rest is met more "
        "nearly. [default: the whole field]",
        FloatRange(min=0, max=180, min_open=True),
    )
    pair: tuple[str, str] | None = options.pair_option
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "export",
    "The camera for OpenCV, ROS, Kalibr, COLMAP, mrcal and others.",
    "cubicfish export --to opencv",
    "cubicfish export --to kalibr-ds -o camchain.yaml --max-angle 90",
    "cubicfish export --to mrcal -m lens_a/camera.yaml",
    "cubicfish export rig/rig.yaml --to kalibr-omni -o camchain.yaml",
    "cubicfish export rig --to opencv --pair left,right",
    help=_HELP,
)
def command(given: Asked) -> None:
    """See ``_HELP``."""
    from cubicfish_cli.library.exporting import export_files

    made = call(
        export_files, given, camera=options.calibration_path(given.calibration or given.model)
    )
    if given.as_json:
        print_json(made.record)
        return
    print_wrote(made.files)
    for line in made.lines:
        result(line)
    for line in made.warnings:
        say(f"warning: {line}")
