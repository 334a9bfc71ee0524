"""Key figures of a camera, for every command that names one."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cubicfish_cli.core.angles import angle_from_axis
from cubicfish_cli.core.assess.fit_record import FitRecord, Origin, origin_of
from cubicfish_cli.core.assess.verdict import Verdict, verdict
from cubicfish_cli.core.codes import words
from cubicfish_cli.core.lenses.cubic import CubicCamera
from cubicfish_cli.core.lenses.point import PointCamera

_STEPS = 512  # pixels that are looked at between the axis and an edge
_ROUNDED_DEG = 1.0


@dataclass(frozen=True, kw_only=True)
class FieldSeen:
    """The angle that a photo spans, degrees: to its edges, or as far as it may be trusted.

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
    """A camera in the figures that people ask for first; what is not known is None.

    Attributes:
        camera: the camera, of either lift.
        fit: how well it fits.
        made_by: where it comes from, plain data; empty where nothing is known.

    """

    camera: CubicCamera | PointCamera
    fit: FitRecord = dataclasses.field(default_factory=FitRecord)
    made_by: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def origin(self) -> Origin:
        """Where it comes from, as far as that is plain."""
        return origin_of(self.made_by)

    @property
    def title(self) -> str:
        """What its owner calls it; empty without a name."""
        return self.origin.title or ""

    @property
    def is_measured(self) -> bool:
        """Whether a fit is on record."""
        return math.isfinite(self.fit.rms_px)

    @property
    def max_angle_deg(self) -> float | None:
        """As far from the axis the camera may be trusted."""
        return self.camera.max_angle_deg if isinstance(self.camera, CubicCamera) else None

    @cached_property
    def field(self) -> FieldSeen | None:
        """The field that a photo shows."""
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
        """One standard deviation of both, from the corners' noise."""
        sigma = self.fit.uncertainty
        both = sigma.focal_px, sigma.principal_point_px
        return [own if len(own) == 2 and all(map(math.isfinite, own)) else None for own in both]

    @cached_property
    def verdict(self) -> Verdict:
        """What the calibration is worth, and why: what ``cubicfish calibrate`` prints."""
        return verdict(self.fit, self.camera.image_size, self.camera.outline())

    @property
    def line(self) -> str:
        """All that matters in one line, behind the title."""
        return str(words("camera").camera_line(self))


def field_seen(camera: CubicCamera) -> FieldSeen:
    """The angles that a photo of a camera spans."""
    width, height = camera.image_size
    left, right, top, bottom = -0.5, width - 0.5, -0.5, height - 0.5
    x, y = camera.project(np.array([0.0, 0.0, 1.0]))

    def reach(to_x: float, to_y: float) -> float:
        """The largest angle from the axis towards a place on the photo's edge, degrees."""
        share = np.linspace(0, 1, _STEPS)[:, None]
        way = (1 - share) * [x, y] + share * [to_x, to_y]
        rays = np.concatenate([camera.unproject(way), camera.photo_rays(way[-1:])])
        angle = np.rad2deg(angle_from_axis(rays[np.isfinite(rays[:, 0])]))
        return float(angle.max()) if len(angle) else 0.0

    return FieldSeen(
        horizontal=reach(left, y) + reach(right, y),
        vertical=reach(x, top) + reach(x, bottom),
        diagonal=max(
            reach(left, top) + reach(right, bottom), reach(left, bottom) + reach(right, top)
        ),
    )
