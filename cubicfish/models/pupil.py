"""The entrance pupil of a fisheye moves: where a near point is seen depends on its distance.

Rays that come in from the side enter the lens farther forward, so no one point is the centre of
projection. Those at an angle θ from the axis meet it t·(θ/sin θ − 1) in front of where rays near
the axis do (Gennery 2006, "Generalized Camera Calibration Including Fish-Eye Lenses", of whose
series this is the first term; θ is that of the point as seen from the origin, which is enough and
needs no iteration). For boards at arm's length these millimetres are pixels; for distant points
they are nothing.
"""

import numpy as np

from cubicfish.types import FloatArray

# Rays whose sine of the angle from the axis is below this count as along it: no pupil moves there.
_ON_AXIS = 1e-6


def from_pupil(points: FloatArray, travel: float) -> FloatArray:
    """Points as seen from where their rays enter the lens.

    Args:
        points: (..., 3) in the camera frame, whose origin is the pupil of rays along the axis.
        travel: t, in the points' unit.

    Returns:
        (..., 3) the points less the pupil's place.

    """
    moved = np.array(points, float)
    if travel:
        moved[..., 2] -= travel * _compute_profile(moved)[0]
    return moved


def from_pupil_and_slopes(
    points: FloatArray, travel: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The points of :func:`from_pupil`, and the derivatives of their depths.

    Args:
        points: (N, 3) in the camera frame.
        travel: as in :func:`from_pupil`.

    Returns:
        (N, 3) points; (N, 3) d depth / d point, beside the point's own; (N,) d depth / d travel.

    """
    profile, length, sine, angle = _compute_profile(points)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = points / length[:, None]
        steepness = (sine - angle * along[:, 2]) / (sine**2 * length)
    # The direction in which the angle grows: away from the axis.
    outward = along * (along[:, 2] / sine)[:, None]
    outward[:, 2] -= 1 / sine
    moved = points.copy()
    moved[:, 2] -= travel * profile
    return moved, -(travel * steepness)[:, None] * outward, -profile


def pupil_profile(rays: FloatArray) -> FloatArray:
    """Where on the axis rays (..., 3) enter the lens if the pupil travels by 1: z (...)."""
    return _compute_profile(rays)[0]


def _compute_profile(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """θ/sin θ − 1 of points (..., 3), their lengths, sin θ and θ: (...)."""
    across = np.hypot(points[..., 0], points[..., 1])
    length = np.hypot(across, points[..., 2])  # of any size: squares would overflow
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = np.maximum(across / length, _ON_AXIS)
        angle = np.arctan2(sine, points[..., 2] / length)
    return angle / sine - 1, length, sine, angle
