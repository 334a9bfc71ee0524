"""The metric picture of a board's plane, in one photo or in many."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cubicfish_cli.arrays import Refusal
from cubicfish_cli.boards.board import Board
from cubicfish_cli.errors import ViewError
from cubicfish_cli.fitting.evaluate import evaluate
from cubicfish_cli.fitting.statistics import photos_on_record, poses_on_record
from cubicfish_cli.formats.camera_yaml import CameraFile, PointCameraFile
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.library.asked import Run
from cubicfish_cli.library.detection import detect_corners
from cubicfish_cli.library.views import Size, Views
from cubicfish_cli.photos import Photo
from cubicfish_cli.target import Target
from cubicfish_cli.undistortion.choose import ChosenView
from cubicfish_cli.undistortion.frames import Crop, camera_for_photos
from cubicfish_cli.undistortion.plane import PlaneView, PointProjector, plane_view
from cubicfish_cli.undistortion.view import matrix_of_rotation
from cubicfish_cli.wording import did_you_mean, quoted
from cubicfish_cli.words.codes import Event

_LIMIT = 1e9
_ROTATION_TOLERANCE = 1e-6


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
    """The plane of a board, seen squarely from its front, as ``undistort --plane`` renders it.

    Args:
        camera: the camera that took the photo.
        target: the object.
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
    return plane_of(
        camera,
        board_with_plane(target, board),
        turn,
        place,
        pixels_per_unit=pixels_per_unit,
        margin=margin,
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


def plane_of(
    camera: PointProjector,
    board: Board,
    rotation: npt.NDArray[np.float64],
    translation: npt.NDArray[np.float64],
    *,
    pixels_per_unit: float | None,
    margin: float | None,
) -> PlaneView:
    """See :func:`build_plane`."""
    corners = board.plane_points([0, board.columns - 1], [0, board.rows - 1])
    beyond = board.square if margin is None else margin
    return plane_view(
        camera,
        origin=rotation @ np.asarray(board.origin) + translation,
        x_axis=rotation @ np.asarray(board.x_axis),
        y_axis=rotation @ np.asarray(board.y_axis),
        low=corners[0] - beyond,
        high=corners[1] + beyond,
        pixels_a_unit=pixels_per_unit,
    )


class PlanesOfPhotos(Views):
    """A board's plane, whose place is another one in each photo."""

    def __init__(
        self,
        loaded: CameraFile | PointCameraFile,
        crop: Crop | None,
        target: Target,
        board: str,
        *,
        pixels_per_unit: float | None = None,
        margin: float | None = None,
    ) -> None:
        """Prepare for the board of a target.

        Args:
            loaded: the camera, and the poses of the photos that it was calibrated from.
            crop: the part of the calibrated photos that the photos show.
            target: the object.
            board: name of one of its boards.
            pixels_per_unit: as in :func:`build_plane`.
            margin: likewise.

        Raises:
            ViewError: it has no such board, or the board has no plane.

        """
        self._loaded, self._crop, self._target = loaded, crop, target
        self._board = board_with_plane(target, board)
        self._scale, self._margin = pixels_per_unit, margin
        self._poses = _poses_of(loaded.fit)
        self._photos = {
            Path(str(record.get("image"))).name for record in photos_on_record(loaded.fit)
        }

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
        camera = self._loaded.camera
        missing = [source for source in sources if source.name not in self._poses]
        if not missing or not isinstance(camera, CubicCamera):
            return
        run.listener.tell(Event.WITHOUT_POSE, photos=len(missing))
        progress = run.listener.counting("Finding corners")
        photos = [Photo(name=source.name, path=source) for source in missing]
        found = detect_corners(photos, self._target, progress=progress, executor=run.executor)
        self._poses |= _poses_of(evaluate(camera, found.corners).as_record())

    def chosen(self, source: Path, size: Size) -> tuple[PointProjector, ChosenView]:
        """The board's plane in this photo."""
        camera, rotation, translation = self._placed(source, size)
        plane = plane_of(
            camera,
            self._board,
            rotation,
            translation,
            pixels_per_unit=self._scale,
            margin=self._margin,
        )
        return camera, ChosenView(views={"": plane}, unit=self._target.units)

    def kept_share(self, source: Path, size: Size) -> None:
        """A plane is not about directions."""

    def seen(self, source: Path, size: Size) -> None:
        """Nor has it a field."""

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
            camera = camera_for_photos(camera, size, self._crop)
        return camera, matrix_of_rotation(vector), translation


def _poses_of(fit: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Rotation vector and translation by the photo's file name, without folders."""
    return {Path(name).name: pose for name, pose in poses_on_record(fit).items()}
