"""What is rendered of each of many photos, and where it may be trusted."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.app.asked import Run
from cubicfish_cli.app.asked_pictures import PlaneOptions
from cubicfish_cli.app.photos import Photo, Picture
from cubicfish_cli.app.undistortion.batch import Job
from cubicfish_cli.app.undistortion.images import remap_picture
from cubicfish_cli.core.arrays import Refusal
from cubicfish_cli.core.assess.fit_record import FitRecord
from cubicfish_cli.core.boards.board import Board
from cubicfish_cli.core.codes import Event
from cubicfish_cli.core.errors import UsageError, ViewError
from cubicfish_cli.core.io.camera_yaml import CameraFile, PointCameraFile
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.target import Target
from cubicfish_cli.core.views.choose import ChosenView, chosen_view
from cubicfish_cli.core.views.maps import (
    UndistortMap,
    build_map,
    camera_for_photos,
)
from cubicfish_cli.core.views.options import ViewOptions
from cubicfish_cli.core.views.plane import PlaneView, PointProjector, plane_view
from cubicfish_cli.core.views.view import View, matrix_of_rotation
from cubicfish_cli.core.wording import did_you_mean, quoted

Size = tuple[int, int]
_PIXELS_PER_BLOCK = 262_144  # bounds the memory that a large picture takes
_LIMIT = 1e9
_ROTATION_TOLERANCE = 1e-6


class Views(ABC):
    """What a run renders of each photo; called, it renders one.

    Sizes are (width, height), pixels.
    """

    interpolation: str

    @abstractmethod
    def group(self, source: Path, size: Size) -> Hashable:
        """Photos with the same group have the same view and maps."""

    @abstractmethod
    def chosen(self, source: Path, size: Size) -> tuple[Any, ChosenView]:
        """The camera that took a photo of ``size``, None for several, and the view of it.

        Raises:
            ViewError: there is no such view of this photo.

        """

    def place(self, sources: Sequence[Path], run: Run) -> None:  # noqa: B027
        """Find out, before anything is rendered, what has to be known of each photo."""

    def maps(self, source: Path, size: Size) -> Mapping[str, UndistortMap]:
        """Part of the view -> its map."""
        camera, view = self.chosen(source, size)
        return {part: build_map(camera, one) for part, one in view.views.items()}

    def __call__(self, job: Job, photos: Mapping[str, Picture]) -> dict[str, Picture]:
        """The pictures of a job, as :func:`write_many` asks for them."""
        picture = photos[""]
        maps = self.maps(job.source, (picture.shape[1], picture.shape[0]))
        how = self.interpolation
        return {part: remap_picture(picture, maps[part], how) for part in job.outputs}


class ViewsBySize(Views):
    """A view from the camera's place: the same for all photos of a size."""

    def __init__(
        self, camera: CubicCamera, asked: View | ViewOptions | None, interpolation: str
    ) -> None:
        """Prepare for photos of this camera.

        Args:
            camera: the camera.
            asked: the view, or what is asked of it.
            interpolation: how pixels are blended.

        """
        self._camera, self._asked, self.interpolation = camera, asked, interpolation
        self._made: dict[Size, Mapping[str, UndistortMap]] = {}
        self._lock = Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel without the maps, which are quicker made than sent, and the lock."""
        return ViewsBySize, (self._camera, self._asked, self.interpolation)

    def group(self, source: Path, size: Size) -> Hashable:
        """The size."""
        return size

    def chosen(self, source: Path, size: Size) -> tuple[CubicCamera, ChosenView]:
        """The view that is asked for."""
        camera = camera_for_photos(self._camera, size)
        return camera, chosen_view(camera, self._asked)

    def maps(self, source: Path, size: Size) -> Mapping[str, UndistortMap]:
        """Made once for each size, from any thread."""
        with self._lock:
            if size not in self._made:
                self._made[size] = super().maps(source, size)
            return self._made[size]


def build_plane(
    camera: PointProjector,
    target: Target,
    board: str,
    rotation: npt.ArrayLike,
    translation: npt.ArrayLike,
    *,
    pixels_per_unit: float | None = None,
    margin: float | None = None,
) -> PlaneView:
    """The plane of a board, seen squarely from its front, as ``undistort`` renders it.

    Args:
        camera: the camera that took the photo.
        target: the calibration target.
        board: the name of one of its boards, a grid.
        rotation: (3, 3) of ``camera_from_world`` of this photo.
        translation: (3,) of the same, in the target's unit.
        pixels_per_unit: the picture's scale; by default the largest that the photo has there.
        margin: how far the picture goes on beyond the outer corners, in the target's unit; by
            default a square.

    Raises:
        ViewError: there is no such board, it has no plane, the pose is none, or the camera does
            not see the plane from its front.

    """
    refusal = Refusal(error=ViewError)
    turn = refusal.numbers(rotation, "rotation", 3, limit=_LIMIT)
    if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=_ROTATION_TOLERANCE):
        raise ViewError("rotation is no rotation matrix (3, 3)")
    place = refusal.numbers([np.asarray(translation)], "translation", 3, limit=_LIMIT)[0]
    plane = board_with_plane(target, board)
    corners = plane.plane_points([0, plane.columns - 1], [0, plane.rows - 1])
    beyond = plane.square if margin is None else margin
    return plane_view(
        camera,
        origin=turn @ np.asarray(plane.origin) + place,
        x_axis=turn @ np.asarray(plane.x_axis),
        y_axis=turn @ np.asarray(plane.y_axis),
        low=corners[0] - beyond,
        high=corners[1] + beyond,
        pixels_per_unit=pixels_per_unit,
    )


def board_with_plane(target: Target, name: str) -> Board:
    """A board of a target, by its name.

    Raises:
        ViewError: there is none, or it has no plane.

    """
    names = {board.name: board for board in target.boards}
    if name not in names:
        raise ViewError(
            f"the target has no board {quoted(name)}: {did_you_mean(name, sorted(names))}"
        )
    if names[name].points is not None:
        raise ViewError(
            f"board {quoted(name)} is a list of points and has no plane: name a board with a grid"
        )
    return names[name]


class PlanesOfPhotos(Views):
    """A board's plane, whose place is another one in each photo."""

    def __init__(
        self, loaded: CameraFile | PointCameraFile, asked: PlaneOptions, interpolation: str
    ) -> None:
        """Prepare for the board of a target.

        Args:
            loaded: the camera, and the poses of the photos that it was calibrated from.
            asked: of which board, and how.
            interpolation: how pixels are blended.

        Raises:
            UsageError: the target has no such board, or the board has no plane.
            TargetError: the target's file cannot be used.

        """
        self._loaded, self._asked, self._target = loaded, asked, asked.loaded()
        self.interpolation = interpolation
        try:
            board_with_plane(self._target, asked.board)
        except ViewError as problem:
            raise UsageError(str(problem)) from None
        self._poses = _poses_of(loaded.fit)
        self._photos = {Path(photo.image).name for photo in loaded.fit.per_image}

    def group(self, source: Path, size: Size) -> Hashable:
        """The photo itself."""
        return source

    def place(self, sources: Sequence[Path], run: Run) -> None:
        """Find the poses of photos that the camera's file does not place, from corners in them.

        Args:
            sources: the photos.
            run: how the work is done.

        Raises:
            CubicfishError: no corners, or too few, in all of them.

        """
        from cubicfish_cli.app.detection import detect_corners
        from cubicfish_cli.core.fit.evaluate import evaluate

        camera = self._loaded.camera
        missing = [source for source in sources if source.name not in self._poses]
        if not missing or not isinstance(camera, CubicCamera):
            return
        run.listener.tell(Event.WITHOUT_POSE, photos=len(missing))
        photos = [Photo(name=source.name, path=source) for source in missing]
        found = detect_corners(photos, self._target, run.work("Finding corners"))
        self._poses |= _poses_of(FitRecord(per_image=evaluate(camera, found.corners).photos))

    def chosen(self, source: Path, size: Size) -> tuple[Any, ChosenView]:
        """The board's plane in this photo."""
        camera, rotation, translation = self._placed(source, size)
        plane = build_plane(
            camera,
            self._target,
            self._asked.board,
            rotation,
            translation,
            pixels_per_unit=self._asked.pixels_per_unit,
        )
        return camera, ChosenView(views={"": plane}, unit=self._target.units)

    def _placed(self, source: Path, size: Size) -> tuple[PointProjector, Any, Any]:
        """A camera, and the rotation and the translation from the world to its frame."""
        camera = self._loaded.camera
        if not isinstance(camera, CubicCamera):
            if size != camera.image_size:
                raise ViewError(
                    "a camera of lift 'point' takes photos of its own size only, "
                    f"{camera.image_size[0]}x{camera.image_size[1]}"
                )
            if camera.frame == "world":
                if self._photos and source.name not in self._photos:
                    raise ViewError(
                        "this camera of lift 'point' holds for the one photo that it was fitted "
                        f"to, {min(self._photos)}: use that, or a camera of lift 'ray'"
                    )
                return camera, np.eye(3), np.zeros(3)
        if source.name not in self._poses:
            raise ViewError(
                "nothing is known of where this photo was taken: it has no pose in the camera "
                "file and no board was found in it"
            )
        vector, translation = self._poses[source.name]
        if isinstance(camera, CubicCamera):
            camera = camera_for_photos(camera, size)
        return camera, matrix_of_rotation(vector), translation


def _poses_of(fit: FitRecord) -> dict[str, tuple[Any, Any]]:
    """Rotation vector and translation by the photo's file name, without folders."""
    return {Path(name).name: pose for name, pose in fit.poses.items()}
