"""Scaramuzza's polynomial lens, and its file: OCamCalib's calib_results.txt.

A pixel less the centre, straightened by the stretch matrix, is (x, y); its ray is (x, y, f(r))
with f(r) = a0 + a1 r + a2 r² + ... and r = hypot(x, y). Pixel -> ray (``cam2world``) evaluates f;
ray -> pixel (``world2cam``) finds r either from f itself or from a second polynomial, the radius
over the ray's elevation, which files carry along. The two disagree by the second one's own error.

The file, as its ``exportData2TXT`` writes it and ``get_ocam_model`` (ocam_functions.cpp)
and other readers want it: five remarks, each with a blank line below it and below its values. Some
readers skip white space, others take the values from lines 3, 7, 11, 15 and 19.

- The camera's axes are x down the rows, y along the columns and z BACKWARDS, so that f(0) < 0.
- The centre is (row, column), counted from 0 at the middle of the first pixel.
- row = c x + d y + centre row, column = e x + y + centre column.
- The inverse polynomial is the radius over atan(z / hypot(x, y)), lowest order first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt
from numpy.polynomial import Polynomial, chebyshev, polynomial

from cubicfish import CameraFileError, CubicCamera, FloatArray
from cubicfish.files import read_text
from cubicfish.models import FormulaLens, RadialCamera, angle_from_axis
from cubicfish.solve import nearest_lens
from cubicfish_cli.foreign.file_contents import PlacedLens, numbers, size

# Degrees to try. Real files mostly have 4; the toolbox's C reader takes up to 63.
_DEGREES = range(4, 13)
# A higher degree must lower the RMS or the largest error by such a share and so many pixels.
_TOLERATED_SHARE = np.array([0.05, 0.1])
_TOLERATED_PX = np.array([0.002, 0.02])
# The inverse polynomial gets terms until it is this near, in pixels. Beyond the degree below its
# powers cancel to nothing.
_INVERSE_PX = 0.003
_INVERSE_DEGREES = range(5, 15)
_INVERSE_MARGIN_RAD = np.deg2rad(5)
_TABLE = 4096
_NEWTON_ITERATIONS = 6
# Radii are sought up to the photo's farthest corner and a little more.
_MARGIN = 1.15
# A comparison of lenses takes in rays outside the photo too: up to so many focal lengths.
_COMPARED_MARGIN = 6.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaramuzzaLens(FormulaLens):
    """Scaramuzza, Martinelli & Siegwart 2006, the OCam toolbox's lens.

    Attributes:
        cx, cy: the centre, pixels.
        stretch: (2, 2), pixel - centre = stretch @ (x, y), x to the right and y down; a fit is one
            of [[c, d], [e, 1]].
        a: (N + 1,) a0, a1, ..., lowest order first, a0 > 0 (z is forward).
        inverse: (M + 1,) r = i0 + i1 t + i2 t² + ..., lowest order first, t = angle from the axis
            - π/2; empty where a file has none.
        max_radius: the largest radius; by default a little more than the photo's farthest corner.

    """

    name = "ocam"
    label = "Scaramuzza"
    fixed = ("stretch4", "a2")  # 1, and the linear term

    cx: float
    cy: float
    stretch: FloatArray
    a: FloatArray
    inverse: FloatArray = field(default_factory=lambda: np.zeros(0), metadata=FormulaLens.FIXED)
    max_radius: float | None = field(default=None, metadata=FormulaLens.FIXED)

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """Fit f to the radial lens's profile, by linear least squares."""
        start = cls._fit_near(radial, np.linspace(0.02, covered, 200), _DEGREES[0])
        return (replace(start, max_radius=_COMPARED_MARGIN * radial.fy),)

    @property
    def units(self) -> FloatArray:
        """See :class:`Lens`: focal lengths, to a power of 2, which rounds nothing."""
        focal = 2.0 ** np.round(np.log2(self.a[0]))
        shape = focal ** (1.0 - np.arange(len(self.a)))
        return np.array([focal, focal, 1, 1, 1, 1, *shape])

    @cached_property
    def max_angle(self) -> float:
        """See :class:`Lens`: as far as the angle grows with the radius."""
        return float(_tabulate_angles(self.a, self._find_max_radius)[1][-1])

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`: by f itself; NaN where f has no such angle."""
        rho = np.hypot(points[:, 0], points[:, 1])
        return self._compute_pixel(
            points, rho, _find_radius(self.a, rho, points[:, 2], self._find_max_radius)
        )

    def project_by_inverse(self, points: FloatArray) -> FloatArray:
        """Project by the inverse polynomial, as most programs do; NaN without one."""
        if not len(self.inverse):
            return np.full((len(points), 2), np.nan)
        rho = np.hypot(points[:, 0], points[:, 1])
        seen = np.isfinite(self.pixels(points)[:, 0])
        radius = polynomial.polyval(angle_from_axis(points) - np.pi / 2, self.inverse)
        return self._compute_pixel(points, rho, np.where(seen, radius, np.nan))

    @property
    def also(self) -> Mapping[str, Callable[[FloatArray], FloatArray]]:
        """See :class:`Lens`."""
        return {"world2cam by the inverse polynomial": self.project_by_inverse}

    def unproject(self, pixel: npt.ArrayLike) -> FloatArray:
        """See :class:`Lens`: by f."""
        pixel = np.asarray(pixel, float)
        plane = np.linalg.solve(self.stretch, (pixel.reshape(-1, 2) - [self.cx, self.cy]).T).T
        radius = np.hypot(plane[:, 0], plane[:, 1])
        rays = np.column_stack([plane, polynomial.polyval(radius, self.a)])
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        inside = radius <= _tabulate_angles(self.a, self._find_max_radius)[0][-1]
        return np.where(inside[:, None], rays, np.nan).reshape(*pixel.shape[:-1], 3)

    @classmethod
    def nearest_to(cls, camera: CubicCamera, rays: FloatArray, pixel: FloatArray) -> ScaramuzzaLens:
        """See :class:`Lens`: the lens has the lowest degree that follows the camera well.

        Its degree is 4 to 12, stretch[1, 1] is 1, and its inverse goes with it.
        """
        tried = [cls.of_degree(degree, camera, rays, pixel) for degree in _DEGREES]
        errors = np.array([_measure_distance(one, rays, pixel) for one in tried])
        best = errors.min(axis=0)
        good_enough = np.maximum((1 + _TOLERATED_SHARE) * best, best + _TOLERATED_PX)
        found = tried[int(np.argmax((errors <= good_enough).all(axis=1)))]
        return found.with_inverse(float(angle_from_axis(rays).max()))

    def with_inverse(self, farthest: float) -> ScaramuzzaLens:
        """Add r as a polynomial in angle - π/2, from the axis to ``farthest`` radians.

        Its degree is the lowest at which it is within 0.003 px of f's own radius, 14 at most.
        """
        end = min(farthest + _INVERSE_MARGIN_RAD, self.max_angle)
        middle, half = end / 2 - np.pi / 2, end / 2
        # Chebyshev's points keep the error even up to both ends.
        x = np.cos(np.pi * (np.arange(1500) + 0.5) / 1500)
        angle = middle + half * x + np.pi / 2
        radius = _find_radius(self.a, np.sin(angle), np.cos(angle), self._find_max_radius)
        inside = angle <= farthest
        series: FloatArray = np.zeros(1)
        for degree in _INVERSE_DEGREES:
            series = np.asarray(chebyshev.chebfit(x, radius, degree), float)
            error = np.abs(chebyshev.chebval(x, series) - radius)
            if error[inside].max() <= _INVERSE_PX:
                break
        powers = Polynomial(chebyshev.cheb2poly(series))
        inverse = powers(Polynomial([-middle / half, 1 / half])).coef
        return replace(self, inverse=np.asarray(inverse, float))

    @classmethod
    def of_degree(
        cls, degree: int, camera: CubicCamera, rays: FloatArray, pixel: FloatArray
    ) -> ScaramuzzaLens:
        """Return the nearest lens of a degree, without its inverse; the linear term stays 0."""
        start = cls._fit_near(camera.radial, angle_from_axis(rays), degree)
        max_radius = 2 * float(np.hypot(*camera.image_size))
        return replace(
            nearest_lens([replace(start, max_radius=max_radius)], rays, pixel), max_radius=None
        )

    @classmethod
    def _fit_near(cls, radial: RadialCamera, theta: FloatArray, degree: int) -> Self:
        """Fit f to a radial lens's profile at angles from its axis, by linear least squares."""
        powers = np.array([0, *range(2, degree + 1)])
        profile = radial.profile(theta)
        # Times sin θ the equation stays finite where f crosses 0.
        rows = profile[:, None] ** powers * np.sin(theta)[:, None]
        found = np.linalg.lstsq(rows, profile * np.cos(theta), rcond=None)[0]
        a = np.zeros(degree + 1)
        a[powers] = found * radial.fy ** (1.0 - powers)
        return cls(
            image_size=radial.image_size,
            cx=radial.cx,
            cy=radial.cy,
            stretch=np.diag([radial.fx / radial.fy, 1.0]),
            a=a,
        )

    @property
    def _find_max_radius(self) -> float:
        if self.max_radius is not None:
            return self.max_radius
        width, height = self.image_size
        corners = np.array([[-0.5, -0.5], [width, -0.5], [-0.5, height], [width, height]])
        plane = np.linalg.solve(self.stretch, (corners - [self.cx, self.cy]).T)
        return _MARGIN * float(np.hypot(*plane).max())

    def _compute_pixel(self, points: FloatArray, rho: FloatArray, radius: FloatArray) -> FloatArray:
        # On the axis the direction is 0/0, and the radius 0.
        direction = points[:, :2] / np.maximum(rho, np.finfo(float).tiny)[:, None]
        pixel = (radius[:, None] * direction) @ self.stretch.T + [self.cx, self.cy]
        return np.asarray(pixel, float)


def _measure_distance(
    lens: ScaramuzzaLens, rays: FloatArray, pixel: FloatArray
) -> tuple[float, float]:
    """Return RMS and largest distance, pixels; infinite for a lens that does not see all rays."""
    squares = ((lens.pixels(rays) - pixel) ** 2).sum(axis=1)
    if not np.isfinite(squares).all():
        return float("inf"), float("inf")
    return float(np.sqrt(squares.mean())), float(np.sqrt(squares.max()))


def _tabulate_angles(a: FloatArray, max_radius: float) -> tuple[FloatArray, FloatArray]:
    """Return radii from 0 on and their angles from the axis, as far as the angle grows."""
    radius = np.linspace(0, max_radius, _TABLE)
    angle = np.arctan2(radius, polynomial.polyval(radius, a))
    falls = np.flatnonzero(np.diff(angle) <= 0)
    end = falls[0] + 1 if falls.size else _TABLE
    return radius[:end], angle[:end]


def _find_radius(a: FloatArray, rho: FloatArray, z: FloatArray, max_radius: float) -> FloatArray:
    """Find the smallest r, at most ``max_radius``, where (r, f(r)) points along (ρ, Z), or NaN."""
    table, angle = _tabulate_angles(a, max_radius)
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


MAX_BYTES = 1_000_000
# The toolbox's own C reader holds no more coefficients.
MAX_COEFFICIENTS = 64
_REMARKS = (
    "#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB). "
    "These are used by cam2world",
    "#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB). "
    "These are used by world2cam",
    '#center: "row" and "column", starting from 0 (C convention)',
    '#affine parameters "c", "d", "e"',
    '#image size: "height" and "width"',
)
# The content of the lines, and how many numbers; None for coefficients behind their count.
_PARTS = {
    "the polynomial": None,
    "the inverse polynomial": None,
    "the center": 2,
    "c, d, e": 3,
    "the image size": 2,
}
# x and y change places between the toolbox's axes and the image's.
_SWAP = np.array([[0.0, 1.0], [1.0, 0.0]])


def ocamcalib_text(one: PlacedLens) -> str:
    """Write a lens as the text of calib_results.txt, numbers at full precision."""
    lens: ScaramuzzaLens = one.lens
    # The last entry of their matrix is 1: the stretch is divided by it, and radii multiplied.
    scale = float(lens.stretch[0, 0])
    matrix = _SWAP @ (lens.stretch / scale) @ _SWAP
    polynomial = -lens.a * scale ** (1.0 - np.arange(len(lens.a)))
    inverse = lens.inverse * scale
    width, height = lens.image_size
    values = (
        f"{len(polynomial)} {_write_spaced(polynomial)}",
        f"{len(inverse)} {_write_spaced(inverse)}".rstrip(),
        _write_spaced([lens.cy, lens.cx]),
        _write_spaced(matrix.ravel()[:3]),
        f"{height} {width}",
    )
    parts = zip(_REMARKS, values, strict=True)
    # Readers count its lines: comments go nowhere but the end.
    notes = [f"#{line}\n" for line in one.note]
    return "".join([*(f"{remark}\n\n{value}\n\n" for remark, value in parts), *notes])


def _write_spaced(values: Iterable[float]) -> str:
    """Write numbers so that they read back exactly; f's linear term is 0 and not -0."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def read_ocamcalib(path: Path) -> ScaramuzzaLens:
    """Read calib_results.txt.

    Raises:
        CameraFileError: the file is not one; one line that names the file and the line.

    """
    text = read_text(path, max_bytes=MAX_BYTES, error=CameraFileError)
    rows = {
        Path(f"{path}, line {number}"): line.split()
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    }
    if len(rows) != len(_PARTS):
        raise CameraFileError(
            f"{path}: {len(rows)} lines of numbers, not {len(_PARTS)} ({', '.join(_PARTS)}): "
            "is it OCamCalib's calib_results.txt?"
        )
    values = [
        _read_numbers(where, cells, part)
        for (where, cells), part in zip(rows.items(), _PARTS, strict=True)
    ]
    f, inverse, (row, column), (c, d, e), (height, width) = values
    where, *_, last = rows
    if len(f) < 2:
        raise CameraFileError(f"{where}: the polynomial has fewer than two coefficients")
    lens = ScaramuzzaLens(
        image_size=size(last, width, height, "the image size"),
        cx=float(column),
        cy=float(row),
        stretch=_SWAP @ np.array([[c, d], [e, 1.0]]) @ _SWAP,
        a=-f,
        inverse=inverse,
    )
    refuse_no_camera(where, lens)
    return lens


def refuse_no_camera(where: Path, lens: ScaramuzzaLens) -> None:
    """Refuse numbers that no camera has.

    Raises:
        CameraFileError: it looks backwards, or its pixels are far from square; ``where`` begins the
            line.

    """
    if not lens.a[0] > 0:
        raise CameraFileError(
            f"{where}: the first coefficient has the wrong sign: such a lens would look backwards"
        )
    if not 0.1 < np.linalg.det(lens.stretch) < 10:
        raise CameraFileError(f"{where}: the stretch is not that of a camera: c must be near 1")


def _read_numbers(where: Path, cells: Sequence[str], part: str) -> FloatArray:
    """Return the numbers of a line, without a leading count."""
    try:
        values = numbers(where, list(map(float, cells)), part, (len(cells),))
    except ValueError as problem:
        raise CameraFileError(f"{where}: {part} must hold finite numbers") from problem
    wanted, given = _PARTS[part], len(values)
    if wanted is not None:
        if given != wanted:
            raise CameraFileError(f"{where}: {wanted} numbers are expected for {part}")
        return values
    if not 0 <= values[0] <= MAX_COEFFICIENTS or values[0] != given - 1:
        raise CameraFileError(
            f"{where}: {part} must be a count of at most {MAX_COEFFICIENTS} and as many "
            f"coefficients, not {values[0]:g} and {given - 1}"
        )
    return values[1:]
