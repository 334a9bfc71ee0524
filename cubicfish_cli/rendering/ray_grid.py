"""The rays of a whole photo, worked out once for many photos through the same lens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cubicfish_cli.rendering.render import Unproject
from cubicfish_cli.types import FloatArray

# Rays to 1e-7: a thousandth of a pixel of a lens with 10,000 pixels a radian, in half the memory.
FloatArray32 = npt.NDArray[np.float32]

_PIXELS_A_BLOCK = 200_000


@dataclass(frozen=True, eq=False)
class RayGrid:
    """A lens as a table: the ray of each pixel's middle and its slopes along x and y.

    Within a pixel the ray is taken as linear, which is off by some thousandths of a pixel at most.

    Attributes:
        ray: (height, width, 3), NaN outside the lens's field.
        by_x, by_y: (height, width, 3) change a pixel.

    """

    ray: FloatArray32
    by_x: FloatArray32
    by_y: FloatArray32

    @classmethod
    def of(cls, unproject: Unproject, image_size: tuple[int, int]) -> RayGrid:
        """Tabulate ``unproject`` for photos of ``image_size`` (width, height)."""
        width, height = image_size
        # One pixel more on each side, so that every slope has two neighbours.
        framed = np.empty((height + 2, width + 2, 3), np.float32)
        x = np.arange(-1.0, width + 1)
        rows_a_block = max(1, _PIXELS_A_BLOCK // len(x))
        for top in range(0, height + 2, rows_a_block):
            y = np.arange(top, min(height + 2, top + rows_a_block)) - 1.0
            pixel = np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1)
            rays = unproject(pixel.reshape(-1, 2))
            framed[top : top + len(y)] = rays.reshape(len(y), width + 2, 3)
        return cls(
            ray=framed[1:-1, 1:-1],
            by_x=_slope(framed[1:-1, :-2], framed[1:-1, 1:-1], framed[1:-1, 2:]),
            by_y=_slope(framed[:-2, 1:-1], framed[1:-1, 1:-1], framed[2:, 1:-1]),
        )

    def __call__(self, pixel: FloatArray) -> FloatArray:
        """Pixels (N, 2) of the photo -> rays (N, 3), as a renderer wants them."""
        height, width = self.ray.shape[:2]
        place = np.clip(np.rint(pixel).astype(np.intp), 0, (width - 1, height - 1))
        flat = place[:, 1] * width + place[:, 0]
        off = pixel - place
        rays = self.ray.reshape(-1, 3)[flat].astype(float)
        rays += off[:, :1] * self.by_x.reshape(-1, 3)[flat]
        rays += off[:, 1:] * self.by_y.reshape(-1, 3)[flat]
        return rays


def _slope(before: FloatArray32, here: FloatArray32, after: FloatArray32) -> FloatArray32:
    """Change a step; from one side where the other is outside the field, else none."""
    both = (after - before) / 2
    one = np.where(np.isnan(before), after - here, here - before)
    slope = np.where(np.isnan(both), one, both)
    return np.nan_to_num(slope, nan=0.0)
