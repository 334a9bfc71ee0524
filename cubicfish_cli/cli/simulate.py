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
from cubicfish_cli.rendering.options import (
    FILMS,
    FORMATS,
    LOOKS,
    OUTSIDE_LENSES,
    FilmOptions,
    LookOptions,
)


def _film(seconds: float | None, rate: float, shutter: float, readout: float) -> FilmOptions | None:
    """What is asked of a film; None where none is."""
    if seconds is not None:
        return FilmOptions(seconds=seconds, rate=rate, shutter_ms=shutter, readout_ms=readout)
    names = ("rate", "shutter", "readout")
    films = {f"--{name}": options.is_given(name) for name in names}
    options.refuse_given("is of films: give --film SECONDS too", films)
    return None


film_options = bundle(
    _film,
    option(
        "--film SECONDS",
        "Instead of photos a film, film.mp4, of a hand that moves the target in front of the "
        "camera (pip install 'cubicfish[video]').",
        FloatRange(*FILMS["seconds"]),
    ),
    option(
        "--rate HZ",
        "With --film: frames per second.",
        FloatRange(*FILMS["rate"]),
        FilmOptions.rate,
    ),
    option(
        "--shutter MS",
        "With --film: for how long each row gathers light, which blurs what moves.",
        FloatRange(*FILMS["shutter_ms"]),
        FilmOptions.shutter_ms,
    ),
    option(
        "--readout MS",
        "With --film: how long after the first row the last one is read, which bends what moves; "
        "0 is a global shutter.",
        FloatRange(*FILMS["readout_ms"]),
        FilmOptions.readout_ms,
    ),
)

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
        "--exposure --light FACTOR",
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
    lens: str | None = option(
        "--lens NAME|FILE",
        "In place of --model: a lens that no camera.yaml can hold ("
        + ", ".join(OUTSIDE_LENSES)
        + "), or another tool's camera file, such as mrcal's .cameramodel or COLMAP's cameras.txt.",
    )
    image_size: tuple[int, int] | None = option(
        "--size",
        "Size of the photos, for --lens NAME (default 960x720) and files that do not say.",
        options.SIZE,
    )
    number: int | None = option(
        "-n --number N", "How many photos. [default: 12]", IntRange(1, 10_000)
    )
    film: FilmOptions | None = film_options
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
    "cubicfish simulate -t target.yaml --lens moving-pupil --size 1280x960 --exposure 2",
    "cubicfish simulate -t target.yaml --lens moving-pupil --film 30 --shutter 12",
    "cubicfish simulate -t target.yaml -m camera.yaml --poses photos/true_poses.csv -o again/",
)
def command(given: Asked) -> None:
    """Render photos of the target in target.yaml as a camera would take them.

    The camera is a camera.yaml, or a lens given by its formula as in sample_data/true_camera.yaml.
    A lens that the cubic can hold flatters the fit: --lens takes others.
    Poses are chosen so that the photos together fill its field, from different sides and
    distances, each with whole boards. Beside the photos go true_corners.csv (where each corner
    that can be seen really is), true_poses.csv and true_camera.yaml: calibrate the photos, and you
    know how far the result is from the truth. Of a film each frame has its truth, under the name
    that 'cubicfish frames' gives it: where each corner was when its own row was exposed.
    """
    from cubicfish_cli.library.simulation import simulate_files

    lens, target, film = given.lens, needed_target(given.target), given.film
    if lens is not None and options.is_given("model"):
        raise click.UsageError("--lens stands in the place of --model: leave one of them out")
    if lens is None and given.image_size is not None:
        raise click.UsageError("the camera says the size of its photos: --size goes with --lens")
    if lens is not None and lens not in OUTSIDE_LENSES and not Path(lens).exists():
        raise click.UsageError(f"--lens: {lens} is no file and none of {', '.join(OUTSIDE_LENSES)}")
    made = call(simulate_files, given, target=target, lens=lens or options.model_path(given.model))
    if given.as_json:
        print_json(made.as_record())
        return
    what = count(made.frames, "photo" if film is None else "frame")
    what = f"{'a film of ' * (film is not None)}{what} with {count(made.corners, 'corner')}"
    result(f"wrote {what} to {given.folder}")
    print_wrote(made.truth.values())
    photos = given.folder if film is None else made.photos[0]
    result(f"\nNext: cubicfish calibrate {photos} --target {target}", whole=True)
