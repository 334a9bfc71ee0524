"""The six faces of a cube about the camera, as six pictures or as one cross."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import ViewError
from cubicfish_cli.types import FloatArray
from cubicfish_cli.undistortion.projections import PerspectiveView
from cubicfish_cli.undistortion.view import (
    Rotation,
    View,
    is_numbers,
    rotation_from_angles,
    rotation_vector,
)

# Where each face looks (yaw, pitch) and where it is in the cross (column, row): the faces
# above and below the front one continue it.
FACES: Mapping[str, tuple[tuple[float, float], tuple[int, int]]] = {
    "front": ((0, 0), (1, 1)),
    "right": ((90, 0), (2, 1)),
    "back": ((180, 0), (3, 1)),
    "left": ((-90, 0), (0, 1)),
    "up": ((0, 90), (1, 0)),
    "down": ((0, -90), (1, 2)),
}


def face_views(side: int, rotation: Rotation = (0.0, 0.0, 0.0)) -> dict[str, PerspectiveView]:
    """The faces of a cube turned by ``rotation``: flat views of 90°, ``side`` pixels square."""
    turn = PerspectiveView(size=(1, 1), focal=1.0, rotation=rotation).camera_from_view
    views = {}
    for name, ((yaw, pitch), _) in FACES.items():
        face = PerspectiveView(
            size=(side, side),
            focal=side / 2,
            rotation=rotation_from_angles(yaw_deg=yaw, pitch_deg=pitch),
        )
        whole = rotation_vector(turn @ face.camera_from_view)
        views[name] = PerspectiveView(size=face.size, focal=face.focal, rotation=whole)
    return views


@dataclass(frozen=True, kw_only=True)
class CrossView(View):
    """A cube unfolded into one picture: up, a row of left, front, right and back, and down.

    Attributes:
        rotation: of the front face, as for other views.

    The size must be 4 to 3; the five corners between the faces stay empty.
    """

    kind: ClassVar[str] = "cross"

    rotation: Rotation = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        width, height = self.size
        if width % 4 or width * 3 != height * 4:
            raise ViewError(
                f"a cube's cross is four faces wide and three high, which {width}x{height} is "
                f"not: choose {4 * (-(-width // 4))}x{3 * (-(-width // 4))}"
            )
        if not is_numbers(self.rotation, 3):
            raise ViewError("a view's rotation must be three finite numbers")

    @property
    def side(self) -> int:
        """Side of a face, pixels."""
        return self.size[0] // 4

    def placed_faces(self) -> Iterator[tuple[tuple[int, int], PerspectiveView]]:
        """Each face with the pixel (column, row) of its top-left corner."""
        for name, face in face_views(self.side, self.rotation).items():
            column, row = FACES[name][1]
            yield (column * self.side, row * self.side), face

    def rays(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> camera-frame rays (..., 3), NaN between the faces."""
        pixel = np.asarray(pixel, float)
        rays = np.full((*pixel.shape[:-1], 3), np.nan)
        for corner, face in self.placed_faces():
            own = pixel - corner
            inside = ((own >= -0.5) & (own < self.side - 0.5)).all(axis=-1)
            rays[inside] = face.rays(own[inside])
        return rays

    def pixels(self, rays: npt.ArrayLike) -> FloatArray:
        """Camera-frame rays (..., 3) -> pixels (..., 2)."""
        rays = np.asarray(rays, float)
        pixel = np.full((*rays.shape[:-1], 2), np.nan)
        for corner, face in self.placed_faces():
            own = face.pixels(rays)
            with np.errstate(invalid="ignore"):
                inside = ((own >= -0.5) & (own <= self.side - 0.5)).all(axis=-1)
            pixel[inside] = own[inside] + corner
        return pixel

    def describe(self) -> str:
        """What it is, and the faces' side."""
        return f"cube as a cross, faces of {self.side} px"
