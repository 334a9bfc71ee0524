"""Fast evaluation of the cubic camera over a whole picture, for each kind of view.

A row of P over unit rays, f = Σ p_ijk X^i Y^j Z^k, becomes a few products of small matrices over a
picture's columns x and rows y, since in each kind of view X, Y and Z are products of functions of x
alone and of y alone. The rotation of the view is put into P beforehand: Φ(R d) = L(R) Φ(d).
Whatever factor the three rows of P share cancels in the pixel's ratios.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from cubicfish.models.cubic import CubicCamera
from cubicfish.models.lift import EXPONENTS, lift, lift_rotation
from cubicfish.types import FloatArray
from cubicfish.views.view import CentralView, PlaneView, View

_MONOMIALS = [(i, j, k, column) for column, (i, j, k) in enumerate(EXPONENTS.tolist())]
_SLACK = 1e-9
_ALL = slice(None)
# Nodes beyond the highest frequency: 13 leave 1e-5 px at most, and mostly 1e-8.
_CHEBYSHEV_MARGIN = 13


class CubicGrid(ABC):
    """Pixels of a cubic camera along the rays of a picture's rows."""

    @abstractmethod
    def homogeneous(self, rows: slice) -> tuple[FloatArray, FloatArray, FloatArray]:
        """P1Φ, P2Φ and P3Φ of the rows, times a common factor above 0: three of (h, W)."""

    @abstractmethod
    def outside(self, rows: slice) -> npt.NDArray[np.bool_] | None:
        """Where the rows (h, W) leave the camera's cone or the view; None where they do nowhere."""

    def fill(
        self, rows: slice, map_x: npt.NDArray[np.float32], map_y: npt.NDArray[np.float32]
    ) -> None:
        """Write the pixels of the rows into two arrays (h, W), NaN outside the camera's cone."""
        outside = self.outside(rows)
        u, v, w = self.homogeneous(rows)
        if outside is not None:
            w[outside] = np.nan
        # Divided in float64; only the result is rounded.
        np.divide(u, w, out=map_x, casting="same_kind")
        np.divide(v, w, out=map_y, casting="same_kind")


def grid_of(camera: CubicCamera, view: View) -> CubicGrid | None:
    """The fast way for this kind of view, if there is one."""
    if isinstance(view, PlaneView):
        if camera.pupil_travel:
            return None  # near points are seen elsewhere than P alone says
        width, height = view.size
        return _FlatGrid(camera, view.camera_from_pixel, np.arange(width), np.arange(height))
    if not isinstance(view, CentralView):
        return None
    turn = view.camera_from_view
    x, y = ((np.arange(float(side)) - (side - 1) / 2) / view.focal for side in view.size)
    sideways = turn[:, [1, 0, 2]]
    makers: dict[str, Callable[[], CubicGrid]] = {
        "perspective": lambda: _FlatGrid(camera, turn, x, y),
        "cylindrical": lambda: _cylinder(camera, turn, x, y),
        "equirectangular": lambda: _sphere(camera, turn, x, y),
        "epipolar-cylindrical": lambda: _SidewaysGrid(_cylinder(camera, sideways, y, x)),
        "epipolar-equirectangular": lambda: _SidewaysGrid(_sphere(camera, sideways, y, x)),
        "stereographic": lambda: _StereographicGrid(camera, turn, x, y),
        "equidistant": lambda: _EquidistantGrid(camera, turn, x, y),
    }
    return makers[view.kind]()


class _FlatGrid(CubicGrid):
    """Rays M (x, y, 1): with n their length, n³f is A(x, y) + n·B(x, y).

    A is a cubic and B a quadratic, so each is a product of two small matrices, and n is one
    square root.
    """

    def __init__(
        self, camera: CubicCamera, matrix: FloatArray, x: npt.ArrayLike, y: npt.ArrayLike
    ) -> None:
        """Prepare for M (3, 3), columns x (W,) and rows y (H,)."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        gram = matrix.T @ matrix
        turned = camera.P @ lift_rotation(matrix)  # holds for every linear map, not only for turns
        even, odd = _compute_flat_coefficients(turned, gram)
        powers = x ** np.arange(4)[:, None]
        self._even = even @ powers
        self._odd = odd[:, :3, :3] @ powers[:3]
        self._y_powers = y[:, None] ** np.arange(4)
        # n² = [gram22 + 2 gram12 y + gram11 y²] + [2 gram02 + 2 gram01 y] x + gram00 x²
        self._square_x = gram[0, 0] * x * x
        self._square_y = gram[2, 2] + 2 * gram[1, 2] * y + gram[1, 1] * y * y
        self._cross_y = 2 * (gram[0, 2] + gram[0, 1] * y)
        self._x = x
        self._crossed = bool(
            np.abs(self._cross_y).max(initial=0) * np.abs(x).max(initial=0)
            > 1e-15 * self._square_y.max(initial=0)
        )
        axis = matrix[2]
        self._along_x = axis[0] * x
        self._along_y = axis[1] * y + axis[2]
        self._least_cosine = float(np.cos(np.deg2rad(camera.max_angle_deg) + _SLACK))

    def _measure_length(self, rows: slice) -> FloatArray:
        n = self._square_y[rows, None] + self._square_x
        if self._crossed:
            n += self._cross_y[rows, None] * self._x
        return np.sqrt(n, out=n)

    def homogeneous(self, rows: slice) -> tuple[FloatArray, FloatArray, FloatArray]:
        n = self._measure_length(rows)
        powers = self._y_powers[rows]
        sums = []
        for even, odd in zip(self._even, self._odd, strict=True):
            part = powers[:, :3] @ odd
            part *= n
            part += powers @ even
            sums.append(part)
        return sums[0], sums[1], sums[2]

    def outside(self, rows: slice) -> npt.NDArray[np.bool_] | None:
        cosine = self._least_cosine
        # The cone, or its complement where it is wider than 180°, is convex: the corners decide.
        ends = np.ix_([rows.start, rows.stop - 1], [0, -1])
        along = self._along_y[ends[0]] + self._along_x[ends[1]]
        square = self._square_y[ends[0]] + self._square_x[ends[1]]
        square += self._cross_y[ends[0]] * self._x[ends[1]]
        if (along > max(0.0, cosine) * np.sqrt(square)).all():
            return None
        along = self._along_y[rows, None] + self._along_x
        return np.asarray(along < cosine * self._measure_length(rows))


def _compute_flat_coefficients(P: FloatArray, gram: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients of A and B, (3, 4, 4) each: [row of P, power of y, power of x]."""
    even, odd = np.zeros((3, 4, 4)), np.zeros((3, 4, 4))
    square = (
        (0, 0, gram[2, 2]),
        (0, 1, 2 * gram[0, 2]),
        (1, 0, 2 * gram[1, 2]),
        (1, 1, 2 * gram[0, 1]),
        (0, 2, gram[0, 0]),
        (2, 0, gram[1, 1]),
    )
    for i, j, k, column in _MONOMIALS:
        # A monomial of degree m is multiplied by n^(3 - m), of which n² is a polynomial again.
        missing = 3 - (i + j + k)
        part = even if missing % 2 == 0 else odd
        if missing < 2:
            part[:, j, i] += P[:, column]
            continue
        for down, across, share in square:
            part[:, j + down, i + across] += share * P[:, column]
    return even, odd


class _TurningGrid(CubicGrid):
    """Unit rays (h sin x, v, h cos x), h and v of the row alone: f is one matrix product."""

    def __init__(
        self,
        camera: CubicCamera,
        turn: FloatArray,
        x: FloatArray,
        across: FloatArray,
        down: FloatArray,
        off: npt.NDArray[np.bool_],
    ) -> None:
        """Prepare for azimuths x (W,), h and v (H,), and the rows that the view leaves out."""
        P = camera.P @ lift_rotation(turn)
        pairs = sorted({(i, k) for i, _, k, _ in _MONOMIALS})
        sine, cosine = np.sin(x), np.cos(x)
        self._columns = np.array([sine**i * cosine**k for i, k in pairs])
        self._rows = np.zeros((3, len(down), len(pairs)))
        for i, j, k, column in _MONOMIALS:
            term = across ** (i + k) * down**j
            self._rows[:, :, pairs.index((i, k))] += P[:, column, None] * term
        axis = turn[2]
        self._along_x = axis[0] * sine + axis[2] * cosine
        self._across, self._along_y = across, axis[1] * down
        self._least_cosine = float(np.cos(np.deg2rad(camera.max_angle_deg) + _SLACK))
        self._off_rows, self._off_columns = off, np.abs(x) > np.pi * (1 + _SLACK)

    def homogeneous(
        self, rows: slice, columns: slice = _ALL
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        u, v, w = (part[rows] @ self._columns[:, columns] for part in self._rows)
        return u, v, w

    def outside(self, rows: slice, columns: slice = _ALL) -> npt.NDArray[np.bool_]:
        along = self._across[rows, None] * self._along_x[columns]
        along += self._along_y[rows, None]
        outside = along < self._least_cosine
        outside |= self._off_columns[columns]
        outside[self._off_rows[rows]] = True
        return np.asarray(outside)


def _cylinder(camera: CubicCamera, turn: FloatArray, x: FloatArray, y: FloatArray) -> _TurningGrid:
    length = np.sqrt(1 + y * y)
    return _TurningGrid(camera, turn, x, 1 / length, y / length, np.zeros(len(y), bool))


def _sphere(camera: CubicCamera, turn: FloatArray, x: FloatArray, y: FloatArray) -> _TurningGrid:
    off = np.abs(y) > np.pi / 2 * (1 + _SLACK)
    return _TurningGrid(camera, turn, x, np.cos(y), np.sin(y), off)


class _SidewaysGrid(CubicGrid):
    """Rows and columns of another grid exchanged."""

    def __init__(self, upright: _TurningGrid) -> None:
        """Prepare for the grid whose columns are the rows here."""
        self._upright = upright

    def homogeneous(self, rows: slice) -> tuple[FloatArray, FloatArray, FloatArray]:
        u, v, w = (part.T for part in self._upright.homogeneous(_ALL, rows))
        return u, v, w

    def outside(self, rows: slice) -> npt.NDArray[np.bool_] | None:
        return self._upright.outside(_ALL, rows).T


class _StereographicGrid(CubicGrid):
    """Unit rays (2x, 2y, 1 − x² − y²)/q with q = 1 + x² + y²: q³f is of degree 6 in x and y."""

    def __init__(self, camera: CubicCamera, turn: FloatArray, x: FloatArray, y: FloatArray) -> None:
        """Prepare for columns x (W,) and rows y (H,), offsets in focal lengths."""
        x, y = x / 2, y / 2
        P = camera.P @ lift_rotation(turn)
        coefficients = _compute_stereographic_coefficients(P)
        self._columns = coefficients @ (x ** np.arange(7)[:, None])
        self._y_powers = y[:, None] ** np.arange(7)
        least = float(np.cos(np.deg2rad(camera.max_angle_deg) + _SLACK))
        # axis·d < least, times q
        axis = turn[2]
        self._beyond_x = 2 * axis[0] * x - (axis[2] + least) * x * x
        self._beyond_y = 2 * axis[1] * y - (axis[2] + least) * y * y + (axis[2] - least)

    def homogeneous(self, rows: slice) -> tuple[FloatArray, FloatArray, FloatArray]:
        powers = self._y_powers[rows]
        u, v, w = (powers @ columns for columns in self._columns)
        return u, v, w

    def outside(self, rows: slice) -> npt.NDArray[np.bool_] | None:
        return np.asarray(self._beyond_y[rows, None] + self._beyond_x < 0)


def _compute_stereographic_coefficients(P: FloatArray) -> FloatArray:
    """(3, 7, 7): [row of P, power of y, power of x] of q³f."""

    def times(a: FloatArray, b: FloatArray) -> FloatArray:
        product = np.zeros((a.shape[0] + b.shape[0] - 1, a.shape[1] + b.shape[1] - 1))
        for down, across in np.argwhere(a):
            product[down : down + b.shape[0], across : across + b.shape[1]] += a[down, across] * b
        return product

    def power(base: FloatArray, exponent: int) -> FloatArray:
        result = np.ones((1, 1))
        for _ in range(exponent):
            result = times(result, base)
        return result

    x, y = np.array([[0.0, 2.0]]), np.array([[0.0], [2.0]])
    square = np.array([[0.0, 0, 1], [0, 0, 0], [1, 0, 0]])
    one = np.zeros((3, 3))
    one[0, 0] = 1
    total = np.zeros((3, 7, 7))
    for i, j, k, column in _MONOMIALS:
        term = times(times(power(x, i), power(y, j)), power(one - square, k))
        term = times(term, power(one + square, 3 - i - j - k))
        rows, columns = (min(side, 7) for side in term.shape)
        total[:, :rows, :columns] += P[:, column, None, None] * term[:rows, :columns]
    return total


class _EquidistantGrid(CubicGrid):
    """Unit rays (s x, s y, cos θ), θ² = x² + y² and s = sin θ / θ: f is entire in x and y.

    So f is its own interpolation at a few Chebyshev nodes per side, which is one matrix product
    too.
    """

    def __init__(self, camera: CubicCamera, turn: FloatArray, x: FloatArray, y: FloatArray) -> None:
        """Prepare for columns x (W,) and rows y (H,), offsets in focal lengths."""
        node_x, column_weights = _interpolate(x)
        node_y, self._row_weights = _interpolate(y)
        node = np.stack(np.meshgrid(node_x, node_y), axis=-1)
        theta = np.hypot(node[..., 0], node[..., 1])[..., None]
        rays = np.concatenate([node * np.sinc(theta / np.pi), np.cos(theta)], axis=-1)
        at_nodes = np.moveaxis(lift(rays @ turn.T) @ camera.P.T, -1, 0)
        self._columns = at_nodes @ column_weights.T
        self._along = (rays @ turn[2]) @ column_weights.T
        limit = np.deg2rad(camera.max_angle_deg)
        self._least_cosine = float(np.cos(limit + _SLACK))
        self._square_x, self._square_y = x * x, y * y
        # Rays this close to the view's axis are inside the cone whichever way they look.
        self._safe = float(max(0, limit - np.arccos(np.clip(turn[2, 2], -1, 1)))) ** 2

    def homogeneous(self, rows: slice) -> tuple[FloatArray, FloatArray, FloatArray]:
        u, v, w = (self._row_weights[rows] @ columns for columns in self._columns)
        return u, v, w

    def outside(self, rows: slice) -> npt.NDArray[np.bool_] | None:
        farthest = (np.pi * (1 + _SLACK)) ** 2
        square = self._square_y[rows]
        largest = square.max() + self._square_x.max()
        if largest < self._safe:
            return None
        outside = self._row_weights[rows] @ self._along < self._least_cosine
        if largest > farthest:
            outside |= square[:, None] + self._square_x > farthest
        return np.asarray(outside)


def _interpolate(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Chebyshev nodes (n,) over x (W,), within ±π, and the weights (W, n) of their values."""
    extent = float(min(np.abs(x).max(), np.pi)) or 1.0
    # f has frequencies up to 3: its coefficients vanish beyond 3·extent and a margin.
    count = int(3 * extent) + _CHEBYSHEV_MARGIN
    node = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    at_nodes = np.polynomial.chebyshev.chebvander(node, count - 1)
    to_coefficients = at_nodes.T * (2 / count)
    to_coefficients[0] /= 2
    # Places farther away than a half turn are no part of the view.
    at_x = np.polynomial.chebyshev.chebvander(np.clip(x / extent, -1, 1), count - 1)
    return node * extent, at_x @ to_coefficients
