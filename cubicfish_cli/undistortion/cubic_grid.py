"""The cubic camera over a whole flat picture at once.

A row of P over the ray d = R (x, y, 1)/n, with n² = x² + y² + 1, becomes after
multiplication by n³ (which cancels in the ratio) A(x, y) + n·B(x, y): A is a cubic, B a
quadratic. Over a grid of columns x and rows y both are products of two small matrices, so a
picture costs two of them a row of P and one square root.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cubicfish_cli.model.cubic import CubicCamera
from cubicfish_cli.model.lift import EXPONENTS, lift_rotation

FloatArray = npt.NDArray[np.float64]


class CubicGrid:
    """Pixels of a cubic camera along the rays (x, y, 1) of a grid, turned by a rotation."""

    def __init__(self, camera: CubicCamera, camera_from_view: FloatArray, x: FloatArray) -> None:
        """Prepare for columns x (W,)."""
        turned = camera.P @ lift_rotation(camera_from_view)  # Φ(R d) = L(R) Φ(d)
        even, odd = _grid_coefficients(turned)
        powers = x ** np.arange(4)[:, None]
        self._even = even @ powers
        self._odd = odd[:, :3, :3] @ powers[:3]
        self._x, self._square = x, x * x + 1
        self._axis = camera_from_view[2]
        self._least_cosine = np.cos(np.deg2rad(camera.max_angle_deg))

    def pixels(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels u and v for rows y (h,): two of (h, W), NaN outside the camera's cone."""
        n = np.sqrt(y[:, None] ** 2 + self._square)
        powers = y[:, None] ** np.arange(4)
        u, v, w = (
            powers @ even + n * (powers[:, :3] @ odd)
            for even, odd in zip(self._even, self._odd, strict=True)
        )
        along = (self._axis[1] * y + self._axis[2])[:, None] + self._axis[0] * self._x
        w[along < self._least_cosine * n] = np.nan
        return u / w, v / w


def _grid_coefficients(P: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients of A and B, (3, 4, 4) each: [row of P, power of y, power of x]."""
    even, odd = np.zeros((3, 4, 4)), np.zeros((3, 4, 4))
    for column, (i, j, k) in enumerate(EXPONENTS.tolist()):
        # A monomial of degree m is left with n^(3 - m); n² is x² + y² + 1 again.
        missing = 3 - (i + j + k)
        part = even if missing % 2 == 0 else odd
        part[:, j, i] += P[:, column]
        if missing >= 2:
            part[:, j, i + 2] += P[:, column]
            part[:, j + 2, i] += P[:, column]
    return even, odd
