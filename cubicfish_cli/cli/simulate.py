"""``cubicfish simulate``: photos of known truth, through any camera."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from cubicfish_cli.cli import json_keys, options
from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.numbers import FloatRange, IntRange
from cubicfish_cli.cli.options import as_command, option
from cubicfish_cli.cli.target_choice import needed_target
from cubicfish_cli.cli.terminal import print_json, progress, result, say, working

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from cubicfish_cli.model.cubic import CubicCamera
    from cubicfish_cli.rendering.film import Shutter
    from cubicfish_cli.rendering.outside import OutsideLens
    from cubicfish_cli.rendering.pose import Pose
    from cubicfish_cli.rendering.simulate import Look
    from cubicfish_cli.rendering.views import WholeLens
    from cubicfish_cli.target import Target

# The names of rendering.simulate.FORMATS, here so that --help need not load numpy.
FORMATS = ("jpg", "png")
# And those of rendering.outside.OUTSIDE_LENSES.
LENSES = ("moving-pupil", "mirror", "equisolid", "orthographic")
FILM = "film.mp4"


@as_command(
    "simulate",
    "Render photos of a target through a camera, with the truth beside them.",
    "cubicfish simulate --target target.yaml --model calibration/camera.yaml -n 12 -o photos/",
    "cubicfish simulate -t target.yaml -m camera.yaml --noise 6 --blur 1.5 --exposure 0.3",
    "cubicfish simulate -t target.yaml --lens moving-pupil --size 1280x960 --exposure 2",
    "cubicfish simulate -t target.yaml --lens moving-pupil --film 30 --shutter 12",
    "cubicfish simulate -t target.yaml -m camera.yaml --poses photos/true_poses.csv -o again/",
)
@options.target_option
@options.model_option
@option(
    "--lens NAME|FILE",
    "In place of --model: a lens that no camera.yaml can hold ("
    + ", ".join(LENSES)
    + "), or another tool's camera file, such as mrcal's .cameramodel or COLMAP's cameras.txt.",
)
@option(
    "--size",
    "Size of the photos, for --lens NAME (default 960x720) and files that do not say.",
    options.SIZE,
)
@option("-n --number N", "How many photos. [default: 12]", IntRange(1, 10_000))
@option(
    "--film SECONDS",
    "Instead of photos a film, film.mp4, of a hand that moves the target in front of the "
    "camera (pip install 'cubicfish[video]').",
    FloatRange(0.1, 3600),
    to="seconds",
)
@option("--rate HZ", "With --film: frames a second.", FloatRange(1, 240), 30.0)
@option(
    "--shutter MS",
    "With --film: for how long each row gathers light, which blurs what moves.",
    FloatRange(0, 1000),
    8.0,
)
@option(
    "--readout MS",
    "With --film: how long after the first row the last one is read, which bends what moves; "
    "0 is a global shutter.",
    FloatRange(0, 1000),
    15.0,
)
@options.output_option("Where the photos and their truth go.", default="simulated", folder=True)
@option(
    "--poses FILE",
    "Take the photos from these poses: a CSV file with the columns image,rx,ry,rz,tx,ty,tz "
    "(camera_from_world), such as the true_poses.csv of earlier photos.",
    options.FILE,
    to="pose_file",
)
@option(
    "--noise LEVELS",
    "Standard deviation of the sensor's noise, grey levels of 255.",
    FloatRange(0, 100),
    2.0,
)
@option("--blur PX", "Standard deviation of the lens's blur, pixels.", FloatRange(0, 50), 0.7)
@option(
    "--vignetting SHARE",
    "Share of the light that is lost 90° from the axis.",
    FloatRange(0, 0.8),
    0.4,
)
@option(
    "--exposure --light FACTOR",
    "1 is a well-lit photo, 0.2 a dark one. Above 1.15 white paper saturates and bleeds: "
    "dark squares come apart at their corners, by some 2 px at 1.5 and 5 px at 3.",
    FloatRange(0.02, 4),
    1.0,
    to="exposure",
)
@option(
    "--seed N", "Other poses and other noise; the same seed gives the same photos.", IntRange(0), 0
)
@option(
    "--format",
    "Of the photos; png keeps every grey level.",
    click.Choice(FORMATS),
    "jpg",
    to="form",
)
@options.overwrite_option
@options.json_option(json_keys.SIMULATE)
def command(
    target: Path | None,
    model: Path | None,
    lens: str | None,
    size: tuple[int, int] | None,
    number: int | None,
    seconds: float | None,
    rate: float,
    shutter: float,
    readout: float,
    output: Path,
    pose_file: Path | None,
    noise: float,
    blur: float,
    vignetting: float,
    exposure: float,
    seed: int,
    form: str,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Render photos of the target in target.yaml as a camera would take them.

    The camera is a camera.yaml, or a lens given by its formula as in sample_data/true_camera.yaml.
    A lens that the cubic can hold flatters the fit: --lens takes others.
    Poses are chosen so that the photos together fill its field, from different sides and
    distances, each with whole boards. Beside the photos go true_corners.csv (where each corner
    that can be seen really is), true_poses.csv and true_camera.yaml: calibrate the photos, and you
    know how far the result is from the truth. Of a film each frame has its truth, under the name
    that 'cubicfish frames' gives it: where each corner was when its own row was exposed.
    """
    from cubicfish_cli.errors import OutputError
    from cubicfish_cli.files import whole_files
    from cubicfish_cli.rendering.pose_table import pose_table_text
    from cubicfish_cli.rendering.simulate import Look, photo_bytes, simulated_photos
    from cubicfish_cli.rendering.truth import true_corners_text
    from cubicfish_cli.target import load_target

    _check_film(seconds)
    target = needed_target(target)
    if pose_file is not None and number is not None:
        raise click.UsageError("--poses says how many photos there are: leave -n out")
    thing = load_target(target)
    given = click.get_current_context().get_parameter_source("model")
    if lens is not None and given is ParameterSource.COMMANDLINE:
        raise click.UsageError("--lens stands in the place of --model: leave one of them out")
    if lens is None and size is not None:
        raise click.UsageError("the camera says the size of its photos: --size goes with --lens")
    with working("Choosing where to take photos from"):
        source = _chosen_lens(lens, size, thing) if lens else _lens(options.model_path(model))
        true, image_size = source.lens, source.image_size
    look = Look(noise=noise, blur=blur, vignetting=vignetting, exposure=exposure)
    if any(board.shape is not None for board in thing.boards):
        say(f"Boards are rendered flat: bends and offsets in {target} are left out.")
    flat = thing.with_flat_boards()
    if seconds is not None:
        from cubicfish_cli.rendering.film import Shutter

        times = Shutter(rate=rate, open_s=shutter / 1000, readout_s=readout / 1000)
        paths, texts = _film(flat, source, seconds, times, look, seed, output, overwrite=overwrite)
        frames = max(1, round(seconds * rate))
        _say_written(f"a film of {count(frames, 'frame')}", [FILM], paths, texts, output, target,
                     image_size, seed, as_json=as_json)  # fmt: skip
        return
    with working("Choosing where to take photos from"):
        poses = _poses(thing, true, image_size, pose_file, number or 12, seed, form)
    corners = true_corners_text(flat, true, poses, image_size)
    if corners.count("\n") <= 2:
        raise OutputError("no photo shows a corner: check the poses, the target and its units")
    texts = {
        "true_corners.csv": corners,
        "true_poses.csv": pose_table_text(poses),
        "true_camera.yaml": source.text(flat, poses),
    }
    paths = {name: output / name for name in (*poses, *texts)}
    say(f"Rendering {count(len(poses), 'photo')} of {image_size[0]}x{image_size[1]} pixels.")
    with (
        whole_files(list(paths.values()), overwrite=overwrite) as temporary,
        progress("Rendering") as callback,
    ):
        places = dict(zip(paths, temporary, strict=True))
        photos = simulated_photos(flat, true, image_size, poses, look, seed=seed)
        for done, (name, photo) in enumerate(photos, start=1):
            places[name].write_bytes(photo_bytes(photo, form))
            callback(done, len(poses))
        for name, text in texts.items():
            places[name].write_text(text, encoding="utf-8", newline="\n")
    _say_written(count(len(poses), "photo"), list(poses), paths, texts, output, target, image_size,
                 seed, as_json=as_json)  # fmt: skip


def _check_film(seconds: float | None) -> None:
    """Refuse what says how a film is made without --film, and what only photos have with it."""
    context = click.get_current_context()

    def given(name: str) -> bool:
        return context.get_parameter_source(name) is ParameterSource.COMMANDLINE

    if seconds is None:
        for name in ("rate", "shutter", "readout"):
            if given(name):
                raise click.UsageError(f"--{name} is of films: give --film SECONDS too")
        return
    for name, shown in (("number", "-n"), ("pose_file", "--poses"), ("form", "--format")):
        if given(name):
            raise click.UsageError(f"{shown} is of photos: leave it out with --film")


def _film(
    target: Target,
    source: _Source,
    seconds: float,
    shutter: Shutter,
    look: Look,
    seed: int,
    output: Path,
    *,
    overwrite: bool,
) -> tuple[dict[str, Path], dict[str, str]]:
    """Render a film and write it with its truth: files by name, and the texts among them."""
    from cubicfish_cli.errors import OutputError
    from cubicfish_cli.files import whole_files
    from cubicfish_cli.films.source import library
    from cubicfish_cli.films.write import refuse_odd, write_film
    from cubicfish_cli.frame_names import frame_name
    from cubicfish_cli.rendering.film import film_frames, film_truth, hand_path
    from cubicfish_cli.rendering.pose_table import pose_table_text

    size = source.image_size
    library()  # said before the work if it is not there
    refuse_odd(size)
    frames = max(1, round(seconds * shutter.rate))
    names = [f"{frame_name(Path(FILM).stem, one / shutter.rate)}.png" for one in range(frames)]
    with working("Choosing how the target is moved"):
        path = hand_path(target, source.lens, size, seconds, seed=seed)
        poses, corners = film_truth(target, source.lens, size, path, shutter, names)
    if corners.count("\n") <= 2:
        raise OutputError("no frame shows a corner: check the target and its units")
    texts = {
        "true_corners.csv": corners,
        "true_poses.csv": pose_table_text(poses),
        "true_camera.yaml": source.text(target, poses),
    }
    paths = {name: output / name for name in (FILM, *texts)}
    say(f"Rendering {count(frames, 'frame')} of {size[0]}x{size[1]} pixels.")
    with (
        whole_files(list(paths.values()), overwrite=overwrite) as temporary,
        progress("Rendering") as callback,
    ):
        places = dict(zip(paths, temporary, strict=True))

        def rendered() -> Iterator[npt.NDArray[np.uint8]]:
            pictures = film_frames(
                target, source.lens, size, path, shutter, frames, look, seed=seed
            )
            for done, picture in enumerate(pictures, start=1):
                yield picture
                callback(done, frames)

        write_film(places[FILM], rendered(), size, shutter.rate)
        for name, text in texts.items():
            places[name].write_text(text, encoding="utf-8", newline="\n")
    return paths, texts


def _say_written(
    what: str,
    pictures: Sequence[str],
    paths: Mapping[str, Path],
    texts: Mapping[str, str],
    output: Path,
    target: Path,
    image_size: tuple[int, int],
    seed: int,
    *,
    as_json: bool,
) -> None:
    seen = texts["true_corners.csv"].count("\n") - 2
    if as_json:
        print_json(
            {
                "photos": [str(paths[name]) for name in pictures],
                "corners": seen,
                "image_size": image_size,
                "seed": seed,
                **{Path(name).stem: str(paths[name]) for name in texts},
            }
        )
        return
    result(f"wrote {what} with {count(seen, 'corner')} to {output}")
    for name in texts:
        result(f"wrote {paths[name]}")
    given = paths[FILM] if FILM in pictures else output
    result(f"\nNext: cubicfish calibrate {given} --target {target}", whole=True)


@dataclass(frozen=True, kw_only=True)
class _Source:
    """What photos are taken with.

    Attributes:
        lens: the true lens.
        image_size: (width, height) of the photos.
        text: target and poses -> what true_camera.yaml holds.

    """

    lens: WholeLens
    image_size: tuple[int, int]
    text: Callable[[Target, Mapping[str, Pose]], str]


def _lens(path: Path) -> _Source:
    """The lens of a file."""
    from cubicfish_cli.formats.camera_yaml import load_camera
    from cubicfish_cli.rendering.lens_file import is_lens_file, lens_text, load_lens
    from cubicfish_cli.rendering.outside import RaysAtDistance

    if is_lens_file(path):
        true = load_lens(path)
        if isinstance(true, RaysAtDistance):
            return _outside(true.lens)
        return _Source(lens=true, image_size=true.image_size, text=lambda *_: lens_text(true))
    camera = load_camera(path).camera
    return _Source(
        lens=camera,
        image_size=camera.image_size,
        text=lambda *_: _camera_text(camera, {"camera": str(path)}),
    )


def _chosen_lens(name: str, size: tuple[int, int] | None, target: Target) -> _Source:
    """The lens that --lens names."""
    from cubicfish_cli.fitting.conversion.exact_lens import ExactLens
    from cubicfish_cli.formats.foreign import read_foreign
    from cubicfish_cli.rendering.outside import outside_lens

    if name in LENSES:
        return _outside(outside_lens(name, size or (960, 720), units=target.units))
    path = Path(name)
    if not path.exists():
        raise click.UsageError(f"--lens: {name} is no file and none of {', '.join(LENSES)}")
    record, found = read_foreign(path, image_size=size)
    exact = ExactLens.of(record)
    say(
        f"true_camera.yaml will be the cubic camera nearest to the lens of {found}, "
        f"{exact.nearest.error.rms_px:.4f} px from it (RMS); photos and corners are the lens's own."
    )
    made_from = {"imported_from": found, "lens": record.model}
    return _Source(
        lens=exact,
        image_size=record.image_size,
        text=lambda *_: _camera_text(exact.nearest.camera, made_from),
    )


def _outside(lens: OutsideLens) -> _Source:
    """A lens that is perhaps not central: true_camera.yaml says as which lens of rays."""
    from cubicfish_cli.rendering.lens_file import lens_text
    from cubicfish_cli.rendering.truth import visible_points

    return _Source(
        lens=lens,
        image_size=lens.image_size,
        text=lambda target, poses: lens_text(
            lens.seen_from(visible_points(target, lens, poses, lens.image_size))
        ),
    )


def _camera_text(camera: CubicCamera, made_by: Mapping[str, object]) -> str:
    from cubicfish_cli.formats.camera_writer import camera_text

    return camera_text(camera, fit={}, made_by={"command": "simulate", **made_by})


def _poses(
    target: Target,
    lens: WholeLens,
    image_size: tuple[int, int],
    file: Path | None,
    number: int,
    seed: int,
    form: str,
) -> dict[str, Pose]:
    """Poses by the photos' file names."""
    from cubicfish_cli.errors import CorrespondenceError
    from cubicfish_cli.rendering.pose_table import load_poses
    from cubicfish_cli.rendering.simulate import chosen_poses
    from cubicfish_cli.wording import quoted

    if file is None:
        digits = len(str(number)) if number > 9 else 2
        poses = chosen_poses(target, lens, image_size, number, seed=seed)
        return {f"photo_{i:0{digits}d}.{form}": pose for i, pose in enumerate(poses, start=1)}
    named: dict[str, Pose] = {}
    for name, pose in load_poses(file).items():
        own = Path(name).stem + f".{form}"
        if Path(name).name != name or own in named or own.startswith("."):
            raise CorrespondenceError(
                f"{file}: {quoted(name)} cannot be the name of a photo here: give each row a file "
                "name of its own, without folders"
            )
        named[own] = pose
    return named
