"""How uncertain a camera's pixels are: over the field in two figures, and at pixels of a photo.

The field is where the camera may be trusted, as far as the photo shows it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from cubicfish.types import FloatArray

CERTAIN_PX = 0.5
"""A camera is certain where one standard deviation is below this, in photos of up to 2000
pixels."""
TRUSTED_PX = 2 * CERTAIN_PX
"""The calibrated field ends where one standard deviation reaches this, in such photos; a camera
whose median is as large is not to be trusted."""
PERCENT = 95.0
"""The second figure is this percentile: single places at the very edge, where no corner is near,
say little about the rest of the field."""
_LARGEST_PX = 1e6
_SIDE = 2000.0


def of_size(image_size: tuple[int, int]) -> float:
    """The factor of limits in pixels, which are stated for photos of up to 2000 pixels per side."""
    return max(1.0, max(image_size) / _SIDE)


def end_px(image_size: tuple[int, int], goal_px: float | None) -> float:
    """One standard deviation at which the calibrated field ends, pixels.

    Args:
        image_size: (width, height) of the photos, pixels.
        goal_px: the uncertainty that somebody asked for; None for what is usual. A field does not
            end before.

    """
    return max(TRUSTED_PX * of_size(image_size), goal_px or 0.0)


@dataclass(frozen=True, kw_only=True)
class FieldUncertainty:
    """One standard deviation of a distant point's pixel, sqrt(var x + var y), over many places.

    Attributes:
        median_px: the median.
        p95_px: not exceeded at 95 % of the places.

    """

    median_px: float
    p95_px: float

    def as_record(self) -> dict[str, float]:
        """Plain data for JSON."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class PixelUncertainty(FieldUncertainty):
    """The same at some pixels, with the largest one."""

    max_px: float


def summed(sigma: FloatArray) -> FieldUncertainty:
    """Sum up the uncertainty at many places (N,), N above 0, in two figures."""
    return FieldUncertainty(
        median_px=float(np.median(sigma)), p95_px=float(np.percentile(sigma, PERCENT))
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class UncertaintyGrid:
    """One standard deviation of a distant point's pixel, on a grid over the photo.

    Attributes:
        noise_px: standard deviation of a corner's coordinate.
        median_px, p95_px, max_px: over the grid.
        focal_px: standard deviation of the focal lengths along x and y, pixels per radian.
        principal_point_px: standard deviation of the centre of symmetry, x and y.
        x, y: (C,) and (R,) pixels of the grid.
        sigma_px: (R, C) sqrt(var x + var y), pixels; NaN outside the valid field.

    """

    noise_px: float = math.nan
    median_px: float = math.nan
    p95_px: float = math.nan
    max_px: float = math.nan
    focal_px: tuple[float, ...] = ()
    principal_point_px: tuple[float, ...] = ()
    x: tuple[float, ...] = ()
    y: tuple[float, ...] = ()
    sigma_px: tuple[tuple[float, ...], ...] = ()

    @property
    def field(self) -> FieldUncertainty | None:
        """The uncertainty over the field in two figures; None where they are not known."""
        if not math.isfinite(self.median_px + self.p95_px):
            return None
        return FieldUncertainty(median_px=self.median_px, p95_px=self.p95_px)

    @property
    def has_grid(self) -> bool:
        """Whether there is a grid: x and y increase, and each value is in pixels or unknown."""
        if min(len(self.x), len(self.y)) < 2 or len(self.sigma_px) != len(self.y):
            return False
        if any(len(row) != len(self.x) for row in self.sigma_px):
            return False
        grow = all(bool((np.diff(side) > 0).all()) for side in (self.x, self.y))
        sigma = np.array(self.sigma_px)
        return grow and not bool(np.any((sigma < 0) | (sigma >= _LARGEST_PX)))

    def at(self, pixel: FloatArray) -> FloatArray | None:
        """The uncertainty at pixels (N, 2).

        Returns:
            (N,) pixels, interpolated bilinearly between those of the four points around that lie in
            the valid field; NaN where none does. None where there is no grid.

        """
        if not self.has_grid:
            return None
        across, down = _shares(pixel[:, 0], self.x), _shares(pixel[:, 1], self.y)
        return self._interpolated(lambda values: np.einsum("nr,nr->n", down, across @ values.T))

    def over_grid(self, x: FloatArray, y: FloatArray) -> FloatArray | None:
        """The same at columns (C,) and rows (R,) of pixels: (R, C)."""
        if not self.has_grid:
            return None
        across, down = _shares(x, self.x), _shares(y, self.y)
        return self._interpolated(lambda values: down @ values @ across.T)

    def _interpolated(self, interpolate: Callable[[FloatArray], FloatArray]) -> FloatArray:
        sigma = np.array(self.sigma_px)
        total, weight = interpolate(np.nan_to_num(sigma)), interpolate(np.isfinite(sigma) * 1.0)
        return np.where(weight > 0, total / np.where(weight > 0, weight, 1), np.nan)

    def over(self, pixel: FloatArray) -> PixelUncertainty | None:
        """The uncertainty over some pixels (N, 2); None where it is known at none of them."""
        sigma = self.at(pixel)
        sigma = None if sigma is None else sigma[np.isfinite(sigma)]
        if sigma is None or not len(sigma):
            return None
        return PixelUncertainty(**vars(summed(sigma)), max_px=float(sigma.max()))

    def __repr__(self) -> str:
        """The grid's figures in one line."""
        return f"<uncertainty: {self.median_px:.3f} px, at most {self.max_px:.3f} px>"


def _shares(at: FloatArray, grid: Sequence[float]) -> FloatArray:
    """(N, G) what each coordinate of a grid counts at some (N,) in linear interpolation."""
    place = np.interp(at, grid, np.arange(len(grid)))
    return np.maximum(0.0, 1 - np.abs(place[:, None] - np.arange(len(grid))))
