"""Key figures of a camera, for every command that names one."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from cubicfish.angles import angle_from_axis, azimuth
from cubicfish.judge.fit_record import FitRecord, Origin
from cubicfish.judge.verdict import Verdict, photo_verdicts, share_within, verdict
from cubicfish.models.cubic import CubicCamera
from cubicfish.models.sphere import ray_at
from cubicfish.types import FloatArray

if TYPE_CHECKING:
    from cubicfish.models.point import PointCamera

_STEPS = 512  # pixels that are tested between the axis and an edge
_DIFFERENCE = 1e-3  # radians, for slopes
_WORTH_SAYING_DEG = 0.5


@dataclass(frozen=True, kw_only=True)
class FieldSeen:
    """The field of view of a photo, degrees, to its edges, whether calibrated there or not.

    Beyond the calibrated field the lens is extrapolated, up to 90° from the axis, from where on a
    photo may be black.

    Attributes:
        horizontal, vertical: along the row and the column of the axis's pixel.
        diagonal: the larger of the two from corner to corner.
        off_deg: how far the three may be off where they are extrapolated: one standard deviation,
            0 where they are calibrated; infinite where the photo may show more.

    """

    horizontal: float
    vertical: float
    diagonal: float
    off_deg: tuple[float, ...] = (0.0, 0.0, 0.0)

    def __str__(self) -> str:
        """``at least 174° x 143° ± 1° (at least 174° diagonal)``."""
        sizes = (self.horizontal, self.vertical, self.diagonal)
        across, along, diagonal = map(_write_extent, sizes, self.off_deg)
        return f"{across} x {along} ({diagonal} diagonal)"


def _write_extent(size_deg: float, off_deg: float) -> str:
    if math.isinf(off_deg):
        return f"at least {size_deg:.0f}°"
    return f"{size_deg:.0f}°" + f" ± {off_deg:.0f}°" * (off_deg >= _WORTH_SAYING_DEG)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CameraFacts:
    """A camera's key figures; None stands for what is not known.

    Attributes:
        camera: the camera, of either lift.
        fit: how well the camera fits.
        made_by: where the camera comes from, plain data; empty where nothing is known.

    """

    camera: CubicCamera | PointCamera
    fit: FitRecord = dataclasses.field(default_factory=FitRecord)
    made_by: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def origin(self) -> Origin:
        """Where the camera comes from, as far as ``made_by`` says it."""
        return Origin.of(self.made_by)

    @property
    def title(self) -> str:
        """The name that its owner gave the camera; empty without one."""
        return self.origin.title or ""

    @property
    def is_measured(self) -> bool:
        """Whether the record of a fit is known."""
        return math.isfinite(self.fit.rms_px)

    @property
    def max_angle_deg(self) -> float | None:
        """Angle from the axis to which the camera may be trusted; None for the ``point`` lift."""
        return self.camera.max_angle_deg if isinstance(self.camera, CubicCamera) else None

    @cached_property
    def field(self) -> FieldSeen | None:
        """The field of view of a photo; None for the ``point`` lift."""
        return field_seen(self.camera) if isinstance(self.camera, CubicCamera) else None

    @cached_property
    def axis(self) -> tuple[list[float], list[float]] | None:
        """Focal lengths, pixels per radian on the axis, and the pixel of the axis, x and y each."""
        if not isinstance(self.camera, CubicCamera):
            return None
        pixel, slope = self.camera.project_jacobian(np.array([0.0, 0.0, 1.0]))
        return [float(slope[0, 0]), float(slope[1, 1])], pixel.tolist()

    @property
    def axis_sigma(self) -> list[tuple[float, ...] | None]:
        """One standard deviation of both figures of :attr:`axis`; None where it is not known."""
        sigma = self.fit.uncertainty
        both = sigma.focal_px, sigma.principal_point_px
        return [own if len(own) == 2 and all(map(math.isfinite, own)) else None for own in both]

    @cached_property
    def calibrated_share(self) -> float:
        """The share of the photo where the camera is calibrated, 0 to 1."""
        return share_within(self.camera.outline(), self.camera.image_size)

    @cached_property
    def verdict(self) -> Verdict:
        """The verdict, with its reasons, that ``cubicfish calibrate`` prints."""
        return verdict(self.fit, self.camera.image_size, self.camera.outline())

    @cached_property
    def photo_verdicts(self) -> list[Verdict]:
        """The verdict on each photo of the fit."""
        return photo_verdicts(self.fit, self.camera.image_size)

    @property
    def line(self) -> str:
        """The title, if there is one, and the key figures."""
        return f"{self.title}: {self.figures}" if self.title else self.figures

    @property
    def figures(self) -> str:
        """The lens, its errors and the verdict, ``..., held-out error 0.388 px, good``."""
        fit, parts = self.fit, [self.lens_line]
        if math.isfinite(fit.held_out_rms_px):
            parts.append(f"held-out error {fit.held_out_rms_px:.3f} px")
        elif self.is_measured:
            parts.append(f"error {fit.rms_px:.3f} px RMS")
        if math.isfinite(fit.uncertainty.median_px):
            parts.append(f"uncertainty ±{fit.uncertainty.median_px:.3f} px")
        if self.is_measured:
            parts.append(self.verdict.words)
        return ", ".join(parts)

    @property
    def lens_line(self) -> str:
        """``1280x960 px, sees at least 174° x 143° (...), calibrated to ..., focal length ...``."""
        seen, parts = self.field, ["{}x{} px".format(*self.camera.image_size)]
        if seen is not None:
            parts.append(f"sees {seen}, calibrated to {self.max_angle_deg:.0f}° from the axis")
        if self.axis is not None:
            focal, (x, y) = self.axis
            parts.append(f"focal length {sum(focal) / 2:.1f} px")
            parts.append(f"principal point ({x:.1f}, {y:.1f})")
        return ", ".join(parts)


def field_seen(camera: CubicCamera) -> FieldSeen:
    """Measure the field of view of a camera's photos."""
    width, height = camera.image_size
    left, right, top, bottom = -0.5, width - 0.5, -0.5, height - 0.5
    x, y = camera.project(np.array([0.0, 0.0, 1.0]))
    edges = [(left, y), (right, y), (x, top), (x, bottom)]
    corners = [(left, top), (right, bottom), (left, bottom), (right, top)]
    ends = np.array(edges + corners)
    share = np.linspace(0, 1, _STEPS)[:, None, None]
    rays = camera.unproject((1 - share) * [x, y] + share * ends)
    angles = np.rad2deg(angle_from_axis(rays))
    extent = np.where(np.isfinite(angles), angles, 0.0).max(axis=0)  # the largest on each way
    farther, off = _extrapolate(camera, ends - [x, y])
    short = np.isnan(angles[-1])
    extent = np.where(short & np.isfinite(farther), np.fmax(farther, extent), extent)
    off = np.where(short, np.where(np.isfinite(farther), off, np.inf), 0.0)
    both, spread = extent[::2] + extent[1::2], np.hypot(off[::2], off[1::2])
    wider = 2 + int(both[3] > both[2])
    ways = [0, 1, wider]
    across, along, diagonal = both[ways].tolist()
    return FieldSeen(
        horizontal=across, vertical=along, diagonal=diagonal, off_deg=tuple(spread[ways].tolist())
    )


def _extrapolate(camera: CubicCamera, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Continue a camera beyond its field along the tangent of its profile.

    Args:
        camera: the camera.
        offset: (N, 2) from the axis's pixel, of pixels beyond the field.

    Returns:
        The angles (N,) from the axis, degrees, NaN beyond 90°, and how far they may be off: as they
        would be if the slope changed out there by as much as over the field's outer half.

    """
    end, way = np.deg2rad(camera.max_angle_deg), azimuth(offset)
    angles = end - _DIFFERENCE * np.array([[0.0], [1.0]]) - np.array([0.0, end / 2])[:, None, None]
    pixel = camera.project(ray_at(*np.broadcast_arrays(angles, way)))
    radius = np.linalg.norm(pixel - camera.project(np.array([0.0, 0.0, 1.0])), axis=-1)
    slope, before = (radius[:, 0] - radius[:, 1]) / _DIFFERENCE
    beyond = (np.linalg.norm(offset, axis=-1) - radius[0, 0]) / slope
    off = np.abs(slope - before) / slope * beyond
    shown = (slope > 0) & (end + beyond <= np.pi / 2)
    return np.where(shown, np.rad2deg(end + beyond), np.nan), np.rad2deg(off)
