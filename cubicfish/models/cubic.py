"""The cubic polynomial camera of Zhu & Yin (2010), applied to unit rays (the ``ray`` lift).

λ m = P Φ(d) with m = (u, v, 1), P 3x20 and d the unit ray of a camera-frame point (Eq. 2 and
5–7). P may be trusted on a cone about the camera's z axis; outside it every answer is NaN.

An unconstrained fit can put a zero of P3Φ inside or just outside the data, where pixels run to
infinity and come back mirrored. A sound P has P3Φ > 0 and a positive Jacobian determinant (the
picture is neither folded nor mirrored) over the whole cone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from cubicfish.angles import angle_from_axis, azimuth, unit_rays
from cubicfish.errors import ViewError
from cubicfish.models.lift import evaluate_cubics, lift
from cubicfish.models.pupil import from_pupil, from_pupil_and_slopes, pupil_profile
from cubicfish.models.radial import RadialCamera
from cubicfish.models.sphere import cone_rays, ray_at, rays_of_pixels
from cubicfish.types import FloatArray
from cubicfish.units import times
from cubicfish.wording import Brief

# Pixel -> ray is exact to this many pixels; a pixel for which no ray is as exact gets NaN.
UNPROJECT_TOLERANCE_PX = 1e-6
# Number of pixels at a time, whose intermediate arrays stay in the processor's cache.
_BLOCK = 8192
# A ray this close beyond the edge of the cone is rounding, not a ray outside.
_EDGE_SLACK_RAD = 1e-9
_CHECK_RAYS = 6000
# By so much at most, a camera's frame turned after the angle of its corners was measured.
_TURNED_DEG = 1.0
# Beyond this angle from the axis, a fisheye's image circle may end within the photo.
_FILLED_RAD = np.pi / 2
# Bisections of the angle at which the field ends: exact to some billionths of a radian.
_HALVINGS = 30


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CubicCamera(Brief):
    """A fisheye camera: pixels are ratios of cubics in the unit ray.

    Attributes:
        image_size: (width, height), pixels.
        P: (3, 20), columns in the paper's order (:data:`cubicfish.models.lift.MONOMIALS`).
        max_angle_deg: half-angle of the cone about +z where P may be trusted.
        radial: the Kannala–Brandt reference, in the same camera frame.
        pupil_travel: travel of the entrance pupil (:mod:`cubicfish.models.pupil`); P is
            for distant points, and near ones are seen farther from the axis.
        units: unit of the travel; None where it is not known.

    """

    image_size: tuple[int, int]
    P: FloatArray
    max_angle_deg: float
    radial: RadialCamera
    pupil_travel: float = 0.0
    units: str | None = None

    def in_units(self, units: str | None) -> CubicCamera:
        """The same for points in another unit; central if both are named and one is unknown."""
        factor = times(self.units, units)
        if factor == 1:
            return self
        return replace(self, pupil_travel=self.pupil_travel * (factor or 0.0), units=units)

    def scaled(self, factor: float) -> CubicCamera:
        """The same for points in another unit, of which ``factor`` make one of ``units``."""
        return replace(self, pupil_travel=self.pupil_travel * factor, units=None)

    def pupil_shift(self, rays: npt.ArrayLike) -> FloatArray:
        """How far along the axis from the camera's place rays (..., 3) enter the lens, (...).

        In ``units``; 0 along the axis and where there is no direction.
        """
        return self.pupil_travel * np.nan_to_num(pupil_profile(np.asarray(rays, float)))

    def over_corners(self, covered_deg: float) -> CubicCamera:
        """The same where its corners are too, some of which may lie beyond its calibrated field.

        Args:
            covered_deg: angle from the axis of the farthest corner; NaN where it is not known.

        """
        if not self.max_angle_deg < covered_deg + _TURNED_DEG:
            return self
        return replace(self, max_angle_deg=covered_deg + _TURNED_DEG)

    def for_photos(self, size: tuple[int, int]) -> CubicCamera:
        """The camera of photos of ``size``: the calibrated size, or of the same shape.

        A pixel's centre is at its whole coordinates, so a photo scaled by s has pixel
        (x + 1/2)·s − 1/2 where the original has x. Leaving the half out shifts a half-size picture
        by a quarter pixel.

        Args:
            size: (width, height) of the photos at hand.

        Raises:
            ViewError: the photos are neither.

        """
        width, height = self.image_size
        if size == self.image_size:
            return self
        if size[0] * height != size[1] * width:
            raise ViewError(
                f"the photo has {size[0]}x{size[1]} pixels, the camera was calibrated for "
                f"{width}x{height}: use photos of that size or of exactly that shape"
            )
        scale = size[0] / width
        shift = (scale - 1) / 2
        affine = np.array([[scale, 0, shift], [0, scale, shift], [0, 0, 1]])
        old = self.radial
        fx, fy = scale * old.fx, scale * old.fy
        cx, cy = scale * old.cx + shift, scale * old.cy + shift
        radial = replace(old, image_size=size, fx=fx, fy=fy, cx=cx, cy=cy)
        return replace(self, image_size=size, P=affine @ self.P, radial=radial)

    def project(self, points: npt.ArrayLike, *, near: bool = False) -> FloatArray:
        """Camera-frame points (..., 3) -> pixels (..., 2); NaN outside the cone.

        Args:
            points: of any length where they are far away.
            near: whether the distance of the points counts; they are then in ``units``.

        """
        points = _check_numbers(points, 3)
        if near:
            points = from_pupil(points, self.pupil_travel)
        rays = unit_rays(points)
        with np.errstate(invalid="ignore"):
            inside = angle_from_axis(rays) <= np.deg2rad(self.max_angle_deg) + _EDGE_SLACK_RAD
        rays = np.where(inside[..., None], rays, [0.0, 0.0, 1.0])
        homogeneous = lift(rays) @ self.P.T
        pixel = homogeneous[..., :2] / homogeneous[..., 2:]
        return np.where(inside[..., None], pixel, np.nan)

    def project_jacobian(
        self, points: npt.ArrayLike, *, near: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Pixels and their derivatives by the points, for an optimisation of the caller's own.

        Args:
            points: (..., 3) in the camera frame, as :meth:`project` takes them.
            near: as for :meth:`project`.

        Returns:
            Pixels (..., 2) and d pixel / d point (..., 2, 3), pixels per unit of the points; both
            NaN outside the cone.

        """
        points = np.asarray(points, float)
        pixel = self.project(points, near=near)
        inside = np.isfinite(pixel[..., 0])
        slope = np.full((*pixel.shape, 3), np.nan)
        slope[inside] = self.pixel_and_slopes(points[inside], near=near)[1]
        return pixel, slope

    def pixel_and_slopes(
        self, points: FloatArray, *, near: bool = True
    ) -> tuple[FloatArray, FloatArray]:
        """Pixel and d pixel / d point, unchecked: (N, 3) -> (N, 2), (N, 2, 3)."""
        moved, by_point = points, np.zeros((1, 3))
        if near and self.pupil_travel:
            moved, by_point, _ = from_pupil_and_slopes(points, self.pupil_travel)
        rays = unit_rays(moved)
        length = np.sum(rays * moved, axis=-1)
        pixel, across = self.pixel_and_slope(rays)
        # A point that moves along its ray keeps its pixel.
        across -= (across @ rays[:, :, None]) * rays[:, None, :]
        across /= length[:, None, None]
        return pixel, across + across[:, :, 2:] * by_point[:, None, :]

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) -> unit rays (..., 3); NaN outside the valid field.

        Newton's method on the sphere, from the reference's ray. A result counts only when it
        reprojects within :data:`UNPROJECT_TOLERANCE_PX` from inside the cone.
        """
        pixel = _check_numbers(pixel, 2)
        flat = pixel.reshape(-1, 2)
        rays = np.full((len(flat), 3), np.nan)
        candidates = np.flatnonzero(self._may_be_inside(flat))
        for block in np.array_split(candidates, len(candidates) // _BLOCK + 1):
            rays[block] = self._find_rays(flat[block])
        return rays.reshape((*pixel.shape[:-1], 3))

    def photo_rays(self, pixel: FloatArray) -> FloatArray:
        """Pixels (N, 2) -> the rays (N, 3) that a photo shows there; NaN where it may be black.

        Where P may be trusted these are its own. Beyond, up to 90° from the axis, they are those
        of the radial reference, which is extrapolated there.
        """
        rays, beyond = self.unproject(pixel), self.radial.unproject(pixel)
        beyond[~(angle_from_axis(beyond) <= _FILLED_RAD)] = np.nan
        return np.where(np.isfinite(rays), rays, beyond)

    def _may_be_inside(self, pixel: FloatArray) -> npt.NDArray[np.bool_]:
        """Cheaply rule out pixels (N, 2) that lie clearly outside the image of the cone's rim."""
        around = np.linspace(-np.pi, np.pi, 721)
        rim = self.project(ray_at(np.full(721, np.deg2rad(self.max_angle_deg)), around))
        middle = self.project([0.0, 0.0, 1.0])
        offset = rim - middle
        order = np.argsort(azimuth(offset))
        with np.errstate(invalid="ignore", over="ignore"):
            own = pixel - middle
            farthest = np.interp(
                azimuth(own),
                azimuth(offset[order]),
                np.hypot(offset[order, 0], offset[order, 1]),
                period=2 * np.pi,
            )
            return np.hypot(own[:, 0], own[:, 1]) <= 1.02 * farthest

    def _find_rays(self, pixel: FloatArray) -> FloatArray:
        limit = np.deg2rad(self.max_angle_deg)
        theta = np.arccos(np.clip(self.radial.unproject(pixel)[:, 2], -1, 1))
        # The reference has no ray for a pixel beyond its own end: start those at the cone's edge.
        theta = np.where(np.isfinite(theta), np.minimum(theta, limit), limit)
        offset = (pixel - [self.radial.cx, self.radial.cy]) / [self.radial.fx, self.radial.fy]
        rays = ray_at(theta, azimuth(offset))
        best = rays_of_pixels(pixel, rays, self.pixel_and_slope, UNPROJECT_TOLERANCE_PX)
        inside = np.arccos(np.clip(best[:, 2], -1, 1)) <= limit + _EDGE_SLACK_RAD
        return np.where(inside[:, None], best, np.nan)

    def pixel_and_slope(self, rays: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixel and d pixel / d ray of unit rays, unchecked: (N, 3) -> (N, 2), (N, 2, 3)."""
        homogeneous, gradient = evaluate_cubics(self.P, rays)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixel = homogeneous[:, :2] / homogeneous[:, 2:]
            slope = (gradient[:, :2] - pixel[:, :, None] * gradient[:, 2:]) / homogeneous[
                :, 2:, None
            ]
        return pixel, slope

    def outline(self, count: int = 180) -> FloatArray:
        """Outline of the valid field within the photo, a polygon: (count, 2) pixels.

        Along each azimuth it is the farthest pixel that is inside the cone and the photo.
        """
        return self.project(self.edge(count))

    def edge(self, count: int = 180) -> FloatArray:
        """Unit rays (count, 3) at the edge of the valid field, evenly by their azimuths from x."""
        return _find_edge(self, count)


def _check_numbers(given: npt.ArrayLike, count: int) -> FloatArray:
    """An array (..., count).

    Raises:
        ViewError: it has another shape, or holds no numbers.

    """
    try:
        numbers = np.asarray(given, float)
    except (TypeError, ValueError) as problem:
        raise ViewError(f"(..., {count}) numbers are wanted: {problem}") from problem
    if numbers.shape[-1:] != (count,):
        raise ViewError(f"the shape is {numbers.shape}, where (..., {count}) is wanted")
    return numbers


@lru_cache(maxsize=4)
def _find_edge(camera: CubicCamera, count: int) -> FloatArray:
    """Find :meth:`CubicCamera.edge`, cached since everything about a camera's field needs it."""
    around = np.linspace(0, 2 * np.pi, count, endpoint=False)
    near, far = np.zeros(count), np.full(count, np.deg2rad(camera.max_angle_deg))
    width, height = camera.image_size

    def inside(theta: FloatArray) -> npt.NDArray[np.bool_]:
        u, v = camera.project(ray_at(theta, around)).T
        return (u >= -0.5) & (v >= -0.5) & (u <= width - 0.5) & (v <= height - 0.5)

    near = np.where(inside(far), far, near)
    for _ in range(_HALVINGS):
        middle = (near + far) / 2
        ok = inside(middle)
        near, far = np.where(ok, middle, near), np.where(ok, far, middle)
    rays = ray_at(near, around)
    rays.flags.writeable = False
    return rays


def pole_or_fold_deg(P: npt.ArrayLike, angle_deg: float) -> float | None:
    """How near to the axis P (3, 20) has a pole or a fold, or is mirrored, within a cone.

    Args:
        P: the camera's matrix.
        angle_deg: half-angle of the cone.

    Returns:
        The least angle from the axis, degrees; None where P is sound over the whole cone.

    """
    P = np.asarray(P, float)
    rays = _make_cone(float(angle_deg))
    homogeneous, gradient = evaluate_cubics(P, rays)
    numerators, denominator = homogeneous.T[:2], homogeneous.T[2]
    # Working on one coordinate of all rays after the other is fastest.
    across, (x, y, z) = gradient.transpose(1, 2, 0), rays.T
    # d(u, v) = (d(P1Φ, P2Φ) − (u, v) d(P3Φ)) / P3Φ; times P3Φ² it stays finite at a pole.
    u, v = across[:2] * denominator - numerators[:, None] * across[2]
    # The determinant of a turn of the ray, which has no component along it: d · (∇u × ∇v).
    determinant = (
        x * (u[1] * v[2] - u[2] * v[1])
        + y * (u[2] * v[0] - u[0] * v[2])
        + z * (u[0] * v[1] - u[1] * v[0])
    )
    good = (denominator > 0) & (determinant > 0)
    theta = np.rad2deg(np.arccos(np.clip(rays[:, 2], -1, 1)))
    nearest = float(theta[~good].min(initial=angle_deg))
    return nearest if nearest < angle_deg else None


@lru_cache(maxsize=4)
def _make_cone(angle_deg: float) -> FloatArray:
    """Rays of a cone, (N, 3), cached since a fit needs the same ones many times."""
    angle = np.deg2rad(angle_deg)
    rim = ray_at(np.full(720, angle), np.linspace(0, 2 * np.pi, 720, endpoint=False))
    rays = np.vstack([[[0.0, 0.0, 1.0]], cone_rays(angle, _CHECK_RAYS), rim])
    rays.flags.writeable = False
    return rays
