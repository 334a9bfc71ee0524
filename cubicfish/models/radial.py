"""The radial reference: the Kannala–Brandt lens (Kannala & Brandt 2006, as OpenCV's fisheye).

r(θ) = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸), θ the angle from the optical axis, which may
exceed 90°. It starts the cubic fit, is its prior where there are no corners, and stands beside it
in every figure.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from cubicfish.angles import columns, unit_rays
from cubicfish.geometry import inverse_of_growing, kannala_brandt, kannala_brandt_slope
from cubicfish.models.lens import Lens
from cubicfish.types import FloatArray

# Below this ratio of ρ to |X| the profile's series replaces its quotient, which is 0/0 on the axis.
_NEAR_AXIS = 1e-6
_NO_TERM = 1e-20


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialCamera(Lens):
    """A Kannala–Brandt lens.

    Attributes:
        image_size: (width, height), pixels.
        fx, fy: focal lengths, pixels per radian.
        cx, cy: principal point, pixels.
        k: (4,) coefficients k1..k4 of the radial profile.

    """

    name = "kannala_brandt"
    label = "Kannala–Brandt"

    fx: float
    fy: float
    cx: float
    cy: float
    k: FloatArray

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[RadialCamera, ...]:
        """See :class:`Lens`: the lens itself."""
        return (radial,)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """(8,) of :attr:`parameters`."""
        return ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")

    @property
    def parameters(self) -> FloatArray:
        """(8,): fx, fy, cx, cy, k1..k4."""
        return np.array([self.fx, self.fy, self.cx, self.cy, *self.k])

    @classmethod
    def from_parameters(
        cls, parameters: npt.ArrayLike, image_size: tuple[int, int]
    ) -> RadialCamera:
        """Build from (8,): fx, fy, cx, cy, k1..k4."""
        values = np.asarray(parameters, float)
        fx, fy, cx, cy = (float(value) for value in values[:4])
        return cls(image_size=image_size, fx=fx, fy=fy, cx=cx, cy=cy, k=values[4:8].copy())

    def with_parameters(self, parameters: FloatArray) -> RadialCamera:
        """The same lens with other parameters (8,)."""
        return self.from_parameters(parameters, self.image_size)

    def profile(self, theta: npt.ArrayLike) -> FloatArray:
        """Normalised radius r(θ): (...,) radians -> (...,)."""
        return kannala_brandt(np.asarray(theta, float), self.k)

    @cached_property
    def max_angle(self) -> float:
        """Largest angle to which r(θ) grows, radians, at most π."""
        k1, k2, k3, k4 = self.k
        slope = np.array([9 * k4, 7 * k3, 5 * k2, 3 * k1, 1.0])
        # Coefficients that are nothing beside 1 up to π; np.roots would divide by them.
        slope[np.abs(slope) < _NO_TERM] = 0
        roots = np.roots(slope)
        squares = roots[np.abs(roots.imag) < 1e-9 * np.maximum(1, np.abs(roots.real))].real
        squares = squares[squares > 0]
        return float(min(np.pi, np.sqrt(squares.min()))) if squares.size else float(np.pi)

    def project(self, points: npt.ArrayLike) -> FloatArray:
        """Points (..., 3) of any length -> pixels (..., 2); NaN beyond :attr:`max_angle`."""
        x, y, z = columns(unit_rays(points))
        rho = np.hypot(x, y)
        theta = np.arctan2(rho, z)
        radius = self.profile(theta)
        # Both formulas are evaluated everywhere, and the one that is valid is taken.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            scale = np.where(rho > _NEAR_AXIS, radius / rho, 1 / z)
            pixel = np.stack(
                [self.fx * x * scale + self.cx, self.fy * y * scale + self.cy], axis=-1
            )
        seen = theta <= self.max_angle
        seen &= (z > 0) | (rho > _NEAR_AXIS)  # straight back has no azimuth
        return np.where(seen[..., None], pixel, np.nan)

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`Lens`; for any angle, also beyond :attr:`max_angle`."""
        return project_jacobian(self.parameters, points)

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> unit rays (..., 3); NaN where no angle has this radius."""
        pixel = np.asarray(pixel, float)
        x = (pixel[..., 0] - self.cx) / self.fx
        y = (pixel[..., 1] - self.cy) / self.fy
        radius = np.hypot(x, y)
        theta = self.angle(radius)
        sine = np.sin(theta)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(radius > 0, sine / radius, 1.0)
            rays = np.stack([x * scale, y * scale, np.cos(theta)], axis=-1)
        return np.where(np.isfinite(theta)[..., None], rays, np.nan)

    def angle(self, radius: npt.ArrayLike) -> FloatArray:
        """Invert the profile: normalised radius (...,) -> θ, radians; NaN beyond its end."""
        radius = np.asarray(radius, float)
        slope = partial(kannala_brandt_slope, k=self.k)
        return inverse_of_growing(self.profile, slope, radius, self.max_angle)


def project_jacobian(
    parameters: FloatArray, points: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Pixels with their derivatives, without any check of the field, for least squares.

    Args:
        parameters: (8,) fx, fy, cx, cy, k1..k4.
        points: (N, 3) in the camera frame.

    Returns:
        pixel (N, 2); d pixel / d point (N, 2, 3); d pixel / d parameters (N, 2, 8).

    """
    (fx, fy, cx, cy), k = parameters[:4], parameters[4:]
    x, y, z = columns(points)
    rho_squared = x * x + y * y
    rho = np.sqrt(rho_squared)
    norm_squared = rho_squared + z * z
    theta = np.arctan2(rho, z)
    radius, slope = kannala_brandt(theta, k), kannala_brandt_slope(theta, k)
    axis = rho_squared < _NEAR_AXIS**2 * norm_squared
    safe_rho = np.where(axis, 1, rho)
    safe_z = np.where(axis, np.where(z == 0, 1, z), 1)
    # pixel = f * (x, y) * g + c, where g = r(θ)/ρ depends on ρ and z alone
    g = np.where(axis, 1 / safe_z, radius / safe_rho)
    # On the axis it is multiplied by x² and y², which are 0 there.
    dg_drho_over_rho = np.where(axis, 0, (slope * z / norm_squared - g) / safe_rho**2)
    dg_dz = -slope / norm_squared
    pixel = np.stack([fx * x * g + cx, fy * y * g + cy], axis=-1)

    # Working on one coordinate of all points after the other is fastest.
    d_point = np.empty((2, 3, len(points)))
    across = x * y * dg_drho_over_rho
    d_point[0, 0], d_point[0, 1], d_point[0, 2] = g + x * x * dg_drho_over_rho, across, x * dg_dz
    d_point[1, 0], d_point[1, 1], d_point[1, 2] = across, g + y * y * dg_drho_over_rho, y * dg_dz
    d_point *= np.array([fx, fy])[:, None, None]

    d_parameters = np.zeros((2, 8, len(points)))
    d_parameters[0, 0] = x * g
    d_parameters[1, 1] = y * g
    d_parameters[0, 2] = 1
    d_parameters[1, 3] = 1
    square = theta * theta
    odd = theta * square
    outwards = np.stack([fx * x, fy * y]) / safe_rho
    outwards[:, axis] = 0
    for power in range(4, 8):
        np.multiply(outwards, odd, out=d_parameters[:, power])
        odd = odd * square
    return pixel, d_point.transpose(2, 0, 1), d_parameters.transpose(2, 0, 1)
