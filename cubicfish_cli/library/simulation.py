"""Photos and films of known truth, with that truth beside them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from cubicfish_cli.arrays import Refusal
from cubicfish_cli.errors import CameraFileError, CorrespondenceError, OutputError
from cubicfish_cli.files import Content, write_files
from cubicfish_cli.formats.calibrated import Calibrated, camera_text
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.frame_names import frame_name
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.listener import SILENT, Count, Listener
from cubicfish_cli.observations import MAX_SIDE
from cubicfish_cli.rendering.lens_file import is_lens_file, lens_text, load_lens
from cubicfish_cli.rendering.outside import (
    OUTSIDE_LENSES,
    OutsideLens,
    RaysAtDistance,
    outside_lens,
)
from cubicfish_cli.rendering.pose import Pose, load_poses, pose_table_text
from cubicfish_cli.rendering.simulate import (
    FORMATS,
    Look,
    chosen_poses,
    photo_bytes,
    simulated_photos,
)
from cubicfish_cli.rendering.truth import true_corners_text, visible_points
from cubicfish_cli.rendering.views import WholeLens
from cubicfish_cli.target import Target
from cubicfish_cli.wording import did_you_mean, quoted

FILM = "film.mp4"
_SIZE = (960, 720)
_MOST_PHOTOS = 10_000
_LOOK = {"noise": 2.0, "blur": 0.7, "vignetting": 0.4, "exposure": 1.0, "seed": 0}
LOOK = tuple(_LOOK)
_BOUNDS = {"noise": (0, 100), "blur": (0, 50), "vignetting": (0, 0.8), "exposure": (0.02, 4)}
_MOST_SECONDS = 3600.0

StrPath = str | os.PathLike[str]


class LookOptions(TypedDict, total=False):
    """How simulated pictures look.

    Attributes:
        noise: standard deviation of the sensor's noise, grey levels of 255, at most 100; 2.
        blur: standard deviation of the lens's blur, pixels, at most 50; 0.7.
        vignetting: share of the light that is lost 90° from the axis, at most 0.8; 0.4.
        exposure: 1 is a well-lit picture, 0.2 a dark one; 0.02 to 4, and overexposed ones bleed.
        seed: another one gives other poses, other motion and other noise, the same one the same.

    """

    noise: float
    blur: float
    vignetting: float
    exposure: float
    seed: int


@dataclass(frozen=True, kw_only=True)
class Source:
    """What photos are taken with.

    Attributes:
        lens: the true lens.
        image_size: (width, height) of the photos.
        text: target and poses -> what true_camera.yaml holds.
        note: what is to be known of that file; None for nothing.

    """

    lens: WholeLens
    image_size: tuple[int, int]
    text: Callable[[Target, Mapping[str, Pose]], str]
    note: str | None = None

    @classmethod
    def of(
        cls,
        lens: Source | Calibrated | CubicCamera | StrPath,
        image_size: Sequence[int] | None,
        target: Target,
    ) -> Source:
        """What a caller names: a camera, a lens or a file of one; see :func:`simulate_photos`.

        Raises:
            CameraFileError: it cannot be used, or is for photos of another size.

        """
        size = None
        if image_size is not None:
            refusal = Refusal(error=CameraFileError)
            size = refusal.size(image_size, "image_size", limit=MAX_SIDE)
        if isinstance(lens, Source):
            source = lens
        elif isinstance(lens, Calibrated | CubicCamera):
            camera = lens.camera if isinstance(lens, Calibrated) else lens
            text = _camera_text(camera, {})
            source = cls(lens=camera, image_size=camera.image_size, text=lambda *_: text)
        elif os.fspath(lens) in OUTSIDE_LENSES or _is_of_another_tool(Path(lens)):
            source = cls.of_lens(os.fspath(lens), size, target)
        else:
            source = cls.of_file(Path(lens))
        if size not in (None, source.image_size):
            raise CameraFileError(
                "the lens is for photos of {}x{} pixels: leave image_size out".format(
                    *source.image_size
                )
            )
        return source

    @classmethod
    def of_file(cls, path: Path) -> Source:
        """The lens of a camera.yaml, or of a file of a lens's formula.

        Raises:
            CameraFileError: it cannot be used.

        """
        if is_lens_file(path):
            true = load_lens(path)
            if isinstance(true, RaysAtDistance):
                return cls._outside(true.lens)
            return cls(lens=true, image_size=true.image_size, text=lambda *_: lens_text(true))
        camera = load_camera(path).camera
        text = _camera_text(camera, {"camera": str(path)})
        return cls(lens=camera, image_size=camera.image_size, text=lambda *_: text)

    @classmethod
    def of_lens(cls, name: str, size: tuple[int, int] | None, target: Target) -> Source:
        """A lens that no camera.yaml can hold, or that of another tool's file.

        Args:
            name: of the lens, or of the file.
            size: (width, height) of photos, where that is not told.
            target: whose unit is the lens's.

        Raises:
            CameraFileError: the file cannot be used.

        """
        if name in OUTSIDE_LENSES:
            return cls._outside(outside_lens(name, size or _SIZE, units=target.units))
        # Loaded late: they take as long as a photo.
        from cubicfish_cli.fitting.conversion.from_lens import ExactLens
        from cubicfish_cli.formats.foreign import read_foreign

        given, found = read_foreign(Path(name), image_size=size)
        exact = ExactLens.of(given)
        text = _camera_text(exact.nearest.camera, {"imported_from": found, "lens": given.name})
        return cls(
            lens=exact,
            image_size=given.image_size,
            text=lambda *_: text,
            note=f"true_camera.yaml will be the cubic camera nearest to the lens of {found}, "
            f"{exact.nearest.error.rms_px:.4f} px from it (RMS); photos and corners are the "
            "lens's own.",
        )

    @classmethod
    def _outside(cls, lens: OutsideLens) -> Source:
        """A lens that is perhaps not central: true_camera.yaml says as which lens of rays."""

        def text(target: Target, poses: Mapping[str, Pose]) -> str:
            points = visible_points(target, lens, poses, lens.image_size)
            return lens_text(lens.seen_from(points))

        return cls(lens=lens, image_size=lens.image_size, text=text)


def _is_of_another_tool(path: Path) -> bool:
    """Whether a file is no camera or lens of ours, and of a format that is known."""
    from cubicfish_cli.formats.foreign import sniffed

    try:
        sniffed(path)
    except CameraFileError:  # what is wrong with it is said by the reader of our own
        return False
    return True


def _camera_text(camera: CubicCamera, made_by: Mapping[str, object]) -> str:
    return camera_text(camera, fit={}, made_by={"command": "simulate", **made_by})


@dataclass(frozen=True, kw_only=True)
class Simulated:
    """Photos or a film, still to be rendered.

    Attributes:
        pictures: names of the photos' files, or of the film's.
        frames: how many photos or frames.
        texts: the truth, by the name of its file.
        rendered: progress -> name of a picture's file -> what writes it, in their order.

    """

    pictures: list[str]
    frames: int
    texts: Mapping[str, str]
    rendered: Callable[[Count], dict[str, Content]]

    @property
    def corners(self) -> int:
        """How many corners can be seen."""
        return self.texts["true_corners.csv"].count("\n") - 2

    def save(
        self, folder: StrPath, *, overwrite: bool = False, listener: Listener = SILENT
    ) -> list[Path]:
        """Render the pictures and write them beside their truth, all or nothing.

        Args:
            folder: where; it is made if it is not there.
            overwrite: whether existing files may be replaced.
            listener: who is told how far it is.

        Returns:
            The files: pictures first, then true_corners.csv, true_poses.csv, true_camera.yaml.

        Raises:
            OutputError: a file exists and ``overwrite`` is false, or cannot be written.

        """
        contents = {**self.rendered(listener.counting("Rendering")), **self.texts}
        files = {Path(folder) / name: content for name, content in contents.items()}
        return write_files(files, overwrite=overwrite)


def _truth(
    target: Target, source: Source, poses: Mapping[str, Pose], corners: str
) -> dict[str, str]:
    return {
        "true_corners.csv": corners,
        "true_poses.csv": pose_table_text(poses),
        "true_camera.yaml": source.text(target, poses),
    }


def simulate_photos(
    target: Target,
    lens: Source | Calibrated | CubicCamera | StrPath,
    *,
    image_size: Sequence[int] | None = None,
    poses: StrPath | None = None,
    number: int = 12,
    form: str = "jpg",
    **look: Unpack[LookOptions],
) -> Simulated:
    """Photos of a target whose poses fill the camera's field, as ``cubicfish simulate``.

    Args:
        target: the object; its boards are rendered flat.
        lens: a camera or a fit; the name of a lens that no camera can hold (``moving-pupil``,
            ``mirror``, ``equisolid``, ``orthographic``); or a file: camera.yaml, a lens's
            formula, or another tool's.
        image_size: (width, height) of the photos in pixels, for lenses with a name (by default
            960x720) and files that do not say.
        poses: a table to take them from instead, such as the true_poses.csv of earlier photos;
            lengths in the target's unit, rotation vectors in radians, ``camera_from_world``.
        number: of photos, without one.
        form: of the files: ``jpg`` or ``png``.
        look: ``noise``, ``blur``, ``vignetting``, ``exposure`` and ``seed`` of
            :class:`LookOptions`.

    Returns:
        Photos still to be rendered, which ``save(folder)`` does: grey, each with its truth in
        true_corners.csv (pixels), true_poses.csv and true_camera.yaml. ``corners`` says how many
        there are to be seen.

    Raises:
        CameraFileError: the lens cannot be used.
        CorrespondenceError: the table cannot be used.
        TargetError: the target cannot be drawn, or is not seen so often.
        OutputError: no photo shows a corner, or an option is out of its bounds.

    """
    shown, seed = _look(look)
    _check("number", number, 1, _MOST_PHOTOS)
    if form not in FORMATS:
        told = did_you_mean(str(form), FORMATS)
        raise OutputError(f"photos are not written as {quoted(form)}: {told}")
    source = Source.of(lens, image_size, target)
    if poses is None:
        digits = len(str(number)) if number > 9 else 2
        chosen = chosen_poses(target, source.lens, source.image_size, number, seed=seed)
        named = {f"photo_{i:0{digits}d}.{form}": pose for i, pose in enumerate(chosen, start=1)}
    else:
        named = _poses_of_table(Path(poses), form)
    flat = target.with_flat_boards()
    corners = true_corners_text(flat, source.lens, named, source.image_size)
    if corners.count("\n") <= 2:
        raise OutputError("no photo shows a corner: check the poses, the target and its units")

    def rendered(progress: Count) -> dict[str, Content]:
        photos = simulated_photos(flat, source.lens, source.image_size, named, shown, seed=seed)

        def write(done: int, path: Path) -> None:
            path.write_bytes(photo_bytes(next(photos)[1], form))
            progress(done, len(named))

        return {name: partial(write, done) for done, name in enumerate(named, start=1)}

    texts = _truth(flat, source, named, corners)
    return Simulated(pictures=list(named), frames=len(named), texts=texts, rendered=rendered)


def _look(given: LookOptions) -> tuple[Look, int]:
    """What was asked of the pictures, and the seed."""
    chosen: dict[str, Any] = {**_LOOK, **given}
    for name in chosen.keys() - _LOOK.keys():
        raise TypeError(f"{name} is no option of a simulation")
    for name, (least, most) in _BOUNDS.items():
        _check(name, chosen[name], least, most)
    return Look(**{name: chosen[name] for name in _BOUNDS}), int(chosen["seed"])


def _check(name: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise OutputError(f"{name} must be from {least:g} to {most:g}, not {value}")


def _poses_of_table(path: Path, form: str) -> dict[str, Pose]:
    """Poses by the photos' file names."""
    named: dict[str, Pose] = {}
    for name, pose in load_poses(path).items():
        own = Path(name).stem + f".{form}"
        if Path(name).name != name or own in named or own.startswith("."):
            raise CorrespondenceError(
                f"{path}: {quoted(name)} cannot be the name of a photo here: give each row a file "
                "name of its own, without folders"
            )
        named[own] = pose
    return named


def simulate_film(
    target: Target,
    lens: Source | Calibrated | CubicCamera | StrPath,
    seconds: float,
    *,
    image_size: Sequence[int] | None = None,
    rate: float = 30.0,
    shutter_ms: float = 8.0,
    readout_ms: float = 15.0,
    **look: Unpack[LookOptions],
) -> Simulated:
    """A film of a hand that moves a target in front of the camera, as ``cubicfish simulate``.

    Args:
        target: the object; its boards are rendered flat.
        lens: a camera or a fit; the name of a lens that no camera can hold (``moving-pupil``,
            ``mirror``, ``equisolid``, ``orthographic``); or a file: camera.yaml, a lens's
            formula, or another tool's.
        seconds: how long the film is, 0.1 to 3600.
        image_size: (width, height) of the frames in pixels, for lenses with a name (by default
            960x720) and files that do not say.
        rate: frames per second, 1 to 240.
        shutter_ms: for how long each row gathers light, milliseconds up to 1000.
        readout_ms: how long after the first row the last one is read, milliseconds up to 1000;
            0 is a global shutter.
        look: as for :func:`simulate_photos`.

    Returns:
        The film still to be rendered, which ``save(folder)`` does: film.mp4, and the truth of each
        frame under the name that ``cubicfish frames`` gives it.

    Raises:
        CameraFileError: the lens cannot be used.
        PhotoError: the extra ``video`` is not installed.
        TargetError: the target cannot be drawn, or is not seen so often.
        OutputError: no frame shows a corner, a side is odd, or an option is out of its bounds.

    """
    from cubicfish_cli.films.source import library
    from cubicfish_cli.films.write import refuse_odd, write_film
    from cubicfish_cli.rendering.film import Shutter, film_frames, film_truth, hand_path

    shown, seed = _look(look)
    _check("seconds", seconds, 0.1, _MOST_SECONDS)
    _check("rate", rate, 1, 240)
    _check("shutter_ms", shutter_ms, 0, 1000)
    _check("readout_ms", readout_ms, 0, 1000)
    shutter = Shutter(rate=rate, open_s=shutter_ms / 1000, readout_s=readout_ms / 1000)
    source = Source.of(lens, image_size, target)
    size = source.image_size
    library()  # said before the work if it is not there
    refuse_odd(size)
    frames = max(1, round(seconds * shutter.rate))
    names = [f"{frame_name(Path(FILM).stem, one / shutter.rate)}.png" for one in range(frames)]
    flat = target.with_flat_boards()
    path = hand_path(flat, source.lens, size, seconds, seed=seed)
    poses, corners = film_truth(flat, source.lens, size, path, shutter, names)
    if corners.count("\n") <= 2:
        raise OutputError("no frame shows a corner: check the target and its units")

    def rendered(progress: Count) -> dict[str, Content]:
        def pictures() -> Iterator[npt.NDArray[np.uint8]]:
            made = film_frames(flat, source.lens, size, path, shutter, frames, shown, seed=seed)
            for done, picture in enumerate(made, start=1):
                yield picture
                progress(done, frames)

        return {FILM: lambda file: write_film(file, pictures(), size, shutter.rate)}

    texts = _truth(flat, source, poses, corners)
    return Simulated(pictures=[FILM], frames=frames, texts=texts, rendered=rendered)
