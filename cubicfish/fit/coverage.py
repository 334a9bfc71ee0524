"""Where corners are, how far beyond them the camera is extrapolated, and what that costs.

Squares of the picture show which of its parts hold corners. At the rim, where a lens bends most and
corners are few, squares are too coarse: each direction from the axis is examined by itself there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cubicfish.angles import angle_from_axis, azimuth
from cubicfish.geometry import inside_polygon
from cubicfish.judge.fit_record import CoverageExtent
from cubicfish.judge.uncertainty import CERTAIN_PX, TRUSTED_PX, of_size
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.sphere import ray_at
from cubicfish.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from cubicfish.models.point import PointCamera

# Cells along the photo's shorter side by which coverage is counted.
_CELLS = 8
# A camera beyond 90° sees itself where corners leave a hole in the middle that is this wide and
# round: the largest of the hole's angles in eight directions is at most this many times the
# smallest.
_BLIND_DEG, _ROUND = 30.0, 1.5
Sigma = Callable[[FloatArray], FloatArray]

_DIRECTIONS = 72
# A corner stands for directions so far to both sides, and for so much more of the field outwards.
_BESIDE_DEG = 10.0
_BEYOND = 0.05
_NEARLY_ALL = 0.9
# In a direction, corners reach the rim if they end within this share of where all corners end.
_NEAR = 0.1
# The rim's errors are those of the outermost corners, the middle's those within half the field.
_RIM_SHARE, _FEWEST_AT_THE_RIM = 0.1, 20
_MIDDLE = 0.5
# Beyond the corners the camera may be trusted as long as it is certain, or at most so many times as
# uncertain as at their edge; one degree is granted in any case.
_TIMES = 2.0
_LEAST_MARGIN_DEG = 1.0
_STEP_DEG = 0.25
_RINGS = 8
_EDGE_SLACK_RAD = 1e-6


def blind_angle(points: FloatArray) -> float:
    """The angle from its axis within which a camera sees itself, radians; 0 where it does not.

    A camera that looks into a mirror is in the middle of its own picture: the nearest corners are
    at about the same angle all around the axis.

    Args:
        points: (N, 3) all corners, camera frame; NaN ones are ignored.

    """
    points = points[np.isfinite(points[:, 0])]
    angle = angle_from_axis(points)
    eighth = np.floor(azimuth(points[:, :2]) / (np.pi / 4)).astype(int) % 8
    nearest = np.full(8, np.inf)
    np.minimum.at(nearest, eighth, angle)
    low, high = nearest.min(), nearest.max()
    round_ = np.radians(_BLIND_DEG) <= low and high <= _ROUND * low
    return float(low) if round_ and angle.max(initial=0.0) > np.pi / 2 else 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldCells:
    """The field where a camera may be trusted, in the squares by which coverage is counted.

    Attributes:
        cell: side of a square, pixels.
        field: (rows, columns) whether a square's middle lies in the field, and where the camera
            does not see itself.
        hit: (rows, columns) whether a square holds a corner.
        blind: the angle from its axis within which the camera sees itself, radians.

    """

    cell: float
    field: BoolArray
    hit: BoolArray
    blind: float

    @classmethod
    def of(cls, camera: CubicCamera | PointCamera, pixel: FloatArray) -> FieldCells:
        """The field of a camera in squares, and which of them hold corners (N, 2), pixels."""
        width, height = camera.image_size
        cell = min(camera.image_size) / _CELLS
        x = np.arange(cell / 2, width, cell)
        y = np.arange(cell / 2, height, cell)
        middle = np.stack(np.meshgrid(x, y), axis=-1)
        field = inside_polygon(middle.reshape(-1, 2), camera.outline()).reshape(middle.shape[:2])
        blind = 0.0
        if isinstance(camera, CubicCamera):
            blind = blind_angle(camera.unproject(pixel))
            if blind:
                field &= ~(angle_from_axis(camera.unproject(middle)) < blind)
        column, row = np.floor(pixel / cell).astype(int).T
        kept = (column >= 0) & (row >= 0) & (column < len(x)) & (row < len(y))
        hit = np.zeros_like(field)
        hit[row[kept], column[kept]] = True
        return cls(cell=cell, field=field, hit=hit, blind=blind)

    @property
    def coverage(self) -> float:
        """Share of the field's squares that hold a corner, 0 to 1."""
        return float((self.hit & self.field).sum() / max(self.field.sum(), 1))

    @property
    def empty(self) -> BoolArray:
        """(rows, columns) squares of the field without a corner."""
        return self.field & ~self.hit


def coverage_extent(
    camera: CubicCamera, points: FloatArray, residual: FloatArray, sigma: Sigma
) -> CoverageExtent:
    """Measure how well corners cover the field's rim.

    Args:
        camera: the camera.
        points: (N, 3) the corners of the fit in its frame.
        residual: (N, 2) their errors, pixels; NaN where the fit cannot tell one.
        sigma: gives the uncertainty of the pixels of unit rays (M, 3) -> (M,), pixels.

    """
    angle = np.rad2deg(angle_from_axis(points))
    covered = float(angle.max())
    at_edge = camera.edge(_DIRECTIONS)
    edge = np.rad2deg(angle_from_axis(at_edge))
    own = np.rad2deg(azimuth(points[:, :2]))
    around = np.arange(_DIRECTIONS) * 360 / _DIRECTIONS
    farthest = np.array([_find_farthest_beside(direction, own, angle) for direction in around])
    short = np.minimum(edge, covered) - farthest
    uncertain = sigma(at_edge)
    uncertain = uncertain[np.isfinite(uncertain)]
    rim, middle, rim_from = _measure_rim(angle, residual)
    return CoverageExtent(
        all_around_deg=_measure_all_around(farthest, edge, covered),
        rim_coverage=float(np.mean(short <= _NEAR * covered)),
        extrapolated_deg=float(np.median(np.maximum(edge - farthest, 0))),
        edge_uncertainty_px=float(np.median(uncertain)) if uncertain.size else np.nan,
        rim_from_deg=rim_from,
        rim_rms_px=rim,
        middle_rms_px=middle,
    )


def _find_farthest_beside(direction: float, azimuths: FloatArray, angle: FloatArray) -> float:
    """The largest angle (N,) of those whose azimuths (N,) are near a direction; all in degrees."""
    beside = np.abs((azimuths - direction + 180) % 360 - 180) <= _BESIDE_DEG
    return float(angle[beside].max(initial=0.0))


def trusted_angle_deg(camera: CubicCamera, covered_deg: float, sigma: Sigma) -> float:
    """How far from the axis the camera may be trusted: beyond its corners while it is certain.

    Args:
        camera: the camera; its own angle is the upper limit.
        covered_deg: angle from the axis up to which there are corners.
        sigma: as for :func:`coverage_extent`.

    """
    farthest = camera.max_angle_deg
    least = min(covered_deg + _LEAST_MARGIN_DEG, farthest)
    tried = np.append(np.arange(least, farthest, _STEP_DEG), farthest)
    limit = CERTAIN_PX * of_size(camera.image_size)
    around = np.linspace(0, 2 * np.pi, _DIRECTIONS, endpoint=False)
    rings = np.deg2rad(np.append(covered_deg, tried))
    angle, azimuths = np.meshgrid(rings, around, indexing="ij")
    rays = ray_at(angle.ravel(), azimuths.ravel())
    at_corners, *beyond = np.median(sigma(rays).reshape(angle.shape), axis=1)
    certain = np.array(beyond) <= max(limit, _TIMES * at_corners)
    last = len(tried) if certain.all() else int(certain.argmin())
    return float(tried[max(last - 1, 0)])


def certain_angle_deg(camera: CubicCamera, sigma: Sigma) -> float:
    """How far from the axis a camera is certain: within the corners too, where its rim is not.

    Args:
        camera: the camera, most of whose field is certain.
        sigma: as for :func:`coverage_extent`.

    Returns:
        The farthest angle where the median over the directions that the photo shows is below
        :data:`TRUSTED_PX`, degrees; the field's own end where it is so out there.

    """
    farthest = camera.max_angle_deg
    tried = np.append(np.arange(_STEP_DEG, farthest, _STEP_DEG), farthest)[::-1]
    around = np.linspace(0, 2 * np.pi, _DIRECTIONS, endpoint=False)
    edge = angle_from_axis(camera.edge(_DIRECTIONS)) + _EDGE_SLACK_RAD
    limit = TRUSTED_PX * of_size(camera.image_size)
    # From outside inwards, a few rings at once: most cameras are certain out there.
    for first in range(0, len(tried), _RINGS):
        rings = tried[first : first + _RINGS]
        angle, azimuths = np.meshgrid(np.deg2rad(rings), around, indexing="ij")
        own = sigma(ray_at(angle.ravel(), azimuths.ravel())).reshape(angle.shape)
        for deg, ring, there in zip(rings, own, angle <= edge, strict=True):
            if there.any() and np.median(ring[there]) < limit:
                return float(deg)
    return float(farthest)


def _measure_all_around(farthest: FloatArray, edge: FloatArray, covered: float) -> float:
    """The largest angle up to which corners are nearly all around, as far as the photo shows it."""
    angles = np.arange(1.0, covered, 1.0)
    shown = edge >= angles[:, None]
    near = farthest + _BEYOND * covered >= angles[:, None]
    share = (shown & near).sum(axis=1) / np.maximum(shown.sum(axis=1), 1)
    short = np.flatnonzero((share < _NEARLY_ALL) & shown.any(axis=1))
    return float(angles[short[0]] - 1) if short.size else covered


def _measure_rim(angle: FloatArray, residual: FloatArray) -> tuple[float, float, float]:
    """RMS at the rim and in the middle, and where the rim begins; NaN for too few corners."""
    known = np.isfinite(residual[:, 0])
    angle, residual = angle[known], residual[known]
    count = max(_FEWEST_AT_THE_RIM, round(_RIM_SHARE * len(angle)))
    if len(angle) < 3 * count:
        return np.nan, np.nan, np.nan
    start = float(np.floor(np.sort(angle)[-count]))
    square = np.sum(residual * residual, axis=1)
    rim, middle = square[angle >= start], square[angle <= _MIDDLE * start]
    if len(middle) < _FEWEST_AT_THE_RIM:
        middle = square[angle < start]
    if not middle.size:
        return np.nan, np.nan, np.nan
    return float(np.sqrt(rim.mean())), float(np.sqrt(middle.mean())), start
