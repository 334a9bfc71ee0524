"""What is rendered of each of many photos: here one view for all of a size."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Sequence
from pathlib import Path
from threading import Lock
from typing import Any

from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.undistortion.choose import ChosenView, SeenField
from cubicfish_cli.undistortion.frames import Crop, camera_for_photos
from cubicfish_cli.undistortion.maps import UndistortMap, build_map
from cubicfish_cli.undistortion.view import Camera

Size = tuple[int, int]


class Views(ABC):
    """What a run renders of each photo; sizes are (width, height), pixels."""

    @abstractmethod
    def group(self, source: Path, size: Size) -> Hashable:
        """Photos with the same group have the same view and maps."""

    @abstractmethod
    def chosen(self, source: Path, size: Size) -> tuple[Any, ChosenView]:
        """The camera that took a photo of ``size``, and the view of it.

        Raises:
            ViewError: there is no such view of this photo.

        """

    def view(self, source: Path, size: Size) -> ChosenView:
        """The view of a photo."""
        return self.chosen(source, size)[1]

    def maps(self, source: Path, size: Size) -> Sequence[UndistortMap]:
        """Its maps, one for each part of the view."""
        camera, view = self.chosen(source, size)
        return [build_map(camera, part) for part in view.views.values()]

    def kept_share(self, source: Path, size: Size) -> float | None:
        """Share of what the camera sees that the view keeps; None where it is not of directions."""
        camera, view = self.chosen(source, size)
        return view.kept_share(camera)

    def seen(self, source: Path, size: Size) -> SeenField | None:
        """What the camera sees of the view's field; None where it has none."""
        camera, view = self.chosen(source, size)
        return view.seen_by(camera)


class ViewsBySize(Views):
    """A view from the camera's place: the same for all photos of a size."""

    def __init__(
        self, camera: CubicCamera, crop: Crop | None, choose: Callable[[Camera], ChosenView]
    ) -> None:
        """Prepare for photos of this camera, or of a part of its pictures.

        Args:
            camera: the camera.
            crop: the part; None for all.
            choose: camera of the photos -> what is rendered of them.

        """
        self._camera, self._crop, self._choose = camera, crop, choose
        self._made: dict[Size, Sequence[UndistortMap]] = {}
        self._lock = Lock()

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel without the maps, which are quicker made than sent, and the lock."""
        return ViewsBySize, (self._camera, self._crop, self._choose)

    def group(self, source: Path, size: Size) -> Hashable:
        """The size."""
        return size

    def chosen(self, source: Path, size: Size) -> tuple[CubicCamera, ChosenView]:
        """The view that is asked for."""
        camera = camera_for_photos(self._camera, size, self._crop)
        return camera, self._choose(camera)

    def maps(self, source: Path, size: Size) -> Sequence[UndistortMap]:
        """Made once for each size, from any thread."""
        with self._lock:
            if size not in self._made:
                self._made[size] = super().maps(source, size)
            return self._made[size]
