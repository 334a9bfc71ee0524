"""``cubicfish simulate``: photos of known truth, through any camera."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cubicfish import CorrespondenceError, OutputError, Run, UsageError, did_you_mean, quoted
from cubicfish.files import StrPath
from cubicfish_cli.inputs.target_source import target_in
from cubicfish_cli.plan import Plan
from cubicfish_cli.terminal import parameters
from cubicfish_cli.terminal.parameters import FloatRange, as_command, bundle, option, record
from cubicfish_cli.terminal.progress import How
from cubicfish_cli.terminal.terminal import print_next, print_wrote, result
from cubicfish_cli.words.phrases import plural, shell_line

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from cubicfish import Calibration, CameraFile, CubicCamera, FloatArray, Target
    from cubicfish.files import Content


_MOST_PHOTOS = 10_000
_RENDERING = "Rendering"
_FORMATS = ("jpg", "png")
_QUALITY = 95
_BOUNDS: Mapping[str, tuple[float, float]] = {
    "noise": (0, 100),
    "blur": (0, 50),
    "vignetting": (0, 0.8),
    "exposure": (0.02, 4),
}


@record
class LookOptions:
    """Options of the sensor and the poses of simulated pictures.

    Attributes:
        noise: standard deviation of the sensor's noise, grey levels of 255, at most 100.
        blur: standard deviation of the lens's blur, pixels, at most 50.
        vignetting: share of the light that is lost 90° from the axis, at most 0.8.
        exposure: 1 is a well-lit picture, 0.2 a dark one; 0.02 to 4, and overexposed ones bleed.
        seed: of poses and noise.

    Raises:
        UsageError: a value is out of its bounds.

    """

    noise: float = option(
        "--noise LEVELS",
        "Standard deviation of the sensor's noise, grey levels of 255.",
        FloatRange(*_BOUNDS["noise"]),
        2.0,
    )
    blur: float = option(
        "--blur PX",
        "Standard deviation of the lens's blur, pixels.",
        FloatRange(*_BOUNDS["blur"]),
        0.7,
    )
    vignetting: float = option(
        "--vignetting SHARE",
        "Share of the light that is lost 90° from the axis.",
        FloatRange(*_BOUNDS["vignetting"]),
        0.4,
    )
    exposure: float = option(
        "--exposure FACTOR",
        "1 is a well-lit photo, 0.2 a dark one. Above 1.15 white paper saturates and bleeds: "
        "dark squares come apart at their corners, by some 2 px at 1.5 and 5 px at 3.",
        FloatRange(*_BOUNDS["exposure"]),
        1.0,
    )
    seed: int = option(
        "--seed N",
        "Other poses and other noise; the same seed gives the same photos.",
        click.IntRange(0),
        0,
    )

    def __post_init__(self) -> None:
        for name, (least, most) in _BOUNDS.items():
            value = getattr(self, name)
            if not least <= value <= most:
                raise UsageError(f"{name} must be from {least:g} to {most:g}, not {value}")


@record
class SimulateOptions:
    """Options of :func:`simulate_files`.

    Attributes:
        target: the calibration target, or its file; its boards are rendered flat.
        camera: a camera, a fit, or the file of one.
        number: of photos, where there are no ``poses``; by default 12.
        folder: the folder for photo_01.jpg and so on, true_corners.csv (pixels), true_poses.csv
            and true_camera.yaml.
        poses: a table of poses, such as an earlier true_poses.csv; lengths in the target's unit,
            rotation vectors in radians, ``camera_from_world``.
        look: of the sensor.
        form: of the photos: ``jpg`` or ``png``.

    Raises:
        UsageError: an option is not usable, or the options do not go together.

    """

    target: Target | StrPath = parameters.needed_target
    camera: Calibration | CameraFile | CubicCamera | StrPath = parameters.model_options
    number: int | None = option(
        "-n --number N", "How many photos. [default: 12]", click.IntRange(1, _MOST_PHOTOS)
    )
    folder: StrPath = parameters.output_option(
        "Where the photos and their truth go.", default="simulated", folder=True
    )
    poses: StrPath | None = option(
        "--poses FILE",
        "Take the photos from these poses: a CSV file with the columns image,rx,ry,rz,tx,ty,tz "
        "(camera_from_world), such as the true_poses.csv of earlier photos.",
        parameters.FILE,
    )
    look: LookOptions = bundle(LookOptions)
    form: str = option(
        "--format",
        "Of the photos; png keeps every grey level.",
        parameters.Choice(_FORMATS),
        _FORMATS[0],
    )

    def __post_init__(self) -> None:
        if self.poses is not None and self.number is not None:
            raise UsageError("--poses says how many photos there are: leave --number out")
        if self.number is not None and not 1 <= self.number <= _MOST_PHOTOS:
            raise UsageError(f"number must be from 1 to {_MOST_PHOTOS}, not {self.number}")
        if self.form not in _FORMATS:
            suggestion = did_you_mean(str(self.form), _FORMATS)
            raise UsageError(f"photos are not written as {quoted(self.form)}: {suggestion}")


@dataclass(frozen=True, kw_only=True)
class SimulatedFiles:
    """Result of :func:`simulate_files`.

    Attributes:
        photos: the photos.
        truth: the files beside them: ``true_corners``, ``true_poses`` and ``true_camera``.
        corners: how many corners are visible in them.
        image_size: (width, height), pixels.
        seed: the seed of poses and noise.

    """

    photos: Sequence[Path]
    truth: Mapping[str, Path]
    corners: int
    image_size: tuple[int, int]
    seed: int

    def as_record(self) -> dict[str, Any]:
        """Return plain data: what ``cubicfish simulate --json`` prints.

        Keys:
            photos: the photos' files
            corners: how many corners can be seen in them
            image_size: [width, height]
            seed: the seed
            true_corners: the file with the corners' true places
            true_poses: the file with the true poses
            true_camera: the file with the true camera

        """
        named = ("photos", "corners", "image_size", "seed")
        return {**{name: getattr(self, name) for name in named}, **self.truth}


def simulate_files(options: SimulateOptions, *, run: Run = Run()) -> SimulatedFiles:
    """Render photos of a target beside their truth, as ``cubicfish simulate`` does.

    The poses fill the camera's field. All files are written, or none.

    Raises:
        UsageError: the options do not go together.
        CameraFileError: the camera cannot be used.
        CorrespondenceError: the table cannot be used.
        TargetError: the target cannot be drawn, or there are not enough views of it.
        OutputError: no photo shows a corner, or a file exists and may not be replaced.

    """
    from cubicfish import CameraFile, CubicCamera, Event, load_camera
    from cubicfish.scene import Look, Scene
    from cubicfish_cli.extensions.simulation.poses import pose_table_text

    folder = Path(options.folder)
    truth = [folder / name for name in ("true_corners.csv", "true_poses.csv", "true_camera.yaml")]
    plan = Plan(run).reads(options.target, options.camera, options.poses)
    plan.writes(*truth)
    thing, look, listener = target_in(options.target), options.look, run.listener
    listener.progress("Choosing where to take photos from")
    made_by, known = {"command": "simulate"}, options.camera
    if isinstance(known, str | os.PathLike):
        made_by["camera"], known = str(known), load_camera(Path(known))
    camera = known if isinstance(known, CubicCamera) else known.camera
    camera, size = camera.in_units(thing.units), camera.image_size
    scene = Scene.of(thing, camera)
    if any(board.shape is not None for board in thing.boards):
        listener.tell(Event.RENDERED_FLAT)
    if options.poses is None:
        chosen = scene.choose_poses(options.number or 12, seed=look.seed)
        digits = max(2, len(str(len(chosen))))
        names = (f"photo_{i:0{digits}d}.{options.form}" for i in range(1, len(chosen) + 1))
        named = dict(zip(names, chosen, strict=True))
    else:
        named = _poses_of_table(Path(options.poses), options.form)
    corners = scene.corners_text(named)
    if corners.count("\n") <= 2:
        raise OutputError("no photo shows a corner: check the poses, the target and its units")
    plan.writes(*(folder / name for name in named), within=folder)
    about_camera = CameraFile(camera=camera, made_by=made_by).text()
    contents = (corners, pose_table_text(named), about_camera)
    texts: dict[Path, Content] = dict(zip(truth, contents, strict=True))
    pictures = plural(len(named), "photo")
    listener.tell(Event.RENDERING, pictures=pictures, width=size[0], height=size[1])
    listener.progress(_RENDERING)
    rendered = scene.photos(named, Look(**vars(look)))

    def write(done: int, path: Path) -> None:
        path.write_bytes(_photo_bytes(next(rendered)[1], path.suffix[1:]))
        listener.progress(_RENDERING, done, len(named))

    photos = {folder / name: partial(write, done) for done, name in enumerate(named, start=1)}
    plan.write({**photos, **texts})
    return SimulatedFiles(
        photos=list(photos),
        truth={path.stem: path for path in texts},
        corners=corners.count("\n") - 2,
        image_size=size,
        seed=look.seed,
    )


def _poses_of_table(path: Path, form: str) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Read the poses of a table, by the photos' file names.

    Raises:
        CorrespondenceError: a row names no file of its own, or the table cannot be used.

    """
    from cubicfish_cli.extensions.simulation.poses import load_poses

    named: dict[str, tuple[FloatArray, FloatArray]] = {}
    for name, pose in load_poses(path).items():
        own = Path(name).stem + f".{form}"
        if Path(name).name != name or own in named or own.startswith("."):
            raise CorrespondenceError(
                f"{path}: {quoted(name)} cannot be the name of a photo here: give each row a file "
                "name of its own, without folders"
            )
        named[own] = pose
    return named


def _photo_bytes(photo: npt.NDArray[np.uint8], form: str) -> bytes:
    """Encode a photo as a JPEG file of quality 95 (``jpg``) or a PNG file (``png``)."""
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY] if form == "jpg" else []
    _, data = cv2.imencode(f".{form}", photo, options)
    return data.tobytes()


@as_command(
    "simulate",
    "Render photos of a target, with the truth beside them.",
    "cubicfish simulate --target target.yaml --model calibration/camera.yaml -n 12 -o photos/",
    "cubicfish simulate -t target.yaml -m camera.yaml --noise 6 --blur 1.5 --exposure 0.3",
    "cubicfish simulate -t target.yaml -m camera.yaml --poses photos/true_poses.csv -o again/",
    do=simulate_files,
    how=("overwrite", "as_json"),
)
def command(made: SimulatedFiles, given: SimulateOptions, how: How) -> None:
    """Render photos of the target in target.yaml as a camera would take them.

    Poses are chosen so that the photos together fill the camera's field, from different sides and
    distances, each with whole boards. Beside the photos go true_corners.csv (where each corner that
    can be seen really is), true_poses.csv and true_camera.yaml: calibrate the photos, and you know
    how far the result is from the truth.
    """
    if how.print(made):
        return
    photos, corners = plural(len(made.photos), "photo"), plural(made.corners, "corner")
    result(f"wrote {photos} with {corners} to {given.folder}")
    print_wrote(made.truth.values())
    print_next(shell_line("cubicfish", "calibrate", given.folder, "--target", given.target))
