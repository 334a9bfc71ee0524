"""``cubicfish simulate``: photos of known truth, through any camera."""

from __future__ import annotations

from pathlib import Path

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.options import (
    FloatRange,
    IntRange,
    as_command,
    bundle,
    needed_target,
    option,
    record,
)
from cubicfish_cli.cli.progress import call
from cubicfish_cli.cli.terminal import print_json, print_wrote, result
from cubicfish_cli.rendering.options import FORMATS, LOOKS, LookOptions

look_options = bundle(
    LookOptions,
    option(
        "--noise LEVELS",
        "Standard deviation of the sensor's noise, grey levels of 255.",
        FloatRange(*LOOKS["noise"]),
        LookOptions.noise,
    ),
    option(
        "--blur PX",
        "Standard deviation of the lens's blur, pixels.",
        FloatRange(*LOOKS["blur"]),
        LookOptions.blur,
    ),
    option(
        "--vignetting SHARE",
        "Share of the light that is lost 90° from the axis.",
        FloatRange(*LOOKS["vignetting"]),
        LookOptions.vignetting,
    ),
    option(
        "--exposure FACTOR",
        "1 is a well-lit photo, 0.2 a dark one. Above 1.15 white paper saturates and bleeds: "
        "dark squares come apart at their corners, by some 2 px at 1.5 and 5 px at 3.",
        FloatRange(*LOOKS["exposure"]),
        LookOptions.exposure,
    ),
    option(
        "--seed N",
        "Other poses and other noise; the same seed gives the same photos.",
        IntRange(0),
        LookOptions.seed,
    ),
)


@record
class Asked:
    """What is asked of ``cubicfish simulate``."""

    target: Path | None = options.target_option
    model: Path | None = options.model_option
    lens: Path | None = option(
        "--lens FILE",
        "In place of --model: another tool's camera file, such as mrcal's .cameramodel or "
        "COLMAP's cameras.txt, as it is.",
        options.FILE,
    )
    image_size: tuple[int, int] | None = option(
        "--size", "Size of the photos, where the file of --lens does not say.", options.SIZE
    )
    number: int | None = option(
        "-n --number N", "How many photos. [default: 12]", IntRange(1, 10_000)
    )
    folder: Path = options.output_option(
        "Where the photos and their truth go.", default="simulated", folder=True
    )
    poses: Path | None = option(
        "--poses FILE",
        "Take the photos from these poses: a CSV file with the columns image,rx,ry,rz,tx,ty,tz "
        "(camera_from_world), such as the true_poses.csv of earlier photos.",
        options.FILE,
    )
    look: LookOptions = look_options
    form: str | None = option(
        "--format",
        "Of the photos; png keeps every grey level. [default: jpg]",
        click.Choice(FORMATS),
    )
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option


@as_command(
    "simulate",
    "Render photos of a target through a camera, with the truth beside them.",
    "cubicfish simulate --target target.yaml --model calibration/camera.yaml -n 12 -o photos/",
    "cubicfish simulate -t target.yaml -m camera.yaml --noise 6 --blur 1.5 --exposure 0.3",
    "cubicfish simulate -t target.yaml --lens other.cameramodel --exposure 2",
    "cubicfish simulate -t target.yaml -m camera.yaml --poses photos/true_poses.csv -o again/",
)
def command(given: Asked) -> None:
    """Render photos of the target in target.yaml as a camera would take them.

    The camera is a camera.yaml, or another tool's file with --lens, which does not flatter the fit
    as a lens does that the cubic can hold. Poses are chosen so that the photos together fill its
    field, from different sides and distances, each with whole boards. Beside the photos go
    true_corners.csv (where each corner that can be seen really is), true_poses.csv and
    true_camera.yaml: calibrate the photos, and you know how far the result is from the truth.
    """
    from cubicfish_cli.library.simulation import simulate_files

    lens, target = given.lens, needed_target(given.target)
    if lens is not None and options.is_given("model"):
        raise click.UsageError("--lens stands in the place of --model: leave one of them out")
    if lens is None and given.image_size is not None:
        raise click.UsageError("the camera says the size of its photos: --size goes with --lens")
    made = call(simulate_files, given, target=target, lens=lens or options.model_path(given.model))
    if given.as_json:
        print_json(made.as_record())
        return
    photos, corners = count(len(made.photos), "photo"), count(made.corners, "corner")
    result(f"wrote {photos} with {corners} to {given.folder}")
    print_wrote(made.truth.values())
    result(f"\nNext: cubicfish calibrate {given.folder} --target {target}", whole=True)
