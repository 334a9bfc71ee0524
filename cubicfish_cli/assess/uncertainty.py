"""How sure a camera is of its pixels: over the field in two figures, and at pixels of a photo.

The field is where the camera may be trusted, as far as the photo shows it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cubicfish_cli.assess.records import recorded_number
from cubicfish_cli.types import FloatArray

CERTAIN_PX = 0.5
"""A camera is certain where its pixels are known to this, in a photo of up to 2000 pixels."""
PERCENT = 95.0
"""Single places at the very edge, where no corner is near, say little of the rest: the second
figure is what so much of the field is within."""
_LARGEST_PX = 1e6


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

    @property
    def words(self) -> str:
        """``0.009 px (1σ, median over the field; 95 % of it within 0.013 px)``."""
        return f"{self.median_px:.3f} px ({self.meaning})"

    @property
    def meaning(self) -> str:
        """What the median is of, and the other figure: to stand behind the median."""
        return f"1σ, median over the field; 95 % of it within {self.p95_px:.3f} px"


def summed(sigma: FloatArray) -> FieldUncertainty:
    """Uncertainty at many places (N,), N above 0, in two figures."""
    return FieldUncertainty(
        median_px=float(np.median(sigma)), p95_px=float(np.percentile(sigma, PERCENT))
    )


def recorded_uncertainty(fit: Mapping[str, Any]) -> FieldUncertainty | None:
    """That of a fit's record, as camera.yaml keeps it; None where it does not say."""
    record = fit.get("uncertainty")
    if not isinstance(record, Mapping):
        return None
    rows = record.get("sigma_px")
    grid = [
        recorded_number(value)
        for row in (rows if isinstance(rows, list) else [])
        for value in (row if isinstance(row, list) else [])
    ]
    known = [value for value in grid if value is not None]
    counted = summed(np.array(known)) if known else None
    # Older files have no figure of 95 %: the grid does.
    told = counted.as_record() if counted else {}
    for name in ("median_px", "p95_px"):
        number = recorded_number(record.get(name))
        told |= {} if number is None else {name: number}
    return FieldUncertainty(**told) if len(told) == 2 else None


def recorded_grid(fit: Mapping[str, Any]) -> Any:
    """The uncertainty over the photo of a fit's record, for :func:`sigma_at`; None if it is none.

    Its x and y grow, and its values are None, where nothing is known, or pixels.
    """
    record: Any = fit.get("uncertainty")
    try:
        x, y, sigma = (np.array(record[name], np.float64) for name in ("x", "y", "sigma_px"))
        sides = [bool((np.diff(side) > 0).all()) and np.isfinite(side).all() for side in (x, y)]
        of_two = sigma.ndim == 2 and sigma.shape == (*y.shape, *x.shape)
        right = of_two and all(sides) and min(len(x), len(y)) > 1
    except (KeyError, TypeError, ValueError):
        return None
    return record if right and not bool(np.any((sigma < 0) | (sigma >= _LARGEST_PX))) else None


def sigma_at(record: Mapping[str, Any], pixel: FloatArray) -> FloatArray:
    """Uncertainty at pixels, from the grid that a camera file holds.

    Args:
        record: the grid that a fit leaves (``uncertainty_record`` of fitting/uncertainty.py).
        pixel: (N, 2).

    Returns:
        (N,) pixels: bilinear between the grid's points that lie in the valid field; NaN where
        none of the four around does.

    """
    x, y = np.asarray(record["x"], float), np.asarray(record["y"], float)
    sigma = np.array(
        [[np.nan if value is None else value for value in row] for row in record["sigma_px"]], float
    )
    place = np.stack(
        [np.interp(pixel[:, 0], x, np.arange(len(x))), np.interp(pixel[:, 1], y, np.arange(len(y)))]
    )
    first = np.clip(np.floor(place).astype(int), 0, [[len(x) - 2], [len(y) - 2]])
    share = place - first
    total, weights = np.zeros(len(pixel)), np.zeros(len(pixel))
    for right in (0, 1):
        for down in (0, 1):
            weight = np.abs(1 - right - share[0]) * np.abs(1 - down - share[1])
            value = sigma[first[1] + down, first[0] + right]
            weight = np.where(np.isfinite(value), weight, 0)
            total += weight * np.nan_to_num(value)
            weights += weight
    with np.errstate(invalid="ignore"):
        return np.where(weights > 0, total / np.where(weights > 0, weights, 1), np.nan)


def uncertainty_at(fit: Mapping[str, Any], pixel: FloatArray) -> dict[str, float] | None:
    """How far the camera itself may be off at some pixels (N, 2), by the record of its fit.

    Returns:
        ``median_px``, ``p95_px`` and ``max_px``; None where the record does not say.

    """
    record = fit.get("uncertainty")
    if not isinstance(record, dict):
        return None
    try:
        sigma = sigma_at(record, pixel)
    except (KeyError, TypeError, ValueError, IndexError):
        return None  # not this tool's; the errors are measured all the same
    sigma = sigma[np.isfinite(sigma)]
    if not len(sigma):
        return None
    return {**summed(sigma).as_record(), "max_px": float(sigma.max())}
