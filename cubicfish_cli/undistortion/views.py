"""What to render: an output picture and the ray that each of its pixels looks along.

A view is a plain record. A further projection (cylindrical, equirectangular, ...) is a further
subclass of :class:`View`, entered in the table at the end of this module.
"""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import ViewError
from cubicfish_cli.wording import did_you_mean, quoted

FloatArray = npt.NDArray[np.float64]

MAX_SIDE = 32_766
"""cv2.remap counts pixels in 16 bits."""
MAX_DEFAULT_FIELD_DEG = 120.0
"""A flat picture of a wider field spends nearly all its pixels on the rim."""


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
        rotation: rotation vector (radians) of camera_from_view: it turns a ray of the view
            into the camera's frame. Zero looks along the camera's axis.

    Raises:
        ViewError: the size or the rotation is not usable.

    """

    kind: ClassVar[str]

    size: tuple[int, int]
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not _numbers(self.size, 2) or not all(
            isinstance(side, int) and 1 <= side <= MAX_SIDE for side in self.size
        ):
            raise ViewError(
                f"a view's size must be two whole numbers from 1 to {MAX_SIDE}, "
                f"width and height, not {quoted(self.size)}"
            )
        if not _numbers(self.rotation, 3):
            raise ViewError(
                "a view's rotation must be three finite numbers, a rotation vector in "
                f"radians, not {quoted(self.rotation)}"
            )

    @abstractmethod
    def view_rays(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels of the view (..., 2) -> rays in the view's frame (..., 3), of any length.

        NaN where the view has no ray.
        """

    def rays(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels of the view (..., 2) -> rays in the camera's frame (..., 3)."""
        return self.view_rays(pixel) @ self.camera_from_view.T

    @property
    def camera_from_view(self) -> FloatArray:
        """Rotation matrix (3, 3)."""
        return np.asarray(cv2.Rodrigues(np.array(self.rotation).reshape(3, 1))[0], float)

    @abstractmethod
    def _parameters(self) -> dict[str, Any]:
        """What a subclass adds to the record, as plain data."""

    @classmethod
    @abstractmethod
    def _from_parameters(
        cls, size: tuple[int, int], rotation: tuple[float, float, float], data: Mapping[str, Any]
    ) -> View:
        """The inverse of :meth:`_parameters`."""

    def to_json(self) -> str:
        """The view as JSON text, which :func:`view_from_json` reads."""
        record = {"kind": self.kind, "size": list(self.size)}
        return json.dumps(record | self._parameters() | {"rotation": list(self.rotation)})


@dataclass(frozen=True, kw_only=True)
class PerspectiveView(View):
    """A flat picture without distortion: straight lines are straight.

    Attributes:
        focal: pixels; the scale of the picture at its middle.

    The axis meets the picture's middle, ((width − 1)/2, (height − 1)/2).
    """

    kind: ClassVar[str] = "perspective"

    focal: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not _numbers((self.focal,), 1) or self.focal <= 0:
            raise ViewError(
                f"a view's focal length must be positive, in pixels, not {quoted(self.focal)}"
            )

    @classmethod
    def with_field(
        cls,
        hfov_deg: float,
        size: tuple[int, int],
        rotation: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> PerspectiveView:
        """The view whose width, from edge to edge, spans ``hfov_deg`` degrees.

        Raises:
            ViewError: the field is not between 0° and 180°, or the size is not usable.

        """
        if not _numbers((hfov_deg,), 1) or not 0 < hfov_deg < 180:
            raise ViewError(
                f"a perspective view's field must be between 0° and 180°, not {quoted(hfov_deg)}: "
                "choose about 120 or less"
            )
        width = size[0] if _numbers(size, 2) else 1  # what is wrong with it is said below
        return cls(size=size, focal=_focal(width, hfov_deg), rotation=rotation)

    @property
    def hfov_deg(self) -> float:
        """Field across the width, from edge to edge, degrees."""
        return 2 * math.degrees(math.atan(self.size[0] / 2 / self.focal))

    @property
    def camera_matrix(self) -> FloatArray:
        """(3, 3) pinhole matrix of the output picture."""
        x, y = self._middle
        return np.array([[self.focal, 0, x], [0, self.focal, y], [0, 0, 1]])

    def slopes(self) -> tuple[FloatArray, FloatArray]:
        """Rays (x, y, 1) in the view's frame: x (W,) of the columns and y (H,) of the rows."""
        x, y = self._middle
        width, height = self.size
        columns, rows = np.arange(width, dtype=float), np.arange(height, dtype=float)
        return (columns - x) / self.focal, (rows - y) / self.focal

    def view_rays(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels of the view (..., 2) -> rays (x, y, 1) in the view's frame (..., 3)."""
        flat = (np.asarray(pixel, float) - self._middle) / self.focal
        return np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1)

    @property
    def _middle(self) -> tuple[float, float]:
        return (self.size[0] - 1) / 2, (self.size[1] - 1) / 2

    def _parameters(self) -> dict[str, Any]:
        return {"focal": self.focal}

    @classmethod
    def _from_parameters(
        cls, size: tuple[int, int], rotation: tuple[float, float, float], data: Mapping[str, Any]
    ) -> PerspectiveView:
        _only(data, ("focal",))
        return cls(size=size, rotation=rotation, focal=data["focal"])


def default_view(camera: Camera) -> PerspectiveView:
    """The view to use where nobody asks for another: flat, as large as the photo.

    It keeps the photo's scale on the camera's axis, unless the longer side would then span
    more than :data:`MAX_DEFAULT_FIELD_DEG` or than the camera's valid field.

    Raises:
        ViewError: the camera has no pixel about its axis, or its photos are too large.

    """
    step = 1e-4
    around = np.array([[step, 0, 1], [-step, 0, 1], [0, step, 1], [0, -step, 1]])
    right, left, down, up = camera.project(around)
    (ux, vx), (uy, vy) = (right - left) / (2 * step), (down - up) / (2 * step)
    area = ux * vy - uy * vx
    if not area > 0:
        raise ViewError("the camera has no sound scale on its axis: calibrate it again")
    widest = min(MAX_DEFAULT_FIELD_DEG, 2 * camera.max_angle_deg)
    focal = max(float(np.sqrt(area)), _focal(max(camera.image_size), widest))
    return PerspectiveView(size=camera.image_size, focal=focal)


def rotation_from_angles(
    *, yaw_deg: float = 0.0, pitch_deg: float = 0.0, roll_deg: float = 0.0
) -> tuple[float, float, float]:
    """The rotation of a view that looks to the right, up, and then rolls clockwise.

    ``yaw_deg`` turns to the right, ``pitch_deg`` up, and ``roll_deg`` turns the view clockwise
    about its own axis, as seen by the camera.

    Raises:
        ViewError: an angle is not finite.

    """
    if not _numbers((yaw_deg, pitch_deg, roll_deg), 3):
        raise ViewError("a view's angles must be finite numbers of degrees")
    turns = ((0, yaw_deg, 0), (pitch_deg, 0, 0), (0, 0, roll_deg))
    yaw, pitch, roll = (cv2.Rodrigues(np.radians(np.array(turn, float)))[0] for turn in turns)
    x, y, z = cv2.Rodrigues(yaw @ pitch @ roll)[0].ravel().tolist()
    return x, y, z


def view_from_json(text: str) -> View:
    """The view that :meth:`View.to_json` wrote.

    Raises:
        ViewError: the text is not JSON, or not the record of a view.

    """
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as problem:
        raise ViewError("the view is not JSON text") from problem
    if not isinstance(data, dict):
        raise ViewError("the view is not a JSON object")
    for key in ("kind", "size", "rotation"):
        if key not in data:
            raise ViewError(f"the view has no {quoted(key)}")
    kind, size, rotation = data.pop("kind"), data.pop("size"), data.pop("rotation")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise ViewError(
            f"unknown kind of view {quoted(kind)}: {did_you_mean(str(kind), sorted(_KINDS))}"
        )
    if not isinstance(size, list) or not isinstance(rotation, list):
        raise ViewError("the view's size and rotation must be lists of numbers")
    return _KINDS[kind]._from_parameters(tuple(size), tuple(rotation), data)  # type: ignore[arg-type]


def _focal(side: int, field_deg: float) -> float:
    return side / 2 / math.tan(math.radians(field_deg) / 2)


def _numbers(values: object, count: int) -> bool:
    """Whether ``values`` is a tuple of ``count`` finite numbers."""
    return (
        isinstance(values, tuple)
        and len(values) == count
        and all(
            isinstance(value, int | float) and not isinstance(value, bool) and _finite(value)
            for value in values
        )
    )


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond every float
        return False


def _only(data: Mapping[str, Any], keys: tuple[str, ...]) -> None:
    for key in keys:
        if key not in data:
            raise ViewError(f"the view has no {quoted(key)}")
    for key in data:
        if key not in keys:
            raise ViewError(f"the view has an unknown key {quoted(key)}")


_KINDS: Mapping[str, type[View]] = {view.kind: view for view in (PerspectiveView,)}
