"""The kinds of central views: how directions are laid out in a picture.

With the view's axis along z, x to the right and y down, and offsets (x, y) from the picture's
middle in focal lengths:

- perspective: (x, y) = (X, Y) / Z. Straight lines are straight.
- cylindrical: x = azimuth about the vertical, y = Y / √(X² + Z²). Verticals are straight.
- equirectangular: x = azimuth, y = elevation below the horizon.
- epipolar-cylindrical: x = X / √(Y² + Z²), y = angle about the horizontal, downwards.
- epipolar-equirectangular: x = angle from the plane X = 0, y = angle about the horizontal.
- stereographic: radius 2·tan(θ/2), θ from the axis. Shapes are kept in the small.
- equidistant: radius θ. What "fisheye" means in most programs.

The epipolar ones are those of the same name on their sides. Where x points from one camera to
another, all that a row shows lies in one plane through both: their rows agree beyond 180° too.

The six faces of a cube about the camera are six pictures.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from cubicfish_cli.core.angles import columns, unit_rays
from cubicfish_cli.core.types import FloatArray
from cubicfish_cli.core.views.options import FACES
from cubicfish_cli.core.views.view import (
    CentralView,
    Rotation,
    rotation_from_angles,
    rotation_vector,
)

# What a picture sensibly shows where its scale grows without bounds towards the limit.
_FLAT_SIDE_DEG = 160.0
_STEREOGRAPHIC_SIDE_DEG = 320.0
# The seam of a full turn may be met by rounding.
_SLACK = 1e-9
# A picture's very edge lies beyond the seam, so that the seam itself is in the picture.
_BEYOND = 1 - 1e-6


class PerspectiveView(CentralView):
    """A flat picture without distortion: straight lines are straight."""

    kind: ClassVar[str] = "perspective"

    @staticmethod
    def flat_rays(flat: FloatArray) -> FloatArray:
        """(x, y, 1)."""
        return np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1)

    @staticmethod
    def ray_offsets(rays: FloatArray) -> FloatArray:
        """(X, Y) / Z; nothing that lies behind."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(rays[..., 2:] > 0, rays[..., :2] / rays[..., 2:], np.nan)

    @classmethod
    def least_focal(cls, size: tuple[int, int]) -> float:
        """160° along the longer side: beyond, nearly all pixels go to the rim."""
        return max(size) / 2 / math.tan(math.radians(_FLAT_SIDE_DEG / 2))


class CylindricalView(CentralView):
    """A picture on an upright cylinder, unrolled."""

    kind: ClassVar[str] = "cylindrical"

    @staticmethod
    def flat_rays(flat: FloatArray) -> FloatArray:
        """(sin x, y, cos x)."""
        x = _within(flat[..., 0], math.pi)
        return np.stack([np.sin(x), flat[..., 1], np.cos(x)], axis=-1)

    @staticmethod
    def ray_offsets(rays: FloatArray) -> FloatArray:
        """Azimuth and slope; nothing straight up or down."""
        x, y, z = columns(rays)
        across = np.hypot(x, z)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(across > 0, y / across, np.nan)
        return np.stack([np.where(across > 0, np.arctan2(x, z), np.nan), slope], axis=-1)

    @classmethod
    def least_focal(cls, size: tuple[int, int]) -> float:
        """160° down the height, or the full turn, whichever is smaller."""
        return (
            min(size[1] / 2 / math.tan(math.radians(_FLAT_SIDE_DEG / 2)), size[0] / (2 * math.pi))
            * _BEYOND
        )


class EquirectangularView(CentralView):
    """Longitude and latitude: what panorama viewers take."""

    kind: ClassVar[str] = "equirectangular"

    @staticmethod
    def flat_rays(flat: FloatArray) -> FloatArray:
        """(sin x cos y, sin y, cos x cos y)."""
        x, y = _within(flat[..., 0], math.pi), _within(flat[..., 1], math.pi / 2)
        return np.stack([np.sin(x) * np.cos(y), np.sin(y), np.cos(x) * np.cos(y)], axis=-1)

    @staticmethod
    def ray_offsets(rays: FloatArray) -> FloatArray:
        """Azimuth and elevation."""
        x, y, z = columns(rays)
        return np.stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))], axis=-1)

    @classmethod
    def least_focal(cls, size: tuple[int, int]) -> float:
        """The whole sphere."""
        return min(size[0] / (2 * math.pi), size[1] / math.pi) * _BEYOND


class _OnItsSide(CentralView):
    """A kind of view with x and y exchanged; the kind itself comes behind it in the bases."""

    @classmethod
    def flat_rays(cls, flat: FloatArray) -> FloatArray:
        """See :meth:`CentralView.flat_rays`."""
        return super().flat_rays(flat[..., ::-1])[..., [1, 0, 2]]  # type: ignore[safe-super]

    @classmethod
    def ray_offsets(cls, rays: FloatArray) -> FloatArray:
        """See :meth:`CentralView.ray_offsets`."""
        return super().ray_offsets(rays[..., [1, 0, 2]])[..., ::-1]  # type: ignore[safe-super]

    @classmethod
    def least_focal(cls, size: tuple[int, int]) -> float:
        """See :meth:`CentralView.least_focal`."""
        return super().least_focal((size[1], size[0]))  # type: ignore[safe-super]


class EpipolarCylindricalView(_OnItsSide, CylindricalView):
    """A picture on a cylinder that lies on its side, unrolled."""

    kind: ClassVar[str] = "epipolar-cylindrical"


class EpipolarEquirectangularView(_OnItsSide, EquirectangularView):
    """Angles along, and about, the horizontal."""

    kind: ClassVar[str] = "epipolar-equirectangular"


class StereographicView(CentralView):
    """A "little planet": circles stay circles."""

    kind: ClassVar[str] = "stereographic"

    @staticmethod
    def flat_rays(flat: FloatArray) -> FloatArray:
        """(x, y, 1 − r²/4)."""
        square = np.sum(flat * flat, axis=-1, keepdims=True)
        return np.concatenate([flat, 1 - square / 4], axis=-1)

    @staticmethod
    def ray_offsets(rays: FloatArray) -> FloatArray:
        """2 (X, Y) / (|X| + Z); nothing straight behind."""
        rays = unit_rays(rays)
        down = 1 + rays[..., 2:]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(down > 0, 2 * rays[..., :2] / down, np.nan)

    @classmethod
    def least_focal(cls, size: tuple[int, int]) -> float:
        """320° along the longer side."""
        return max(size) / 4 / math.tan(math.radians(_STEREOGRAPHIC_SIDE_DEG / 4))


class EquidistantView(CentralView):
    """An ideal fisheye: the distance from the middle is the angle from the axis."""

    kind: ClassVar[str] = "equidistant"

    @staticmethod
    def flat_rays(flat: FloatArray) -> FloatArray:
        """(sin θ (x, y)/θ, cos θ)."""
        theta = _within(np.hypot(flat[..., 0], flat[..., 1])[..., None], math.pi)
        return np.concatenate([flat * np.sinc(theta / math.pi), np.cos(theta)], axis=-1)

    @staticmethod
    def ray_offsets(rays: FloatArray) -> FloatArray:
        """θ (X, Y) / √(X² + Y²); nothing straight behind."""
        x, y, z = columns(rays)
        rho = np.hypot(x, y)
        theta = np.arctan2(rho, z)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(rho > 0, theta / rho, np.where(z > 0, 1.0, np.nan))
        return rays[..., :2] * scale[..., None]

    @classmethod
    def least_focal(cls, size: tuple[int, int]) -> float:
        """The full turn along the shorter side."""
        return min(size) / (2 * math.pi) * _BEYOND


def _within(angle: FloatArray, limit: float) -> FloatArray:
    return np.where(np.abs(angle) <= limit * (1 + _SLACK), angle, np.nan)


def face_views(side: int, rotation: Rotation = (0.0, 0.0, 0.0)) -> dict[str, PerspectiveView]:
    """The faces of a cube turned by ``rotation``: flat views of 90°, ``side`` pixels square."""
    turn = PerspectiveView(size=(1, 1), focal=1.0, rotation=rotation).camera_from_view
    views = {}
    for name, (yaw, pitch) in FACES.items():
        face = PerspectiveView(
            size=(side, side),
            focal=side / 2,
            rotation=rotation_from_angles(yaw_deg=yaw, pitch_deg=pitch),
        )
        whole = rotation_vector(turn @ face.camera_from_view)
        views[name] = PerspectiveView(size=face.size, focal=face.focal, rotation=whole)
    return views
