"""``cubicfish simulate``: photos of known truth, through any camera."""

from __future__ import annotations

from pathlib import Path

import click

from cubicfish_cli.cli import options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.numbers import FloatRange, IntRange
from cubicfish_cli.cli.options import as_command, needed_target, option, record
from cubicfish_cli.cli.progress import listening, working
from cubicfish_cli.cli.terminal import print_json, print_wrote, result, say

# The names of rendering.simulate.FORMATS, here so that --help need not load numpy.
FORMATS = ("jpg", "png")
# And those of rendering.outside.OUTSIDE_LENSES.
LENSES = ("moving-pupil", "mirror", "equisolid", "orthographic")


@record
class Asked:
    """What is asked of ``cubicfish simulate``."""

    target: Path | None = options.target_option
    model: Path | None = options.model_option
    lens: str | None = option(
        "--lens NAME|FILE",
        "In place of --model: a lens that no camera.yaml can hold ("
        + ", ".join(LENSES)
        + "), or another tool's camera file, such as mrcal's .cameramodel or COLMAP's cameras.txt.",
    )
    size: tuple[int, int] | None = option(
        "--size",
        "Size of the photos, for --lens NAME (default 960x720) and files that do not say.",
        options.SIZE,
    )
    number: int | None = option(
        "-n --number N", "How many photos. [default: 12]", IntRange(1, 10_000)
    )
    seconds: float | None = option(
        "--film SECONDS",
        "Instead of photos a film, film.mp4, of a hand that moves the target in front of the "
        "camera (pip install 'cubicfish[video]').",
        FloatRange(0.1, 3600),
    )
    rate: float = option("--rate HZ", "With --film: frames per second.", FloatRange(1, 240), 30.0)
    shutter: float = option(
        "--shutter MS",
        "With --film: for how long each row gathers light, which blurs what moves.",
        FloatRange(0, 1000),
        8.0,
    )
    readout: float = option(
        "--readout MS",
        "With --film: how long after the first row the last one is read, which bends what moves; "
        "0 is a global shutter.",
        FloatRange(0, 1000),
        15.0,
    )
    output: Path = options.output_option(
        "Where the photos and their truth go.", default="simulated", folder=True
    )
    pose_file: Path | None = option(
        "--poses FILE",
        "Take the photos from these poses: a CSV file with the columns image,rx,ry,rz,tx,ty,tz "
        "(camera_from_world), such as the true_poses.csv of earlier photos.",
        options.FILE,
    )
    noise: float = option(
        "--noise LEVELS",
        "Standard deviation of the sensor's noise, grey levels of 255.",
        FloatRange(0, 100),
        2.0,
    )
    blur: float = option(
        "--blur PX", "Standard deviation of the lens's blur, pixels.", FloatRange(0, 50), 0.7
    )
    vignetting: float = option(
        "--vignetting SHARE",
        "Share of the light that is lost 90° from the axis.",
        FloatRange(0, 0.8),
        0.4,
    )
    exposure: float = option(
        "--exposure --light FACTOR",
        "1 is a well-lit photo, 0.2 a dark one. Above 1.15 white paper saturates and bleeds: "
        "dark squares come apart at their corners, by some 2 px at 1.5 and 5 px at 3.",
        FloatRange(0.02, 4),
        1.0,
    )
    seed: int = option(
        "--seed N",
        "Other poses and other noise; the same seed gives the same photos.",
        IntRange(0),
        0,
    )
    form: str = option(
        "--format", "Of the photos; png keeps every grey level.", click.Choice(FORMATS), "jpg"
    )
    overwrite: bool = options.overwrite_option
    as_json: bool = options.json_option("simulate")


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
    from cubicfish_cli.library.simulation import FILM, LOOK, Source, simulate_film, simulate_photos
    from cubicfish_cli.target import load_target

    _check_film(given.seconds)
    target = needed_target(given.target)
    if given.pose_file is not None and given.number is not None:
        raise click.UsageError("--poses says how many photos there are: leave -n out")
    thing = load_target(target)
    if given.lens is not None and options.is_given("model"):
        raise click.UsageError("--lens stands in the place of --model: leave one of them out")
    if given.lens is None and given.size is not None:
        raise click.UsageError("the camera says the size of its photos: --size goes with --lens")
    if given.lens is not None and given.lens not in LENSES and not Path(given.lens).exists():
        raise click.UsageError(f"--lens: {given.lens} is no file and none of {', '.join(LENSES)}")
    choosing = "Choosing where to take photos from"
    with working(choosing):
        if given.lens is not None:
            source = Source.of_lens(given.lens, given.size, thing)
        else:
            source = Source.of_file(options.model_path(given.model))
    if source.note:
        say(source.note)
    if any(board.shape is not None for board in thing.boards):
        say(f"Boards are rendered flat: bends and offsets in {target} are left out.")
    how = {name: getattr(given, name) for name in LOOK}
    if given.seconds is not None:
        with working("Choosing how the target is moved"):
            made = simulate_film(
                thing,
                source,
                given.seconds,
                rate=given.rate,
                shutter_ms=given.shutter,
                readout_ms=given.readout,
                **how,
            )
        shown, what = count(made.frames, "frame"), f"a film of {count(made.frames, 'frame')}"
        photos = given.output / FILM
    else:
        with working(choosing):
            made = simulate_photos(
                thing,
                source,
                poses=given.pose_file,
                number=given.number or 12,
                **how,
                form=given.form,
            )
        shown = what = count(made.frames, "photo")
        photos = given.output
    say(f"Rendering {shown} of {{}}x{{}} pixels.".format(*source.image_size))
    with listening() as listener:
        made.save(given.output, overwrite=given.overwrite, listener=listener)
    texts = {Path(name).stem: given.output / name for name in made.texts}
    if given.as_json:
        print_json(
            {
                "photos": [given.output / name for name in made.pictures],
                "corners": made.corners,
                "image_size": source.image_size,
                "seed": given.seed,
                **texts,
            }
        )
        return
    result(f"wrote {what} with {count(made.corners, 'corner')} to {given.output}")
    print_wrote(texts.values())
    result(f"\nNext: cubicfish calibrate {photos} --target {target}", whole=True)


def _check_film(seconds: float | None) -> None:
    """Refuse what says how a film is made without --film, and what only photos have with it."""
    if seconds is None:
        names = ("rate", "shutter", "readout")
        films = {f"--{name}": options.is_given(name) for name in names}
        options.refuse_given("is of films: give --film SECONDS too", films)
        return
    photos = {"-n": "number", "--poses": "pose_file", "--format": "form"}
    options.refuse_given(
        "is of photos: leave it out with --film",
        {name: options.is_given(parameter) for name, parameter in photos.items()},
    )
