"""A view: an output picture, and the ray that each of its pixels looks along.

Kinds of views from the camera's own place differ in how they lay out directions. With the view's
axis along z, x to the right and y down, and offsets (x, y) from the picture's middle in focal
lengths:

- perspective: (x, y) = (X, Y) / Z. Straight lines are straight.
- cylindrical: x = azimuth about the vertical, y = Y / √(X² + Z²). Verticals are straight.
- equirectangular: x = azimuth, y = elevation below the horizon.
- epipolar-cylindrical: x = X / √(Y² + Z²), y = angle about the horizontal, downwards.
- epipolar-equirectangular: x = angle from the plane X = 0, y = angle about the horizontal.
- stereographic: radius 2·tan(θ/2), θ from the axis. Shapes are kept in the small.
- equidistant: radius θ. What "fisheye" means in most programs.

The epipolar ones are those of the same name on their sides. Where x points from one camera to
another, all that a row shows lies in one plane through both: their rows agree beyond 180° too.

The six faces of a cube about the camera are six perspective views.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.angles import columns, unit_rays
from cubicfish.errors import ViewError
from cubicfish.types import FloatArray

Rotation = tuple[float, float, float]
Vector = tuple[float, float, float]
Field = tuple[float, bool]
"""How wide a field may be, degrees, and whether it may be just as wide or must stay below."""

MAX_SIDE = 32_766
"""cv2.remap counts pixels in 16 bits."""

# Largest offsets of pictures whose scale grows without bounds towards the limit: a sensible one
# ends at 80° or 160° from the middle.
_FLAT = math.tan(math.radians(80.0))
_PLANET = 2 * math.tan(math.radians(80.0))
# Rounding may put a direction this much beyond the seam of a full turn.
_SLACK = 1e-9
# A picture's very edge lies beyond the seam, so that the seam itself is in the picture.
_BEYOND = 1 - 1e-6


class PointProjector(Protocol):
    """Projects points: a camera, or P of the ``point`` lift."""

    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) of the photos, pixels."""

    def project(self, points: npt.ArrayLike, /) -> FloatArray:
        """Points (..., 3) -> pixels (..., 2), NaN where they are not seen."""


class Camera(PointProjector, Protocol):
    """Projects directions: rays of any length, NaN beyond a cone about +z."""

    @property
    def max_angle_deg(self) -> float:
        """Half-angle of the cone where the camera may be trusted."""


@dataclass(frozen=True, kw_only=True)
class View(ABC):
    """An output picture.

    Attributes:
        kind: how it lays out what it shows.
        size: (width, height), pixels.

    Raises:
        ViewError: a side has no pixel, or more than ``cv2.remap`` can count.

    """

    kind: str
    size: tuple[int, int]

    def __post_init__(self) -> None:
        width, height = self.size
        if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
            raise ViewError(
                f"a view's size is from 1 to {MAX_SIDE} pixels a side, not {width}x{height}"
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

    @abstractmethod
    def describe(self, unit: str = "unit") -> str:
        """The view in a few words, after its size; ``unit`` is what lengths are in."""

    def as_record(self) -> dict[str, Any]:
        """The view as plain data: its kind, its size, and what its kind adds."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return {key: list(one) if isinstance(one, tuple) else one for key, one in values.items()}


@dataclass(frozen=True, kw_only=True)
class Projection:
    """How a kind of view lays out directions.

    Attributes:
        rays: offsets in focal lengths (..., 2) -> rays of the view (..., 3); NaN off the view.
        offsets: the inverse; NaN where the view does not show the ray.
        most: the largest offsets along x and y that such a view sensibly shows.
        widest: the fields across and down that it can show.

    """

    rays: Callable[[FloatArray], FloatArray]
    offsets: Callable[[FloatArray], FloatArray]
    most: tuple[float, float]
    widest: tuple[Field, Field]

    @property
    def on_its_side(self) -> Projection:
        """The same with x and y exchanged."""
        return Projection(
            rays=lambda flat: self.rays(flat[..., ::-1])[..., [1, 0, 2]],
            offsets=lambda rays: self.offsets(rays[..., [1, 0, 2]])[..., ::-1],
            most=self.most[::-1],
            widest=self.widest[::-1],
        )


def _perspective_rays(flat: FloatArray) -> FloatArray:
    return np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1)


def _perspective_offsets(rays: FloatArray) -> FloatArray:
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing that lies behind
        return np.where(rays[..., 2:] > 0, rays[..., :2] / rays[..., 2:], np.nan)


def _cylindrical_rays(flat: FloatArray) -> FloatArray:
    x = _within(flat[..., 0], math.pi)
    return np.stack([np.sin(x), flat[..., 1], np.cos(x)], axis=-1)


def _cylindrical_offsets(rays: FloatArray) -> FloatArray:
    x, y, z = columns(rays)
    across = np.hypot(x, z)
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing straight up or down
        slope = np.where(across > 0, y / across, np.nan)
    return np.stack([np.where(across > 0, np.arctan2(x, z), np.nan), slope], axis=-1)


def _equirectangular_rays(flat: FloatArray) -> FloatArray:
    x, y = _within(flat[..., 0], math.pi), _within(flat[..., 1], math.pi / 2)
    return np.stack([np.sin(x) * np.cos(y), np.sin(y), np.cos(x) * np.cos(y)], axis=-1)


def _equirectangular_offsets(rays: FloatArray) -> FloatArray:
    x, y, z = columns(rays)
    return np.stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))], axis=-1)


def _stereographic_rays(flat: FloatArray) -> FloatArray:
    square = np.sum(flat * flat, axis=-1, keepdims=True)
    return np.concatenate([flat, 1 - square / 4], axis=-1)


def _stereographic_offsets(rays: FloatArray) -> FloatArray:
    rays = unit_rays(rays)
    down = 1 + rays[..., 2:]
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing straight behind
        return np.where(down > 0, 2 * rays[..., :2] / down, np.nan)


def _equidistant_rays(flat: FloatArray) -> FloatArray:
    theta = _within(np.hypot(flat[..., 0], flat[..., 1])[..., None], math.pi)
    return np.concatenate([flat * np.sinc(theta / math.pi), np.cos(theta)], axis=-1)


def _equidistant_offsets(rays: FloatArray) -> FloatArray:
    x, y, z = columns(rays)
    rho = np.hypot(x, y)
    theta = np.arctan2(rho, z)
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing straight behind
        scale = np.where(rho > 0, theta / rho, np.where(z > 0, 1.0, np.nan))
    return rays[..., :2] * scale[..., None]


def _within(angle: FloatArray, limit: float) -> FloatArray:
    return np.where(np.abs(angle) <= limit * (1 + _SLACK), angle, np.nan)


_CYLINDRICAL = Projection(
    rays=_cylindrical_rays,
    offsets=_cylindrical_offsets,
    most=(math.pi, _FLAT),
    widest=((360, True), (180, False)),
)
_EQUIRECTANGULAR = Projection(
    rays=_equirectangular_rays,
    offsets=_equirectangular_offsets,
    most=(math.pi, math.pi / 2),
    widest=((360, True), (180, True)),
)
PROJECTIONS: Mapping[str, Projection] = {
    "perspective": Projection(
        rays=_perspective_rays,
        offsets=_perspective_offsets,
        most=(_FLAT, _FLAT),
        widest=((180, False), (180, False)),
    ),
    "cylindrical": _CYLINDRICAL,
    "equirectangular": _EQUIRECTANGULAR,
    "epipolar-cylindrical": _CYLINDRICAL.on_its_side,
    "epipolar-equirectangular": _EQUIRECTANGULAR.on_its_side,
    "stereographic": Projection(
        rays=_stereographic_rays,
        offsets=_stereographic_offsets,
        most=(_PLANET, _PLANET),
        widest=((360, False), (360, False)),
    ),
    "equidistant": Projection(
        rays=_equidistant_rays,
        offsets=_equidistant_offsets,
        most=(math.pi, math.pi),
        widest=((360, True), (360, True)),
    ),
}


@dataclass(frozen=True, kw_only=True)
class CentralView(View):
    """A view from the camera's own place: its pixels depend on directions alone.

    Attributes:
        kind: one of :data:`PROJECTIONS`.
        focal: pixels; the scale of the picture at its middle, pixels per radian.
        rotation: rotation vector (radians) of camera_from_view: it turns a ray of the view
            into the camera's frame. Zero looks along the camera's axis.

    The view's axis meets the picture's middle, ((width − 1)/2, (height − 1)/2).
    """

    focal: float
    rotation: Rotation = (0.0, 0.0, 0.0)

    @classmethod
    def with_field(
        cls,
        kind: str,
        field_deg: float,
        size: tuple[int, int],
        rotation: Rotation = (0.0, 0.0, 0.0),
        *,
        vertical: bool = False,
    ) -> CentralView:
        """The view whose width (or height) spans ``field_deg`` degrees from edge to edge.

        The field is one that this kind of view can show: :attr:`Projection.widest`.

        Raises:
            ViewError: the size is not usable.

        """
        axis, half = int(vertical), math.radians(field_deg) / 2
        ray = np.array([0.0, 0.0, math.cos(half)])
        ray[axis] = math.sin(half)
        focal = size[axis] / 2 / float(PROJECTIONS[kind].offsets(ray)[axis])
        return cls(kind=kind, size=size, focal=focal, rotation=rotation)

    @property
    def least_focal(self) -> float:
        """The focal length at which the picture shows all that its kind sensibly can."""
        most = PROJECTIONS[self.kind].most
        focal = [side / 2 / end for side, end in zip(self.size, most, strict=True)]
        # Near the limit of an endless kind, nearly all pixels go to the rim; other kinds have an
        # end.
        return max(focal) if self.kind in _ENDLESS else min(focal) * _BEYOND

    def half_field(self, offset: float, axis: int) -> float:
        """An offset in focal lengths along x (axis 0) or y (1) -> half a field, radians.

        The largest half field for an offset beyond that.
        """
        flat = np.zeros(2)
        flat[axis] = offset
        ray = PROJECTIONS[self.kind].rays(flat)
        angle = math.atan2(ray[axis], ray[2])
        return PROJECTIONS[self.kind].most[axis] if math.isnan(angle) else angle

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
        """(3, 3) focal length and middle of the picture: a pinhole's for a perspective view."""
        x, y = self.middle
        return np.array([[self.focal, 0, x], [0, self.focal, y], [0, 0, 1]])

    @property
    def camera_from_view(self) -> FloatArray:
        """Rotation matrix (3, 3)."""
        return matrix_of_rotation(np.array(self.rotation))

    def rays(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels of the view (..., 2) -> rays in the camera's frame (..., 3)."""
        flat = (np.asarray(pixel, float) - self.middle) / self.focal
        return PROJECTIONS[self.kind].rays(flat) @ self.camera_from_view.T

    def pixels(self, rays: npt.ArrayLike) -> FloatArray:
        """Camera-frame rays (..., 3) -> pixels of the view (..., 2); NaN where it shows none."""
        own = np.asarray(rays, float) @ self.camera_from_view
        return PROJECTIONS[self.kind].offsets(own) * self.focal + self.middle

    def describe(self, unit: str = "unit") -> str:
        """Kind, field and focal length."""
        kind = "" if self.kind == "perspective" else f"{self.kind}, "
        return f"{kind}{self.hfov_deg:.1f}° across, focal length {self.focal:.2f} px"


_ENDLESS = ("perspective", "stereographic")


@dataclass(frozen=True, kw_only=True)
class PlaneView(View):
    """A plane, seen squarely from its front.

    Attributes:
        origin: the point of the plane, in the camera's frame, that pixel (0, 0) shows.
        x_axis, y_axis: unit vectors in the camera's frame, of growing column and row.
        pixels_per_unit: scale of the picture, pixels per unit of length.

    """

    kind: str = "plane"
    origin: Vector
    x_axis: Vector
    y_axis: Vector
    pixels_per_unit: float

    @property
    def camera_from_pixel(self) -> FloatArray:
        """(3, 3) that takes (column, row, 1) to the point of the plane, camera frame."""
        scale = 1 / self.pixels_per_unit
        axes = np.array([self.x_axis, self.y_axis]) * scale
        return np.column_stack([axes[0], axes[1], self.origin])

    def rays(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> points of the plane in the camera's frame (..., 3)."""
        pixel = np.asarray(pixel, float)
        matrix = self.camera_from_pixel
        return pixel @ matrix[:, :2].T + matrix[:, 2]

    def pixels(self, rays: npt.ArrayLike) -> FloatArray:
        """Rays in the camera's frame (..., 3) -> pixels where they meet the plane (..., 2)."""
        homogeneous = unit_rays(rays) @ np.linalg.inv(self.camera_from_pixel).T
        with np.errstate(divide="ignore", invalid="ignore"):
            pixel = homogeneous[..., :2] / homogeneous[..., 2:]
            return np.where(homogeneous[..., 2:] > 0, pixel, np.nan)

    def describe(self, unit: str = "unit") -> str:
        """The scale."""
        return f"the plane at {self.pixels_per_unit:.4g} pixels per {unit}"


def rotation_from_angles(
    yaw_deg: float = 0.0, pitch_deg: float = 0.0, roll_deg: float = 0.0
) -> Rotation:
    """The rotation of a view that looks to the right, up, and then rolls clockwise.

    ``yaw_deg`` turns to the right, ``pitch_deg`` up, and ``roll_deg`` turns the view clockwise
    about its own axis, as seen by the camera.
    """
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


FACES: Mapping[str, tuple[float, float]] = {
    "front": (0, 0),
    "right": (90, 0),
    "back": (180, 0),
    "left": (-90, 0),
    "up": (0, 90),
    "down": (0, -90),
}
"""Where each face of a cube looks: yaw, pitch."""


def face_views(side: int, rotation: Rotation = (0.0, 0.0, 0.0)) -> dict[str, CentralView]:
    """Faces of a cube turned by ``rotation``: perspective views of 90°, ``side`` pixels square."""
    front = CentralView(kind="perspective", size=(side, side), focal=side / 2, rotation=rotation)
    views = {}
    for name, angles in FACES.items():
        face = matrix_of_rotation(np.array(rotation_from_angles(*angles)))
        views[name] = replace(front, rotation=rotation_vector(front.camera_from_view @ face))
    return views
