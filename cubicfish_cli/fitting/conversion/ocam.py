"""OCamCalib's lens (Scaramuzza, Martinelli & Siegwart 2006), of any degree, with its inverse.

A pixel less the centre, straightened by the stretch matrix, is (x, y); its ray is (x, y, f(r))
with f(r) = a0 + a1 r + a2 r² + ... and r = hypot(x, y). Pixel -> ray (``cam2world``) evaluates f;
ray -> pixel (``world2cam``) finds r either from f itself or from a second polynomial, the radius
over the ray's elevation, which files carry along. The two disagree by the second one's own error.

A record ``ocam`` holds

- ``cx``, ``cy``: the centre;
- ``stretch``: (2, 2), pixel - centre = stretch @ (x, y), x to the right and y down;
- ``a``: (N + 1,) a0, a1, ..., lowest order first, a0 > 0 (z is forward);
- ``inverse``: (M + 1,) r = i0 + i1 t + i2 t² + ..., lowest order first, t = angle from the axis
  - π/2; empty where a file has none.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev, polynomial
from scipy.optimize import least_squares

from cubicfish_cli.angles import angle_from_axis
from cubicfish_cli.fitting.conversion.lens_model import FloatArray, LensModel
from cubicfish_cli.model.cubic import CubicCamera
from cubicfish_cli.model.lens_record import LensRecord

# Degrees that are tried. Real files mostly have 4; the toolbox's C reader takes up to 63.
_DEGREES = range(4, 13)
# A higher degree must lower the RMS or the largest error by such a share and so many pixels.
_WORTH_A_DEGREE = np.array([0.05, 0.1])
_WORTH_PX = np.array([0.002, 0.02])
# The inverse polynomial gets terms until it is this near, in pixels. Beyond the degree below, its
# powers in degrees from the axis, as py-OCamCalib wants them, cancel to nothing.
_INVERSE_PX = 0.003
_INVERSE_DEGREES = range(5, 15)
_INVERSE_MARGIN_RAD = np.deg2rad(5)
_TABLE = 4096
_NEWTON_ITERATIONS = 6
# Radii are looked for up to the photo's farthest corner and a little more.
_REACH = 1.15


def project(record: LensRecord, points: FloatArray) -> FloatArray:
    """Camera-frame points (N, 3) -> pixels (N, 2), by f itself; NaN where f has no such angle."""
    a = np.asarray(record.values["a"], float)
    rho = np.hypot(points[:, 0], points[:, 1])
    radius = _radius(a, rho, points[:, 2], _largest_radius(record))
    return _pixel(record, points, rho, radius)


def project_by_inverse(record: LensRecord, points: FloatArray) -> FloatArray:
    """As :func:`project`, by the inverse polynomial, as most programs do; NaN without one."""
    inverse = np.asarray(record.values["inverse"], float)
    if not len(inverse):
        return np.full((len(points), 2), np.nan)
    rho = np.hypot(points[:, 0], points[:, 1])
    seen = np.isfinite(project(record, points)[:, 0])
    radius = polynomial.polyval(angle_from_axis(points) - np.pi / 2, inverse)
    return _pixel(record, points, rho, np.where(seen, radius, np.nan))


def unproject(record: LensRecord, pixel: FloatArray) -> FloatArray:
    """Pixels (N, 2) -> unit rays (N, 3), by f."""
    a = np.asarray(record.values["a"], float)
    stretch = np.asarray(record.values["stretch"], float)
    plane = np.linalg.solve(stretch, (pixel - _centre(record)).T).T
    radius = np.hypot(plane[:, 0], plane[:, 1])
    rays = np.column_stack([plane, polynomial.polyval(radius, a)])
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def fit(camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> LensRecord:
    """The nearest lens of the lowest degree that does justice to the camera, and its inverse.

    Args:
        camera: the camera; its reference starts the fit.
        rays: (N, 3) unit rays of the camera's field.
        pixel: (N, 2) where the camera sees them.

    Returns:
        A record ``ocam`` of degree 4 to 12 with stretch[1, 1] = 1.

    """
    tried = [_fit_degree(camera, degree, rays, pixel) for degree in _DEGREES]
    errors = np.array([_rms_and_largest(record, rays, pixel) for record in tried])
    best = errors.min(axis=0)
    good_enough = np.maximum((1 + _WORTH_A_DEGREE) * best, best + _WORTH_PX)
    record = tried[int(np.argmax((errors <= good_enough).all(axis=1)))]
    farthest = float(angle_from_axis(rays).max())
    values = {**record.values, "inverse": inverse_polynomial(record, farthest)}
    return LensRecord(model="ocam", values=values, image_size=camera.image_size)


def inverse_polynomial(record: LensRecord, farthest: float) -> FloatArray:
    """The radius as a polynomial in t = angle - π/2, from the axis to ``farthest`` radians.

    Its degree is the lowest at which it is within 0.003 px of f's own radius, 14 at most.
    """
    a = np.asarray(record.values["a"], float)
    end = min(farthest + _INVERSE_MARGIN_RAD, _last_angle(a, _largest_radius(record)))
    middle, half = end / 2 - np.pi / 2, end / 2
    # Chebyshev's points keep the error even up to both ends.
    x = np.cos(np.pi * (np.arange(1500) + 0.5) / 1500)
    angle = middle + half * x + np.pi / 2
    radius = _radius(a, np.sin(angle), np.cos(angle), _largest_radius(record))
    inside = angle <= farthest
    series: FloatArray = np.zeros(1)
    for degree in _INVERSE_DEGREES:
        series = np.asarray(chebyshev.chebfit(x, radius, degree), float)
        error = np.abs(chebyshev.chebval(x, series) - radius)
        if error[inside].max() <= _INVERSE_PX:
            break
    return shifted(np.asarray(chebyshev.cheb2poly(series), float), -middle / half, 1 / half)


def shifted(coefficients: FloatArray, offset: float, scale: float = 1.0) -> FloatArray:
    """The coefficients of p(offset + scale x), lowest order first, from those of p."""
    result = np.zeros(1)
    for value in coefficients[::-1]:
        result = polynomial.polyadd(polynomial.polymul(result, [offset, scale]), [value])
    return np.asarray(result, float)


def _fit_degree(
    camera: CubicCamera, degree: int, rays: FloatArray, pixel: FloatArray
) -> LensRecord:
    """Least squares over cx, cy, c, d, e and a0, a2..aN; the stretch matrix is [[c, d], [e, 1]].

    Radii count in units of the reference's focal length, so that all values are near 1.
    """
    unit = camera.radial.fy
    rho = np.hypot(rays[:, 0], rays[:, 1])
    powers = np.array([0, *range(2, degree + 1)])
    direction = rays[:, :2] / np.maximum(rho, 1e-12)[:, None]

    def lens(values: FloatArray) -> LensRecord:
        a = np.zeros(degree + 1)
        a[powers] = values[5:] * unit ** (1.0 - powers)
        return LensRecord(
            model="ocam",
            values={
                "cx": float(values[0] * unit),
                "cy": float(values[1] * unit),
                "stretch": np.array([[values[2], values[3]], [values[4], 1.0]]),
                "a": a,
                "inverse": np.zeros(0),
            },
            image_size=camera.image_size,
        )

    def radius_of(values: FloatArray) -> tuple[FloatArray, FloatArray]:
        a = np.zeros(degree + 1)
        a[powers] = values[5:]
        return a, _radius(a, rho, rays[:, 2], reach)

    def residuals(values: FloatArray) -> FloatArray:
        _, radius = radius_of(values)
        stretch = np.array([[values[2], values[3]], [values[4], 1.0]])
        miss = (radius[:, None] * direction) @ stretch.T + values[:2] - pixel / unit
        # A lens that does not reach a ray is as far off as the ray is from the centre.
        miss = np.where(np.isfinite(radius)[:, None], miss, rho[:, None])
        return np.asarray(miss.ravel(), float)

    def slopes(values: FloatArray) -> FloatArray:
        a, radius = radius_of(values)
        stretch = np.array([[values[2], values[3]], [values[4], 1.0]])
        plane = radius[:, None] * direction
        jacobian = np.zeros((len(rays), 2, 5 + len(powers)))
        jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1
        jacobian[:, 0, 2:4] = plane
        jacobian[:, 1, 4] = plane[:, 0]
        # f(r) ρ = r Z, differentiated along each coefficient.
        steep = polynomial.polyval(radius, polynomial.polyder(a)) * rho - rays[:, 2]
        d_radius = -rho[:, None] * radius[:, None] ** powers / steep[:, None]
        jacobian[:, :, 5:] = (direction @ stretch.T)[:, :, None] * d_radius[:, None, :]
        jacobian = np.where(np.isfinite(radius)[:, None, None], jacobian, 0)
        return np.asarray(jacobian.reshape(2 * len(rays), -1), float)

    width, height = camera.image_size
    reach = 2 * np.hypot(width, height) / unit
    start = np.array([camera.radial.cx / unit, camera.radial.cy / unit, 1.0, 0.0, 0.0])
    start[2] = camera.radial.fx / camera.radial.fy
    # f on the reference's profile; times sin θ the equation stays finite where f crosses 0.
    theta = angle_from_axis(rays)
    profile = camera.radial.profile(theta)
    rows = profile[:, None] ** powers * np.sin(theta)[:, None]
    shape = np.linalg.lstsq(rows, profile * np.cos(theta), rcond=None)[0]
    solved = least_squares(
        residuals, np.concatenate([start, shape]), jac=slopes, method="lm", max_nfev=60
    )
    return lens(solved.x)


def _rms_and_largest(
    record: LensRecord, rays: FloatArray, pixel: FloatArray
) -> tuple[float, float]:
    """Of the distances, pixels; infinite for a lens that does not reach all rays."""
    squares = ((project(record, rays) - pixel) ** 2).sum(axis=1)
    if not np.isfinite(squares).all():
        return float("inf"), float("inf")
    return float(np.sqrt(squares.mean())), float(np.sqrt(squares.max()))


def _centre(record: LensRecord) -> FloatArray:
    return np.array([record.values["cx"], record.values["cy"]], float)


def _largest_radius(record: LensRecord) -> float:
    """The radius of the photo's farthest corner, and a little more."""
    width, height = record.image_size
    corners = np.array([[-0.5, -0.5], [width, -0.5], [-0.5, height], [width, height]])
    stretch = np.asarray(record.values["stretch"], float)
    plane = np.linalg.solve(stretch, (corners - _centre(record)).T)
    return _REACH * float(np.hypot(*plane).max())


def _angles(a: FloatArray, reach: float) -> tuple[FloatArray, FloatArray]:
    """Radii from 0 on and their angles from the axis, as far as the angle grows."""
    radius = np.linspace(0, reach, _TABLE)
    angle = np.arctan2(radius, polynomial.polyval(radius, a))
    falls = np.flatnonzero(np.diff(angle) <= 0)
    end = falls[0] + 1 if falls.size else _TABLE
    return radius[:end], angle[:end]


def _last_angle(a: FloatArray, reach: float) -> float:
    return float(_angles(a, reach)[1][-1])


def _radius(a: FloatArray, rho: FloatArray, z: FloatArray, reach: float) -> FloatArray:
    """The smallest r up to ``reach`` at which (r, f(r)) has the direction (ρ, Z), else NaN."""
    table, angle = _angles(a, reach)
    slope = polynomial.polyder(a)
    # Along unit vectors Newton's step means the same near and far.
    norm = np.hypot(rho, z)
    with np.errstate(divide="ignore", invalid="ignore"):
        rho, z = rho / norm, z / norm
        radius = np.interp(np.arctan2(rho, z), angle, table, right=np.nan)
        for _ in range(_NEWTON_ITERATIONS):
            miss = polynomial.polyval(radius, a) * rho - radius * z
            radius = radius - miss / (polynomial.polyval(radius, slope) * rho - z)
    return np.asarray(radius, float)


def _pixel(
    record: LensRecord, points: FloatArray, rho: FloatArray, radius: FloatArray
) -> FloatArray:
    # On the axis the direction is 0/0, and the radius 0.
    direction = points[:, :2] / np.maximum(rho, np.finfo(float).tiny)[:, None]
    stretch = np.asarray(record.values["stretch"], float)
    pixel = (radius[:, None] * direction) @ stretch.T + _centre(record)
    return np.asarray(pixel, float)


MODEL = LensModel(
    name="ocam",
    project=project,
    fit=fit,
    also={"world2cam by the inverse polynomial": project_by_inverse},
)
