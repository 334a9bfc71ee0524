"""A view: an output picture, and the ray that each of its pixels looks along."""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.core.errors import ViewError
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.core.views.options import WIDEST, is_numbers
from cubicfish_cli.core.wording import quoted

Rotation = tuple[float, float, float]

MAX_SIDE = 32_766
"""cv2.remap counts pixels in 16 bits."""


class Camera(Protocol):
    """What a map is made from.

    ``project`` takes camera-frame rays (..., 3) to pixels (..., 2), NaN outside the cone of
    half-angle ``max_angle_deg`` about +z where the camera may be trusted.
    """

    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) of the camera's photos, pixels."""

    @property
    def max_angle_deg(self) -> float:
        """Half-angle of the cone where the camera may be trusted."""

    def project(self, points: npt.ArrayLike, /) -> FloatArray:
        """Camera-frame rays (..., 3) -> pixels (..., 2)."""


@dataclass(frozen=True, kw_only=True)
class View(ABC):
    """An output picture.

    Attributes:
        size: (width, height), pixels.

    Raises:
        ViewError: an attribute is not usable.

    """

    kind: ClassVar[str]

    size: tuple[int, int]

    def __post_init__(self) -> None:
        if not is_numbers(self.size, 2) or not all(
            isinstance(side, int) and 1 <= side <= MAX_SIDE for side in self.size
        ):
            raise ViewError(
                f"a view's size must be two whole numbers from 1 to {MAX_SIDE}, "
                f"width and height, not {quoted(self.size)}"
            )

    @abstractmethod
    def rays(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels of the view (..., 2) -> rays in the camera's frame (..., 3), of any length.

        NaN where the view has no ray.
        """

    @abstractmethod
    def pixels(self, rays: npt.ArrayLike) -> FloatArray:
        """Camera-frame rays (..., 3) -> pixels of the view (..., 2), the inverse of :meth:`rays`.

        NaN where the view does not show the direction.
        """

    def parameters(self) -> dict[str, Any]:
        """What a kind of view adds to the record, as plain data."""
        values = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "size"}
        return {key: list(one) if isinstance(one, tuple) else one for key, one in values.items()}

    @abstractmethod
    def describe(self) -> str:
        """The view in a few words, after its size."""

    def to_json(self) -> str:
        """The view as JSON text: its kind, its size and :meth:`parameters`."""
        return json.dumps({"kind": self.kind, "size": list(self.size)} | self.parameters())

    def pixel_grid(self) -> FloatArray:
        """(H, W, 2) every pixel of the view."""
        width, height = self.size
        x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
        return np.stack([x, y], axis=-1)


@dataclass(frozen=True, kw_only=True)
class CentralView(View):
    """A view from the camera's own place: its pixels depend on directions alone.

    Attributes:
        focal: pixels; the scale of the picture at its middle, pixels per radian.
        rotation: rotation vector (radians) of camera_from_view: it turns a ray of the view
            into the camera's frame. Zero looks along the camera's axis.

    The view's axis meets the picture's middle, ((width − 1)/2, (height − 1)/2). A kind of view
    is told by two functions: which ray lies at an offset from the middle, and where a ray lies.
    """

    focal: float
    rotation: Rotation = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not is_numbers(self.rotation, 3):
            raise ViewError(
                "a view's rotation must be three finite numbers, a rotation vector in "
                f"radians, not {quoted(self.rotation)}"
            )
        if not is_numbers((self.focal,), 1) or self.focal <= 0:
            raise ViewError(
                f"a view's focal length must be positive, in pixels, not {quoted(self.focal)}"
            )

    @staticmethod
    @abstractmethod
    def flat_rays(flat: FloatArray) -> FloatArray:
        """Offsets in focal lengths (..., 2) -> rays of the view (..., 3); NaN off the view."""

    @staticmethod
    @abstractmethod
    def ray_offsets(rays: FloatArray) -> FloatArray:
        """The inverse of :meth:`flat_rays`; NaN where the view does not show the ray."""

    @classmethod
    @abstractmethod
    def least_focal(cls, size: tuple[int, int]) -> float:
        """The focal length at which a picture shows all that this kind of view sensibly can."""

    @classmethod
    def offset(cls, angle: float, axis: int) -> float:
        """Half a field (radians) along x (axis 0) or y (1) -> offset in focal lengths."""
        ray = np.array([0.0, 0.0, math.cos(angle)])
        ray[axis] = math.sin(angle)
        return float(cls.ray_offsets(ray)[axis])

    @classmethod
    def half_field(cls, offset: float, axis: int) -> float:
        """The inverse of :meth:`offset`; the largest half field for an offset beyond it."""
        flat = np.zeros(2)
        flat[axis] = offset
        ray = cls.flat_rays(flat)
        angle = math.atan2(ray[axis], ray[2])
        return math.radians(WIDEST[cls.kind][axis][0]) / 2 if math.isnan(angle) else angle

    @classmethod
    def with_field(
        cls,
        field_deg: float,
        size: tuple[int, int],
        rotation: Rotation = (0.0, 0.0, 0.0),
        *,
        vertical: bool = False,
    ) -> CentralView:
        """The view whose width (or height) spans ``field_deg`` degrees from edge to edge.

        The field is one that this kind of view can show, as :data:`~.options.WIDEST` has them.

        Raises:
            ViewError: the size is not usable.

        """
        axis = int(vertical)
        side = size[axis] if is_numbers(size, 2) else 1  # what is wrong with it is said below
        focal = side / 2 / cls.offset(math.radians(field_deg) / 2, axis)
        return cls(size=size, focal=focal, rotation=rotation)

    @property
    def hfov_deg(self) -> float:
        """Field across the width, from edge to edge, degrees."""
        return 2 * math.degrees(self.half_field(self.size[0] / 2 / self.focal, 0))

    @property
    def vfov_deg(self) -> float:
        """Field down the height, from edge to edge, degrees."""
        return 2 * math.degrees(self.half_field(self.size[1] / 2 / self.focal, 1))

    @property
    def middle(self) -> tuple[float, float]:
        """The pixel that the view's axis meets."""
        return (self.size[0] - 1) / 2, (self.size[1] - 1) / 2

    @property
    def camera_matrix(self) -> FloatArray:
        """(3, 3) focal length and middle of the picture; of a pinhole where that is flat."""
        x, y = self.middle
        return np.array([[self.focal, 0, x], [0, self.focal, y], [0, 0, 1]])

    @property
    def camera_from_view(self) -> FloatArray:
        """Rotation matrix (3, 3)."""
        return matrix_of_rotation(np.array(self.rotation))

    def slopes(self) -> tuple[FloatArray, FloatArray]:
        """Offsets from the middle in focal lengths: x (W,) of the columns, y (H,) of the rows."""
        x, y = self.middle
        width, height = self.size
        columns, rows = np.arange(width, dtype=float), np.arange(height, dtype=float)
        return (columns - x) / self.focal, (rows - y) / self.focal

    def view_rays(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels of the view (..., 2) -> rays in the view's own frame (..., 3), of any length."""
        return self.flat_rays((np.asarray(pixel, float) - self.middle) / self.focal)

    def rays(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels of the view (..., 2) -> rays in the camera's frame (..., 3)."""
        return self.view_rays(pixel) @ self.camera_from_view.T

    def pixels(self, rays: npt.ArrayLike) -> FloatArray:
        """Camera-frame rays (..., 3) -> pixels of the view (..., 2); NaN where it shows none."""
        flat = self.ray_offsets(np.asarray(rays, float) @ self.camera_from_view)
        return flat * self.focal + self.middle

    def describe(self) -> str:
        """Kind, field and focal length."""
        kind = "" if self.kind == "perspective" else f"{self.kind}, "
        return f"{kind}{self.hfov_deg:.1f}° across, focal length {self.focal:.2f} px"


def rotation_from_angles(
    *, yaw_deg: float = 0.0, pitch_deg: float = 0.0, roll_deg: float = 0.0
) -> Rotation:
    """The rotation of a view that looks to the right, up, and then rolls clockwise.

    ``yaw_deg`` turns to the right, ``pitch_deg`` up, and ``roll_deg`` turns the view clockwise
    about its own axis, as seen by the camera.

    Raises:
        ViewError: an angle is not finite.

    """
    if not is_numbers((yaw_deg, pitch_deg, roll_deg), 3):
        raise ViewError("a view's angles must be finite numbers of degrees")
    turns = ((0, yaw_deg, 0), (pitch_deg, 0, 0), (0, 0, roll_deg))
    yaw, pitch, roll = (cv2.Rodrigues(np.radians(np.array(turn, float)))[0] for turn in turns)
    return rotation_vector(np.asarray(yaw @ pitch @ roll, float))


def matrix_of_rotation(vector: FloatArray) -> FloatArray:
    """Rotation vector (3,) -> rotation matrix (3, 3)."""
    return np.asarray(cv2.Rodrigues(np.asarray(vector, float).reshape(3, 1))[0], float)


def rotation_vector(matrix: FloatArray) -> Rotation:
    """Rotation matrix (3, 3) -> rotation vector."""
    x, y, z = cv2.Rodrigues(matrix)[0].ravel().tolist()
    return x, y, z
