"""A board's plane in each photo, squarely from its front: ``undistort --view plane:BOARD``."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cubicfish import (
    Calibration,
    CameraFile,
    CubicCamera,
    Event,
    Run,
    TargetError,
    UsageError,
    ViewError,
    build_plane,
    detect,
    evaluate,
    load_camera,
)
from cubicfish.judge import FitRecord
from cubicfish.models import PointCamera
from cubicfish.photos import Photo
from cubicfish.views import ChosenView, Interpolation
from cubicfish_cli.inputs.target_source import target_in
from cubicfish_cli.undistortion.batch import Size, Views
from cubicfish_cli.undistortion.options import PlaneOptions


class PlaneViews(Views):
    """Views of a board's plane, one per photo, since the board's pose differs."""

    def __init__(
        self,
        given: Path | Calibration | CameraFile | CubicCamera,
        options: PlaneOptions,
        how: Interpolation,
    ) -> None:
        """Prepare for the board of a target.

        Args:
            given: the camera, maybe with the poses of the photos of its calibration, or its file.
            options: the board, and the view's size and field.
            how: how pixels are interpolated.

        Raises:
            UsageError: the target has no such board, or the board has no plane.
            TargetError: the target's file cannot be used.
            CameraFileError: the camera's cannot.

        """
        loaded = load_camera(given, any_lift=True) if isinstance(given, Path) else given
        fit = FitRecord() if isinstance(loaded, CubicCamera) else loaded.fit
        self._seen_by = loaded if isinstance(loaded, CubicCamera) else loaded.camera
        self._plane, self._target = options, target_in(options.target)
        self.interpolation = how
        try:
            self._target.board(options.board, flat=True)
        except TargetError as problem:
            raise UsageError(str(problem)) from None
        self._poses = _read_poses(fit)
        self._photos = {Path(photo.image).name for photo in fit.per_image}

    def find_poses(self, sources: Sequence[Path], run: Run) -> None:
        """Find the poses of photos that the camera's file does not place, from corners in them.

        Args:
            sources: the photos.
            run: how the work is done.

        Raises:
            CubicfishError: none of them shows enough corners.

        """
        camera = self._seen_by
        missing = [source for source in sources if source.name not in self._poses]
        if not missing or not isinstance(camera, CubicCamera):
            return
        run.listener.tell(Event.WITHOUT_POSE, photos=len(missing))
        photos = [Photo(name=source.name, path=source) for source in missing]
        found = detect(photos, [self._target], run, again=False)
        self._poses |= _read_poses(FitRecord(per_image=evaluate(camera, found.corners).photos))

    def chosen(self, source: Path, size: Size) -> ChosenView:
        """Return the board's plane in this photo."""
        camera, rotation, translation = self._find_placed(source, size)
        plane = build_plane(
            camera,
            self._target,
            self._plane.board,
            rotation,
            translation,
            pixels_per_unit=self._plane.pixels_per_unit,
        )
        return ChosenView(views={"": plane}, camera=camera, unit=self._target.units)

    def _find_placed(self, source: Path, size: Size) -> tuple[CubicCamera | PointCamera, Any, Any]:
        """Return a camera, and the rotation and the translation from the world to its frame."""
        camera = self._seen_by
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
            camera = camera.for_photos(size)
        return camera, vector, translation


def _read_poses(fit: FitRecord) -> dict[str, tuple[Any, Any]]:
    """Return rotation vector and translation by the photo's file name, without folders."""
    return {Path(name).name: pose for name, pose in fit.poses.items()}
