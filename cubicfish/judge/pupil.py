"""The effect of the moving entrance pupil: how far it displaces a near point."""

from dataclasses import dataclass

import numpy as np

from cubicfish.models.cubic import CubicCamera
from cubicfish.models.pupil import from_pupil
from cubicfish.models.sphere import ray_at
from cubicfish.types import FloatArray

_DIRECTIONS = 72


@dataclass(frozen=True, kw_only=True)
class PupilEffect:
    """How much farther out a near point at the edge of the corners is seen than a distant one.

    Attributes:
        travel: travel of the entrance pupil (:mod:`cubicfish.models.pupil`), in ``units``.
        distance: median distance of the corners from the camera.
        units: unit of both; None where it is not known.
        rim_px: how much farther from the axis a point at that distance is seen, pixels.

    """

    travel: float
    distance: float
    units: str | None = None
    rim_px: float


def pupil_effect(camera: CubicCamera, points: FloatArray, covered: float) -> PupilEffect:
    """Measure the effect of the moving entrance pupil.

    Args:
        camera: the camera.
        points: (N, 3) corners in its frame and unit.
        covered: angle from the axis up to which there are corners, radians.

    """
    distance = float(np.median(np.linalg.norm(points, axis=1)))
    around = np.linspace(0, 2 * np.pi, _DIRECTIONS, endpoint=False)
    far = ray_at(np.full(_DIRECTIONS, covered), around)
    near = from_pupil(distance * far, camera.pupil_travel)
    near /= np.linalg.norm(near, axis=1)[:, None]
    moved = camera.pixel_and_slope(near)[0] - camera.pixel_and_slope(far)[0]
    outward = np.sum(moved * far[:, :2], axis=1) / np.linalg.norm(far[:, :2], axis=1)
    return PupilEffect(
        travel=camera.pupil_travel,
        distance=distance,
        units=camera.units,
        rim_px=float(np.median(outward)),
    )
