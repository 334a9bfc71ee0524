"""Photos and films of known truth, with that truth beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import CorrespondenceError, OutputError
from cubicfish_cli.files import Content
from cubicfish_cli.formats.calibrated import camera_text
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.frame_names import frame_name
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.rendering.lens_file import is_lens_file, lens_text, load_lens
from cubicfish_cli.rendering.outside import (
    OUTSIDE_LENSES,
    OutsideLens,
    RaysAtDistance,
    outside_lens,
)
from cubicfish_cli.rendering.pose import Pose, load_poses, pose_table_text
from cubicfish_cli.rendering.simulate import Look, chosen_poses, photo_bytes, simulated_photos
from cubicfish_cli.rendering.truth import true_corners_text, visible_points
from cubicfish_cli.rendering.views import WholeLens
from cubicfish_cli.target import Target
from cubicfish_cli.wording import quoted

if TYPE_CHECKING:
    from cubicfish_cli.rendering.film import Shutter

FILM = "film.mp4"
_SIZE = (960, 720)

Count = Callable[[int, int], None]


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

    def files(self, folder: Path, progress: Count) -> dict[Path, Content]:
        """What :func:`write_files` writes; pictures are rendered when they are written.

        Args:
            folder: where.
            progress: called with frames done and all frames.

        """
        contents = {**self.rendered(progress), **self.texts}
        return {folder / name: content for name, content in contents.items()}


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
    source: Source,
    look: Look,
    *,
    poses: Path | None = None,
    number: int = 12,
    seed: int = 0,
    form: str = "jpg",
) -> Simulated:
    """Photos of a target whose poses fill the camera's field.

    Args:
        target: the object; its boards are rendered flat.
        source: what photos are taken with.
        look: noise, blur and light.
        poses: a table to take them from instead.
        number: of photos, without one.
        seed: other poses, other noise.
        form: of the files: ``jpg`` or ``png``.

    Raises:
        CorrespondenceError: the table cannot be used.
        OutputError: no photo shows a corner.

    """
    if poses is None:
        digits = len(str(number)) if number > 9 else 2
        chosen = chosen_poses(target, source.lens, source.image_size, number, seed=seed)
        named = {f"photo_{i:0{digits}d}.{form}": pose for i, pose in enumerate(chosen, start=1)}
    else:
        named = _poses_of_table(poses, form)
    flat = target.with_flat_boards()
    corners = true_corners_text(flat, source.lens, named, source.image_size)
    if corners.count("\n") <= 2:
        raise OutputError("no photo shows a corner: check the poses, the target and its units")

    def rendered(progress: Count) -> dict[str, Content]:
        photos = simulated_photos(flat, source.lens, source.image_size, named, look, seed=seed)

        def write(done: int, path: Path) -> None:
            path.write_bytes(photo_bytes(next(photos)[1], form))
            progress(done, len(named))

        return {name: partial(write, done) for done, name in enumerate(named, start=1)}

    texts = _truth(flat, source, named, corners)
    return Simulated(pictures=list(named), frames=len(named), texts=texts, rendered=rendered)


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
    target: Target, source: Source, look: Look, seconds: float, shutter: Shutter, *, seed: int = 0
) -> Simulated:
    """A film of a hand that moves a target in front of the camera.

    Args:
        target: the object; its boards are rendered flat.
        source: what the film is taken with.
        look: noise, blur and light.
        seconds: how long it is.
        shutter: how it is exposed.
        seed: another motion, other noise.

    Raises:
        PhotoError: the extra ``video`` is not installed.
        OutputError: no frame shows a corner, or a side is odd.

    """
    from cubicfish_cli.films.source import library
    from cubicfish_cli.films.write import refuse_odd, write_film
    from cubicfish_cli.rendering.film import film_frames, film_truth, hand_path

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
            made = film_frames(flat, source.lens, size, path, shutter, frames, look, seed=seed)
            for done, picture in enumerate(made, start=1):
                yield picture
                progress(done, frames)

        return {FILM: lambda file: write_film(file, pictures(), size, shutter.rate)}

    texts = _truth(flat, source, poses, corners)
    return Simulated(pictures=[FILM], frames=frames, texts=texts, rendered=rendered)
