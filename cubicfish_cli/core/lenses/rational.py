"""The rational function model (Claus & Fitzgibbon 2005): the lift on the image's side.

The ray of the pixel (u, v) is A (u², uv, v², u, v, 1) with A 3x6. The way from a ray to its pixel
is the intersection of two conics, found by Newton's method.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from cubicfish_cli.core.lenses.lens import HELD, Lens
from cubicfish_cli.core.lenses.radial import RadialCamera, project_jacobian
from cubicfish_cli.core.lenses.sphere import tangent_basis
from cubicfish_cli.core.types import FloatArray

_NEWTON_ITERATIONS = 12
# In normalised pixels; what has not met its ray this closely has no pixel.
_TOLERANCE = 1e-10
# Entries of A that are not free: the middle's ray is (0, 0, 1), which fixes the scale and two
# turns of the camera frame, and v's ray does not turn with u, which fixes the third.
_FREE = np.array([0, 1, 2, 3, 4, 6, 7, 8, 10, 12, 13, 14, 15, 16])


@dataclass(frozen=True, kw_only=True, eq=False)
class RationalLens(Lens):
    """Pixels are (m − centre) / unit inside, by the centre and the focal lengths of ``radial``.

    Attributes:
        entries: (14,) those of A that are free, row by row.
        radial: a lens nearby, where Newton's method starts.

    """

    name = "rational_function"
    label = "rational function"
    compared = True

    entries: FloatArray
    radial: RadialCamera = field(metadata=HELD)

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """The stereographic lens: (u, v, 1 − (u² + v²)/4)."""
        matrix = np.zeros((3, 6))
        matrix[0, 3] = matrix[1, 4] = 1
        matrix[2, [0, 2]] = -0.25
        entries = matrix.reshape(-1)[_FREE]
        return (cls(image_size=radial.image_size, entries=entries, radial=radial),)

    @property
    def A(self) -> FloatArray:
        """(3, 6): pixels less the middle, over the focal length, lifted -> rays of any length."""
        flat = np.zeros(18)
        flat[_FREE] = self.entries
        flat[17] = 1
        return flat.reshape(3, 6)

    def pixel_and_slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See :class:`Lens`; derivatives by the implicit function theorem."""
        length = np.linalg.norm(points, axis=1)
        unit = np.array([self.radial.fx, self.radial.fy])
        centre = np.array([self.radial.cx, self.radial.cy])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            basis = np.swapaxes(tangent_basis(points / length[:, None]), 1, 2)
            xy, ray = self._solve(points, basis)
            # B A φ(m) = 0 with the rows of B orthogonal to the point: differentiate all three.
            inverse = _inverse(basis @ self.A @ _lift_slope(xy))
            d_point = inverse @ basis * (np.linalg.norm(ray, axis=1) / length)[:, None, None]
            by_entry = basis[:, :, :, None] * _lift(xy)[:, None, None, :]
            d_values = -inverse @ by_entry.reshape(len(points), 2, 18)[:, :, _FREE]
        pixel = xy * unit + centre
        return (
            np.where(np.isfinite(pixel), pixel, np.inf),
            unit[:, None] * d_point,
            unit[:, None] * d_values,
        )

    def _solve(self, points: FloatArray, basis: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Normalised pixels (N, 2) and their rays (N, 3), NaN where there is none."""
        radial = self.radial
        guess = project_jacobian(radial.parameters, points)[0]
        xy = (guess - [radial.cx, radial.cy]) / [radial.fx, radial.fy]
        for _ in range(_NEWTON_ITERATIONS):
            miss = basis @ (_lift(xy) @ self.A.T)[:, :, None]
            step = (_inverse(basis @ self.A @ _lift_slope(xy)) @ miss)[:, :, 0]
            length = np.linalg.norm(step, axis=1)
            xy = xy - step * np.minimum(1, 0.5 / np.maximum(length, 1e-300))[:, None]
            if not np.nanmax(length, initial=0) > 1e-13:
                break
        ray = _lift(xy) @ self.A.T
        off = np.linalg.norm((basis @ ray[:, :, None])[:, :, 0], axis=1)
        met = (off <= _TOLERANCE * np.linalg.norm(ray, axis=1)) & (np.sum(ray * points, axis=1) > 0)
        return np.where(met[:, None], xy, np.nan), ray


def _lift(xy: FloatArray) -> FloatArray:
    x, y = xy.T
    return np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)], axis=-1)


def _lift_slope(xy: FloatArray) -> FloatArray:
    x, y = xy.T
    zero, one = np.zeros_like(x), np.ones_like(x)
    return np.stack(
        [
            np.stack([2 * x, y, zero, one, zero, zero], axis=-1),
            np.stack([zero, x, 2 * y, zero, one, zero], axis=-1),
        ],
        axis=-1,
    )


def _inverse(matrix: FloatArray) -> FloatArray:
    """Inverses of (N, 2, 2), inf or NaN where there is none."""
    a, b, c, d = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 0], matrix[:, 1, 1]
    inverse = np.stack([np.stack([d, -b], -1), np.stack([-c, a], -1)], -2)
    return inverse / (a * d - b * c)[:, None, None]
