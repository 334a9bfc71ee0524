"""Key figures of a camera, for every command that names one."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from cubicfish.angles import angle_from_axis
from cubicfish.judge.fit_record import FitRecord, Origin
from cubicfish.judge.verdict import Verdict, photo_verdicts, verdict
from cubicfish.models.cubic import CubicCamera

if TYPE_CHECKING:
    from cubicfish.models.point import PointCamera

_STEPS = 512  # pixels that are tested between the axis and an edge
_ROUNDED_DEG = 1.0


@dataclass(frozen=True, kw_only=True)
class FieldSeen:
    """The field of view of a photo, degrees: to its edges, or as far as the camera may be trusted.

    Attributes:
        horizontal, vertical: along the row and the column of the axis's pixel.
        diagonal: the larger of the two from corner to corner.

    """

    horizontal: float
    vertical: float
    diagonal: float

    def beyond(self, max_angle_deg: float) -> bool:
        """Whether a photo shows more than is calibrated, in its middle row or column."""
        return max(self.horizontal, self.vertical) > 2 * max_angle_deg + _ROUNDED_DEG


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
        """``1280x960 px, sees 174° x 143° (...), focal length 384.2 px, ..., good``."""
        fit, seen = self.fit, self.field
        parts = ["{}x{} px".format(*self.camera.image_size)]
        if seen is not None:
            around = f"{seen.horizontal:.0f}° x {seen.vertical:.0f}°"
            parts.append(f"sees {around} ({seen.diagonal:.0f}° diagonal)")
            if self.max_angle_deg is not None and seen.beyond(self.max_angle_deg):
                parts.append(f"calibrated to {self.max_angle_deg:.0f}° from the axis")
        if self.axis is not None:
            focal, (x, y) = self.axis
            parts.append(f"focal length {sum(focal) / 2:.1f} px")
            parts.append(f"principal point ({x:.1f}, {y:.1f})")
        if math.isfinite(fit.held_out_rms_px):
            parts.append(f"held-out error {fit.held_out_rms_px:.3f} px")
        elif self.is_measured:
            parts.append(f"error {fit.rms_px:.3f} px RMS")
        if self.is_measured:
            parts.append(self.verdict.words)
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
    ways = (1 - share) * [x, y] + share * ends
    rays = np.concatenate([camera.unproject(ways), camera.photo_rays(ends)[None]])
    angles = np.rad2deg(angle_from_axis(rays))
    extent = np.where(np.isfinite(angles), angles, 0.0).max(axis=0)  # the largest on each way
    horizontal, vertical, *diagonals = (extent[::2] + extent[1::2]).tolist()
    return FieldSeen(horizontal=horizontal, vertical=vertical, diagonal=max(diagonals))
