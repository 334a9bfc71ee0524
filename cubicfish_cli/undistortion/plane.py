"""The metric picture of a plane in the scene, such as a board's: as many pixels a unit everywhere.

Pixels are points of the plane, not mere directions, so that the picture is right from wherever
the photo was taken, as long as the plane's place in the camera's frame is known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import ViewError
from cubicfish_cli.undistortion.view import FloatArray, View, is_numbers, only_keys

Vector = tuple[float, float, float]

_SQUARE_TOLERANCE = 1e-6


@dataclass(frozen=True, kw_only=True)
class PlaneView(View):
    """A plane, seen squarely from its front.

    Attributes:
        origin: the point of the plane, in the camera's frame, that pixel (0, 0) shows.
        x_axis, y_axis: unit vectors in the camera's frame, of growing column and row. Their
            cross product points away from the viewer, as the target file has it.
        pixels_a_unit: scale of the picture, pixels a unit of length.

    Raises:
        ViewError: an attribute is not usable, or the camera is behind the plane, whose
            picture would be mirrored.

    """

    kind: ClassVar[str] = "plane"

    origin: Vector
    x_axis: Vector
    y_axis: Vector
    pixels_a_unit: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not all(is_numbers(v, 3) for v in (self.origin, self.x_axis, self.y_axis)):
            raise ViewError("a plane's origin and axes must be three finite numbers each")
        if not is_numbers((self.pixels_a_unit,), 1) or self.pixels_a_unit <= 0:
            raise ViewError("a plane's picture must have a positive number of pixels a unit")
        axes = np.array([self.x_axis, self.y_axis])
        if not np.allclose(axes @ axes.T, np.eye(2), atol=_SQUARE_TOLERANCE):
            raise ViewError("a plane's axes must be unit vectors at a right angle")
        if np.cross(*axes) @ np.array(self.origin) <= 0:
            raise ViewError(
                "the camera is behind this plane, whose picture would be mirrored: "
                "check the target's axes and the pose"
            )

    @property
    def camera_from_pixel(self) -> FloatArray:
        """(3, 3) that takes (column, row, 1) to the point of the plane, camera frame."""
        scale = 1 / self.pixels_a_unit
        axes = np.array([self.x_axis, self.y_axis]) * scale
        return np.column_stack([axes[0], axes[1], self.origin])

    def rays(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> points of the plane in the camera's frame (..., 3)."""
        pixel = np.asarray(pixel, float)
        matrix = self.camera_from_pixel
        return pixel @ matrix[:, :2].T + matrix[:, 2]

    def pixels(self, rays: npt.ArrayLike) -> FloatArray:
        """Rays in the camera's frame (..., 3) -> pixels where they meet the plane (..., 2)."""
        homogeneous = np.asarray(rays, float) @ np.linalg.inv(self.camera_from_pixel).T
        with np.errstate(divide="ignore", invalid="ignore"):
            pixel = homogeneous[..., :2] / homogeneous[..., 2:]
            return np.where(homogeneous[..., 2:] > 0, pixel, np.nan)

    def describe(self) -> str:
        """The scale."""
        return f"the plane at {self.pixels_a_unit:.4g} pixels a unit"

    def parameters(self) -> dict[str, Any]:
        """Place and scale."""
        return {
            "origin": list(self.origin),
            "x_axis": list(self.x_axis),
            "y_axis": list(self.y_axis),
            "pixels_a_unit": self.pixels_a_unit,
        }

    @classmethod
    def from_parameters(cls, size: tuple[int, int], data: Mapping[str, Any]) -> PlaneView:
        """The view of a record."""
        only_keys(data, ("origin", "x_axis", "y_axis", "pixels_a_unit"))
        vectors = {key: data[key] for key in ("origin", "x_axis", "y_axis")}
        if not all(isinstance(vector, list) for vector in vectors.values()):
            raise ViewError("a plane's origin and axes must be lists of numbers")
        return cls(
            size=size,
            pixels_a_unit=data["pixels_a_unit"],
            **{key: tuple(vector) for key, vector in vectors.items()},
        )
