"""A target before a camera: where it can be photographed from, and what those photos show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from cubicfish.models.cubic import CubicCamera
from cubicfish.scene.photos import (
    LAMP,
    Background,
    Look,
    RayGrid,
    chosen_poses,
    render,
    room_background,
)
from cubicfish.scene.truth import (
    Pose,
    TrueCorners,
    project_corners,
    rotation_matrix,
    true_corners_text,
)
from cubicfish.scene.views import (
    Distances,
    NearLens,
    Viewpoint,
    WanderingPupil,
    WholeLens,
    sample_views,
    view_from,
)
from cubicfish.target.target import Target

_USUAL = Look()


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A target before a camera.

    Attributes:
        target: the calibration target; its boards are taken as flat.
        lens: the camera: anything with ``project`` and ``unproject``.
        image_size: (width, height), pixels.

    """

    target: Target
    lens: WholeLens
    image_size: tuple[int, int]

    @classmethod
    def of(cls, target: Target, camera: CubicCamera) -> Scene:
        """A target before a fitted camera, whose entrance pupil travels if the fit says so."""
        camera = camera.in_units(target.units)
        lens = NearLens(camera=camera) if camera.pupil_travel else camera
        return cls(target=target.with_flat_boards(), lens=lens, image_size=camera.image_size)

    def views(
        self, count: int, *, seed: int = 0, within: Distances | None = None
    ) -> list[Viewpoint]:
        """Sample up to ``count`` views; see :func:`~cubicfish.scene.views.sample_views`."""
        size = self.image_size
        return sample_views(self.target, self.lens, size, count, seed=seed, within=within)

    def view(self, camera_from_world: Pose) -> Viewpoint | None:
        """What is seen from a pose; None where no corner is.

        Raises:
            TargetError: a board of a kind that cannot be drawn.

        """
        return view_from(self.target, self.lens, camera_from_world, self.image_size)

    def choose_poses(self, count: int, *, seed: int = 0) -> list[Pose]:
        """Choose ``count`` poses, ``camera_from_world``, that together fill the field.

        Raises:
            TargetError: the target cannot be drawn, or cannot be seen so often.

        """
        return chosen_poses(self.target, self.lens, self.image_size, count, seed=seed)

    def corners(self, camera_from_world: Pose, *, neighbourhood: float = 0.5) -> TrueCorners:
        """The exact pixels of all corners from a pose, and which of them are visible.

        ``neighbourhood`` is how much around a corner must be seen too, in squares.

        Raises:
            TargetError: a board of a kind that cannot be drawn.

        """
        return project_corners(
            self.target, self.lens, camera_from_world, self.image_size, neighbourhood=neighbourhood
        )

    def corners_text(self, poses: Mapping[str, Pose]) -> str:
        """The visible corners of photos, by the photos' names, as the text of a corners.csv.

        Raises:
            TargetError: a board of a kind that cannot be drawn.

        """
        return true_corners_text(self.target, self.lens, poses, self.image_size)

    def photo(
        self,
        camera_from_world: Pose,
        look: Look = _USUAL,
        *,
        number: int = 0,
        background: Background | None = None,
    ) -> npt.NDArray[np.uint8]:
        """Render one photo, lit over the photographer's shoulder -> (height, width) grey levels.

        Args:
            camera_from_world: the pose.
            look: the sensor.
            number: of the photo: each has noise of its own.
            background: world directions (N, 3) -> brightness (N,) where no board is; by
                default a plain room.

        Raises:
            TargetError: a board of a kind that cannot be drawn.

        """
        return render(
            self.target,
            self._rays,
            camera_from_world,
            self.image_size,
            noise=look.noise,
            blur=look.blur,
            vignetting=look.vignetting,
            exposure=look.exposure,
            light_from=rotation_matrix(camera_from_world[0]).T @ LAMP,
            background=background or room_background,
            seed=(look.seed, number),
            ray_starts=self.lens.ray_starts if isinstance(self.lens, WanderingPupil) else None,
        )

    def photos(
        self, poses: Mapping[str, Pose], look: Look = _USUAL
    ) -> Iterator[tuple[str, npt.NDArray[np.uint8]]]:
        """Render photos one by one: name, and (height, width) grey levels.

        Raises:
            TargetError: a board of a kind that cannot be drawn.

        """
        for number, (name, pose) in enumerate(poses.items()):
            yield name, self.photo(pose, look, number=number)

    @cached_property
    def _rays(self) -> RayGrid:
        return RayGrid.of(self.lens.unproject, self.image_size)
