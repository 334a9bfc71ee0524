"""Two cameras of one size, pixel by pixel: how far apart they see the same ray."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from cubicfish.angles import angle_from_axis
from cubicfish.arrays import Refusal
from cubicfish.errors import FitError, ViewError
from cubicfish.fit.alignment import Project, turned_onto
from cubicfish.geometry import nearest_rotation, pixel_grid
from cubicfish.judge.fit_record import ErrorStatistics
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.sphere import all_around, ray_at
from cubicfish.solve.poses import vector_from_rotation
from cubicfish.solve.statistics import error_statistics, rings
from cubicfish.types import FloatArray, IntArray
from cubicfish.views.view import PointProjector
from cubicfish.wording import Brief

# Pixels that numbers are taken at, and rays that the frames are aligned by.
_PIXELS = 40_000
_ALIGNING_PIXELS = 2_500
_FEW_PIXELS = 400
# A ray and the one whose pixel is nearest in the other lens say how the frames are turned; the
# farthest of such pairs come from outside the other's field and are left out in the next round.
_START_ROUNDS = 4
_START_RAYS = 500
_DISTANCES = 500_000  # at once
_START_SHARE = 0.8


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Comparison(Brief):
    """Differences of a second camera to a first one, in the first one's pixels.

    Attributes:
        first, second: the cameras.
        rotation: (3, 3) from the first camera's frame to the second's, the one that makes the
            differences smallest.
        scale: pixels of the first camera's photos for one of the second's.
        statistics: over a grid of pixels of the common field; ``corners`` counts the pixels.
        common_share: how much of the first camera's field the second one sees too.
        rings: by angle from the first camera's axis: ``from_deg``, ``to_deg``, ``rms_px``,
            ``max_px`` and the number of pixels.

    """

    first: CubicCamera
    second: CubicCamera
    rotation: FloatArray
    scale: float
    statistics: ErrorStatistics
    common_share: float
    rings: list[dict[str, float]]

    @property
    def rotation_deg(self) -> float:
        """Angle of the rotation between the frames."""
        return float(np.rad2deg(np.linalg.norm(vector_from_rotation(self.rotation[None]))))

    def difference(self, pixel: FloatArray) -> FloatArray:
        """Where the second camera sees what the first sees at ``pixel``, less it.

        Args:
            pixel: (..., 2) of the first camera.

        Returns:
            (..., 2) pixels of the first camera; NaN outside the common field.

        """
        rays = self.first.unproject(pixel)
        return _project_scaled(self.second, self.scale, rays @ self.rotation.T) - pixel

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON."""
        record = self.statistics.as_record()
        record["pixels"] = record.pop("corners")
        return {
            **record,
            "common_share": self.common_share,
            "rotation_deg": self.rotation_deg,
            "scale": self.scale,
            "by_angle": self.rings,
        }


def _project_scaled(camera: CubicCamera, scale: float, points: FloatArray) -> FloatArray:
    """Pixels of points in photos of a camera that were scaled."""
    return (camera.project(points) + 0.5) * scale - 0.5


def compare(first: CubicCamera, second: CubicCamera) -> Comparison:
    """Differences of two cameras over their common field, frames aligned.

    Raises:
        FitError: the photos' sizes are neither equal nor one an exact rescale of the other, or
            the cameras have no field in common.

    """
    scale = _compute_scale(first.image_size, second.image_size)
    pixel = pixel_grid(first.image_size, _PIXELS)
    rays = first.unproject(pixel)
    if np.isfinite(rays[:, 0]).sum() < _FEW_PIXELS:  # a narrow field falls between them
        pixel = _spread_near_axis(first)
        rays = first.unproject(pixel)
    seen = np.flatnonzero(np.isfinite(rays[:, 0]))
    some = seen[:: max(1, len(seen) // _ALIGNING_PIXELS)]
    project, near = partial(_project_scaled, second, scale), (rays[some], pixel[some])
    _, rotation = turned_onto(project, *near, _fit_turn(project, *near))
    miss = project(rays[seen] @ rotation.T) - pixel[seen]
    common = np.isfinite(miss[:, 0])
    if not common.any():
        raise FitError(
            "the two cameras see no common field: are both of the same lens, in photos that were "
            "neither cropped nor turned?"
        )
    return Comparison(
        first=first,
        second=second,
        rotation=rotation,
        scale=scale,
        statistics=error_statistics(miss[common]),
        common_share=float(common.mean()),
        rings=rings(angle_from_axis(rays[seen][common]), miss[common]),
    )


def aligned_difference(
    first: PointProjector, second: PointProjector, rays: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Pixel differences of two lenses under the rotation that makes them smallest.

    A calibration determines the camera frame only as well as its corners do, and the poses make
    up for the rest: two calibrations of one lens may differ by a small rotation and still be the
    same camera. The rotation may also be large, such as between frames with other axes.

    Args:
        first: one lens.
        second: the other.
        rays: (N, 3) unit rays in the second lens's frame; best spread over its whole field.

    Returns:
        Differences first(R d) − second(d), (N, 2) pixels, NaN where either lens
        has no pixel; and R (3, 3).

    Raises:
        ViewError: ``rays`` are no such array.

    """
    rays = Refusal(error=ViewError).numbers(rays, "rays", 3)
    wanted = second.project(rays)
    return turned_onto(first.project, rays, wanted, _fit_turn(first.project, rays, wanted))


def _fit_turn(project: Project, rays: FloatArray, wanted: FloatArray) -> FloatArray:
    """Turn each ray onto that ray whose pixel in a lens is nearest to its own (Wahba 1965)."""
    # Rays of the whole sphere: the lens may look along any axis of its frame.
    probes = all_around(max(4 * len(rays), 4000))
    seen = project(probes)
    good = np.isfinite(seen).all(axis=1)
    pairs = np.flatnonzero(np.isfinite(wanted).all(axis=1))
    if good.sum() < 3 or len(pairs) < 3:
        return np.eye(3)
    some = pairs[:: max(1, len(pairs) // _START_RAYS)]
    nearest, distance = _find_nearest(wanted[some], seen[good])
    matched, own = probes[good][nearest], rays[some]
    near = distance <= np.quantile(distance, _START_SHARE)
    rotation = np.eye(3)
    for _ in range(_START_ROUNDS):
        if near.sum() < 3:
            break
        rotation = nearest_rotation(matched[near].T @ own[near])
        off = np.linalg.norm(own @ rotation.T - matched, axis=1)
        near = off <= np.quantile(off, _START_SHARE)
    return rotation


def _find_nearest(pixel: FloatArray, among: FloatArray) -> tuple[IntArray, FloatArray]:
    """Find the nearest of pixels (M, 2) to each of (N, 2): (N,) its index and its distance."""
    square, parts = np.sum(among**2, axis=1), len(pixel) * len(among) // _DISTANCES + 1
    blocks = np.array_split(pixel, parts)
    index = np.concatenate([np.argmin(square - 2 * one @ among.T, axis=1) for one in blocks])
    return index, np.linalg.norm(pixel - among[index], axis=1)


def _spread_near_axis(camera: CubicCamera) -> FloatArray:
    """Pixels (N, 2) spread evenly over the part of the photo that a camera of narrow field sees."""
    angle = np.deg2rad(np.geomspace(1e-3, 90, 200))[:, None]
    around = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    fan = ray_at(*np.broadcast_arrays(angle, around))
    edge = camera.project(fan.reshape(-1, 3))
    edge = edge[np.isfinite(edge[:, 0])]
    if not len(edge):
        return np.zeros((0, 2))
    side = round(_PIXELS**0.5)
    low = np.maximum(edge.min(axis=0), 0)
    high = np.minimum(edge.max(axis=0), np.subtract(camera.image_size, 1))
    x, y = np.linspace(low, high, side).T
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _compute_scale(first: tuple[int, int], second: tuple[int, int]) -> float:
    if first[0] * second[1] != first[1] * second[0]:
        raise FitError(
            "the cameras are for photos of {}x{} and {}x{} pixels, and neither size is the other "
            "one scaled: compare cameras of one size".format(*first, *second)
        )
    return first[0] / second[0]
