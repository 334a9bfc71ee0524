"""mrcal's LENSMODEL_SPLINED_STEREOGRAPHIC: a stereographic lens and two B-spline surfaces.

With θ the angle from the axis, u = 2 tan(θ/2) along the point's azimuth and

    x = fx (u_x + Δ_x(u)) + cx,    y = fy (u_y + Δ_y(u)) + cy.

Δ is a uniform B-spline over u with Nx x Ny control points whose middle is u = 0. Across
``fov_x_deg`` lie Nx - order intervals along x, and along y as many as Ny - order of the same
length; beyond them the last patch goes on (mrcal's documentation, "lens models" and "splined
models"; compared with mrcal itself in the tests).
"""

import math
from dataclasses import dataclass, field
from typing import Self

import numpy as np
import numpy.typing as npt
from scipy import linalg, sparse

from cubicfish import CubicCamera, FloatArray
from cubicfish.models import FocalLens, RadialCamera, angle_from_axis, cone_rays

_ORDER = 3
# Intervals across the field: more are tried until the spline is this near to the camera.
_INTERVALS = (6, 8, 10, 13, 16, 20, 25, 30, 36)
_NEAR_PX = 0.005
# Weight of the surfaces' bending against the rays of a mean control point, pixels: it matters
# little where there are rays, and continues the surfaces straight where there are none.
_STIFFNESS = 1e-4
_OUTLINE = 360
# Rays of the camera's own that the spline is fitted to, for there to be enough up to the rim.
_RAYS = 16_000


@dataclass(frozen=True, kw_only=True, eq=False)
class SplinedLens(FocalLens):
    """A stereographic lens and two B-spline surfaces; see the top of this module.

    Attributes:
        order: 2 or 3, of the splines.
        fov_x_deg: a whole number.
        control: (Ny, Nx, 2) Δ's control points.
        region: (K, 2) pixels: the outline of where the lens may be trusted; no rows if that is
            not known.

    """

    name = "mrcal_splined"
    label = "splined stereographic"
    symmetric = False

    order: int = field(metadata=FocalLens.FIXED)
    fov_x_deg: int = field(metadata=FocalLens.FIXED)
    control: FloatArray
    region: FloatArray = field(metadata=FocalLens.FIXED)

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Return the stereographic lens."""
        control = np.zeros((_ORDER + 1, _ORDER + 1, 2))
        fov_x_deg, nowhere = min(359, math.ceil(math.degrees(2 * covered))), np.zeros((0, 2))
        return (
            cls.near(radial, order=_ORDER, fov_x_deg=fov_x_deg, control=control, region=nowhere),
        )

    @property
    def outline(self) -> FloatArray:
        """See :class:`Lens`."""
        return self.region

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`; NaN straight behind.

        Outside the spline, and outside the region, the pixels are mrcal's own, which mean little.
        """
        u = stereographic(points)
        rows, columns = self.control.shape[:2]
        first, weight = _compute_weights(u, columns, rows, self.order, self.fov_x_deg)
        span = np.arange(self.order + 1)
        across, down = first[:, 0, None] + span, first[:, 1, None] + span
        local = self.control[down[:, :, None], across[:, None, :]]
        bend = np.einsum("nj,ni,njic->nc", weight[:, 1], weight[:, 0], local)
        pixel = np.array([self.fx, self.fy]) * (u + bend) + [self.cx, self.cy]
        return np.where(np.isfinite(u), pixel, np.nan)

    @classmethod
    def nearest_to(cls, camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> Self:
        """See :class:`Lens`: fx, fy, cx, cy of the nearest stereographic lens, then Δ.

        Both steps are linear least squares. Control points are added until the spline is within
        0.005 px of the camera at every ray; where there are no rays Δ goes on straight. More rays
        are added up to the rim, outside the photo too, so that the spline goes on well there.
        """
        more = cone_rays(float(angle_from_axis(rays).max()), _RAYS)
        seen = camera.project(more)
        known = np.isfinite(seen[:, 0])
        rays, pixel = np.concatenate([rays, more[known]]), np.concatenate([pixel, seen[known]])
        u = stereographic(rays)
        focal, centre = np.empty(2), np.empty(2)
        for axis in range(2):
            rows = np.column_stack([u[:, axis], np.ones(len(u))])
            focal[axis], centre[axis] = np.linalg.lstsq(rows, pixel[:, axis], rcond=None)[0]
        bend = (pixel - centre) / focal - u
        half_x, half_y = np.abs(u).max(axis=0)
        fov_x_deg = min(359, math.ceil(math.degrees(4 * math.atan(half_x / 2))) + 1)
        edge_x = _compute_edges(_ORDER + 1, _ORDER + 1, _ORDER, fov_x_deg)[0]
        best: tuple[float, FloatArray] | None = None
        for intervals in _INTERVALS:
            nx = intervals + _ORDER
            ny = math.ceil(intervals * half_y / edge_x * (1 + 1e-9)) + _ORDER
            if best is not None and 2 * nx * ny > len(u):
                break  # more control points than the rays can tell apart
            control, error = fit_surfaces(u, bend, nx, ny, fov_x_deg)
            largest = float(np.abs(error * focal).max())
            if best is None or largest < best[0]:
                best = largest, control
            if largest <= _NEAR_PX:
                break
        assert best is not None
        return cls(
            image_size=camera.image_size,
            fx=float(focal[0]),
            fy=float(focal[1]),
            cx=float(centre[0]),
            cy=float(centre[1]),
            order=_ORDER,
            fov_x_deg=fov_x_deg,
            control=best[1],
            region=_find_outline(camera),
        )


def stereographic(points: FloatArray) -> FloatArray:
    """Return u (N, 2) of camera-frame points (N, 3): length 2 tan(θ/2); NaN straight behind."""
    norm = np.linalg.norm(points, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = 2 * points[:, :2] / (norm + points[:, 2])[:, None]
    return np.where(np.isfinite(u).all(axis=1, keepdims=True), u, np.nan)


def _compute_edges(nx: int, ny: int, order: int, fov_x_deg: float) -> tuple[float, float]:
    """Return half the extent of the spline over u, along x and along y."""
    edge_x = 2 * math.tan(math.radians(fov_x_deg) / 4)
    return edge_x, edge_x * (ny - order) / (nx - order)


def _compute_weights(
    u: FloatArray, nx: int, ny: int, order: int, fov_x_deg: float
) -> tuple[npt.NDArray[np.intp], FloatArray]:
    """Return the control points that count at u: their first column and row (N, 2), and weights.

    The weights (N, 2, order + 1) along x and along y are those of uniform B-splines.
    """
    edge_x, _ = _compute_edges(nx, ny, order, fov_x_deg)
    count = np.array([nx, ny])
    place = np.where(np.isfinite(u), u, 0) * (nx - order) / (2 * edge_x) + (count - 1) / 2
    if order == 3:
        first = np.clip(np.floor(place), 1, count - 3).astype(np.intp) - 1
        x = place - first - 1
        parts = (1 - x) ** 3, 4 + 3 * x * x * (x - 2), 1 + 3 * x * (1 + x * (1 - x)), x**3
        return first, np.stack(parts, axis=-1) / 6
    first = np.clip(np.floor(place + 0.5), 1, count - 2).astype(np.intp) - 1
    x = place - first - 1
    return first, np.stack([(0.5 - x) ** 2, 1.5 - 2 * x * x, (0.5 + x) ** 2], axis=-1) / 2


def fit_surfaces(
    u: FloatArray, bend: FloatArray, nx: int, ny: int, fov_x_deg: float
) -> tuple[FloatArray, FloatArray]:
    """Fit control points (Ny, Nx, 2) to Δ = ``bend`` (N, 2) at u; also return the rest (N, 2)."""
    first, weight = _compute_weights(u, nx, ny, _ORDER, fov_x_deg)
    span = np.arange(_ORDER + 1)
    index = (first[:, 1, None] + span)[:, :, None] * nx + (first[:, 0, None] + span)[:, None, :]
    product = weight[:, 1, :, None] * weight[:, 0, None, :]
    row = np.broadcast_to(np.arange(len(u))[:, None, None], index.shape)
    design = sparse.csr_array(
        (product.ravel(), (row.ravel(), index.ravel())), shape=(len(u), nx * ny)
    )
    stiffness = _STIFFNESS * math.sqrt(len(u) / (nx * ny))
    bending = stiffness * _make_second_differences(nx, ny)
    normal = (design.T @ design + bending.T @ bending).toarray()
    control = linalg.solve(normal, design.T @ bend, assume_a="pos")
    return control.reshape(ny, nx, 2), bend - design @ control


def _make_second_differences(nx: int, ny: int) -> sparse.csr_array:
    """Return rows of second differences of a (Ny, Nx) grid, along x and along y."""
    each_x, each_y = (sparse.csr_array(np.eye(count)) for count in (nx, ny))
    along, down = (sparse.csr_array(np.diff(np.eye(count), 2, axis=0)) for count in (nx, ny))
    return sparse.vstack([sparse.kron(each_y, along), sparse.kron(down, each_x)]).tocsr()


def _find_outline(camera: CubicCamera) -> FloatArray:
    """Return the closed outline of the camera's field, with the photo's corners that it sees."""
    outline = camera.outline(_OUTLINE)
    width, height = camera.image_size
    corners = np.array(
        [[x, y] for x in (-0.5, width - 0.5) for y in (-0.5, height - 0.5)], dtype=float
    )
    seen = corners[np.isfinite(camera.unproject(corners)).all(axis=1)]
    middle = camera.project(np.array([[0.0, 0.0, 1.0]]))[0]
    points = np.concatenate([outline, seen])
    x, y = (points - middle).T.copy()
    around = np.arctan2(y, x)
    points = points[np.argsort(around, kind="stable")]
    return np.concatenate([points, points[:1]])
