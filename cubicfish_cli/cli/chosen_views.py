"""Which views a run renders: the same for all photos of a size, or a plane for each photo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, Protocol

import click

from cubicfish_cli.cli.figures import count
from cubicfish_cli.cli.numbers import FloatRange
from cubicfish_cli.cli.options import FILE, bundle, option
from cubicfish_cli.cli.target_choice import target_path
from cubicfish_cli.cli.view_options import ChosenView, SeenField, ViewOptions

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from cubicfish_cli.executors.executor import Executor
    from cubicfish_cli.formats.camera_yaml import CameraFile, PointCameraFile
    from cubicfish_cli.model.cubic import CubicCamera
    from cubicfish_cli.undistortion.batch import PhotoJob
    from cubicfish_cli.undistortion.frames import Crop
    from cubicfish_cli.undistortion.maps import UndistortMap
    from cubicfish_cli.undistortion.plane import PlaneView, PointProjector

    FloatArray = npt.NDArray[np.float64]


class Views(Protocol):
    """What a run renders of each photo."""

    def group(self, source: Path, size: tuple[int, int]) -> object:
        """Photos with the same group have the same view and maps."""

    def view(self, source: Path, size: tuple[int, int]) -> ChosenView:
        """The view of a photo of (width, height)."""

    def maps(self, source: Path, size: tuple[int, int]) -> Sequence[UndistortMap]:
        """Its maps, one for each part of the view."""

    def kept_share(self, source: Path, size: tuple[int, int]) -> float | None:
        """Share of what the camera sees that the view keeps; None where nobody asks."""

    def seen(self, source: Path, size: tuple[int, int]) -> SeenField | None:
        """What the camera sees of the view's field; None where it has none."""


class ViewsBySize:
    """A view from the camera's place: the same for all photos of a size."""

    def __init__(self, camera: CubicCamera, crop: Crop | None, options: ViewOptions) -> None:
        """Prepare for photos of this camera, or of a part of its pictures."""
        self._camera, self._crop, self._options = camera, crop, options
        self._made: dict[tuple[int, int], Sequence[UndistortMap]] = {}
        self._lock = Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel without the maps, which are quicker made than sent, and the lock."""
        return ViewsBySize, (self._camera, self._crop, self._options)

    def group(self, source: Path, size: tuple[int, int]) -> object:
        """The size."""
        return size

    def _camera_for(self, size: tuple[int, int]) -> CubicCamera:
        from cubicfish_cli.undistortion.frames import camera_for_photos

        return camera_for_photos(self._camera, size, self._crop)

    def view(self, source: Path, size: tuple[int, int]) -> ChosenView:
        """The view that the options ask for."""
        return self._options.chosen(self._camera_for(size))

    def maps(self, source: Path, size: tuple[int, int]) -> Sequence[UndistortMap]:
        """Made once for each size, from any thread."""
        from cubicfish_cli.undistortion.maps import build_map

        with self._lock:
            if size not in self._made:
                views = self.view(source, size).views.values()
                self._made[size] = [build_map(self._camera_for(size), view) for view in views]
            return self._made[size]

    def kept_share(self, source: Path, size: tuple[int, int]) -> float:
        """Of the solid angle."""
        from cubicfish_cli.undistortion.fit import kept_share

        camera = self._camera_for(size)
        return min(1.0, sum(kept_share(camera, v) for v in self.view(source, size).views.values()))

    def seen(self, source: Path, size: tuple[int, int]) -> SeenField | None:
        """Of a single picture; None for those of a cube."""
        return self.view(source, size).seen_by(self._camera_for(size))


@dataclass(frozen=True, kw_only=True)
class PlaneOptions:
    """What the user asked of a board's plane; ``board`` is None where nothing was asked."""

    board: str | None
    target: Path | None
    pixels_a_unit: float | None
    margin: float | None

    def check(self, view: ViewOptions) -> None:
        """Refuse what does not go together."""
        if self.board is None:
            if self.pixels_a_unit is not None or self.margin is not None:
                raise click.UsageError("--pixels-per-unit and --margin go with --plane")
            return
        if target_path(self.target) is None:
            raise click.UsageError("--plane needs the target: name it with --target target.yaml")
        if view.is_asked:
            raise click.UsageError(
                "--plane sets size and direction by the board: leave out the view's options, "
                "or choose --pixels-per-unit and --margin"
            )


class PlanesOfPhotos:
    """A board's plane, whose place is another one in each photo."""

    def __init__(
        self, loaded: CameraFile | PointCameraFile, crop: Crop | None, options: PlaneOptions
    ) -> None:
        """Prepare for the board of a target.

        Raises:
            TargetError: the target is not usable.
            click.UsageError: it has no such board, or the board has no plane.

        """
        from cubicfish_cli.errors import ViewError
        from cubicfish_cli.fitting.statistics import photos_on_record
        from cubicfish_cli.library.planes import board_with_plane
        from cubicfish_cli.target import load_target

        target = target_path(options.target)
        if target is None or options.board is None:
            raise click.UsageError("--plane needs --target")
        self._loaded, self._crop, self._options = loaded, crop, options
        self._target = load_target(target)
        try:
            self._board = board_with_plane(self._target, options.board)
        except ViewError as problem:
            raise click.UsageError(str(problem)) from None
        records = photos_on_record(loaded.fit)
        self._poses = _poses_of(loaded.fit)
        self._photos = {Path(str(record.get("image"))).name for record in records}

    def group(self, source: Path, size: tuple[int, int]) -> object:
        """The photo itself."""
        return source

    def find_missing(self, jobs: Sequence[PhotoJob], executor: Executor | None = None) -> None:
        """Find the poses of photos that the camera file does not know, from corners in them.

        Args:
            jobs: the photos.
            executor: who looks at them instead of processes here.

        Raises:
            CubicfishError: no corners, or too few, in all of them.

        """
        from cubicfish_cli.model.cubic import CubicCamera

        missing = [job for job in jobs if job.source.name not in self._poses]
        if not missing or not isinstance(self._loaded.camera, CubicCamera):
            return
        from cubicfish_cli.cli.terminal import progress, say
        from cubicfish_cli.correspondences import pair
        from cubicfish_cli.fitting.evaluate import evaluate
        from cubicfish_cli.library.detect_corners import detect_corners
        from cubicfish_cli.photos import Photo

        say(f"Looking for corners in {count(len(missing), 'photo')} that have no known pose.")
        photos = [Photo(name=job.source.name, path=job.source) for job in missing]
        with progress("Finding corners") as callback:
            detection = detect_corners(photos, self._target, progress=callback, executor=executor)
        pairs = pair(detection.corners, self._target)
        self._poses |= _poses_of(evaluate(self._loaded.camera, pairs).as_record())

    def _projector(
        self, source: Path, size: tuple[int, int]
    ) -> tuple[PointProjector, FloatArray, FloatArray]:
        """A camera, and the rotation and the translation from the world to its frame."""
        import numpy as np

        from cubicfish_cli.errors import ViewError
        from cubicfish_cli.model.cubic import CubicCamera
        from cubicfish_cli.undistortion.frames import camera_for_photos
        from cubicfish_cli.undistortion.view import matrix_of_rotation

        camera = self._loaded.camera
        if not isinstance(camera, CubicCamera) and size != camera.image_size:
            raise ViewError(
                "a camera of lift 'point' takes photos of its own size only, "
                f"{camera.image_size[0]}x{camera.image_size[1]}"
            )
        if not isinstance(camera, CubicCamera) and camera.frame == "world":
            if self._photos and source.name not in self._photos:
                raise ViewError(
                    "this camera of lift 'point' holds for the one photo that it was fitted to, "
                    f"{min(self._photos)}: use that, or a camera of lift 'ray'"
                )
            return camera, np.eye(3), np.zeros(3)
        if source.name not in self._poses:
            raise ViewError(
                "nothing is known of where this photo was taken: it has no pose in the camera "
                "file and no board was found in it"
            )
        rotation, translation = self._poses[source.name]
        matrix = matrix_of_rotation(rotation)
        own = (
            camera_for_photos(camera, size, self._crop)
            if isinstance(camera, CubicCamera)
            else (camera)
        )
        return own, matrix, translation

    def _plane(self, source: Path, size: tuple[int, int]) -> tuple[PointProjector, PlaneView]:
        from cubicfish_cli.library.planes import plane_of

        camera, rotation, translation = self._projector(source, size)
        return camera, plane_of(
            camera,
            self._board,
            rotation,
            translation,
            pixels_per_unit=self._options.pixels_a_unit,
            margin=self._options.margin,
        )

    def view(self, source: Path, size: tuple[int, int]) -> ChosenView:
        """The board's plane in this photo."""
        return ChosenView(views={"": self._plane(source, size)[1]}, unit=self._target.units)

    def maps(self, source: Path, size: tuple[int, int]) -> Sequence[UndistortMap]:
        """One map, made anew for each photo."""
        from cubicfish_cli.undistortion.maps import build_map

        return [build_map(*self._plane(source, size))]

    def kept_share(self, source: Path, size: tuple[int, int]) -> None:
        """A plane is not about directions."""
        return

    def seen(self, source: Path, size: tuple[int, int]) -> None:
        """Nor has it a field."""
        return


def _poses_of(fit: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Rotation vector and translation by the photo's file name, without folders."""
    from cubicfish_cli.fitting.statistics import poses_on_record

    return {Path(name).name: pose for name, pose in poses_on_record(fit).items()}


plane_options = bundle(
    "plane",
    PlaneOptions,
    option(
        "--plane BOARD",
        "The metric picture of a board's plane instead of a view; needs --target.",
        to="board",
    ),
    option(
        "-t --target FILE",
        "The calibration target: a target.yaml, or one of Kalibr's target files. Where "
        "one is needed, ./target.yaml stands for it; for --plane.",
        FILE,
    ),
    option(
        "--pixels-per-unit N",
        "Scale of a plane: pixels per mm, or whatever the target's units are. [default: "
        "the largest that the photo has there]",
        FloatRange(1e-9, 1_000_000_000),
        to="pixels_a_unit",
    ),
    option(
        "--margin UNITS",
        "Of a plane: how far it goes on beyond the outer corners. [default: a square]",
        FloatRange(0, 1_000_000),
    ),
)
