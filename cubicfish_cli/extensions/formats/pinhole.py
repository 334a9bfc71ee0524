"""OpenCV's pinhole lens with its rational, tangential and thin-prism distortion.

Its numbers stand in OpenCV's order (calib3d's documentation): k1, k2, p1, p2, k3, k4, k5, k6, s1,
s2, s3, s4, τx, τy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from cubicfish_cli.app.lenses.foreign_lens import FocalLens
from cubicfish_cli.core.geometry import decentring
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.types import FloatArray

_COUNT = 14


@dataclass(frozen=True, kw_only=True, eq=False)
class PinholeLens(FocalLens):
    """OpenCV's lens.

    Attributes:
        d: (N,) 0, 4, 5, 8, 12 or 14 numbers in OpenCV's order.

    """

    name = "pinhole"
    label = "pinhole"

    d: FloatArray

    @classmethod
    def starts(cls, radial: RadialCamera, covered: float) -> tuple[Self, ...]:
        """The one without distortion: near around the axis only."""
        return (cls.near(radial, d=np.zeros(8)),)

    def pixels(self, points: FloatArray) -> FloatArray:
        """See :class:`Lens`; not finite behind the camera."""
        d = np.zeros(_COUNT)
        d[: len(self.d)] = self.d
        k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = d
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            x, y = (points[:, :2] / points[:, 2:]).T
            r2 = x * x + y * y
            radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            more_x, more_y = decentring(x, y, p1, p2)
            bent = np.stack(
                [
                    x * radial + more_x + r2 * (s1 + r2 * s2),
                    y * radial + more_y + r2 * (s3 + r2 * s4),
                ],
                axis=-1,
            )
            if tau_x or tau_y:
                tilted = np.column_stack([bent, np.ones(len(bent))]) @ _tilt(tau_x, tau_y).T
                bent = tilted[:, :2] / tilted[:, 2:]
        pixel = bent * [self.fx, self.fy] + [self.cx, self.cy]
        good = (points[:, 2] > 0) & np.isfinite(pixel).all(axis=1)
        return np.where(good[:, None], pixel, np.nan)


def _tilt(tau_x: float, tau_y: float) -> FloatArray:
    """OpenCV's matrix of a sensor turned by τx about x, then by τy about y (Scheimpflug)."""
    cx, sx, cy, sy = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    about_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    about_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    turn = about_y @ about_x
    keep = np.array([[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]])
    return np.asarray(keep @ turn, float)
